"""Installable systems that identify the same things, on the same data; and why one cannot run."""

from benchmarks.identification.peers.armax import ARMAX
from benchmarks.identification.peers.following import FOLLOWING
from benchmarks.identification.peers.peer import Peer, attempt, broken, call, missing
from benchmarks.identification.peers.process import INTERVALS, PROCESS
from benchmarks.identification.peers.tracking import TRACKING

__all__ = [
    "ARMAX",
    "FOLLOWING",
    "INTERVALS",
    "PROCESS",
    "TRACKING",
    "Peer",
    "attempt",
    "broken",
    "call",
    "missing",
]
