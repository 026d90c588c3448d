"""Runs of True are what a loop over the samples finds."""

from __future__ import annotations

import numpy as np

from canid.values.runs import runs


def test_runs_are_found_as_a_loop_finds_them() -> None:
    rng = np.random.default_rng(5)
    for n in (0, 1, 2, 50):
        flags = rng.random(n) < 0.5
        expected, start = [], None
        for k, flag in enumerate([*flags, False]):
            if flag and start is None:
                start = k
            elif not flag and start is not None:
                expected.append((start, k))
                start = None
        assert runs(flags) == expected
        assert runs(flags, longer_than=1) == [(a, b) for a, b in expected if b - a > 1]
