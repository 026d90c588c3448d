"""Whatever is wrong with a log, its row says so in one line: no exception, no wait, no memory."""

from __future__ import annotations

import gzip
import os
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from canid.analysis.fleet.job import Failure, Outcome, Source, Status
from canid.analysis.fleet.one_log.analysis import analyse
from canid.analysis.fleet.running.isolated import Child
from canid.analysis.tables.column_map import ColumnMap
from tests.fleet import short_logs
from tests.fleet.fleet_jobs import GENERIC, QUICK, SHIPPED, URBAN, job, sparse

# bytes that the child may take with a bomb of 600 MB, or of 2 GB; a usual log takes 120 MB
MAX_PEAK_BYTES = 200_000_000


@pytest.fixture(scope="module")
def child() -> Iterator[Child]:
    made = Child()
    yield made
    made.close()


def peak(child: Child) -> int:
    status = Path(f"/proc/{child.pid}/status").read_text(encoding="ascii")
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def write(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def bound_socket(path: Path) -> Path:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))
    return path


def unreadable_memory(path: Path) -> Path:
    path.symlink_to("/proc/self/mem")
    return path


def loop(path: Path) -> Path:
    path.symlink_to(path)
    return path


def another_vehicle(path: Path) -> Path:
    frames = [f"({1e9 + 0.01 * k:.6f}) can0 7FF#00" for k in range(100)]
    return write(path, "\n".join(frames).encode())


def gzip_bomb(path: Path) -> Path:
    with gzip.open(path, "wb", compresslevel=1) as file:
        for _ in range(300):
            file.write(bytes(1_000_000))
    return path


FRAMELESS = b"date Mon Jan 1 00:00:00 2024\nbase hex  timestamps absolute\n"
BAD: dict[str, tuple[Failure, Callable[[Path], Path]]] = {
    "gone.blf": (Failure.MISSING, lambda path: path),
    "a.blf/in a file.blf": (Failure.MISSING, lambda path: write(path.parent, b"x") / path.name),
    "folder.blf": (Failure.NOT_A_LOG, folder),
    "pipe.blf": (Failure.NOT_A_LOG, fifo),
    "socket.asc": (Failure.NOT_A_LOG, bound_socket),
    "memory.asc": (Failure.UNREADABLE, unreadable_memory),
    "loop.blf": (Failure.UNREADABLE, loop),
    "empty.blf": (Failure.EMPTY, lambda path: write(path, b"")),
    "empty.csv": (Failure.EMPTY, lambda path: write(path, b"")),
    "frameless.asc": (Failure.EMPTY, lambda path: write(path, FRAMELESS)),
    "text.asc": (Failure.NOT_A_LOG, lambda path: write(path, b"not a log\n" * 50)),
    "text.blf": (Failure.NOT_A_LOG, lambda path: write(path, b"not a log\n" * 50)),
    "binary.csv": (Failure.NOT_A_LOG, lambda path: write(path, bytes(range(256)) * 50)),
    "no suffix": (Failure.NOT_A_LOG, lambda path: write(path, b"x")),
    "report.pdf": (Failure.NOT_A_LOG, lambda path: write(path, b"%PDF")),
    "no gzip.asc.gz": (Failure.NOT_A_LOG, lambda path: write(path, b"no gzip")),
    "foreign.log": (Failure.NOTHING_MAPPED, another_vehicle),
    "columns.csv": (Failure.NOTHING_MAPPED, lambda path: write(path, b"time,temperature\n0,1\n1,2\n")),
    "bomb.blf": (Failure.NOT_A_LOG, lambda path: sparse(path, 600_000_000)),
    "bomb.asc": (Failure.NOT_A_LOG, lambda path: sparse(path, 300_000_000)),
    "bomb.csv": (Failure.NOT_A_LOG, lambda path: sparse(path, 300_000_000)),
    "bomb.asc.gz": (Failure.NOT_A_LOG, gzip_bomb),
}  # fmt: skip


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("name", BAD)
def test_a_bad_log_is_one_failed_row(tmp_path: Path, child: Child, name: str) -> None:
    """Each kind has its word and a line; the child goes on, and takes no memory for it."""
    failure, make = BAD[name]
    of = job(make(tmp_path / name))
    if name == "memory.asc":  # each process has another one
        of = of._replace(size=-1, modified_ns=0)
    outcome = child.analyse(of, GENERIC)
    assert (outcome.status, outcome.failure, outcome.tables) == (Status.FAILED, failure, {}), outcome.reason
    assert outcome.reason
    assert "\n" not in outcome.reason
    assert "Traceback" not in outcome.reason
    assert child.pid is not None
    assert peak(child) < MAX_PEAK_BYTES


def test_a_log_without_its_vehicle_says_what_to_do() -> None:
    """A source for tables cannot decode a log of frames, and says so."""
    outcome = analyse(job(URBAN), Source(None, ColumnMap(), "map"))
    assert (outcome.failure, outcome.tables) == (Failure.NOTHING_MAPPED, {})
    assert "--vehicle" in outcome.reason


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_log_without_permission(tmp_path: Path) -> None:
    """`permission`, of the file and of its folder; tried as another user where root runs the tests."""
    inside = folder(tmp_path / "private") / "drive.blf"
    write(inside, URBAN.read_bytes())
    alone = write(tmp_path / "alone.blf", URBAN.read_bytes())
    of = [job(path) for path in (alone, inside)]
    # everything is imported before the user changes
    assert analyse(of[0], GENERIC).status is Status.OK
    alone.chmod(0)
    inside.parent.chmod(0)
    root = os.geteuid() == 0
    try:
        if root:
            os.seteuid(65534)
        outcomes = [analyse(one, GENERIC) for one in of]
    finally:
        if root:
            os.seteuid(0)
        inside.parent.chmod(0o700)
    for outcome in outcomes:
        assert (outcome.status, outcome.failure) == (Status.FAILED, Failure.PERMISSION), outcome.reason


def changed_by(path: Path, change: Callable[[], None]) -> Outcome:
    """Analyse a log that something changes again and again."""
    of, ended = job(path), threading.Event()

    def run() -> None:
        while not ended.wait(0.001):
            change()

    thread = threading.Thread(target=run)
    outcome = analyse(of, GENERIC)
    assert outcome.failure is Failure.NONE
    thread.start()
    try:
        return analyse(of, GENERIC)
    finally:
        ended.set()
        thread.join()


@pytest.mark.long("runs of a fleet in processes of their own")
def test_a_log_that_grows_while_it_is_read(tmp_path: Path) -> None:
    """A recording that goes on fails as `changed`, with no key: the next run takes it."""
    path = write(tmp_path / "grows.log", short_logs.log(1, 20.0))

    def append() -> None:
        with path.open("ab") as file:
            file.write(b"(2000000000.0) can0 123#00\n")

    outcome = changed_by(path, append)
    assert (outcome.status, outcome.failure, outcome.key, outcome.tables) == (
        Status.FAILED,
        Failure.CHANGED,
        "",
        {},
    )


@pytest.mark.long("runs of a fleet in processes of their own")
def test_bytes_that_change_while_size_and_time_stay(tmp_path: Path) -> None:
    """Bytes that are overwritten in place, the modification time set back, are noticed as well."""
    path = write(tmp_path / "overwritten.log", short_logs.log(2, 20.0))
    found = path.stat()

    def overwrite() -> None:
        with path.open("r+b") as file:
            file.seek(1000)
            file.write(b"0")
        os.utime(path, ns=(found.st_atime_ns, found.st_mtime_ns))

    outcome = changed_by(path, overwrite)
    assert outcome.failure is Failure.CHANGED


def test_a_log_that_changed_since_it_was_listed(tmp_path: Path) -> None:
    """Another size or another time than when the logs were listed: `changed`, before anything is read."""
    path = write(tmp_path / "a.log", short_logs.log(3, 2.0))
    of = job(path)
    for other in (of._replace(size=of.size + 1), of._replace(modified_ns=of.modified_ns - 1)):
        assert analyse(other, GENERIC).failure is Failure.CHANGED
    # nothing was known of it then
    assert analyse(of._replace(size=-1, modified_ns=0), GENERIC).failure is not Failure.CHANGED


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_an_error_in_canid_is_one_row() -> None:
    """Something that no check foresees: its type and its text, in one line."""
    broken = GENERIC._replace(vehicle=GENERIC.vehicle._replace(estimators=None))  # type: ignore[union-attr, arg-type]
    outcome = analyse(job(SHIPPED / "following_lost_lead.blf", QUICK), broken)
    assert (outcome.status, outcome.failure) == (Status.FAILED, Failure.ERROR)
    assert outcome.reason.startswith("TypeError: ")
    assert outcome.key
