"""Imports go strictly down the floors of docs/design.md, and only the shell touches the world."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

CANID = Path(__file__).parents[1] / "canid"
FLOOR = {
    "types": 0, "errors": 0, "imports": 0, "child": 0, "parsing": 0.5, "findings": 1,
    "clock": 1, "downtime": 1, "vehicle": 1, "smoothing": 1, "lead": 2, "sampling": 1, "gate": 1, "identification": 1,
    "effects": 2,
    "estimators": 2, "screening": 2, "simulation": 3,
    "pipeline": 3, "drive": 4, "check": 4, "saving": 4, "diagnosis": 4, "desk": 4,
    "views": 5,
    "frames": 5, "export": 5, "estimating": 5, "state_file": 5,
    "logs": 6, "session": 7,
    "cli": 8, "__init__": 9, "__main__": 9,
}  # fmt: skip
WORLD = {"socket", "subprocess", "threading", "time", "multiprocessing", "can"}
# beside the shell: a parser that may take for ever must run where it can be ended
PROCESSES = {"parsing.py"}
FILES = sorted(CANID.rglob("*.py"))


def part(path: Path) -> str:
    return path.relative_to(CANID).parts[0].removesuffix(".py")


def imported(path: Path) -> set[str]:
    """Dotted names of everything that a file imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
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


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(CANID)))
def test_imports_go_down(path: Path) -> None:
    own = part(path)
    upward = {name for name in parts_used(path) if name != own and FLOOR[name] >= FLOOR[own]}
    assert not upward, f"{path.name} (floor {FLOOR[own]}) imports {sorted(upward)}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(CANID)))
def test_the_world_is_touched_by_the_shell_only(path: Path) -> None:
    if (FLOOR[part(path)] < 5 and path.name not in PROCESSES) or part(path) == "views":
        assert not {name.split(".")[0] for name in imported(path)} & WORLD


def test_only_frames_imports_python_can() -> None:
    users = {part(path) for path in FILES if "can" in {name.split(".")[0] for name in imported(path)}}
    assert users == {"frames"}


def test_only_one_file_sends() -> None:
    """Nothing but `replay --onto` can transmit: no other file calls a bus's send."""
    senders = []
    for path in FILES:
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        names = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
        senders += [path.name] if names & {"send", "send_periodic"} else []
    assert set(senders) <= {"send.py"}
