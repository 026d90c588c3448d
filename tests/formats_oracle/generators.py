"""The generators, one line each: a format is a module with `draw`, and a line here."""

from __future__ import annotations

from tests.formats_oracle import (
    asc_files,
    blf_files,
    candump_files,
    csv_files,
    mf4_files,
    other_files,
    pcap_files,
    trc_files,
)
from tests.formats_oracle.written import Draw

GENERATORS: dict[str, Draw] = {
    "asc": asc_files.draw,
    "trc": trc_files.draw,
    "blf": blf_files.draw,
    "candump": candump_files.draw,
    "csv": csv_files.draw,
    "other": other_files.draw,
    "pcap": pcap_files.draw,
}
# a file takes seconds, since another process reads it
SLOW_GENERATORS: dict[str, Draw] = {"mf4": mf4_files.draw}
