"""A verb of the command line, as one value; `canid.ui.cli.VERBS` lists all of them."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple, Protocol


class VerbModule(Protocol):
    """`canid.ui.cli.commands.NAME`: what a verb takes, does and writes."""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare arguments and options."""

    def run(self, args: argparse.Namespace) -> int:
        """Do it; returns the exit code."""


class Shown(NamedTuple):
    """A row of the README's table of commands: tests run it, after `canid demo` and the rows above it."""

    command: str
    what: str  # Markdown


class Verb(NamedTuple):
    """Name and help are known at once; the rest is imported when it is asked for.

    So that start-up stays under 0.1 s, and recording starts before numpy, scipy and cantools are imported.
    """

    name: str  # its module is canid.ui.cli.commands.NAME, that of a part canid.ui.cli.commands.NAME_PART
    help: str  # one line for `canid --help`
    shown: tuple[Shown, ...] = ()  # in the README
    parts: Mapping[str, str] = {}  # first words that are verbs of their own -> help

    def module(self, part: str = "") -> VerbModule:
        """The module of the verb, or of one of its parts."""
        return import_module(f"canid.ui.cli.commands.{self.name}{'_' if part else ''}{part}")

    @property
    def results(self) -> Mapping[str, Any]:
        """What it writes with --json, by the `results()` of its module: name of the schema -> type of an object or line."""
        made: Mapping[str, Any] = getattr(self.module(), "results", dict)()
        return made

    def help_of(self, part: str = "") -> str:
        """One line on the verb, or on one of its parts."""
        return self.parts[part] if part else self.help
