"""Which buses this machine has, and canid and can-utils as processes on them."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
# s: canid's imports take 10 s in the virtual machine on a busy host; nothing here is about speed
TIMEOUT_S = 120.0
# RFC 5737's sibling for multicast, RFC 6676: documentation addresses, which are not in use
GROUP = "233.252.0.1"
NEEDS = {
    "vcan": "this kernel has no vcan: run `make vm-test`",
    "netns": "multicast would leave this machine: `make test` runs this in a network namespace of its own",
}


def has_vcan() -> bool:
    """Is there a vcan0 in this network namespace?"""
    return any(name == "vcan0" for _, name in socket.if_nameindex())


def has_netns() -> bool:
    """Does the group's route lead to loopback? To connect a UDP socket sends nothing, but finds the route."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((GROUP, 9))
        except OSError:
            return False
        # loopback's own address is no source for a group, so that none is chosen
        return probe.getsockname()[0] == "0.0.0.0" or probe.getsockname()[0].startswith("127.")


def pytest_runtest_setup(item: pytest.Item) -> None:
    # CANID_BUSES names the buses that must be there: without them the tests fail instead of being skipped
    required = os.environ.get("CANID_BUSES", "").split()
    for need, there in (("vcan", has_vcan), ("netns", has_netns)):
        if item.get_closest_marker(need) and not there():
            (pytest.fail if need in required else pytest.skip)(NEEDS[need])


class Program(NamedTuple):
    """A process whose two outputs go to files, so that no pipe can fill up."""

    process: subprocess.Popen[bytes]
    out: Path
    err: Path

    def says(self) -> str:
        """Its output to the user so far."""
        return self.err.read_text()

    def printed(self) -> str:
        """What it has put out so far."""
        return self.out.read_text()

    def wait_for(self, text: str) -> None:
        """Wait until its output contains this text."""
        until(lambda: text in self.says() or self.process.poll() is not None)
        assert text in self.says(), self.says()

    def end(self, number: int | None = None) -> int:
        """Send a signal, if any, wait for its end, and return its status."""
        if number is not None:
            self.process.send_signal(number)
        try:
            return self.process.wait(TIMEOUT_S)
        except subprocess.TimeoutExpired:
            where = [
                (each / "wchan").read_text() for each in Path(f"/proc/{self.process.pid}/task").iterdir()
            ]
            self.process.send_signal(signal.SIGABRT)  # faulthandler prints what each thread does
            self.process.wait(TIMEOUT_S)
            raise AssertionError(f"did not end; its threads are at {where}\n{self.says()}") from None


def until(true: Callable[[], bool], patience: float = TIMEOUT_S) -> None:
    """Wait for something; fail where it does not come."""
    end = time.monotonic() + patience
    while not true():
        assert time.monotonic() < end, f"waited {patience:g} s for nothing"
        time.sleep(0.05)


@pytest.fixture(name="until")
def _until() -> Callable[..., None]:
    return until


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Program]]:
    """Start a program; what still runs at the end of the test is killed."""
    running: list[subprocess.Popen[bytes]] = []

    def run(*words: object) -> Program:
        name = f"{len(running)}-{Path(str(words[0])).name}"
        out, err = tmp_path / f"{name}.out", tmp_path / f"{name}.err"
        environment = os.environ | {
            "PYTHONPATH": str(ROOT),
            "OMP_NUM_THREADS": "1",
            "PYTHONFAULTHANDLER": "1",
        }
        with out.open("wb") as stdout, err.open("wb") as stderr:
            process = subprocess.Popen(
                [str(word) for word in words],
                stdin=subprocess.DEVNULL,
                stdout=stdout,
                stderr=stderr,
                env=environment,
                start_new_session=True,  # its signals are its own
            )
        running.append(process)
        return Program(process, out, err)

    yield run
    for process in running:
        if process.poll() is None:
            process.kill()
            process.wait()


@pytest.fixture
def canid(start: Callable[..., Program]) -> Callable[..., Program]:
    """Start `canid ...`."""
    return lambda *words: start(sys.executable, "-m", "canid", *words)


@pytest.fixture
def listening(canid: Callable[..., Program]) -> Callable[..., Program]:
    """Start a verb that listens, and wait for its bus to be open: from there on the kernel keeps frames."""

    def run(*words: object) -> Program:
        program = canid(*words)
        program.wait_for("listen-only")
        return program

    return run


@pytest.fixture
def patient(start: Callable[..., Program]) -> Callable[..., Program]:
    """Start `canid ...` that waits a minute for a lost bus instead of 5 s, and wait for its bus to be open.

    In the virtual machine on a busy host a few `ip link` may take that long.
    """
    main = (
        "import sys; from canid.io.recording import recorder; recorder.ALL_LOST_TIMEOUT_S = 60.0; "
        "from canid.ui.cli import main; sys.exit(main())"
    )

    def run(*words: object) -> Program:
        program = start(sys.executable, "-c", main, *words)
        program.wait_for("listen-only")
        return program

    return run


@pytest.fixture
def candump(start: Callable[..., Program]) -> Callable[[str], Program]:
    """candump as the independent listener; `-L` is the format of its logs."""

    def run(channel: str) -> Program:
        assert shutil.which("candump"), "apt-get install can-utils"
        # a buffer for all that a test sends: candump's own 200 kB are full after 300 frames on a busy machine
        program = start("candump", "-L", "-r", str(32 * 1024 * 1024), channel)
        # the kernel lists the sockets that receive: name, id, mask, function, user data, matches, identity
        receivers = Path("/proc/net/can/rcvlist_all")
        until(lambda: channel in receivers.read_text())
        return program

    return run
