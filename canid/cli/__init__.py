"""The command line: parse, call, print. One verb per file; the list below is the registry."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from typing import NoReturn

from canid import __version__
from canid.cli import streams
from canid.cli.interrupt import Ended, ending
from canid.cli.talk import talk, tell
from canid.errors import DONE, NOT_WRITTEN, USAGE, CanidError, ConfigError

# verb, one line for `canid --help`; the module canid.cli.<verb> has `arguments(parser)` and `run(args) -> int`.
# It is imported only when its verb is called: start-up stays under 0.1 s, and recording starts before the
# mathematics is imported.
VERBS = (
    ("demo", "see it work: a simulated drive with known truth on a virtual bus"),
    ("live", "record a bus and tell live how the driver drives; listens only"),
    ("record", "record a bus without loss; listens only"),
    ("replay", "the live view from a recorded log, or the log onto a virtual bus"),
    ("identify", "the driver's parameters from logs: table and JSON"),
    ("diagnose", "what the simulation gets wrong, which cause, and what a better model gains"),
    ("simulate", "make a log with known truth"),
    ("check", "does the vehicle file fit this log or bus, and what is missing"),
    ("init", "propose a vehicle file from a DBC"),
    ("recover", "a clean copy of a damaged log, and what is missing in it"),
    ("export", "signals and estimates as CSV or Parquet"),
)


def usage() -> str:
    """Return the text of `canid --help`."""
    verbs = "\n".join(f"  {name:10}{says}" for name, says in VERBS)
    return (
        "usage: canid VERB [options]\n\n"
        "Records a CAN bus without loss and tells how the driver is driving.\n\n"
        f"{verbs}\n\n"
        "canid VERB --help tells a verb's options; canid --version the version.\n"
        "Exit: 0 done, 1 a check failed, 2 usage or configuration, 3 no bus, 4 input damaged (partial result),\n"
        "      5 could not write, 130/143 interrupted after a clean close.\n"
    )


class Parser(argparse.ArgumentParser):
    """argparse whose complaint is one line, as all of ours are."""

    def error(self, message: str) -> NoReturn:
        """Raise ConfigError, with a guess at what was meant."""
        unknown = re.search(r"unrecognized arguments: (--[\w-]+)", message)
        known = re.findall(r"--[\w-]+", self.format_usage())
        close = get_close_matches(unknown[1], known, n=1) if unknown else []
        hint = f"did you mean {close[0]}?" if close else f"`{self.prog} --help` tells its options"
        raise ConfigError(f"{self.prog.removeprefix('canid ')}: {message}; {hint}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    args = list(sys.argv[1:] if argv is None else argv)
    with streams.installed() as standard:
        code, head = _answered(args)
    lost = [stream for stream in standard if stream.lost]
    # whoever closes the pipe of a table (head, a pager) has had enough; all else that was not written is a loss
    return NOT_WRITTEN if lost and code in LOSABLE and not head else code


# codes of a command that has done its work, and says by NOT_WRITTEN that not all of its output was taken
LOSABLE = (DONE, 129, 130, 143)


def _answered(args: list[str]) -> tuple[int, bool]:
    """Run one command; returns its exit code, and whether the reader of its output has left it."""
    try:
        with ending():
            return _run(args), False
    except CanidError as error:
        for line in error.mistakes if isinstance(error, ConfigError) else (str(error),):
            talk(line)
        return error.exit_code, False
    except KeyboardInterrupt as error:
        talk("interrupted")
        return error.code if isinstance(error, Ended) else 130, False
    except BrokenPipeError:
        return DONE, True
    except OSError as error:
        talk(f"{error.filename or 'standard output'}: {error.strerror}")
        return NOT_WRITTEN, False


def _run(args: list[str]) -> int:
    if not args or args[0] in ("-h", "--help", "help"):
        for line in usage().splitlines():
            tell(line)
        return DONE if args else USAGE
    if args[0] in ("-V", "--version"):
        tell(f"canid {__version__}")
        return DONE
    names = [name for name, _ in VERBS]
    if args[0] not in names:
        close = get_close_matches(args[0], names, n=1)
        hint = f'did you mean "{close[0]}"?' if close else "`canid --help` lists the verbs"
        raise ConfigError(f'no verb "{args[0]}"; {hint}')
    module = import_module(f"canid.cli.{args[0]}")
    parser = Parser(prog=f"canid {args[0]}", description=dict(VERBS)[args[0]])
    module.arguments(parser)
    return int(module.run(parser.parse_args(args[1:])))
