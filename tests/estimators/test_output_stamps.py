"""Of an output that is slower than the samples its own readings alone are fitted; any other drive stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.estimators.output_stamps import at_own_stamps, says, stamps, standing
from canid.values.types import Array, LearnGate, SignalFinding, Trace


def trace(output: Array) -> Trace:
    """A drive of this output."""
    n = len(output)
    return Trace(
        0.1, 0.1 * np.arange(n), output, np.zeros((n, 2)), ("headway_error", "range_rate"), (LearnGate.OPEN,) * n,
        np.ones(n, bool), np.zeros(n, np.int64), {"pedal": output},
    )  # fmt: skip


@pytest.mark.parametrize("decimals", [1, 4, 12])
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("between", ["line", "hold"])
def test_the_own_readings_are_found(between: str, first: int, decimals: int, seed: int) -> None:
    """Whichever samples they are, in whatever steps, and with a pause; the drive is thinned to them, bit for bit."""
    readings = np.round(20.0 + 5.0 * np.random.default_rng(seed).standard_normal(500), decimals)
    k = np.arange(first, 990)
    joined = np.interp(k, 2 * np.arange(500), readings) if between == "line" else readings[k // 2]
    joined[300:320] = np.nan
    usable = np.isfinite(joined)
    found = stamps(joined, usable)
    assert found is not None
    assert found == (first, between)
    thin, used = at_own_stamps(trace(joined), usable)
    assert thin.dt == 0.2
    assert np.array_equal(thin.output[used], readings[k[first::2] // 2][usable[first::2]])
    assert between[:4] in says(trace(joined)).replace("held", "hold")


def test_a_slow_output_is_no_finding_where_its_own_readings_are_fitted(seed: int) -> None:
    """At every second sample; at every third it stays, as any other finding does."""
    slow, late = (SignalFinding(name, ("pedal",), 0.0, 60.0, "", "", False, withholds_delays=True)
                  for name in ("output_slow", "accel_late"))  # fmt: skip
    readings = np.random.default_rng(seed).standard_normal(500)
    for every, expected in ((2, (late,)), (3, (slow, late))):
        output = np.interp(np.arange(900), every * np.arange(500), readings)
        assert standing(trace(output)._replace(findings=(slow, late))) == expected


@pytest.mark.parametrize("step", [0.0, 0.4, 2.0])
def test_an_output_of_every_sample_stays(step: float, seed: int) -> None:
    """White, smooth, coarse or still: not a sample is left out."""
    rng = np.random.default_rng(seed)
    for y in (
        rng.standard_normal(900),
        np.cumsum(rng.standard_normal(900)),
        np.repeat(rng.standard_normal(90), 10),
    ):
        output = np.round(y / step) * step if step else y
        given = trace(output), np.ones(900, bool)
        assert stamps(output, given[1]) is None
        assert at_own_stamps(*given)[0] is given[0]
        assert says(given[0]) == ""
