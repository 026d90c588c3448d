"""The command line that gives a result again, for its provenance."""

from __future__ import annotations

import argparse
import math
import shlex
from collections.abc import Iterable, Iterator

# what a log or a table is read by, and its part
READ_BY = ("--time-zone", "--vehicle", "--columns", "--where", "--vehicle-id")
PART = ("--start", "--stop")
# options are left out where they are not given, or have these values
DEFAULTS = {"--start": -math.inf, "--stop": math.inf, "--seed": 1, "--by": "folder"}
# options with a short name alone
FIELDS = {"-o": "output"}


def reproducing(
    args: argparse.Namespace, verb: str, *operands: str, options: Iterable[str] = (*READ_BY, *PART)
) -> str:
    """Rebuild the command line from its parsed arguments.

    Args:
        args: of the verb; an option that the verb does not have counts as not given.
        verb: with its sub-verb, such as "fleet report".
        operands: that are no options, such as logs.
        options: that change the result, in the order in which they are written.

    Example:
        >>> args = argparse.Namespace(vehicle="generic", where=["a=1", "b=2"], start=-math.inf, stop=60.0, rivals=True)
        >>> reproducing(args, "diagnose", "drive 7.blf", options=(*READ_BY, *PART, "--rivals"))
        "canid diagnose 'drive 7.blf' --vehicle generic --where a=1 --where b=2 --stop 60 --rivals"
    """
    words = [word for option in options for word in _words(args, option)]
    return shlex.join(["canid", *verb.split(), *operands, *words])


def _words(args: argparse.Namespace, option: str) -> Iterator[str]:
    value = getattr(args, FIELDS.get(option) or option.lstrip("-").replace("-", "_"), None)
    if value is None or value is False or value == DEFAULTS.get(option):
        return
    for each in value if isinstance(value, list) else [value]:
        yield option
        if each is not True:
            yield f"{each:g}" if isinstance(each, float) else str(each)
