"""Talk, view and JSON may fail, block or be absent at any time: the recording is complete, and the exit code says it."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from canid.analysis.session import session
from canid.io.logs import open_log
from canid.ui.cli import live_session
from canid.ui.cli.output import output_kinds
from canid.ui.cli.output.outputs import DetachedOutput, Output
from canid.ui.terminal import streams
from canid.values.errors import DONE, NOT_WRITTEN
from tests.fixtures.readers import by_canid
from tests.fixtures.traffic import WORDS, Traffic

ROOT = Path(__file__).parents[2]
# frames/s, and s that a recording lasts: the fault comes in the middle
RATE, SECONDS = 1000.0, 1.6
# s within which --duration and a signal work; fifteen times that on a busy machine, where only a hang fails. How long it
# takes is measured by `python -m benchmarks reliability attack --only talk stop`
STOP, BUSY = 2.0, 15.0
SIGNALS_ON = (
    "import signal; [signal.signal(s, signal.default_int_handler if s == signal.SIGINT else signal.SIG_DFL) "
    "for s in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]; "
)

pytestmark = pytest.mark.usefixtures("between_processes")


class Pipes:
    """What stands at standard output and standard error, by name."""

    def __init__(self, stack: ExitStack):
        self._stack = stack
        self.readers: dict[str, int] = {}

    def end(self, kind: str, name: str) -> int | None:
        """The descriptor for the child; None: it is closed by the shell."""
        if kind == "closed":
            return None
        if kind == "pty":
            reader, writer = pty.openpty()
        elif kind in ("/dev/full", "/dev/null"):
            return self._kept(os.open(kind, os.O_WRONLY))
        else:
            reader, writer = os.pipe()
            if kind == "pipe full":  # from before the first line
                os.set_blocking(writer, False)
                try:
                    while True:
                        os.write(writer, b"x" * 4096)
                except BlockingIOError:
                    os.set_blocking(writer, True)
        self.readers[name] = self._kept(reader)
        if kind == "pipe without reader":
            self.leave(name)
        return self._kept(writer)

    def leave(self, name: str) -> None:
        """The reader goes away."""
        if name in self.readers:
            os.close(self.readers.pop(name))

    def _kept(self, fd: int) -> int:
        def close() -> None:
            with suppress(OSError):
                os.close(fd)

        self._stack.callback(close)
        return fd


@pytest.fixture
def pipes() -> Iterator[Pipes]:
    with ExitStack() as stack:
        yield Pipes(stack)


@pytest.fixture
def traffic() -> Iterator[Traffic]:
    sender = Traffic(RATE).start()
    yield sender
    sender.stop()


def started(
    verb: str, output: Path, out: int | None, err: int | None, *words: object
) -> subprocess.Popen[bytes]:
    """`canid record` or `canid live` with these standard streams."""
    name, more = ("-o", ()) if verb == "record" else ("--record", ("--vehicle", "generic"))
    command = [verb, *WORDS, name, output, *more, *words]
    code = f"{SIGNALS_ON}import sys; from canid.ui.cli import main; sys.exit(main(sys.argv[1:]))"
    shell = 'exec "$0" "$@"' + (" >&-" if out is None else "") + (" 2>&-" if err is None else "")
    return subprocess.Popen(
        ["sh", "-c", shell, sys.executable, "-c", code, *map(str, command)],
        stdin=subprocess.DEVNULL,
        stdout=out,
        stderr=err,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "TERM": "xterm"},
        start_new_session=True,
    )


def recorded(path: Path, traffic: Traffic, least: float) -> str:
    """Why the log is not a contiguous recording of at least so many seconds; "": it is."""
    ids = [(id_, data) for id_, data in by_canid(path).frames]
    numbers = [int.from_bytes(data[:4], "big") for _, data in ids]
    if not numbers:
        return "it is empty"
    if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        return "frames are missing"
    lasted = traffic.sent[numbers[-1]] - traffic.sent[numbers[0]]
    return "" if lasted >= least else f"it ends after {lasted:.1f} s"


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize(
    ("verb", "out", "err", "code"),
    [
        # its reader goes away in the middle; maybe there is nothing more to say
        ("record", "/dev/null", "pipe", None),
        ("live", "/dev/null", "pipe", None),
        ("record", "pipe", "/dev/null", NOT_WRITTEN),
        ("live", "pipe without reader", "pipe without reader", NOT_WRITTEN),
        ("record", "closed", "/dev/null", NOT_WRITTEN),
        ("record", "/dev/null", "closed", NOT_WRITTEN),
        ("live", "closed", "closed", NOT_WRITTEN),
        ("record", "/dev/null", "/dev/full", NOT_WRITTEN),
        ("live", "/dev/full", "/dev/full", NOT_WRITTEN),
        ("record", "pipe full", "pipe full", NOT_WRITTEN),
        ("live", "pipe full", "pipe full", NOT_WRITTEN),
        ("live", "pty", "pty", None),  # a terminal that is not read; it buffers some of it
        ("record", "/dev/null", "/dev/null", DONE),
    ],
)
def test_no_output_can_cost_a_frame(
    verb: str, out: str, err: str, code: int | None, tmp_path: Path, pipes: Pipes, traffic: Traffic
) -> None:
    """Whatever stands at the standard streams, the recording lasts to the end that was asked for and is contiguous."""
    path = tmp_path / "drive.blf"
    ends = pipes.end(out, "out"), pipes.end(err, "err")
    process = started(verb, path, *ends, "--duration", SECONDS)
    began = time.monotonic()
    time.sleep(SECONDS / 2)
    pipes.leave("out") if out == "pipe" else None
    pipes.leave("err") if err == "pipe" else None
    got = process.wait(600.0)
    assert time.monotonic() - began < SECONDS + BUSY * STOP + 10.0
    assert recorded(path, traffic, SECONDS - 0.5) == ""
    assert got == code if code is not None else got in (DONE, NOT_WRITTEN)


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize(
    ("verb", "kind", "number"),
    [
        ("live", "pipe full", signal.SIGTERM),
        ("live", "pty", signal.SIGINT),
        ("live", "fifo", signal.SIGTERM),
        ("record", "pipe full", signal.SIGINT),
        ("record", "fifo", signal.SIGINT),
    ],
)
def test_a_reader_that_does_not_read_delays_no_end(
    verb: str, kind: str, number: signal.Signals, tmp_path: Path, pipes: Pipes, traffic: Traffic
) -> None:
    """The first signal ends it within 2 s, the recording whole; a FIFO for --json that is never opened does not matter."""
    path = tmp_path / "drive.blf"
    json = tmp_path / "fifo"
    words: tuple[object, ...] = ("--json", "-")
    if kind == "fifo":
        os.mkfifo(json)
        words = ("--json", json)
    end = pipes.end("/dev/null" if kind == "fifo" else kind, "out")
    process = started(verb, path, end, pipes.end("/dev/null", "err"), *words)
    while not path.exists():
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(1.2)
    asked = time.monotonic()
    process.send_signal(number)
    got = process.wait(600.0)
    assert time.monotonic() - asked < BUSY * STOP
    assert recorded(path, traffic, 0.8) == ""
    assert got in (NOT_WRITTEN, 128 + number)


@pytest.mark.slow("recordings that are attacked")
def test_what_was_closed_is_not_written_into_the_recording(tmp_path: Path, traffic: Traffic) -> None:
    """With descriptors 0, 1 and 2 closed the log does not get their numbers: no talk and no child writes into it."""
    path = tmp_path / "drive.asc"
    code = "import sys; from canid.ui.cli import main; sys.exit(main(sys.argv[1:]))"
    command = ["live", *WORDS, "--record", path, "--vehicle", "generic", "--duration", SECONDS]
    words = ["sh", "-c", 'exec "$0" "$@" <&- >&- 2>&-', sys.executable, "-c", code, *map(str, command)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    assert subprocess.run(words, env=environment, check=False, timeout=600).returncode == NOT_WRITTEN
    log = open_log(path)
    assert len(list(log)) > 0.5 * RATE * SECONDS
    assert log.damage is None
    assert recorded(path, traffic, SECONDS - 0.5) == ""


def test_all_that_an_end_waits_for_makes_less_than_what_is_promised() -> None:
    """The estimators, --json and the standard streams one after the other: each may take all of its time."""
    assert session.FINISH_S + live_session.JSON_PATIENCE_S + streams.STREAM_PATIENCE_S < STOP - 0.2


def test_an_unread_output_is_waited_for_once(tmp_path: Path) -> None:
    """The second `finish` waits no more, and counts nothing again."""
    os.mkfifo(tmp_path / "fifo")
    output = DetachedOutput(Output("--json", str(tmp_path / "fifo"), output_kinds.JSON))
    output.write("{}\n")
    said = output.finish(0.1)
    began = time.monotonic()
    assert output.finish(60.0) == said
    assert "left 1 pieces unread" in said
    assert time.monotonic() - began < 30.0
