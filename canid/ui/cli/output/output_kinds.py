"""Kinds of output files, and how the content of an existing file shows its kind.

An existing file is replaced only by a file of its own kind. The kind is read from the content, never from the name; a
name with the suffix of another kind is refused before the content is read.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from typing import NamedTuple

from canid.io.logs.formats import FORMATS

# bytes of an existing file from which its kind is recognised
HEAD_BYTES = 65_536


class Kind(NamedTuple):
    """A kind of output file."""

    name: str  # "JSON text"
    suffixes: tuple[str, ...]  # usual ones; others are allowed, except those of `FOREIGN_SUFFIXES`
    # from the first `HEAD_BYTES` bytes of a file that is not empty; None: the writer protects existing files itself
    recognise: Callable[[bytes], bool] | None


def _json_values(head: bytes) -> list[object] | None:
    """Parse the JSON values at the beginning of a file; None: not JSON; []: the first one does not end in it."""
    try:
        text = head.decode("utf-8", "strict" if len(head) < HEAD_BYTES else "ignore")
    except UnicodeDecodeError:
        return None
    if not text.lstrip().startswith(("{", "[")):
        return None
    values: list[object] = []
    decoder, space = json.JSONDecoder(), re.compile(r"\s*")
    at = space.match(text).end()  # type: ignore[union-attr]  # it always matches
    while at < len(text):
        try:
            value, at = decoder.raw_decode(text, at)
        except (ValueError, RecursionError):
            # the last value may continue beyond the head
            return values if len(head) == HEAD_BYTES and not re.search(r"[\x00-\x08]", text) else None
        values.append(value)
        at = space.match(text, at).end()  # type: ignore[union-attr]
    return values


def is_json(head: bytes) -> bool:
    r"""JSON text, except canid's own files: a saved state, the journal of a recording.

    Example:
        >>> is_json(b'{"log": "a.blf"}\n'), is_json(b'{"canid_state": 1,\n"sha256": "0"}'), is_json(b"LOGG\x90")
        (True, False, False)
    """
    values = _json_values(head)
    if values is None or b'"canid_state"' in head[:64]:
        return False
    first = values[0] if values else None
    return not (isinstance(first, dict) and {"t", "utc", "what", "says"} == set(first))


def is_truth(head: bytes) -> bool:
    """The truth of a simulated drive: a JSON object with channels."""
    values = _json_values(head)
    first = values[0] if values else None
    return isinstance(first, dict) and "channels" in first


def _page(verb: str, mark: str) -> Kind:
    """A page of HTML with a mark."""
    return Kind(
        f"a page of canid {verb}",
        (".html", ".htm"),
        lambda head: head.lstrip()[:15].lower().startswith(b"<!doctype html") and mark.encode() in head,
    )


def _generator(name: str) -> str:
    """The mark of what has made a page; a title cannot have it, as the marks of HTML are escaped in it."""
    return f'<meta name="generator" content="{name}">'


def report_page(verb: str) -> Kind:
    """A page of `canid VERB --report`.

    Example:
        >>> page = b'<!DOCTYPE html><meta name="generator" content="canid check">'
        >>> report_page("check").recognise(page), report_page("replay").recognise(page)
        (True, False)
    """
    return _page(verb, _generator(f"canid {verb}"))


def is_study_figure(head: bytes) -> bool:
    """A figure of `canid study`."""
    return head.lstrip()[:4] == b"<svg" and b"canid study" in head


def study_table(header: str) -> Kind:
    """A table of `canid study`, which its own columns show.

    Example:
        >>> study_table("a,b").recognise(b"a,b,c"), study_table("a,b").recognise(b"a,b" + bytes([10]))
        (False, True)
    """
    first = header.encode()
    return Kind("a table of canid study", (".csv",), lambda head: head.partition(b"\n")[0] == first)


def is_junit(head: bytes) -> bool:
    """JUnit XML of `canid identify`."""
    return b'<testsuites name="canid identify"' in head[:200]


def is_plot(head: bytes) -> bool:
    """A plot of `canid identify`."""
    return head.lstrip()[:4] == b"<svg" and b"canid identify" in head


def is_samples_or_estimates(head: bytes) -> bool:
    r"""A table of `canid export`.

    Example:
        >>> is_samples_or_estimates(b"t,gap,output,gate,learn\n"), is_samples_or_estimates(b"timestamp,id\n")
        (True, False)
        >>> is_samples_or_estimates(b"utc,t [s],gap [m],learn\r\n"), is_samples_or_estimates(b"t [s],gap [m]\r\n")
        (True, False)
    """
    columns = head.partition(b"\n")[0].strip().split(b",")
    of_canid = columns[0] in (b"t", b"t [s]") or columns[:2] in ([b"utc", b"t [s]"], [b"epoch [s]", b"t [s]"])
    return of_canid and bool({b"learn", b"can_tell"} & set(columns))


def signals_table(header: str) -> Kind:
    """Signals as CSV, which their own columns show: another program's table has hardly the same.

    Example:
        >>> signals_table("t [s],Speed").recognise(b"t [s],Speed" + bytes([13, 10, 48]))
        True
    """
    first = header.encode("utf-8", "backslashreplace")
    kind = "a table of canid export with these columns"
    return Kind(kind, (".csv",), lambda head: head.partition(b"\r\n")[0] == first[:HEAD_BYTES])


def is_vehicle(head: bytes) -> bool:
    """A vehicle file: TOML that names a DBC."""
    try:
        return "dbc" in tomllib.loads(head.decode("utf-8"))
    except (ValueError, RecursionError):
        return False


JSON = Kind("JSON text", (".json", ".jsonl", ".ndjson"), is_json)
TRUTH = Kind("the truth of a simulated drive", (".truth.json",), is_truth)
PAGE = _page("diagnose", _generator("canid diagnosis"))
COMPARISON_PAGE = _page("compare", "canid comparison")
JUNIT = Kind("JUnit XML of canid identify", (".xml",), is_junit)
PLOT = Kind("a plot of canid identify", (".svg",), is_plot)
STUDY_PAGE = _page("study", "canid study")
STUDY_FIGURE = Kind("a figure of canid study", (".svg",), is_study_figure)
CSV = Kind("a table of canid export", (".csv",), is_samples_or_estimates)
PARQUET = Kind("a Parquet table", (".parquet",), lambda head: head.startswith(b"PAR1"))
# canid's own mark is in the header of each of these
MAT = Kind(
    "a .mat of canid export",
    (".mat",),
    lambda head: head.startswith(b"MATLAB 5.0 MAT-file, canid export"),
)
MF4 = Kind(
    "an .mf4 of canid export", (".mf4",), lambda head: head[:3] == b"MDF" and head[16:24] == b"canid   "
)
MCAP = Kind(
    "an .mcap of canid export",
    (".mcap",),
    lambda head: (
        head.startswith(b"\x89MCAP0\r\n") and re.search(rb"canid[ .\w+-]{0,40} export", head[:80]) is not None
    ),
)
VBO = Kind(
    "a .vbo of canid export",
    (".vbo",),
    lambda head: (
        head.startswith(b"File created on ") and re.search(rb"\ncanid[ .\w+-]{0,40} export", head) is not None
    ),
)
LAYOUT = Kind("a layout of canid export", (".xml",), lambda head: b"<!-- canid export -->" in head[:200])
# the first lines of canid.analysis.export.driver_models
CONTROL = Kind(
    "a driver for python-control", (".py",), lambda head: head.startswith(b'"""Driver identified by canid')
)
IDTF = Kind("a driver for MATLAB", (".mat",), lambda head: b"driver identified by canid" in head[:116])
LATEX = Kind("a table of a driver", (".tex",), lambda head: head.startswith(b"% Driver identified by canid"))
# the first member of the archive of canid.analysis.export.driver_fmu
FMU = Kind(
    "a driver as an FMU",
    (".fmu",),
    lambda head: head[:4] == b"PK\x03\x04" and head[30:51] == b"resources/driver.json",
)
# the mark of canid.analysis.sumo.vehicle_types, behind the XML declaration
SUMO = Kind(
    "vehicle types of canid export",
    (".xml",),
    lambda head: b"<!-- canid export: drivers as SUMO vehicle types -->" in head[:200],
)
VEHICLE_FILE = Kind("a vehicle file", (".toml",), is_vehicle)
PRIOR = Kind(
    "a prior of canid fleet prior",
    (".toml",),
    lambda head: head.startswith(b"# Prior of a new driver by canid fleet prior"),
)
# canid.io.files.state_file replaces saved states only
STATE = Kind("a saved state", (".json", ".state"), None)
# canid.ui.cli.commands.simulate replaces simulated logs only
SIMULATED = Kind("a simulated log", (".blf", ".asc", ".log"), None)
# canid.io.logs never overwrites: it takes the next free name
RECORDING = Kind("a recording", (".blf", ".asc", ".log"), None)

# Suffixes of files that other options or programs write: no option writes another kind under them.
FOREIGN_SUFFIXES = {
    **dict.fromkeys((*FORMATS, ".gz", ".mdf", ".pcap", ".pcapng"), "a log"),
    **dict.fromkeys((".dbc", ".kcd", ".sym", ".arxml", ".xls", ".xlsx", ".cdd", ".ldf"), "a CAN database"),
    **dict.fromkeys((".toml", ".conf", ".ini", ".cfg", ".canrc"), "a configuration"),
    **dict.fromkeys((".py", ".pyc", ".so", ".pth", ".sh", ".m", ".ipynb"), "a program"),
    ".html": "a page",
    ".htm": "a page",
    ".svg": "a plot",
    ".parquet": "a table",
    **dict.fromkeys((".mat", ".mcap", ".vbo"), "a file of measured data"),
    ".events.jsonl": "a recording's journal",
    ".truth.json": "the truth of a simulated drive",
    ".series": "the list of a recording's files",
}


def foreign_kind(name: str, kind: Kind) -> str:
    """What a file of this name usually is, if its suffix belongs to another kind; "": it does not.

    Example:
        >>> foreign_kind("drive.BLF", JSON), foreign_kind("drive.events.jsonl", JSON), foreign_kind("drive.jsonl", JSON)
        ('a log', "a recording's journal", '')
    """
    lower = name.lower()
    fits = [suffix for suffix in FOREIGN_SUFFIXES if lower.endswith(suffix) and suffix not in kind.suffixes]
    return FOREIGN_SUFFIXES[fits[0]] if fits else ""
