"""The option --report, one rule for all verbs: with a name or without, and the kind of its file."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from canid.io.files.derived_name import derived
from canid.ui.cli.output import output_kinds
from canid.ui.cli.output.outputs import Output
from canid.values.errors import ConfigError

# with any other suffix `--report LOG` (the name forgotten, the log taken for it) could write over a log
PAGE_SUFFIXES = (".html", ".htm")


def add(
    parser: argparse.ArgumentParser,
    what: str,
    flags: Sequence[str] = ("--report",),
    default: str = "LOG.VERB.html",
) -> None:
    """--report; an earlier page of the same verb is replaced."""
    parser.add_argument(
        *flags,
        metavar="FILE.html",
        nargs="?",
        const="",
        help=f"{what}; default name: {default} in the current folder; replaces an earlier page",
    )


def output(args: argparse.Namespace, verb: str, kind: output_kinds.Kind | None = None) -> Output | None:
    """The output of --report; None: not asked for. Without a name it gets that of the first log, or of the verb.

    Raises:
        ConfigError: the name is not that of a page.

    Example:
        >>> output(argparse.Namespace(report="a.html"), "check").kind.name
        'a page of canid check'
        >>> output(argparse.Namespace(report="", logs=["drives/a.blf", "b.blf"]), "identify").path
        'a.identify.html'
    """
    if args.report is None:
        return None
    log = getattr(args, "log", None) or next(iter(getattr(args, "logs", ())), None)
    name = page_name(verb, args.report, None if verb == "fleet" else log)
    return Output("--report", name, kind or output_kinds.report_page(verb))


def page_name(
    verb: str, asked: str, log: str | None, what: str = "", option: str = "--report", stem: str = ""
) -> str:
    """The name that was asked for, or else one in the current folder that is derived from the log.

    Args:
        verb: whose option it is.
        asked: the option's argument; "": without a name.
        log: that the page is about; None: none.
        what: the name's last part before `.html`; "": the verb.
        option: as it was given.
        stem: the name's first part where there is no log.

    Raises:
        ConfigError: the name is not that of a page.

    Example:
        >>> page_name("diagnose", "", "drives/a.blf", "diagnosis"), page_name("fleet", "", None)
        ('a.diagnosis.html', 'fleet.html')
    """
    first = Path(log).stem if log else stem
    name = asked or derived(f"{first}." if first else "", f"{what or verb}.html")
    if Path(name).suffix.lower() not in PAGE_SUFFIXES:
        raise ConfigError(f"{verb}: {option} {name} is not an .html file; put logs before {option}")
    return name
