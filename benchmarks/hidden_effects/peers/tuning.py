"""Choose each peer's settings on drives that the table does not use, so that each comes with the best it can.

    python -m benchmarks.hidden_effects.peers.tuning [--logs 160] [--first-seed 70000] [--peers-python PATH]
        [--only naive stlsq frols]

A setting's score is the mean of two shares: clean drives on which it names nothing, and drives with one effect of
LR >= 50 on which it names the planted one and nothing else. Who names something always, or nothing ever, gets a half.
The best settings stand in `methods`.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

from benchmarks.hidden_effects.drives import CLEAN, ONE, Drive, drives
from benchmarks.hidden_effects.hiding import hide
from benchmarks.hidden_effects.peers import frols, naive, stlsq
from benchmarks.hidden_effects.peers.library import fitted, library, remembered, strongest
from benchmarks.hidden_effects.peers.methods import FROLS, MAX_CAUSES, STLSQ, cut
from benchmarks.hidden_effects.table import STRONG
from benchmarks.identification.peers.peer import ELSEWHERE, call, missing
from canid.models.effects import CATALOGUE
from tests.plants.measurement import trace

WHO = ("naive", "stlsq", "frols")
NAIVE = tuple(
    naive.Settings(*s)
    for s in product((10.0, 30.0, 100.0, 300.0, 500.0, 700.0, 1000.0, 2000.0, 3000.0), (1, 2, 4))
)
THRESHOLDS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
ALPHAS, MEMORIES = (0.05, 100.0), (0, 1, 3)
RATIOS, CRITERIA = (0.0, 0.0001, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.05, 0.1, 0.15, 0.2, 0.3), ("", "bic")


class Said(NamedTuple):
    """What one setting said of one drive."""

    settings: Any
    hidden: str  # "": nothing
    names: tuple[str, ...]


def said(drive: Drive, peers: Sequence[str]) -> Iterator[Said]:
    """Ask peers with every setting."""
    planted, prices = hide(drive)
    if any(not price.lr >= STRONG for price in prices.values()):
        return
    at = fitted(trace(planted))
    if at is None:
        return
    hidden = "".join(prices)
    if "naive" in peers:
        steps = naive.select(at, CATALOGUE, max(s.most for s in NAIVE))
        for s in NAIVE:
            yield Said(s, hidden, tuple(name for (name,) in cut(steps, s)))
    lib = library(at, CATALOGUE)
    for memory in MEMORIES:
        names, X, y = remembered(lib, memory)
        for threshold, alpha in product(THRESHOLDS, ALPHAS) if "stlsq" in peers else ():
            sets = strongest([(names[k], size) for k, size in call(STLSQ, X, y, threshold, alpha)])
            yield Said(stlsq.Settings(threshold, alpha, memory), hidden, tuple(n for (n,) in sets))
        for criterion in CRITERIA if "frols" in peers else ():
            kept = call(FROLS, X, y, 0.0, criterion, MAX_CAUSES + memory)
            for ratio in RATIOS:
                sets = strongest([(names[k], err) for k, err in kept if err >= ratio])
                yield Said(frols.Settings(ratio, criterion, memory), hidden, tuple(n for (n,) in sets))


def scores(answers: list[Said]) -> list[tuple[float, float, float, Any]]:
    """Score, share of clean drives left alone, share of effects named exactly, settings; best first.

    Example:
        >>> of = [Said("eager", "", ("a",)), Said("eager", "a", ("a",)), Said("shy", "", ()), Said("shy", "a", ())]
        >>> scores(of)[0]
        (0.5, 0.0, 1.0, 'eager')
    """
    out = []
    for settings in dict.fromkeys(one.settings for one in answers):
        these = [one for one in answers if one.settings == settings]
        silent = [not one.names for one in these if not one.hidden]
        exact = [one.names == (one.hidden,) for one in these if one.hidden]
        if silent and exact:
            a, b = sum(silent) / len(silent), sum(exact) / len(exact)
            out.append(((a + b) / 2, a, b, settings))
    return sorted(out, key=lambda one: -one[0])


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=int, default=160)
    parser.add_argument("--first-seed", type=int, default=70_000)
    parser.add_argument("--peers-python", metavar="PATH")
    parser.add_argument("--only", nargs="+", choices=WHO, default=WHO)
    args = parser.parse_args()
    if args.peers_python:
        os.environ[ELSEWHERE] = args.peers_python
    absent = {name for name, peer in (("stlsq", STLSQ), ("frols", FROLS)) if missing(peer)}
    peers = [name for name in args.only if name not in absent]
    answers: list[Said] = []
    wanted = [drive for drive in drives(args.logs, args.first_seed) if drive.kind in (CLEAN, ONE)]
    for k, drive in enumerate(wanted, 1):
        answers += said(drive, peers)
        if k % 20 == 0:
            print(f"{k} of {len(wanted)} drives", file=sys.stderr, flush=True)
    for kind in (naive.Settings, stlsq.Settings, frols.Settings):
        print(f"\n{kind.__module__.rpartition('.')[2]}: score, clean left alone, named exactly")
        for score, silent, exact, settings in scores([a for a in answers if isinstance(a.settings, kind)])[
            :8
        ]:
            print(f"{score:.3f} {silent:.2f} {exact:.2f} {settings}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
