"""Every child of canid goes before the process that started it where memory runs out, and one file starts them all."""

from __future__ import annotations

import ast
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from canid.values.processes.child import Child
from canid.values.processes.child_process import command
from canid.values.processes.memory_victim import OOM_SCORE

ROOT = Path(__file__).parents[2]
CANID = Path(sys.executable).with_name("canid")
LOG = ROOT / "replay_logs" / "following_motorway.asc"
VEHICLE = ("--vehicle", "generic")
PATIENCE_S = 300.0
# what starts a process, by the last part of its name
STARTING = {
    *("Popen", "check_call", "check_output", "getoutput", "getstatusoutput", "create_subprocess_exec"),
    *(
        "create_subprocess_shell",
        "ProcessPoolExecutor",
        "Process",
        "LocalCluster",
        "system",
        "popen",
        "startfile",
    ),
    *("fork", "forkpty", "posix_spawn", "posix_spawnp", "spawnl", "spawnle", "spawnlp", "spawnlpe", "spawnv"),
    *("spawnve", "spawnvp", "spawnvpe", "execl", "execle", "execlp", "execlpe", "execv", "execve", "execvp"),
}
# (file, what it calls)
ALLOWED = {("values/processes/child.py", "Popen")}


def oom_score(pid: int) -> int:
    """As the kernel has it."""
    return int(Path(f"/proc/{pid}/oom_score_adj").read_text())


def descendants(pid: int) -> dict[int, int]:
    """Processes below one, and the value of each."""
    found: dict[int, int] = {}
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            for child in map(int, task.read_text().split()):
                found |= {child: oom_score(child)} | descendants(child)
        except (OSError, ValueError):
            continue  # it has just ended
    return found


@pytest.fixture
def kernel() -> None:
    """A kernel that has the setting."""
    if not Path("/proc/self/oom_score_adj").exists():
        pytest.skip("needs Linux")


def test_a_child_is_marked_and_its_parent_is_not(kernel: None) -> None:
    """Its own children inherit that."""
    before = oom_score(os.getpid())
    grandchild = "import subprocess, sys; sys.exit(subprocess.run(['sleep', '600']).returncode)"
    for words in (command("canid.signals.dbc_text.parsing"), [sys.executable, "-c", grandchild]):
        with Child(words) as child:
            assert oom_score(child.pid) == OOM_SCORE == 1000
            end = time.monotonic() + PATIENCE_S
            while words[1] == "-c" and not descendants(child.pid) and time.monotonic() < end:
                time.sleep(0.01)
            assert set(descendants(child.pid).values()) <= {OOM_SCORE}
    assert oom_score(os.getpid()) == before < OOM_SCORE


@pytest.mark.slow("verbs that run, each with its children")
@pytest.mark.parametrize(
    ("words", "children"),
    [
        (
            (
                "live",
                "-i",
                "virtual",
                "-c",
                "oom",
                *VEHICLE,
                "--record",
                "x.blf",
                "--web",
                "--diagnose",
                "x.html",
            ),
            3,
        ),
        (("live", "-i", "virtual", "-c", "oom", *VEHICLE, "--record", "y.blf", "--trigger", "brake > 0"), 1),
        (("record", "-i", "virtual", "-c", "oom", "-o", "z.blf", *VEHICLE, "--trigger", "brake > 0"), 1),
        (("fleet", str(LOG.parent), *VEHICLE, "-o", "fleet"), 1),
        (("export", str(LOG), *VEHICLE, "-o", "x.mf4"), 1),
        (("look", str(LOG), "--web"), 0),
    ],
)
def test_all_children_of_a_verb_are_marked(
    words: tuple[str, ...], children: int, kernel: None, tmp_path: Path
) -> None:
    """As long as they live; the verb itself keeps the value that it was started with."""
    seen: dict[int, list[int]] = {}
    own = oom_score(os.getpid())
    with (tmp_path / "said").open("wb") as said:
        verb = subprocess.Popen(
            [CANID, *words],
            cwd=tmp_path,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            start_new_session=True,
        )
        try:
            end = time.monotonic() + (PATIENCE_S if children else 5.0)
            while verb.poll() is None and time.monotonic() < end:
                for pid, value in descendants(verb.pid).items():
                    seen.setdefault(pid, []).append(value)
                assert oom_score(verb.pid) == own
                if len([pid for pid, values in seen.items() if len(values) > 20]) >= max(children, 1):
                    break
                time.sleep(0.01)
        finally:
            verb.send_signal(signal.SIGTERM)
            verb.wait(PATIENCE_S)
    assert len(seen) >= children, (tmp_path / "said").read_text()
    # the first values may be from before it was marked; then it stays so
    for values in seen.values():
        marked = values.index(OOM_SCORE) if OOM_SCORE in values else len(values)
        assert set(values[marked:]) <= {OOM_SCORE}
        assert marked < len(values) or len(values) < 5, values


def test_one_file_starts_processes() -> None:
    """So that none is forgotten: read from the source, whatever the call is named by."""
    found = set()
    for path in (ROOT / "canid").rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        if not any(word in source for word in STARTING):
            continue
        for node in ast.walk(ast.parse(source)):
            called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
            name = called.rpartition(".")[2]
            if name in STARTING and called != "platform.system":
                found.add((str(path.relative_to(ROOT / "canid")), name))
            if isinstance(node, ast.ImportFrom) and node.module in ("subprocess", "multiprocessing"):
                found.add((str(path.relative_to(ROOT / "canid")), f"from {node.module}"))
    assert found == ALLOWED
