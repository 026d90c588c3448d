"""A process that analyses a fleet's logs, and is taken over by one of them, can write, send, start and signal nothing."""

from __future__ import annotations

import json
import os
import pickle
import signal
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from canid.analysis.fleet.failed import Failed
from canid.analysis.fleet.job import Failure, Status
from canid.analysis.fleet.one_log.analysis import analyse
from canid.analysis.fleet.running.isolated import Child
from canid.values.processes.confinement import offered
from tests.fixtures import attempts
from tests.fixtures.attempts import REFUSED
from tests.fleet.fleet_jobs import GENERIC, URBAN, job
from tests.fleet.test_isolated import numbers
from tests.formats_oracle import mf4_conversions

needs_all = pytest.mark.skipif(
    not offered().complete or offered().landlock < 6, reason="this kernel or container refuses to confine"
)


class TakenOver(NamedTuple):
    """A source that attacks where a log of it has been read, in the process that read it."""

    attempts: tuple[str, ...]
    parent: int

    @property
    def fingerprint(self) -> str:
        """Tries them, and says in the reason of a failed log what came of each."""
        if os.getpid() == self.parent:
            return str(hash(self.attempts))  # its name: a child is sent a source once
        raise Failed(Failure.ERROR, attempts.tried(list(self.attempts)))


def answers(child: Child, *expressions: str) -> list[Any]:
    """What comes of attempts in the real child, in the middle of a log."""
    source: Any = TakenOver(expressions, os.getpid())
    outcome = child.analyse(job(URBAN), source)
    assert outcome.failure is Failure.ERROR, outcome.reason
    found: list[Any] = json.loads(outcome.reason)
    return found


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where temporary files are."""
    folder = tmp_path_factory.mktemp("scratch")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(folder))
        yield folder


@pytest.fixture(scope="module")
def child(scratch: Path) -> Iterator[Child]:
    """One for all tests: its start costs more than what it is asked; one that was ended is replaced."""
    made = Child()
    yield made
    made.close()


@pytest.fixture
def listening() -> Iterator[int]:
    """A port of loopback that takes connections."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@pytest.mark.long("runs of a fleet in processes of their own")
@needs_all
def test_what_a_taken_over_analysis_tries_is_refused(child: Child, tmp_path: Path, listening: int) -> None:
    """Files outside of its folder, TCP, other sockets, other programs, signals to its parent; also in what it starts."""
    kept, new = tmp_path / "kept", str(tmp_path / "new")
    kept.write_text("kept", encoding="ascii")
    here = (
        f"open({new!r}, 'w')",
        # a file without a name: nothing is left of it
        "os.open(os.path.expanduser('~'), os.O_TMPFILE | os.O_RDWR)",
        f"open({str(kept)!r}, 'r+')",
        f"os.truncate({str(kept)!r}, 0)",
        f"os.unlink({str(kept)!r})",
        f"os.rename({str(kept)!r}, {new!r})",
        f"os.mkdir({new!r})",
        f"os.chmod({str(kept)!r}, 0o777)",
        f"os.symlink('x', {new!r})",
        f"connected({listening})",
        "socket.socket(socket.AF_INET, socket.SOCK_DGRAM)",
        "socket.socket(socket.AF_UNIX)",
        "socket.socketpair()",
        "ran('/bin/true')",
        "os.execv('/bin/true', ['true'])",
        f"os.kill({os.getpid()}, 0)",
        f"os.killpg({os.getpgrp()}, 0)",
        f"os.pidfd_open({os.getpid()})",
        f"os.open('/proc/{os.getpid()}/mem', os.O_RDONLY)",
    )
    there = tuple(f"in_python({each!r})" for each in (here[0], here[9], here[13], here[15]))
    found = answers(child, *here, *there)
    assert dict(zip((*here, *there), found, strict=True)) == dict.fromkeys((*here, *there), REFUSED)
    assert kept.read_text(encoding="ascii") == "kept"
    assert not os.path.exists(new)


@pytest.mark.long("runs of a fleet in processes of their own")
@needs_all
def test_what_an_analysis_needs_is_left(child: Child, scratch: Path) -> None:
    """It makes and deletes files in its own folder, starts Python, reads, and ends what it has started."""
    tries = (
        "written(os.path.join(tempfile.gettempdir(), 'a'))",
        "written(os.path.join(tempfile.mkdtemp(), 'a'))",
        "tempfile.TemporaryFile().write(b'abc')",
        "in_python('written(os.path.join(tempfile.gettempdir(), \"b\"))')",
        f"len(open({str(URBAN)!r}, 'rb').read(3))",
        "peaks()",
        "killed(subprocess.Popen([sys.executable, '-c', 'input()'], stdin=subprocess.PIPE, start_new_session=True))",
    )
    assert answers(child, *tries) == ["written", "written", 3, "written", 3, True, -signal.SIGKILL]
    (own,) = scratch.iterdir()
    assert [path.name for path in own.rglob("a")] == []
    assert child.analyse(job(URBAN), GENERIC).status is Status.OK
    # no thread of the analysis keeps its rights: all were started after the process gave them up
    statuses = [path.read_text(encoding="ascii") for path in Path(f"/proc/{child.pid}/task").glob("*/status")]
    assert len(statuses) >= 2
    assert all("NoNewPrivs:\t1" in text and "Seccomp:\t2" in text for text in statuses)


@pytest.mark.slow("asammdf in processes of their own")
def test_a_measurement_is_read_by_what_a_confined_process_starts(child: Child, tmp_path: Path) -> None:
    """The numbers of an .mf4 are those that a process with all rights reads, and so are its frames."""
    pytest.importorskip("asammdf", reason="needs asammdf: pip install 'canid[mf4]'")
    columns = {
        "t": [0.1 * k for k in range(300)],
        **{
            name: [20.0 + (k * (j + 3)) % 17 / 5.0 for k in range(300)]
            for j, name in enumerate(mf4_conversions.SIGNALS)
        },
    }
    for content in (mf4_conversions.measurement(columns, {}), mf4_conversions.bus_log({}, 200)):
        path = mf4_conversions.write(tmp_path / "a.mf4", content)
        found, direct = child.analyse(job(path), GENERIC), analyse(job(path), GENERIC)
        assert numbers(found) == numbers(direct)
        assert "failed (" not in found.reason


class Called:
    """A message that makes a folder where it is unpickled without a list of types."""

    def __init__(self, folder: Path) -> None:
        self.folder = str(folder)

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (self.folder,)


def answers_of_nonsense(new: Path) -> dict[str, bytes]:
    """Messages of a process that is not to be believed."""
    rows = ("done", ("another.blf", "key", Status.OK, Failure.NONE, "", {"drives": [1]}), 1)
    return {
        "called": pickle.dumps(Called(new)),
        "none": b"nothing",
        "shape": pickle.dumps((1, 2, 3)),
        "no outcome": pickle.dumps(("done", ("log", "key", "ok", "", "", {}), 1)),
        "no rows": pickle.dumps(rows),
        "another log": pickle.dumps(("fetch", "http://127.0.0.1:9/a.blf")),
    }


def test_what_it_answers_runs_nothing(child: Child, tmp_path: Path) -> None:
    """A message that calls a function costs the log, which is `crashed`, and calls nothing."""
    assert_nonsense(child, tmp_path, "called")


@pytest.mark.slow("a process for each")
@pytest.mark.parametrize("kind", answers_of_nonsense(Path()))
def test_nonsense_costs_one_log(child: Child, tmp_path: Path, kind: str) -> None:
    """A message that is none, no outcome, or asks for a log that is not its own: `crashed`; the next log is analysed."""
    assert_nonsense(child, tmp_path, kind)
    assert child.analyse(job(URBAN), GENERIC).status is Status.OK


def assert_nonsense(child: Child, folder: Path, kind: str) -> None:
    new = folder / "made"
    source: Any = TakenOver((f"answered({answers_of_nonsense(new)[kind]!r})",), os.getpid())
    outcome = child.analyse(job(URBAN), source)
    assert not new.exists()
    assert (outcome.log, outcome.failure, outcome.tables) == (str(URBAN), Failure.CRASHED, {})
    assert "nonsense" in outcome.reason
