"""The peers of the table, each with the settings that `tuning` found best for it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from benchmarks.hidden_effects.peers import frols, naive, stlsq
from benchmarks.hidden_effects.peers.answer import ADEQUATE, BROKE, NAMED, Answer
from benchmarks.hidden_effects.peers.library import fitted, library, remembered, strongest
from benchmarks.identification.peers.peer import ELSEWHERE, Peer, call, missing
from canid.models.effects.effect import Effect
from canid.values.types import Trace

Sets = tuple[tuple[str, ...], ...]

NEEDS_OLD_NUMPY = "SysIdentPy needs numpy < 2.4; --peers-python PATH names an interpreter that has both"
FROLS = Peer("FROLS", frols.select, "sysidentpy", old=NEEDS_OLD_NUMPY)
STLSQ = Peer("STLSQ", stlsq.select, "pysindy")
# terms that FROLS may choose; with more it only gets slower
MAX_CAUSES = 8

# Found by `python -m benchmarks.hidden_effects.peers.tuning` (seeds 70000 to 70159: 64 clean drives, 32 with one cause).
# Scores: naive 0.73, STLSQ 0.58, FROLS 0.63. Naive had 0.76 with one cause at most, but then it could never name two.
NAIVE_BEST = naive.Settings(difference=700.0, most=2)
STLSQ_BEST = stlsq.Settings(threshold=0.4, alpha=0.05, memory=0)
FROLS_BEST = frols.Settings(ratio=0.2, criterion="", memory=0)


class Method(NamedTuple):
    """One peer, as the table asks it."""

    peer: Peer | None  # None: nothing to install
    ask: Callable[[Trace, Sequence[Effect]], Answer]


def ask_naive(trace: Trace, catalogue: Sequence[Effect], settings: naive.Settings = NAIVE_BEST) -> Answer:
    """Output error and BIC."""

    def sets() -> Sets:
        at = fitted(trace)
        if at is None:
            return ()
        return cut(naive.select(at, catalogue, settings.most), settings)

    return _answered(sets)


def cut(steps: Sequence[tuple[str, float]], settings: naive.Settings) -> Sets:
    """Stop where a cause brings too little.

    Example:
        >>> cut([("a", 50.0), ("b", 5.0), ("c", 20.0)], naive.Settings(10.0, 4))
        (('a',),)
    """
    out = []
    for name, difference in steps[: settings.most]:
        if difference < settings.difference:
            break
        out.append((name,))
    return tuple(out)


def ask_stlsq(trace: Trace, catalogue: Sequence[Effect], settings: stlsq.Settings = STLSQ_BEST) -> Answer:
    """PySINDy's STLSQ."""

    def sets() -> Sets:
        at = fitted(trace)
        if at is None:
            return ()
        names, X, y = remembered(library(at, catalogue), settings.memory)
        kept = call(STLSQ, X, y, settings.threshold, settings.alpha)
        return strongest([(names[k], size) for k, size in kept])

    return _answered(sets)


def ask_frols(trace: Trace, catalogue: Sequence[Effect], settings: frols.Settings = FROLS_BEST) -> Answer:
    """SysIdentPy's FROLS."""

    def sets() -> Sets:
        at = fitted(trace)
        if at is None:
            return ()
        names, X, y = remembered(library(at, catalogue), settings.memory)
        kept = call(FROLS, X, y, settings.ratio, settings.criterion, MAX_CAUSES + settings.memory)
        return strongest([(names[k], ratio) for k, ratio in kept])

    apart = bool(os.environ.get(ELSEWHERE))
    # what another process computes is no CPU time of this one
    return _answered(sets, time.perf_counter if apart else time.process_time)


PEERS: dict[str, Method] = {
    "naive (output error + BIC)": Method(None, ask_naive),
    "PySINDy STLSQ": Method(STLSQ, ask_stlsq),
    "SysIdentPy FROLS": Method(FROLS, ask_frols),
}


def absent(name: str) -> str:
    """Say why a peer cannot be asked; empty: it can."""
    peer = PEERS[name].peer
    return missing(peer) if peer else ""


def _answered(sets: Callable[[], Sets], clock: Callable[[], float] = time.process_time) -> Answer:
    began = clock()
    try:
        found = sets()
    except Exception as error:  # whatever a peer raises is a result of the table, not its end
        return Answer((), BROKE, clock() - began, f"{type(error).__name__}: {error}")
    return Answer(found, NAMED if found else ADEQUATE, clock() - began)
