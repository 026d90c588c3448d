"""The log formats that are read: a format is one line here, and the file with its reader.

Everything that lists formats comes from this table: `open_log`, error messages and the help of the verbs. It imports
nothing, so that one format does not pay for the others, nor help for any.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple


class Format(NamedTuple):
    """How a format is read and named."""

    module: str  # with the reader; imported when such a log is opened
    reader: str  # its function (path, state, wanted) -> columns, see `reader_state.Read`
    description: str  # as help texts name it
    is_text: bool = True  # lines, which `text_lines` reads gzipped as well


# the suffixes of text that may be a log of any program: what it is, its first lines say
TEXT_SUFFIXES = (".asc", ".log", ".csv", ".tsv", ".trc", ".txt", ".can", ".crtd", ".trace", ".json")
# those that tables of named columns have as well, and those that nothing but tables has
TABLE_SUFFIXES = (".csv", ".tsv", ".txt")
TABLES_ALONE = (".parquet", ".vbo", ".mcap", ".msl", ".lvm", ".xml", ".xml.gz")

FORMATS = {
    ".blf": Format("canid.io.logs.blf.blf_reader", "read_blf", ".blf", is_text=False),
    ".asc": Format("canid.io.logs.asc.asc_reader", "read_asc", ".asc"),
    ".log": Format("canid.io.logs.candump_reader", "read_candump", "candump .log"),
    ".csv": Format("canid.io.logs.csv_reader", "read_csv", ".csv"),
    ".trc": Format("canid.io.logs.trc_reader", "read_trc", ".trc"),
    ".mf4": Format("canid.io.logs.mf4.mf4_reader", "read_mf4", ".mf4", is_text=False),
    ".pcap": Format("canid.io.logs.pcap.pcap_reader", "read_pcap", ".pcap", is_text=False),
    ".pcapng": Format("canid.io.logs.pcap.pcap_reader", "read_pcap", ".pcapng", is_text=False),
}


class Form(NamedTuple):
    """What a text file is that has such a line among its first."""

    line: str  # regular expression of the beginning of a line; case does not matter
    says: str  # what it is
    # the line where it is read; None: it is not
    format: Format | None
    remedy: str = ""  # what to do where it is not read
    suffixes: tuple[str, ...] = ()  # under which it is expected; empty: under any


def _list(reader: str, description: str) -> Format:
    return Format("canid.io.logs.others.frame_list", reader, description)


_LOG, _CSV, _TRC = FORMATS[".log"], FORMATS[".csv"], FORMATS[".trc"]
_SCREEN = Format("canid.io.logs.others.candump_screen", "read_screen", "candump's output for the screen")
_HEX, _TIME = r"[0-9A-F]", r"\d+[.,]\d+"
_AS = "save it there as candump .log, .asc, .blf or .trc, or as the .csv of python-can"
UNKNOWN_LIST = Form(
    "",
    "lists CAN frames in a form that canid does not know",
    _list("read_list", "list of CAN frames"),
    _AS,
)
# The first line that has one of these forms decides; of a line with two of them the first here.
FORMS = (
    Form(
        r"date\s+\w|base\s+(hex|dec)\b|begin triggerblock",
        "a Vector .asc",
        FORMATS[".asc"],
        suffixes=(".asc",),
    ),
    Form(r"base\s+(hex|dec)\b|begin triggerblock", "a Vector .asc", FORMATS[".asc"]),
    Form(
        rf"\s*-?{_TIME}\s+\d+\s+{_HEX}+x?\s+(Rx|Tx)\s+[dr]\b|\s*-?{_TIME}\s+CANFD\s+\d+\s+(Rx|Tx)\b",
        "a Vector .asc",
        FORMATS[".asc"],
    ),
    Form(r"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-F]{3,8}#", "a candump log", _LOG),
    Form(
        r"\s*\([\d :.-]+\)\s+[!-~]+\s+((RX|TX)\s[ BE-]*\s*)?[0-9A-F]{3,8}\s+\[\s?\d+\]",
        "candump's output for the screen",
        _SCREEN,
    ),
    Form(
        r"\s*(?!\d)[A-Z_][!-~]*\s+((RX|TX)\s[ BE-]*\s*)?[0-9A-F]{3,8}\s+\[\s?\d+\]",
        "is candump's output for the screen, without times",
        None,
        "record with `candump -L` or `candump -l` (or with `-t a`)",
    ),
    Form(
        r"(.{0,120}[\s:])?timestamp:\s+\d+\.\d+\s+ID:\s",
        "what python-can prints on the screen",
        Format("canid.io.logs.others.labelled_lines", "read_labelled", "python-can's output for the screen"),
    ),
    Form(r";\$(FILEVERSION|STARTTIME)|\s*\d+\)\s+-?[\d.]+\s", "a PCAN .trc", _TRC),
    Form(
        r"\*\*\*BUSMASTER|\*\*\*PROTOCOL|\d+:\d\d:\d\d:\d{3,6}\s+(Rx|Tx)\s+\d",
        "a BusMaster log",
        Format("canid.io.logs.others.busmaster", "read_busmaster", "BusMaster .log"),
    ),
    Form(
        r"\s*Time\s+ID\s+DLC\s+Data\b|\s*\d+[.,]\d{3}\s+[0-9A-F]{3,8}\s+[0-8](\s+[0-9A-F]{2})*(\s|$)",
        "a CanHacker .trc",
        Format("canid.io.logs.others.canhacker", "read_canhacker", "CanHacker .trc"),
        suffixes=(".trc", ".log", ".txt"),
    ),
    Form(
        r',?"?timestamp"?,"?arbitration_id"?,"?ext|[\d.e+-]+,0x[0-9A-F]+,[01],[01],[01],\d+,',
        "python-can's .csv",
        _CSV,
    ),
    Form(
        r'"?Time Stamp"?[,;]"?ID"?[,;]"?Extended',
        "a SavvyCAN .csv",
        _list("read_gvret", "SavvyCAN (GVRET) .csv"),
    ),
    Form(
        r"time,addr(ess)?,bus,data\b",
        "a cabana .csv",
        _list("read_cabana", "cabana .csv"),
    ),
    Form(
        r"bus,messageid,message,messagelength,time",
        "a panda .csv",
        _list("read_panda", "panda .csv"),
    ),
    Form(
        r"bus,messageid,message\b",
        "is a panda .csv without times",
        None,
        "record it with a can_logger.py that writes the column Time",
    ),
    Form(
        r'"?Time"?[,;]"?Channel"?[,;]"?ID"?[,;]"?Flags',
        "a Kvaser .csv",
        _list("read_kvaser", "Kvaser .csv"),
    ),
    Form(
        r"Line,Abs ?Time\(Sec\),Rel",
        "a Vehicle Spy .csv",
        _list("read_vehicle_spy", "Vehicle Spy .csv"),
    ),
    Form(
        r"\s*Time\s+Chan\s+Identifier|\s*Chn\s+Identifier\s+Flg",
        "Kvaser's plain text",
        Format("canid.io.logs.others.kvaser_text", "read_kvaser_text", "Kvaser's plain text"),
    ),
    Form(r"@ TEXT @", "is a trace of CARBUS Analyzer", None, _AS),
    Form(
        r"\d+(\.\d+)?\s+\d{0,2}([RT](11|29)\s+[0-9A-F]+|CXX\b)",
        "a CRTD log",
        Format("canid.io.logs.others.crtd", "read_crtd", "CRTD log"),
    ),
    Form(r"Microchip Technology", "a log of Microchip's CAN Bus Analyzer", UNKNOWN_LIST.format),
    Form(
        r'"?No\."?[,\s]\s*"?Time"?[,\s]\s*"?Source"?[,\s]|.*"_source":',
        "is a list of packets of Wireshark",
        None,
        "save the capture there as .pcapng, which is read",
    ),
)


def read_suffixes() -> tuple[str, ...]:
    """All suffixes that `open_log` takes.

    >>> read_suffixes()[:2], ".trc.gz" in read_suffixes(), ".blf.gz" in read_suffixes()
    (('.blf', '.asc'), True, False)
    """
    return (*FORMATS, *(f"{suffix}.gz" for suffix, each in FORMATS.items() if each.is_text))


def described() -> str:
    """The formats in words, for help texts.

    >>> described()
    '.blf, .asc, candump .log, .csv, .trc, .mf4, .pcap or .pcapng'
    """
    *others, last = [each.description for each in FORMATS.values()]
    return f"{', '.join(others)} or {last}"


def log_suffix(path: str | os.PathLike[str]) -> str:
    """Return the suffix that names the format, in lower case, with ".gz" where it is compressed.

    >>> log_suffix("drive.BLF"), log_suffix("drive.2.asc.gz")
    ('.blf', '.asc.gz')
    """
    suffixes = [suffix.lower() for suffix in Path(path).suffixes]
    return "".join(suffixes[-2:] if suffixes[-1:] == [".gz"] else suffixes[-1:])


def format_of(path: str | os.PathLike[str]) -> Format | None:
    """Look up the format of a log; None for an unknown suffix.

    >>> format_of("drive.2.asc.gz").description, format_of("drive.blf.gz")
    ('.asc', None)
    """
    suffix = log_suffix(path)
    return FORMATS[suffix.removesuffix(".gz")] if suffix in read_suffixes() else None
