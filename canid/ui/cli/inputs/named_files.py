"""Files that a command line names for reading: shipped ones by their bare names, and an error where there is none.

Before a verb imports what it computes with: that takes longer than seeing that a name is misspelt.
"""

from __future__ import annotations

import argparse
import os

from canid.values.errors import ConfigError
from canid.values.shipped_files import located

# options and arguments that name logs or DBC files
_NAMES = ("log", "logs", "dbc", "lead")


def resolve(args: argparse.Namespace, *, there: bool = True, logs: bool = True) -> None:
    """Put the paths of shipped files in the place of their bare names.

    Args:
        args: of the verb.
        there: refuse a log that does not exist.
        logs: of logs as well; else of the other files alone.

    Raises:
        ConfigError: the one log does not exist.

    Example:
        >>> args = argparse.Namespace(log="following_mixed.blf", dbc=["generic.dbc", "mine.dbc"])
        >>> resolve(args)
        >>> os.path.isfile(args.log), os.path.isfile(args.dbc[0]), args.dbc[1]
        (True, True, 'mine.dbc')
    """
    for name in _NAMES if logs else _NAMES[2:]:
        value = getattr(args, name, None)
        if isinstance(value, str):
            setattr(args, name, _found(value))
        elif isinstance(value, list):
            setattr(
                args,
                name,
                [
                    _found(name_or_value) if isinstance(name_or_value, str) else name_or_value
                    for name_or_value in value
                ],
            )
    log = getattr(args, "log", None)
    several = getattr(args, "logs", ())
    if not there:
        return
    if isinstance(log, str):
        existing(log)
    elif several and len(several) == 1:
        existing(several[0])


def _found(word: str) -> str:
    """A shipped file's path, or the word as it was given: it may be a URL, a folder with its slash, or `-`.

    >>> _found("s3://bucket/a.blf"), _found("./-x.blf"), _found("")
    ('s3://bucket/a.blf', './-x.blf', '')
    """
    path = str(located(word)) if word else word
    return path if os.path.isabs(path) and not os.path.isabs(word) else word


def existing(log: str) -> None:
    """Raise ConfigError where a log does not exist; what else is wrong with it says whoever opens it."""
    try:
        os.stat(log)
    except (FileNotFoundError, NotADirectoryError):
        raise ConfigError(f"no such log: {log}") from None
    except (OSError, ValueError):
        pass
