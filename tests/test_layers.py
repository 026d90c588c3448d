"""Imports go down: from a layer to those below it, and inside a folder of `ORDER` to what stands earlier in its list."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

CANID = Path(__file__).parents[1] / "canid"
# from the bottom up, with the packages of each; docs/design.md says what lives where
LAYERS = {
    "values": ("processes", "text"),
    "mathematics": ("identification", "estimators", "systems", "population"),
    "signals": ("dbc_text", "vehicle", "samples", "signal_checks", "triggers"),
    "models": ("effects", "monitor", "simulation", "pipeline", "saving", "diagnosis"),
    "io": ("files", "buses", "logs", "recording", "publishing"),
    "analysis": (
        *("drive", "contents", "session", "playback", "tables", "proposal", "comparison", "drive_results"),
        *("export", "sumo", "fleet"),
    ),
    "ui": ("terminal", "views", "web", "cli"),
}
# A folder's packages: each may import those before it. A module that lies next to them and is not listed comes before all.
ORDER = {
    "": tuple(LAYERS),
    **LAYERS,
    "analysis/fleet": ("planning", "storage", "one_log", "answers", "running"),
}
# the package itself, which hands out every public name, and the command line
ROOT = {"__init__.py", "__main__.py"}
# modules of one folder, `__init__` apart: more than one reads through
MOST_MODULES = 24
# below everything, since a parser that may take for ever must run where it can be ended
PROCESSES = "values/processes"
WORLD = {"socket", "subprocess", "threading", "time", "multiprocessing", "can"}
# where nothing asks a clock, and nothing opens a socket or starts a thread
WITHOUT_WORLD = (
    *("values", "mathematics", "signals", "models", "ui/views"),
    *(f"analysis/{name}" for name in ("tables", "proposal", "comparison", "export", "sumo")),
)


class Import(NamedTuple):
    """One name that a file imports."""

    line: int
    name: str


@cache
def files() -> list[Path]:
    """All files of the package."""
    return sorted(CANID.rglob("*.py"))


def modules() -> list[Path]:
    """Files of the package but the two at its root."""
    return [path for path in files() if path.parent != CANID]


@cache
def read(path: Path) -> tuple[list[Import], bool]:
    """What a file imports, wherever in it: in functions and for type checkers as well; and whether it calls a bus's send.

    Nodes are not kept: every collection of garbage would go through them.
    """
    found, sends = [], False
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [Import(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            found += [Import(node.lineno, f"{module}.{alias.name}") for alias in node.names]
        elif isinstance(node, ast.Attribute):
            sends |= node.attr in ("send", "send_periodic")
    return found, sends


def imported(path: Path) -> list[Import]:
    """Everything that a file imports."""
    return read(path)[0]


def packages(path: Path) -> set[str]:
    """Top-level packages that a file imports."""
    return {name.split(".")[0] for _, name in imported(path)}


def lies_in(path: Path, *folders: str) -> bool:
    return f"{path.relative_to(CANID).as_posix()}/".startswith(tuple(f"{folder}/" for folder in folders))


def refusal(here: tuple[str, ...], there: tuple[str, ...]) -> str:
    """Why a module may not import another, and what to do about it; "" where it may.

    Args:
        here: parts of the importing module's name, without `canid`.
        there: parts of the imported name.
    """
    if there == ("__version__",):
        return ""
    if not there or there[0] not in LAYERS:
        return (
            "of the root only the version may be imported: import the name from the module that it lives in."
        )
    common = next((k for k, pair in enumerate(zip(here, there, strict=False)) if pair[0] != pair[1]), None)
    if common is None:
        return ""
    folder = "/".join(here[:common])
    order = ORDER.get(folder, ())
    mine, other = (order.index(name[common]) if name[common] in order else -1 for name in (here, there))
    if other <= mine:
        return ""
    if not folder:
        return (
            f"{here[0]} is layer {mine + 1}, {there[0]} is layer {other + 1}. Move what it needs to {here[0]} or below, "
            "move the importing function up, or let the caller hand it in (as values/presentation.py is handed the views)."
        )
    return (
        f"in {folder}/, {there[common]} comes after {here[common]}. Move what both need to the earlier of them, or change "
        f"their order in tests/test_layers.py if nothing in {there[common]} needs {here[common]}."
    )


def upward(path: Path, canid: Path = CANID) -> Iterator[str]:
    """A sentence for each import of a file that the layers do not allow."""
    here = path.relative_to(canid).with_suffix("").parts
    for line, name in imported(path):
        package, *parts = name.split(".")
        if package == "canid":
            why = refusal(here, tuple(parts))
        else:
            why = "" if package else "imports are absolute: write the module's whole name."
        if why:
            yield f"canid/{path.relative_to(canid).as_posix()}:{line} imports {name}: {why}"


def test_imports_go_down() -> None:
    """Wherever they stand in a file; of the root only the version is imported, which needs nothing."""
    wrong = [sentence for path in modules() for sentence in upward(path)]
    assert not wrong, "\n".join(["imports that go up:", *wrong])


@pytest.mark.parametrize(
    ("file", "source", "says"),
    [
        ("io/logs/log.py", "from canid.ui.views import plots", "io is layer 5, ui is layer 7"),
        (
            "values/types.py",
            "def f():\n    import canid.signals.samples",
            "values is layer 1, signals is layer 3",
        ),
        ("values/types.py", "from canid.values.text import names", "text comes after types"),
        ("values/processes/child.py", "from canid.values.text import names", "text comes after processes"),
        (
            "models/effects/__init__.py",
            "if TYPE_CHECKING:\n    from canid.models import saving",
            "saving comes after",
        ),
        (
            "analysis/fleet/job.py",
            "from canid.analysis.fleet.planning import plan",
            "planning comes after job",
        ),
        (
            "analysis/fleet/storage/store.py",
            "from canid.analysis.fleet import running",
            "running comes after storage",
        ),
        (
            "analysis/comparison/drive.py",
            "from canid.analysis.drive_results import identify",
            "drive_results comes after",
        ),
        ("ui/cli/verb.py", "import canid", "of the root only the version"),
        ("ui/cli/verb.py", "from canid import identify", "of the root only the version"),
        ("ui/cli/verb.py", "from . import verbs", "imports are absolute"),
        ("ui/cli/verb.py", "from canid import __version__", ""),
        ("ui/views/plots.py", "from canid.values.text.names import readable", ""),
        ("analysis/drive_results.py", "from canid.analysis.comparison.comparison import compare", ""),
        ("models/diagnosis/report.py", "from canid.models.diagnosis.driver import driver_fit", ""),
        ("values/text/names.py", "from canid.values.types import Interval", ""),
    ],
)
def test_an_import_that_goes_up_is_named(tmp_path: Path, file: str, source: str, says: str) -> None:
    """With its line, the reason and what to do; what goes down is passed over."""
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(source)
    sentences = list(upward(path, tmp_path))
    assert [says in sentence and f"canid/{file}:" in sentence for sentence in sentences] == [True] * bool(
        says
    )


def test_the_root_holds_the_layers_alone() -> None:
    """Whoever lists canid/ sees seven folders; a new module goes into one of them."""
    more = {path.name for path in CANID.glob("*.py")} ^ ROOT
    assert not more, (
        f"{sorted(more)} in canid/: move each into the lowest layer that has all it imports below it"
    )
    assert {path.relative_to(CANID).parts[0] for path in modules()} == set(LAYERS)


@pytest.mark.parametrize("folder", ORDER)
def test_the_packages_of_a_folder_are_listed(folder: str) -> None:
    """Each has its place in the order, and what is listed is there."""
    listed, place = set(ORDER[folder]), CANID / folder
    there = {path.parent.name for path in place.glob("*/__init__.py")}
    assert not there - listed, (
        f"list {sorted(there - listed)} in tests/test_layers.py, behind all that they import"
    )
    gone = {name for name in listed - there if not (place / f"{name}.py").exists()}
    assert not gone, f"not in canid/{folder}: {sorted(gone)}; take it out of the list"


def test_every_folder_says_what_lives_there() -> None:
    """Each package begins with a sentence; that of a layer with its number."""
    for folder in {path.parent for path in modules()}:
        text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or ""
        assert text.split("\n")[0][-1:] in set(".?!"), f"{folder} has no first sentence"
        if folder.parent == CANID:
            number = tuple(LAYERS).index(folder.name) + 1
            assert text.startswith(f"Layer {number}, {folder.name}: "), folder


def test_no_folder_is_too_long_to_be_read_through() -> None:
    counts = {path.parent: len(list(path.parent.glob("*.py"))) - 1 for path in modules()}
    long = {str(folder.relative_to(CANID)): n for folder, n in counts.items() if n > MOST_MODULES}
    assert not long, f"more than {MOST_MODULES} modules; part them into packages with telling names"


def test_the_world_is_touched_where_it_may_be() -> None:
    """Below layer 5, and in what only computes above it, nothing asks the clock, opens a socket or starts a thread."""
    inside = [path for path in modules() if lies_in(path, *WITHOUT_WORLD) and not lies_in(path, PROCESSES)]
    wrong = [
        f"canid/{path.relative_to(CANID)}: imports {sorted(packages(path) & WORLD)}; let a caller from io, analysis or ui "
        "do it and hand in what it found"
        for path in inside
        if packages(path) & WORLD
    ]
    assert not wrong, "\n".join(wrong)
    assert len(inside) > 100


def test_only_buses_imports_python_can() -> None:
    users = {path.parent for path in files() if "can" in packages(path)}
    assert users
    assert all(lies_in(user, "io/buses") for user in users), users


def test_only_one_folder_starts_processes() -> None:
    users = {path.parent for path in files() if packages(path) & {"subprocess", "multiprocessing"}}
    assert users == {CANID / PROCESSES}


def test_only_one_file_sends() -> None:
    """Nothing but `replay --onto` can transmit: no other file calls a bus's send."""
    senders = {path.name for path in files() if read(path)[1]}
    assert senders <= {"send.py"}
