"""Imports go strictly down the seven layers of docs/design.md, and only the shell touches the world."""

from __future__ import annotations

import ast
from functools import cache
from itertools import chain
from pathlib import Path

CANID = Path(__file__).parents[1] / "canid"
# a folder may import what stands before it
LAYERS = {
    "values": ("values", "processes"),
    "mathematics": ("identification", "estimators", "systems", "population"),
    "signals": ("dbc_text", "vehicle", "samples", "signal_checks", "triggers"),
    "models": ("effects", "monitor", "simulation", "pipeline", "saving", "diagnosis"),
    "world": ("files", "buses", "logs", "recording", "publishing"),
    "desk and session": (
        *(
            "drive",
            "contents",
            "session",
            "tables",
            "proposal",
            "comparison",
            "desk",
            "export",
            "sumo",
            "fleet",
        ),
    ),
    "face": ("views", "web", "cli"),
}
FOLDERS = list(chain(*LAYERS.values()))
ROOT = {"__init__.py", "__main__.py"}
MOST_MODULES = 24
WORLD = {"socket", "subprocess", "threading", "time", "multiprocessing", "can"}
# below the world: a parser that may take for ever must run where it can be ended. The only folder that starts processes
PROCESSES = "processes"
FILES = sorted(CANID.rglob("*.py"))


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Everything that a file holds, parsed once."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def folder(path: Path) -> str:
    return path.relative_to(CANID).parts[0]


def imported(path: Path) -> set[str]:
    """Dotted names of everything that a file imports, wherever in it."""
    names: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def test_every_folder_has_a_layer_and_the_root_holds_no_module() -> None:
    assert {path.name for path in FILES if path.parent == CANID} == ROOT
    assert {folder(path) for path in FILES if path.parent != CANID} == set(FOLDERS)


def test_folders_are_packages_of_one_sentence_and_not_too_many_modules() -> None:
    packages = {path.parent for path in FILES} - {CANID}
    for package in packages:
        names = [path.name for path in package.glob("*.py")]
        says = ast.get_docstring(ast.parse((package / "__init__.py").read_text(encoding="utf-8")))
        assert says, package
        assert len(names) - 1 <= MOST_MODULES, package


def test_imports_go_down() -> None:
    """From the root only the version, which needs nothing."""
    upward = set()
    for path in FILES:
        if path.parent == CANID:
            continue
        for name in imported(path):
            used = name.split(".")[1] if name.startswith("canid.") else ""
            if used == "__version__" or used == folder(path):
                continue
            if used in FOLDERS and FOLDERS.index(used) > FOLDERS.index(folder(path)):
                upward.add(f"{path.relative_to(CANID)} imports {name}")
    assert not upward


def test_the_world_is_touched_by_the_shell_only() -> None:
    world = FOLDERS.index(LAYERS["world"][0])
    inside = [
        path
        for path in FILES
        if path.parent != CANID
        and (FOLDERS.index(folder(path)) < world or folder(path) == "views")
        and folder(path) != PROCESSES
    ]
    found = {path: {name.split(".")[0] for name in imported(path)} & WORLD for path in inside}
    assert {str(path.relative_to(CANID)): names for path, names in found.items() if names} == {}
    assert len(inside) > 100


def test_only_buses_imports_python_can() -> None:
    users = {folder(path) for path in FILES if "can" in {name.split(".")[0] for name in imported(path)}}
    assert users == {"buses"}


def test_only_one_folder_starts_processes() -> None:
    users = {folder(path) for path in FILES if imported(path) & {"subprocess", "multiprocessing"}}
    assert users == {PROCESSES}


def test_only_one_file_sends() -> None:
    """Nothing but `replay --onto` can transmit: no other file calls a bus's send."""
    senders = {
        path.name
        for path in FILES
        if {node.attr for node in nodes(path) if isinstance(node, ast.Attribute)} & {"send", "send_periodic"}
    }
    assert senders <= {"send.py"}
