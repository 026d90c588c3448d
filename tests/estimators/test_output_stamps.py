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
@pytest.mark.parametrize(("every", "first"), [(2, 0), (2, 1), (3, 2), (5, 3)])
@pytest.mark.parametrize("between", ["line", "hold"])
def test_the_own_readings_are_found(between: str, every: int, first: int, decimals: int, seed: int) -> None:
    """Whichever samples they are, in whatever steps, and with a pause; the drive is thinned to them, bit for bit."""
    readings = np.round(20.0 + 5.0 * np.random.default_rng(seed).standard_normal(500), decimals)
    k = np.arange(every - first, 490 * every)
    joined = np.interp(k, every * np.arange(500), readings) if between == "line" else readings[k // every]
    joined = np.round(joined, max(decimals, 4))
    joined[300:320] = np.nan
    usable = np.isfinite(joined)
    found = stamps(joined, usable)
    assert found == (first, every, between, True)
    thin, used = at_own_stamps(trace(joined), usable)
    assert thin.dt == pytest.approx(0.1 * every)
    assert np.array_equal(thin.output[used], readings[k[first::every] // every][usable[first::every]])
    assert between[:4] in says(trace(joined)).replace("held", "hold")


SLOW, HELD, LATE = (
    SignalFinding(name, ("pedal",), 0.0, 60.0, "", "", False, withholds_delays=True)
    for name in ("output_slow", "output_held", "accel_late")
)


def test_a_slow_output_is_no_finding_where_its_own_readings_are_fitted(seed: int) -> None:
    """At every second to fifth sample; at every sixth, and at other instants, it stays, as any other finding does."""
    readings = np.random.default_rng(seed).standard_normal(500)
    for every, expected in ((2, (LATE,)), (5, (LATE,)), (6, (SLOW, LATE)), (4.5, (SLOW, LATE))):
        output = np.interp(np.arange(900), every * np.arange(500), readings)
        assert standing(trace(output)._replace(findings=(SLOW, LATE))) == expected


@pytest.mark.parametrize("between", ["line", "hold"])
@pytest.mark.parametrize("every", [4.1, 4.5, 5.3])
def test_readings_at_other_instants_are_taken_one_a_sample(every: float, between: str, seed: int) -> None:
    """Where a finding says that the output is slow, samples are as far apart as its readings; else all are fitted."""
    readings = np.random.default_rng(seed).standard_normal(500)
    k = np.arange(1200)
    output = (
        np.interp(k, every * np.arange(500), readings)
        if between == "line"
        else readings[(k / every).astype(int)]
    )
    given = trace(output)
    assert says(given) == ""
    slow = given._replace(findings=(SLOW,))
    thin, _ = at_own_stamps(slow, np.ones(1200, bool))
    assert round(thin.dt / given.dt) == np.ceil(every)
    assert "each sample that is fitted holds a new reading" in says(slow)


def test_movements_of_a_held_pedal_are_taken_one_a_sample(seed: int) -> None:
    """Where the gains are fitted by all samples; a model that has the holds keeps all samples."""
    rng = np.random.default_rng(seed)
    output = np.repeat(20.0 + rng.standard_normal(500), rng.integers(3, 11, 500))[:1200]
    given, usable = trace(output)._replace(findings=(HELD,)), np.ones(1200, bool)
    thin, _ = at_own_stamps(given, usable, held=True)
    assert 6 <= round(thin.dt / given.dt) <= 8
    assert at_own_stamps(given, usable)[0] is given
    assert standing(given) == (HELD,)


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
