"""The kinds of files that canid's options write, and how an existing file shows that it is of one of them.

An existing file is replaced only by a file of its own kind. The kind is read from the file's content, never believed
from its name; a name that promises another kind is refused before anything is looked at.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from typing import NamedTuple

# bytes of an existing file that are looked at
HEAD = 65_536


class Kind(NamedTuple):
    """A kind of output file."""

    name: str  # "JSON text"
    suffixes: tuple[str, ...]  # usual ones; what else a name may end with: see `FOREIGN`
    # from the first `HEAD` bytes of a file that is not empty; None: who writes it sees to it that nothing is lost
    recognise: Callable[[bytes], bool] | None


def _json_values(head: bytes) -> list[object] | None:
    """Parse the JSON values, one a line, of a file's beginning; None where it is none, [] where none ends in it."""
    try:
        text = head.decode("utf-8", "strict" if len(head) < HEAD else "ignore")
    except UnicodeDecodeError:
        return None
    if not text.lstrip().startswith(("{", "[")):
        return None
    values: list[object] = []
    decoder, space = json.JSONDecoder(), re.compile(r"\s*")
    at = space.match(text).end()  # type: ignore[union-attr]  # it fits everywhere
    while at < len(text):
        try:
            value, at = decoder.raw_decode(text, at)
        except (ValueError, RecursionError):
            # the last value may go on behind what was read
            return values if len(head) == HEAD and not re.search(r"[\x00-\x08]", text) else None
        values.append(value)
        at = space.match(text, at).end()  # type: ignore[union-attr]
    return values


def is_json(head: bytes) -> bool:
    r"""JSON text that is none of the files that canid keeps for itself: a saved state, a recording's journal.

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
    """The truth of a simulated drive: a JSON object with its channels."""
    values = _json_values(head)
    first = values[0] if values else None
    return isinstance(first, dict) and "channels" in first


def is_page(head: bytes) -> bool:
    """A page that `canid diagnose --report` has written."""
    start = head.lstrip()[:15].lower()
    return start.startswith(b"<!doctype html") and b"canid diagnosis" in head


def is_samples_or_estimates(head: bytes) -> bool:
    r"""A table that `canid export` has written.

    Example:
        >>> is_samples_or_estimates(b"t,gap,output,gate,learn\n"), is_samples_or_estimates(b"timestamp,id\n")
        (True, False)
    """
    columns = head.partition(b"\n")[0].strip().split(b",")
    return columns[0] == b"t" and bool({b"learn", b"can_tell"} & set(columns))


def is_vehicle(head: bytes) -> bool:
    """A vehicle file: TOML that names a DBC."""
    try:
        return "dbc" in tomllib.loads(head.decode("utf-8"))
    except (ValueError, RecursionError):
        return False


JSON = Kind("JSON text", (".json", ".jsonl", ".ndjson"), is_json)
TRUTH = Kind("the truth of a simulated drive", (".truth.json",), is_truth)
PAGE = Kind("a page of canid diagnose", (".html", ".htm"), is_page)
CSV = Kind("a table of canid export", (".csv",), is_samples_or_estimates)
PARQUET = Kind("a Parquet table", (".parquet",), lambda head: head.startswith(b"PAR1"))
VEHICLE = Kind("a vehicle file", (".toml",), is_vehicle)
# canid.state_file replaces what begins as a saved state, and nothing else
STATE = Kind("a saved state", (".json", ".state"), None)
# canid.cli.simulate replaces logs that it has made, and nothing else
SIMULATED = Kind("a simulated log", (".blf", ".asc", ".log"), None)
# canid.frames never writes over anything: it takes the next free name
RECORDING = Kind("a recording", (".blf", ".asc", ".log"), None)

# Names that promise something which other options or programs keep there: no option writes another kind under them.
FOREIGN = {
    **dict.fromkeys(
        (".blf", ".asc", ".log", ".csv", ".trc", ".mf4", ".gz", ".mdf", ".pcap", ".pcapng"), "a log"
    ),
    **dict.fromkeys((".dbc", ".kcd", ".sym", ".arxml", ".xls", ".xlsx", ".cdd", ".ldf"), "a CAN database"),
    **dict.fromkeys((".toml", ".conf", ".ini", ".cfg", ".canrc"), "a configuration"),
    **dict.fromkeys((".py", ".pyc", ".so", ".pth", ".sh", ".m", ".ipynb"), "a program"),
    ".html": "a page",
    ".htm": "a page",
    ".parquet": "a table",
    ".events.jsonl": "a recording's journal",
    ".truth.json": "the truth of a simulated drive",
    ".series": "the list of a recording's files",
}


def promised(name: str, kind: Kind) -> str:
    """What the end of a name promises that is not of this kind, in words; "": nothing.

    Example:
        >>> promised("drive.BLF", JSON), promised("drive.events.jsonl", JSON), promised("drive.jsonl", JSON)
        ('a log', "a recording's journal", '')
    """
    lower = name.lower()
    fits = [suffix for suffix in FOREIGN if lower.endswith(suffix) and suffix not in kind.suffixes]
    return FOREIGN[fits[0]] if fits else ""
