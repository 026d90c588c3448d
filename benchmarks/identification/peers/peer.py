"""What a peer is, where it runs, and how it says that it cannot."""

from __future__ import annotations

import importlib.util
import os
import pickle
import shutil
import subprocess
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

# names an interpreter with an older numpy, for peers that need it; set by --peers-python
ELSEWHERE = "CANID_PEERS_PYTHON"


class Peer(NamedTuple):
    """One way that is not canid's. `run` is a module's function, so that a child process finds it too."""

    name: str
    run: Callable[..., Any]
    needs: str = ""  # a module, or a program
    program: bool = False
    old: str = ""  # why it needs another interpreter; then it is run there where one is named


def missing(peer: Peer) -> str:
    """Say why a peer is not there; empty: it is."""
    if not peer.needs or (peer.old and os.environ.get(ELSEWHERE)):
        return ""
    if peer.program:
        return (
            "" if shutil.which(peer.needs) else f"not installed: apt-get install {peer.needs} octave-control"
        )
    if importlib.util.find_spec(peer.needs):
        return ""
    return f"not installed: {peer.old}" if peer.old else "not installed: pip install 'canid[bench]'"


def reason(error: Exception) -> str:
    """Say in one line why a peer broke."""
    lines = str(error).splitlines()
    return f"breaks: {type(error).__name__}: {lines[0][:80] if lines else ''}"


def call(peer: Peer, *args: Any) -> Any:
    """Run a peer here, or in the interpreter that it needs."""
    python = os.environ.get(ELSEWHERE, "")
    if not (peer.old and python):
        return peer.run(*args)
    child = _child(python, os.getpid())
    assert child.stdin is not None
    assert child.stdout is not None
    pickle.dump((peer.run.__module__, peer.run.__name__, args), child.stdin)
    child.stdin.flush()
    answer = pickle.load(child.stdout)
    if isinstance(answer, Exception):
        raise answer
    return answer


def timed(peer: Peer, *args: Any) -> tuple[Any, float]:
    """Run a peer; returns its answer and s: of CPU, or of a clock where it runs in a process of its own."""
    apart = peer.program or (peer.old and os.environ.get(ELSEWHERE))
    now = time.perf_counter if apart else time.process_time
    before = now()
    answer = call(peer, *args)
    return answer, now() - before


def attempt(peer: Peer, width: int, *args: Any) -> tuple[Any, float, str]:
    """Run a peer that may break; returns its answer (`width` NaNs where it broke), s, and why it broke."""
    try:
        return *timed(peer, *args), ""
    except Exception as error:  # whatever a peer raises is a result of the benchmark, not its end
        return [float("nan")] * width, float("nan"), reason(error)


def broken(done: list[tuple[Any, ...]]) -> str:
    """Say why a peer broke, where it did so in every run; each run ends in its reason."""
    return done[0][-1] if all(run[-1] for run in done) else ""


@cache
def _child(python: str, pid: int) -> subprocess.Popen[bytes]:
    """Start the other interpreter once for each process `pid` of ours: its imports take seconds."""
    root = str(Path(__file__).resolve().parents[3])
    return subprocess.Popen(
        [python, "-W", "ignore", "-m", "benchmarks.identification.peers.child"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        cwd=root,
        env={**os.environ, "PYTHONPATH": root},
    )
