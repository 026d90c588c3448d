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
from canid.cli.interrupt import Ended, ending
from canid.cli.output import streams
from canid.cli.output.messages import info, print_line
from canid.errors import DONE, NOT_WRITTEN, USAGE, CanidError, ConfigError
from canid.one_thread import use_one_thread

# Verb, one line for `canid --help`; the module canid.cli.<verb> has `arguments(parser)` and `run(args) -> int`.
# It is imported only when its verb is called: start-up stays under 0.1 s, and recording starts before numpy, scipy and
# cantools are imported.
VERBS = (
    ("demo", "try canid without hardware: a simulated drive with known parameters on a virtual bus"),
    ("live", "record a bus and estimate the driver's parameters live; listens only"),
    ("record", "record a bus without loss; listens only"),
    ("replay", "show a recorded log in the live view, or send it to a virtual bus"),
    ("identify", "estimate the driver's parameters from logs, as text and JSON"),
    ("diagnose", "find what the simulation gets wrong and why, and how much a better model gains"),
    ("compare", "compare two drivers: which parameters and causes differ, by how much, beyond chance or not"),
    ("fleet", "analyse many drives of many drivers, on all cores or on Dask"),
    ("study", "check both papers behind canid, and repeat their analysis on logs next to canid's"),
    ("simulate", "write a log of a simulated drive with known parameters"),
    ("look", "show what a log contains: ids, rates, changing bits; with DBC files their signals over time"),
    ("check", "check that a vehicle file fits a log or bus, and list what is missing"),
    ("init", "propose a vehicle file from DBC files and a log"),
    ("recover", "write a clean copy of a damaged log, and report what is missing in it"),
    (
        "export",
        "write samples, estimates and signals as CSV, Parquet, .mat, .mf4, .mcap, .vbo or for PlotJuggler",
    ),
    ("schema", "print the JSON Schema of what a verb writes with --json"),
)


def usage() -> str:
    """The text of `canid --help`."""
    verbs = "\n".join(f"  {name:10}{help_text}" for name, help_text in VERBS)
    return (
        "usage: canid VERB [options]\n\n"
        "Record a CAN bus without loss, and identify the driver: gain, lag and dead time, live or from logs.\n\n"
        f"{verbs}\n\n"
        "canid VERB --help lists the options of a verb, canid --version prints the version.\n"
        "canid --print-completion bash|zsh|fish prints a completion script for the shell.\n"
        "Exit codes: 0 done, 1 a check failed, 2 usage or configuration error, 3 no bus or bus lost,\n"
        "            4 input damaged (partial result), 5 output not written, 129/130/143 interrupted,\n"
        "            files closed.\n"
    )


class Parser(argparse.ArgumentParser):
    """argparse with errors in one line, as all of canid's are."""

    def error(self, message: str) -> NoReturn:
        """Raise ConfigError, with the closest option as a hint."""
        unknown = re.search(r"unrecognized arguments: (--[\w-]+)", message)
        known = re.findall(r"--[\w-]+", self.format_usage())
        close = get_close_matches(unknown[1], known, n=1) if unknown else []
        hint = f"did you mean {close[0]}?" if close else f"`{self.prog} --help` lists its options"
        raise ConfigError(f"{self.prog.removeprefix('canid ')}: {message}; {hint}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    args = list(sys.argv[1:] if argv is None else argv)
    use_one_thread()
    with streams.installed() as standard:
        code, left = _run_caught(args)
    lost = [stream for stream in standard if stream.lost]
    # a reader that closes its pipe (head, a pager) wants no more; all else that was not written is a loss
    return NOT_WRITTEN if lost and code in REPLACED_BY_LOSS and not left else code


# exit codes of finished work, which NOT_WRITTEN replaces where not all output was written
REPLACED_BY_LOSS = (DONE, 129, 130, 143)


def _run_caught(args: list[str]) -> tuple[int, bool]:
    """Run one command; returns its exit code, and whether the reader of its output has left."""
    try:
        with ending():
            return _run(args), False
    except CanidError as error:
        for line in error.mistakes if isinstance(error, ConfigError) else (str(error),):
            info(line)
        return error.exit_code, False
    except KeyboardInterrupt as error:
        info("interrupted")
        return error.code if isinstance(error, Ended) else 130, False
    except BrokenPipeError:
        return DONE, True
    except OSError as error:
        info(f"{error.filename or 'standard output'}: {error.strerror}")
        return NOT_WRITTEN, False


def _run(args: list[str]) -> int:
    if not args or args[0] in ("-h", "--help", "help"):
        for line in usage().splitlines():
            print_line(line)
        return DONE if args else USAGE
    if args[0] in ("-V", "--version"):
        print_line(f"canid {__version__}")
        return DONE
    if args[0] == "--print-completion":
        from canid.cli import completion

        return completion.run(args[1:])
    names = [name for name, _ in VERBS]
    if args[0] not in names:
        close = get_close_matches(args[0], names, n=1)
        hint = f'did you mean "{close[0]}"?' if close else "`canid --help` lists the verbs"
        raise ConfigError(f'no verb "{args[0]}"; {hint}')
    module = import_module(f"canid.cli.{args[0]}")
    prog, what, words = f"canid {args[0]}", dict(VERBS)[args[0]], args[1:]
    # of a verb whose first word may be a verb of its own
    parts = getattr(module, "SUB_VERBS", {})
    if words and words[0] in parts:
        module = import_module(f"canid.cli.{args[0]}_{words[0]}")
        prog, what, words = f"{prog} {words[0]}", parts[words[0]], words[1:]
    parser = Parser(prog=prog, description=what)
    module.arguments(parser)
    return int(module.run(parser.parse_args(words)))
