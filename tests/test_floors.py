"""Imports go strictly down the floors of docs/design.md, and only the shell touches the world."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

CANID = Path(__file__).parents[1] / "canid"
FLOOR = {
    "state_constraints": 0, "interval_text": 0, "presentation": 0, "types": 0.2, "runs": 0,
    "errors": 0, "import_guard": 0, "child_process": 0, "one_thread": 0,
    "dbc_text": 0.3, "parsing": 0.5, "identified_model": 0.5, "timestamps": 1,
    "findings": 1, "log_contents": 1, "fleet_summary": 1,
    "frame_columns": 1, "restart_time": 1, "vehicle": 2.2, "samples": 2.5, "signal_checks": 2.7, "triggers": 2.8,
    "identification": 1,
    "effects": 2, "systems": 1.5,
    "estimators": 2, "monitor": 2, "simulation": 3,
    "pipeline": 3, "drive_summary": 3.5, "drive_parameters": 4, "drive_series": 4.2,
    "vehicle_check": 4, "saving": 4, "diagnosis": 4,
    "study": 4.5, "comparison": 4.5, "population": 4.6, "views": 5, "schemas": 5.5, "controls": 5,
    "files": 5, "buses": 6, "logs": 7, "recording": 8, "export": 8.2, "estimator_process": 5,
    "trigger_process": 5.2, "publishing": 6,
    "signal_columns": 7.5, "contents": 7.7, "proposal": 8.5, "drive_reader": 8, "tables": 8.3, "sumo": 8.4, "fleet": 9.2,
    "drive_results": 9, "session": 9, "playback": 9, "web": 9.5,
    "cli": 10, "__init__": 11, "__main__": 11,
}  # fmt: skip
WORLD = {"socket", "subprocess", "threading", "time", "multiprocessing", "can"}
# apart from the shell: a parser that may take for ever must run where it can be ended
PROCESSES = {"parsing.py"}
FILES = sorted(CANID.rglob("*.py"))


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Everything that a file holds, parsed once."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def part(path: Path) -> str:
    return path.relative_to(CANID).parts[0].removesuffix(".py")


def imported(path: Path) -> set[str]:
    """Dotted names of everything that a file imports, wherever in it."""
    names: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def parts_used(path: Path) -> set[str]:
    """Parts of canid that a file imports from."""
    used = {name.split(".")[1] for name in imported(path) if name.startswith("canid.")}
    return {name for name in used if name in FLOOR}


def test_every_part_has_a_floor() -> None:
    assert {part(path) for path in FILES} == set(FLOOR)


def test_imports_go_down() -> None:
    upward = {
        f"{path.relative_to(CANID)} (floor {FLOOR[part(path)]}) imports {name} (floor {FLOOR[name]})"
        for path in FILES
        for name in parts_used(path)
        if name != part(path) and FLOOR[name] >= FLOOR[part(path)]
    }
    assert not upward


def test_the_world_is_touched_by_the_shell_only() -> None:
    inside = [
        path
        for path in FILES
        if (FLOOR[part(path)] < 5 and path.name not in PROCESSES) or part(path) == "views"
    ]
    found = {path: {name.split(".")[0] for name in imported(path)} & WORLD for path in inside}
    assert {str(path.relative_to(CANID)): names for path, names in found.items() if names} == {}
    assert len(inside) > 100


def test_only_buses_imports_python_can() -> None:
    users = {part(path) for path in FILES if "can" in {name.split(".")[0] for name in imported(path)}}
    assert users == {"buses"}


def test_only_one_file_sends() -> None:
    """Nothing but `replay --onto` can transmit: no other file calls a bus's send."""
    senders = {
        path.name
        for path in FILES
        if {node.attr for node in nodes(path) if isinstance(node, ast.Attribute)} & {"send", "send_periodic"}
    }
    assert senders <= {"send.py"}
