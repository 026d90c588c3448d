"""The command line: parse, call, print. One verb per file; `verbs.py` lists them."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from typing import NoReturn

from canid import __version__
from canid.ui.cli.inputs import named_files
from canid.ui.cli.interrupt import Ended, ending
from canid.ui.cli.room import check_modules
from canid.ui.cli.verbs import VERBS
from canid.ui.terminal import streams
from canid.ui.terminal.messages import info, print_line, print_text
from canid.values.errors import DONE, NOT_WRITTEN, USAGE, CanidError, ConfigError, one_line, out_of_memory
from canid.values.processes.one_thread import use_one_thread

# verbs that import what they compute with before they open their log; the others say themselves that it is not there
_SLOW_TO_IMPORT = ("identify", "diagnose", "check", "look", "export", "replay")


def usage() -> str:
    """The text of `canid --help`."""
    verbs = "\n".join(f"  {name:10}{help_text}" for name, help_text, *_ in VERBS)
    return (
        "usage: canid VERB [options]\n\n"
        "Record a CAN bus without loss, and identify the driver: gain, lag and dead time, live or from logs.\n\n"
        f"{verbs}\n\n"
        "canid VERB --help lists the options of a verb, canid --version prints the version.\n"
        "canid --print-completion bash|zsh|fish prints a completion script for the shell.\n"
        "Exit codes: 0 done, 1 a check failed, 2 usage or configuration error, 3 no bus, bus lost or silent,\n"
        "            4 input damaged (partial result), 5 output not written, 129/130/143 interrupted,\n"
        "            files closed.\n"
    )


class Parser(argparse.ArgumentParser):
    """argparse with errors in one line, as all of canid's are."""

    def error(self, message: str) -> NoReturn:
        """Raise ConfigError, with the closest option as a hint."""
        # a word of a megabyte is no line
        message = re.sub(r"(\S{80})\S{40,}", r"\1...", message)
        unknown = re.search(r"unrecognized arguments: --([\w-]+)", message)
        options = re.findall(r"--([\w-]+)", self.format_usage())
        # without the dashes, which every option shares
        close = get_close_matches(unknown[1], options, n=1) if unknown else []
        hint = f"did you mean --{close[0]}?" if close else f"`{self.prog} --help` lists its options"
        if unknown and unknown[1] == "dbc" and "vehicle" in options:
            hint = "DBC files are named in a vehicle file: `canid init FILE.dbc --log LOG -o V.toml`, then --vehicle V.toml"
        elif unknown and unknown[1] == "dbc" and "FILE.dbc" in self.format_usage():
            hint = "FILE.dbc is given without an option"
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
    except (OSError, MemoryError, RuntimeError, ImportError, SystemError) as error:
        if out_of_memory(error):
            info(f"not enough memory ({one_line(error)}); see `ulimit -v`")
        elif isinstance(error, OSError):
            info(f"{error.filename or 'standard output'}: {error.strerror}")
        else:
            raise
        return NOT_WRITTEN, False


def _run(args: list[str]) -> int:
    if not args or args[0] in ("-h", "--help", "help"):
        print_text(usage())
        return DONE if args else USAGE
    if args[0] in ("-V", "--version"):
        print_line(f"canid {__version__}")
        return DONE
    if args[0] == "--print-completion":
        from canid.ui.cli import completion

        return completion.run(args[1:])
    by_name = {verb.name: verb for verb in VERBS}
    if args[0] not in by_name:
        close = get_close_matches(args[0], by_name, n=1)
        hint = f'did you mean "{close[0]}"?' if close else "`canid --help` lists the verbs"
        raise ConfigError(f'no verb "{args[0]}"; {hint}')
    verb = by_name[args[0]]
    part = args[1] if args[1:] and args[1] in verb.parts else ""
    check_modules()
    module = verb.module(part)
    parser = Parser(prog=f"canid {verb.name} {part}".rstrip(), description=verb.help_of(part))
    module.arguments(parser)
    parsed = parser.parse_args(args[2:] if part else args[1:])
    # what is written to the folder of the log is not written into the package
    in_its_folder = verb.name == "recover" or (verb.name == "export" and not parsed.output)
    named_files.resolve(parsed, there=verb.name in _SLOW_TO_IMPORT, logs=not in_its_folder)
    if not getattr(parsed, "time_zone", None):
        return int(module.run(parsed))
    from canid.io.logs.local_time import named

    with named(parsed.time_zone):
        return int(module.run(parsed))
