"""Which files a call of canid goes through, and how often they call each other back, traced by sys.setprofile.

    PYTHONPATH=TREE python benchmarks/structure/walks.py WALK

prints one JSON object. It runs in a process of its own, so that another checkout can be traced; it imports nothing of
this one.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

CHUNKS = 4
# a clean drive of the simulator: long enough that it is searched for causes
DIAGNOSED_MINUTES, DIAGNOSED_SEED = 6, 1
LOG, VEHICLE = "replay_logs/following_urban.blf", "generic"


class Walk(NamedTuple):
    """What a trace has seen."""

    files: int  # of canid, with at least one function called
    functions: int  # of canid
    pairs: int  # (file, file whose function is called next)
    back_calls: int  # two files that are such a pair in both directions


class Tracer:
    """Counts files, functions and successions of calls below a folder, without imports, lambdas and comprehensions."""

    def __init__(self, root: str) -> None:
        self._root = root
        self._functions: set[CodeType] = set()
        self._next: set[tuple[str, str]] = set()
        self._last = ""
        self._importing = 0

    def trace(self, frame: FrameType, event: str, _: Any) -> None:
        """Take one event of sys.setprofile."""
        code = frame.f_code
        if event not in {"call", "return"} or not code.co_filename.startswith(self._root):
            return
        if code.co_name == "<module>":
            self._importing += 1 if event == "call" else -1
        elif event == "call" and not self._importing and not code.co_name.startswith("<"):
            self._functions.add(code)
            if self._last not in {"", code.co_filename}:
                self._next.add((self._last, code.co_filename))
            self._last = code.co_filename

    def walk(self) -> Walk:
        """Count what was seen."""
        back = {frozenset(pair) for pair in self._next if pair[::-1] in self._next}
        files = {code.co_filename for code in self._functions}
        return Walk(len(files), len(self._functions), len(self._next), len(back))


def module(*parts: str) -> Any:
    """Import the module of canid whose name ends so, whichever layer it lies in in this checkout.

    Raises:
        StopIteration: there is none.
    """
    root = Path(import_module("canid").__file__ or "").parent
    wanted = (Path(*parts).with_suffix(".py"), Path(*parts, "__init__.py"))
    path = next(path for name in wanted for path in sorted(root.rglob(str(name))))
    names = path.relative_to(root.parent).with_suffix("").parts
    return import_module(".".join(names).removesuffix(".__init__"))


def pipeline() -> Callable[[], Any]:
    """Four chunks of frames, from `step` to estimates."""
    build = module("pipeline", "pipeline").build
    chunks = module("frame_columns").chunks
    frames = list(module("logs").open_log(LOG))
    running = build(import_module("canid").read_vehicle(VEHICLE))
    parts = list(chunks(frames, -(-len(frames) // CHUNKS)))

    def call() -> Any:
        state = running.init()
        for part in parts:
            state, _ = running.step(state, part)

    return call


def identify() -> Callable[[], Any]:
    """`canid.identify` of a shipped log."""
    canid = import_module("canid")
    return lambda: canid.identify(LOG, VEHICLE, sliding=False)


def diagnose() -> Callable[[], Any]:
    """`canid.diagnose` of the log of a clean simulated drive."""
    canid = import_module("canid")
    folder = tempfile.TemporaryDirectory()
    log = f"{folder.name}/clean.blf"
    words = (
        f"-m canid simulate --minutes {DIAGNOSED_MINUTES} --seed {DIAGNOSED_SEED} --vehicle {VEHICLE} {log}"
    )
    subprocess.run([sys.executable, *words.split()], check=True, capture_output=True)

    def call() -> Any:
        with folder:
            return canid.diagnose(log, VEHICLE)

    return call


WALKS = {"pipeline": pipeline, "identify": identify, "diagnose": diagnose}


def main(name: str) -> None:
    """Trace one walk and print it."""
    call = WALKS[name]()
    tracer = Tracer(os.path.dirname(import_module("canid").__file__) + os.sep)
    sys.setprofile(tracer.trace)
    try:
        call()
    finally:
        sys.setprofile(None)
    print(json.dumps(tracer.walk()._asdict()))


if __name__ == "__main__":
    main(*sys.argv[1:])
