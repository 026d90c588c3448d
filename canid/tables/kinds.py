"""Which files are tables: by suffix, and for .csv, which CAN logs have too, by the header."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

from canid.errors import ConfigError, LogError
from canid.logs import formats

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")
SUFFIXES = (*TEXT_SUFFIXES, ".parquet", ".vbo")
# of the formats that are read as CAN logs
CAN_HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"
# words of a header, in lower case and without blanks, by which other programs' lists of CAN frames are known
_IDS = {"id", "canid", "can_id", "arbitration_id", "arbitrationid", "identifier", "messageid", "id(hex)"}
_DATA = {"data", "databytes", "data_bytes", "d1", "d0", "b0", "b1", "payload", "data(hex)"}
_BEGIN_BYTES = 65_536


def suffix(path: Path) -> str:
    """The suffix, in lower case, with ".gz" where it is compressed."""
    return formats.log_suffix(path)


def is_table(path: str | Path) -> bool:
    """Whether a file is a table of named columns, not a log of CAN frames.

    Raises:
        ConfigError: it lists CAN frames in a way that is not read.

    Example:
        >>> is_table("drive.parquet"), is_table("drive.blf")
        (True, False)
    """
    file = Path(path)
    kind = suffix(file)
    if kind in (".parquet", ".vbo", ".tsv", ".tsv.gz", ".txt", ".txt.gz"):
        return True
    if kind not in (".csv", ".csv.gz") or not file.is_file():
        return False
    lines = _first_lines(file)
    if not lines:
        return False
    cells = [
        cell.strip(' "\ufeff').lower().replace(" ", "") for cell in lines[0].replace(";", ",").split(",")
    ]
    if ",".join(cells) == CAN_HEADER or _is_frame(lines[0]):
        return False
    if _IDS & {*cells} and _DATA & {*cells}:
        raise ConfigError(
            f"{path}: lists CAN frames ({lines[0][:60].strip()} ...), as other programs write them; save the log as "
            f"candump .log, .asc, .blf or .trc there, or as the .csv of python-can"
        )
    return True


def _is_frame(line: str) -> bool:
    """Whether a line is a frame of python-can's .csv: its header may be lost."""
    cells = line.strip().split(",")
    return len(cells) == 7 and cells[1].lower().startswith("0x")


def _first_lines(file: Path) -> list[str]:
    try:
        with gzip.open(file, "rb") if file.suffix.lower() == ".gz" else file.open("rb") as opened:
            begin = opened.read(_BEGIN_BYTES)
    except (OSError, EOFError, zlib.error) as error:
        raise LogError(f"cannot read {file}: {getattr(error, 'strerror', None) or error}") from None
    return [line for line in begin.decode("utf-8", errors="replace").splitlines() if line.strip()]
