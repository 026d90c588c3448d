"""Files that are shipped with canid: vehicles, their DBC files, and logs of simulated drives."""

from __future__ import annotations

import os
from pathlib import Path

# files that a bare name finds; vehicle files have names without a suffix as well (`vehicle_file.locate`)
_SUFFIXES = (".dbc", ".blf", ".asc")

# before the name of a DBC file that a vehicle file takes from `shipped`, as in dbc = "shipped:generic.dbc"
SHIPPED = "shipped:"


def shipped() -> Path:
    """Find the folder of the vehicles that are shipped with canid: in an installed wheel, or in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "_data" / "dbc"
    return installed if os.path.isdir(installed) else package.parent / "dbc"


def located(path: str | os.PathLike[str]) -> Path:
    """A path as it is, or the shipped log or DBC file of this bare name, where the current folder has none of that name.

    Example:
        >>> located("generic.dbc").is_file(), located("mine.dbc"), located("elsewhere/generic.dbc").as_posix()
        (True, PosixPath('mine.dbc'), 'elsewhere/generic.dbc')
    """
    given = Path(path)
    if given.name != os.fspath(path) or given.suffix not in _SUFFIXES or os.path.lexists(given):
        return given
    folders = (shipped(), shipped().parent / "replay_logs")
    return next((file for folder in folders if os.path.isfile(file := folder / given.name)), given)
