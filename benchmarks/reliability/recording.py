"""`canid record` and `canid live` as processes of their own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tests.fixtures.traffic import WORDS

ROOT = Path(__file__).parents[2]
# s: a busy machine may need them
TIMEOUT_S = 120.0
# what a process of ours needs before the command itself: signals that a shell in the background had switched off
BEGIN = (
    "import signal; [signal.signal(s, signal.default_int_handler if s == signal.SIGINT else signal.SIG_DFL) \
for s in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]; import sys; "
)


class Recording:
    """A verb that listens to the traffic; `said` is what it reported so far."""

    def __init__(
        self,
        output: Path,
        *words: object,
        verb: str = "record",
        talk: Path,
        before: str = "",
        bus: Any = WORDS,
        environment: Mapping[str, str] = MappingProxyType({}),
        prefix: Sequence[str] = (),
    ):
        """Start it and wait until its bus is open.

        `talk`: folder for what it says; `before`: Python run first;
        `prefix`: a command that runs it, in its own process.
        """
        self.output = output
        self._out, self._err = talk / f"{output.name}.out", talk / f"{output.name}.err"
        self.json = talk / f"{output.name}.json"
        name = "--record" if verb == "live" else "-o"
        command = ["canid", verb, *bus, name, str(output), "--json", str(self.json), *map(str, words)]
        code = f"{BEGIN}{before}\nfrom canid.ui.cli import main; sys.exit(main(sys.argv[1:]))"
        everything = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"} | dict(environment)
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self.process = subprocess.Popen(
                [*prefix, sys.executable, "-c", code, *command[1:]],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                env=everything,
                start_new_session=True,
            )
        until(lambda: "listen-only" in self.said or self.process.poll() is not None)

    @property
    def said(self) -> str:
        """Standard error so far."""
        return self._err.read_text(errors="replace")

    @property
    def printed(self) -> str:
        """Standard output so far."""
        return self._out.read_text(errors="replace")

    def kill(self) -> float:
        """Send SIGKILL; returns the wall clock just before."""
        instant = time.time()
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.wait()
        return instant

    def end(self, number: int | None = signal.SIGTERM) -> int:
        """Send a signal, if any, and wait; returns the exit code."""
        if number is not None:
            self.process.send_signal(number)
        return self.process.wait(TIMEOUT_S)

    def reported(self) -> dict[str, Any]:
        """The last line of --json."""
        reported: dict[str, Any] = json.loads(self.json.read_text().splitlines()[-1])
        return reported

    def journal(self) -> list[dict[str, Any]]:
        """The events in the journal of the log."""
        path = self.output.with_name(f"{self.output.stem}.events.jsonl")
        return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.kill()


def until(true: Any, patience: float = TIMEOUT_S) -> None:
    """Wait for something; raises TimeoutError where it does not come."""
    end = time.monotonic() + patience
    while not true():
        if time.monotonic() > end:
            raise TimeoutError(f"waited {patience:g} s for nothing")
        time.sleep(0.01)
