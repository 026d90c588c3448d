"""What follows from the verbs: docs/commands.md, the man page, and tables of the README and docs/json.md.

python docs/reference_of_commands.py
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent))

from canid import __version__  # noqa: E402
from canid.ui.cli import completion  # noqa: E402
from canid.ui.cli.commands import schema  # noqa: E402
from canid.ui.cli.verbs import VERBS  # noqa: E402

PAGE = DOCS / "commands.md"
MAN = DOCS / "man/canid.1"
README = DOCS.parent / "README.md"
NAMES = DOCS / "json.md"
SECTION = (
    "## Keys of each schema\n\n<!-- made from the types by `python docs/reference_of_commands.py` -->\n\n"
)
EXIT_CODES = (
    ("0", "done"),
    ("1", "done, and a check failed"),
    ("2", "usage or configuration error"),
    ("3", "no bus, or bus lost"),
    ("4", "input damaged; the rest was used"),
    ("5", "output not written, or lost"),
    ("129, 130, 143", "interrupted; files are closed"),
)
VARIABLES = (
    (
        "CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE, CAN_CONFIG",
        "the bus, as python-can knows it; options come first",
    ),
    ("CANID_TIME_ZONE", "zone of local times in logs, as --time-zone"),
    ("CANID_WEB_TOKEN", "token of the live page"),
    ("NO_COLOR", "no colors in the terminal"),
)


class Option(NamedTuple):
    """An option or argument: how it is written, and what it does."""

    words: tuple[str, ...]  # such as -o FILE, --output FILE
    text: str


class Command(NamedTuple):
    """A verb, or what follows `study`."""

    name: str
    text: str
    arguments: tuple[str, ...]  # as written, without options
    groups: tuple[tuple[str, str, tuple[Option, ...]], ...]  # title, description, options


def commands() -> Iterator[Command]:
    """All verbs, in the order of `canid --help`; those with parts are followed by their parts."""
    verbs = _nested(completion.full_parser())
    for verb in VERBS:
        yield command(verbs[verb.name], verb.name, verb.help)
        for part, parser in _nested(verbs[verb.name]).items():
            yield command(parser, f"{verb.name} {part}", parser.description or "")
        # of a verb that takes words of any kind, of which a few are verbs themselves
        for part, what in verb.parts.items():
            parser = argparse.ArgumentParser(f"canid {verb.name} {part}", description=what)
            verb.module(part).arguments(parser)
            yield command(parser, f"{verb.name} {part}", what)


def command(parser: argparse.ArgumentParser, name: str, text: str) -> Command:
    """What argparse knows of one command."""
    groups = []
    arguments: list[str] = []
    for group in parser._action_groups:
        shown = [a for a in group._group_actions if a.help != argparse.SUPPRESS and not _is_nested(a)]
        arguments += [_value(action) for action in group._group_actions if not action.option_strings]
        options = tuple(option(action) for action in shown if "--help" not in action.option_strings)
        if options:
            # argparse's own two groups need no title
            title = "" if group.title in ("positional arguments", "options") else str(group.title)
            groups.append((title, group.description or "", options))
    return Command(name, text, tuple(arguments), tuple(groups))


def option(action: argparse.Action) -> Option:
    """One option, as a user writes it."""
    value = _value(action)
    words = tuple(f"{name} {value}".strip() for name in action.option_strings) or (value,)
    text = (action.help or "") % (vars(action) | {"prog": "canid"})
    return Option(words, re.sub(r"\s+", " ", text))


def _value(action: argparse.Action) -> str:
    if action.nargs == 0:
        return ""
    name = action.metavar or ("|".join(map(str, action.choices)) if action.choices else action.dest.upper())
    if _is_nested(action) and action.choices:
        name = "|".join(action.choices)
    if isinstance(name, tuple):
        return " ".join(name)
    shapes = {"?": f"[{name}]", "*": f"[{name}...]", "+": f"{name}..."}
    return (
        shapes.get(str(action.nargs), name)
        if not isinstance(action.nargs, int)
        else " ".join([name] * action.nargs)
    )


def _is_nested(action: argparse.Action) -> bool:
    return isinstance(action, argparse._SubParsersAction)


def _nested(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    return {
        name: sub for a in parser._actions if _is_nested(a) for name, sub in dict(a.choices or {}).items()
    }


def markdown() -> str:
    """The page of the documentation."""
    lines = [
        "# Commands",
        "",
        "<!-- made from argparse by `python docs/reference_of_commands.py`; also the man page -->",
        "",
        "Every verb with its arguments and options, as `canid VERB --help` prints them. `canid --version` prints the "
        "version, `canid --print-completion bash|zsh|fish` a [completion script](install.md#completion).",
        "",
    ]
    for each in commands():
        level = "###" if " " in each.name else "##"
        arguments = " ".join(("canid", each.name, *each.arguments))
        lines += [f"{level} canid {each.name}", "", f"`{arguments} [options]`: {_escaped(each.text)}.", ""]
        for title, description, options in each.groups:
            if title:
                lines += [f"**{_escaped(title)}** {_escaped(description)}".strip(), ""]
            lines += ["| | |", "|---|---|"]
            for words, text in options:
                cell = ", ".join(f"`{word}`" for word in words).replace("|", "\\|")
                lines.append(f"| {cell} | {_escaped(text)} |")
            lines.append("")
    lines += [
        "## Exit codes",
        "",
        "| | |",
        "|---|---|",
        *(f"| {code} | {text} |" for code, text in EXIT_CODES),
        "",
    ]
    lines += ["## Environment", "", "| | |", "|---|---|"]
    lines += [f"| {', '.join(f'`{n}`' for n in names.split(', '))} | {text} |" for names, text in VARIABLES]
    return "\n".join(lines) + "\n"


def manual() -> str:
    """The man page, in the macros of man(7)."""
    lines = [
        '.\\" made from argparse by python docs/reference_of_commands.py',
        f'.TH CANID 1 "" "canid {__version__}" "User Commands"',
        ".SH NAME",
        "canid \\- record a CAN bus without loss, and identify the driver",
        ".SH SYNOPSIS",
        ".B canid",
        ".I VERB",
        "[options]",
        ".SH DESCRIPTION",
        "canid listens to a CAN bus, records it so that nothing is lost, and estimates live how the driver drives: gain K, "
        "lag \\(*t and dead time \\(*h, each with a 95 % interval. Logs are identified and diagnosed by the same code.",
        ".SH COMMANDS",
    ]
    for each in commands():
        lines += [f'.SS "{_roff(" ".join((each.name, *each.arguments)))}"', _roff(each.text) + "."]
        for title, description, options in each.groups:
            if title:
                lines += [".PP", f"\\fB{_roff(title)}\\fR {_roff(description)}".rstrip()]
            for words, text in options:
                lines += [".TP", ", ".join(f"\\fB{_roff(word)}\\fR" for word in words), _roff(text)]
    lines += [".SH EXIT STATUS", *(x for code, text in EXIT_CODES for x in (".TP", f"\\fB{code}\\fR", text))]
    lines += [".SH ENVIRONMENT"]
    lines += [x for names, text in VARIABLES for x in (".TP", f"\\fB{_roff(names)}\\fR", _roff(text))]
    return "\n".join(line for line in lines if line) + "\n"


def readme(page: str) -> str:
    """The README with the rows that the verbs bring; they keep their order, those of a new verb come last.

    Raises:
        ValueError: its table of commands is not there.
    """
    rows = [f"| `{shown.command}` | {shown.what} |" for verb in VERBS for shown in verb.shown]
    start = page.index("| | |\n|---|---|\n", page.index("\n## Commands\n")) + len("| | |\n|---|---|\n")
    stop = page.index("\n\n", start) + 1
    before = page[start:stop].splitlines()
    commands = [row.split("` |")[0] for row in before]
    rows.sort(key=lambda row: commands.index(c) if (c := row.split("` |")[0]) in commands else len(before))
    return page[:start] + "".join(f"{row}\n" for row in rows) + page[stop:]


def names(page: str) -> str:
    """docs/json.md with the keys of each schema, which its last section lists."""
    lines = ["| schema | keys |", "|---|---|"]
    for name in schema.names():
        made = schema.json_schema(name)
        objects = [
            ", ".join(f"`{key}`" for key in each["properties"] if key != "schema")
            for each in made.get("anyOf", [made])
        ]
        lines.append(f"| `{name}` | {'; or '.join(objects)} |")
    return page[: page.index(SECTION) + len(SECTION)] + "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """Text of a help, as Markdown that shows it letter by letter; it is a table's cell, too."""
    return re.sub(r"([\\`*_{}\[\]<>|$])", r"\\\1", text)


def _roff(text: str) -> str:
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq").replace('"', "\\(dq")
    return re.sub(r"^\.", r"\\&.", text)


if __name__ == "__main__":
    MAN.parent.mkdir(exist_ok=True)
    PAGE.write_text(markdown(), encoding="utf-8")
    MAN.write_text(manual(), encoding="utf-8")
    README.write_text(readme(README.read_text("utf-8")), encoding="utf-8")
    NAMES.write_text(names(NAMES.read_text("utf-8")), encoding="utf-8")
