"""Signals that are ignored where canid is started: by nohup, or in the background of a script."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
URBAN = str(ROOT / "replay_logs/following_urban.blf")
# s; bounds what hangs, no more
PATIENCE_S = 120.0
VERBS = {
    "replay": ["replay", URBAN, "--vehicle", "generic", "--speed", "1"],
    "record": ["record", "-i", "virtual", "-c", "ignored", "-o", "out.blf"],
}


def handled(pid: int, number: signal.Signals) -> tuple[bool, bool]:
    """Does canid ignore this signal, and does it catch it? By /proc, signal 1 is bit 0. Neither, as long as it is the shell,
    which catches SIGINT until its trap is set.
    """
    if Path(f"/proc/{pid}/cmdline").read_bytes().startswith(b"sh\0"):
        return False, False
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    bit = 1 << (number - 1)
    return bool(int(status["SigIgn"], 16) & bit), bool(int(status["SigCgt"], 16) & bit)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not show signal masks")
@pytest.mark.parametrize(
    "ignored", [signal.SIGINT, getattr(signal, "SIGHUP", signal.SIGINT)], ids=lambda number: number.name
)
@pytest.mark.parametrize("verb", VERBS)
def test_what_was_ignored_stays_ignored(verb: str, ignored: signal.Signals, tmp_path: Path) -> None:
    """SIGINT of a background job in `replay`, SIGHUP of nohup in both: the verb goes on, and SIGTERM ends it with 143."""
    if (verb, ignored) == ("record", signal.SIGINT):
        pytest.skip("a recording handles SIGINT always: the next test")
    process = started(verb, ignored, tmp_path)
    assert handled(process.pid, ignored) == (True, False)
    process.send_signal(ignored)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + signal.SIGTERM, said
    assert "Traceback" not in said


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not show signal masks")
def test_sigint_ends_a_recording_in_the_background(tmp_path: Path) -> None:
    """`canid record ... & kill -INT $!` in a script, where the shell starts it with SIGINT ignored: a clean end, 130."""
    process = started("record", signal.SIGINT, tmp_path, until=signal.SIGINT)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + signal.SIGINT, said
    assert "Traceback" not in said


def started(
    verb: str, ignored: signal.Signals, folder: Path, until: signal.Signals = signal.SIGTERM
) -> subprocess.Popen[str]:
    """Start a verb with a signal ignored, and wait until it handles another one."""
    launcher = f'trap "" {ignored.name.removeprefix("SIG")}; exec "$0" "$@"'
    process = subprocess.Popen(
        ["sh", "-c", launcher, sys.executable, "-m", "canid", *VERBS[verb]],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    end = time.monotonic() + PATIENCE_S
    while not handled(process.pid, until)[1]:
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.05)
    return process
