"""Attacks on what a recording says: every output fails, blocks or is absent, at a time that is drawn."""

from __future__ import annotations

import os
import pty
import random
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from benchmarks.reliability.attack import judging, streams
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.disks import tmpfs
from benchmarks.reliability.needs import root
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import BEGIN, ROOT, until

PROMISE = "talk, view and JSON can fail, block or be absent: no frame is lost, the end comes within 2 s, exit code 5"
# s within which --duration and the first signal end a recording
MAX_STOP_S = 2.0
# two at a time in a round, of one sender
CASES = 2
RATES = (100, 1000, 3000)  # frames/s
JSON = (*("none",) * 6, "file", "-", "FIFO without a reader", "FIFO whose reader leaves", "full disk")
ENDS = ("duration", "SIGTERM", "SIGINT", "SIGHUP")
# A terminal's session, in which the recording is a background job that the terminal would stop (`stty tostop`).
LAUNCHER = """
import fcntl, os, signal, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
modes = termios.tcgetattr(0)
modes[3] |= termios.TOSTOP
termios.tcsetattr(0, termios.TCSANOW, modes)
child = os.fork()
if not child:
    os.setpgid(0, 0)
    os.execv(sys.argv[2], sys.argv[2:])
try:
    os.setpgid(child, child)
except OSError:  # it has done so itself, and runs the command already
    pass
open(sys.argv[1] + "~", "w").write(str(child))
os.rename(sys.argv[1] + "~", sys.argv[1])
signal.signal(signal.SIGHUP, signal.SIG_IGN)
status = os.waitpid(child, 0)[1]
os._exit(os.waitstatus_to_exitcode(status) % 256)
"""


class Case(NamedTuple):
    """One recording and what is wrong around it."""

    verb: str
    suffix: str
    out: str
    err: str
    stdin: str
    json: str
    end: str
    after: float  # s after the log is there until what comes later comes
    seconds: float  # s that it lasts at least
    background: bool  # a background job of a terminal with `stty tostop`

    @property
    def code(self) -> int | None:
        """The exit code; None: it may have lost something or not."""
        # a background job talks to its terminal, which is read
        ends = [] if self.background else [self.out, self.err]
        normal = 0 if self.end == "duration" else 128 + signal.Signals[self.end]
        json = self.json == "FIFO without a reader" or (self.json == "full disk" and self.verb == "record")
        # `live --json` writes nothing but estimates, and there may be none yet
        if self.verb == "live":
            if self.json == "-" and self.out in streams.LOSING and not self.background:
                return 5 if self.err in streams.LOSING else None
            if self.json == "FIFO without a reader" and not any(end in streams.LOSING for end in ends):
                return None
        if any(end in streams.LOSING for end in ends) or json:
            return 5
        uncertain = (*streams.LEAVING, *streams.PATIENT)
        if any(end in uncertain for end in ends) or self.json in ("FIFO whose reader leaves", "full disk"):
            return None
        return normal


def drawn(rng: random.Random) -> Case:
    """Draw a case; half of them have one bad end only, as most accidents."""
    background = rng.random() < 0.1
    kinds = [rng.choice(streams.KINDS), rng.choice(streams.KINDS)]
    if rng.random() < 0.5:
        kinds[rng.randrange(2)] = "/dev/null"
    return Case(
        rng.choice(("record", "live")),
        rng.choice((".blf", ".asc", ".log")),
        *kinds,
        rng.choice(("/dev/null", "closed")),
        rng.choice(JSON if not root() else JSON[:-1]),
        rng.choice(ENDS),
        rng.choice((0.0, rng.uniform(0.0, 1.2))),
        rng.uniform(1.3, 2.2),
        background,
    )


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Some cases at a time, on one bus."""
    cases = [drawn(rng) for _ in range(CASES)]
    with Sender(folder, rng.choice(RATES)) as sender, ThreadPoolExecutor(CASES) as pool:
        for k in range(CASES):
            (folder / str(k)).mkdir()
        played = list(pool.map(lambda k: play(folder / str(k), cases[k], sender), range(CASES)))
        sender.end()
        for case, (path, code, since, asked, ended, notes) in zip(cases, played, strict=True):
            wrong = notes
            till = asked
            if not notes:
                found = judging.read([path])
                if case.end == "duration" and found.numbers:
                    # what was received before the session began is in the log too: it lasts as long from the first frame
                    till = sender.sent[found.numbers[0]] + case.seconds - 0.05
                    asked = sender.sent[found.numbers[-1]]
                wrong += judging.missing(found, sender, since, till)
            took = max(ended - asked, 0.0)
            allowed = {5, 0 if case.end == "duration" else 128 + signal.Signals[case.end]}
            if code != case.code if case.code is not None else code not in allowed:
                wrong.append(f"exit code {code}")
            if took > MAX_STOP_S * judging.busy():
                wrong.append(f"it ended after {took:.1f} s")
            reported = f"{'; '.join(wrong)} ({case})" if wrong else ""
            yield Outcome(_group(case), took, 0, reported, measure="ended within")


def _group(case: Case) -> str:
    if case.background:
        return "background job of a terminal (SIGTTOU)"
    bad = [end for end in (case.out, case.err) if end not in streams.HARMLESS]
    if case.json not in ("none", "file", "-"):
        return "--json: FIFO without or with a reader that leaves, disk full"
    if any("terminal" in end for end in bad):
        return "a terminal without reader, stopped, gone"
    if any(end == "reader leaves" for end in bad):
        return "a reader that leaves, also before the first line"
    if any("pipe" in end or "stops" in end for end in bad):
        return "a pipe that is full, blocked, non-blocking or has no reader"
    if bad:
        return "standard streams closed or on /dev/full"
    return "standard streams in order, stdin closed or not"


def play(folder: Path, case: Case, sender: Sender) -> tuple[Path, int, float, float, float, list[str]]:
    """Record: the log, its exit code, the wall clock when it ran, when it was asked to end and when it ended, notes."""
    path = folder / f"drive{case.suffix}"
    with ExitStack() as stack:
        ends = streams.Ends(stack)
        words, later = _json(case, folder, stack)
        name, more = ("-o", ()) if case.verb == "record" else ("--record", ("--vehicle", "generic"))
        duration = ("--duration", f"{case.seconds:.3f}") if case.end == "duration" else ()
        command = [case.verb, *sender.words, name, str(path), *more, *words, *duration]
        process, target = _started(case, command, folder, ends, stack)
        until(lambda: _began(path) or process.poll() is not None)
        since = time.time()
        time.sleep(case.after)
        ends.act()
        later()
        time.sleep(max(case.seconds - (time.time() - since), 0.0))
        asked = time.time()
        if case.end != "duration" and process.poll() is None:
            os.kill(target(), signal.Signals[case.end])
        notes = []
        try:
            code = process.wait(30.0 * judging.busy())
        except subprocess.TimeoutExpired:
            notes = ["it did not end"]
            os.kill(target(), signal.SIGKILL)
            code = process.wait(30.0)
        ended = time.time()
    return path, code, since, asked, ended, notes


def _began(path: Path) -> bool:
    # a text log has no line before its first frame
    return path.exists() and path.stat().st_size > 0


def _json(case: Case, folder: Path, stack: ExitStack):  # type: ignore[no-untyped-def]
    """The words for --json, and what comes later."""
    path = folder / "out.json"
    if case.json == "none":
        return (), lambda: None
    if case.json == "-":
        return ("--json", "-"), lambda: None
    if "FIFO" in case.json:
        os.mkfifo(path)
        if "leaves" in case.json:
            reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
            return ("--json", str(path)), lambda: os.close(reader)
    if case.json == "full disk":
        disk = stack.enter_context(tmpfs(folder / "small", "16k"))

        def fill() -> None:
            with open(disk / "other", "wb", buffering=0) as file:
                try:
                    while file.write(b"x" * 4096):
                        pass
                except OSError:
                    return

        return ("--json", str(disk / "out.json")), fill
    return ("--json", str(path)), lambda: None


def _started(case: Case, command: list[str], folder: Path, ends: streams.Ends, stack: ExitStack):  # type: ignore[no-untyped-def]
    """The process, and which one gets the signal."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "TERM": "xterm"}
    code = f"{BEGIN}from canid.ui.cli import main; sys.exit(main(sys.argv[1:]))"
    run = [sys.executable, "-c", code, *command]
    if case.background:
        master, slave = pty.openpty()
        stack.callback(os.close, master)
        stack.callback(os.close, slave)
        pid = folder / "pid"
        process = subprocess.Popen(
            [sys.executable, "-c", LAUNCHER, str(pid), *run],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env=environment,
            start_new_session=True,
        )
        until(lambda: pid.exists() or process.poll() is not None)
        _read_on(master)
        return process, lambda: int(pid.read_text())
    out = ends.end(case.out, str(folder / "out"))
    err = ends.end(case.err, str(folder / "err"))
    redirections = "".join(
        word
        for word, closed in (
            (" <&-", case.stdin == "closed"),
            (" >&-", out is None),
            (" 2>&-", err is None),
        )
        if closed
    )
    process = subprocess.Popen(
        ["sh", "-c", f'exec "$0" "$@"{redirections}', *run],
        stdin=subprocess.DEVNULL,
        stdout=out,
        stderr=err,
        env=environment,
        start_new_session=True,
    )
    return process, lambda: process.pid


def _read_on(master: int) -> None:
    """Read what a terminal shows, in a thread, until it is closed."""
    import threading

    def read() -> None:
        try:
            while os.read(master, 65536):
                pass
        except (OSError, termios.error):
            return

    threading.Thread(target=read, daemon=True).start()
