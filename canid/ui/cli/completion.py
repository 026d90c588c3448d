"""Shell completion, by shtab: a script with all verbs and options, which the shell reads once; TAB starts no Python."""

from __future__ import annotations

import argparse
import re

from canid.ui.terminal.messages import print_text
from canid.values.errors import DONE, ConfigError

OPTION = "--print-completion"
SHELLS = ("bash", "zsh", "fish")
# metavars of what is a file or a folder on this machine; a vehicle is a file or a name
# any metavar with a suffix, such as FILE.dbc, is a file too; A and B are those of `compare`
FILES = frozenset({"FILE", "LOG", "DBC", "OUT", "NAME", "A", "B"})
FOLDERS = frozenset({"DIR"})
VEHICLE = "V.toml"


def full_parser() -> argparse.ArgumentParser:
    """One parser with all verbs: for completion and for the reference of commands.

    Example:
        >>> parser = full_parser()
        >>> parser.parse_args(["identify", "drive.blf", "--vehicle", "generic"]).vehicle
        'generic'
    """
    from canid.ui.cli.verbs import VERBS

    parser = argparse.ArgumentParser("canid")
    parser.add_argument("-V", "--version", action="store_true", help="print the version")
    parser.add_argument(OPTION, choices=SHELLS, help="print a completion script for this shell")
    verbs = parser.add_subparsers(metavar="VERB")
    for verb in VERBS:
        verb.module().arguments(verbs.add_parser(verb.name, help=verb.help, description=verb.help))
    return parser


def script(shell: str) -> str:
    """The completion script of a shell.

    Args:
        shell: one of SHELLS.

    Raises:
        ConfigError: an unknown shell.
    """
    import shtab

    from canid.values.shipped_files import shipped

    if shell not in SHELLS:
        raise ConfigError(f'{OPTION}: no completion for "{shell}"; known are {", ".join(SHELLS)}')
    vehicles = " ".join(sorted(path.stem for path in shipped().glob("*.toml")))
    either = {
        "bash": "_canid_vehicle_files",
        "zsh": f"_alternative 'vehicles:shipped vehicle:({vehicles})' 'files:file:_files -g \"*.toml\"'",
        "fish": f"(string split ' ' '{vehicles}'; __fish_complete_suffix .toml)",
    }
    preamble = BASH_VEHICLE.replace("VEHICLES", vehicles) if shell == "bash" else ""
    parser = full_parser()
    for each in _parsers(parser):
        for action in each._actions:
            _complete(action, either)
    return shtab.complete(parser, shell, preamble=preamble)


# shtab takes the matches of functions named _file as file names: a folder is given its slash
BASH_VEHICLE = """\
_canid_vehicle_files() {
  compgen -W "VEHICLES" -- "$1"
  compgen -f -X '!*.toml' -- "$1"
  compgen -d -- "$1"
}"""


def run(words: list[str]) -> int:
    """Print the script for `--print-completion SHELL`."""
    if len(words) != 1:
        raise ConfigError(f"{OPTION}: name one shell of {', '.join(SHELLS)}")
    print_text(script(words[0]))
    return DONE


def _parsers(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    nested = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return [parser, *(each for action in nested for sub in action.choices.values() for each in _parsers(sub))]


def _complete(action: argparse.Action, vehicle: dict[str, str]) -> None:
    """Set what shtab completes for the value of an option or argument."""
    import shtab

    if action.choices or action.nargs == 0:
        return
    words = set(str(action.metavar).replace("[", " ").split()) if isinstance(action.metavar, str) else set()
    if VEHICLE in words:
        action.complete = vehicle  # type: ignore[attr-defined]
    elif words & FOLDERS:
        action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
    elif words & FILES or any(re.fullmatch(r"[A-Z]+\.[a-z]+", word) for word in words):
        action.complete = shtab.FILE  # type: ignore[attr-defined]
