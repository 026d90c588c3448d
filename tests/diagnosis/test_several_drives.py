"""Several drives of one driver, diagnosed together: evidence adds up, each drive judges the others, differences are said."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis.diagnose import diagnose, diagnose_drives
from canid.models.diagnosis.several_drives.joined_drives import PAUSE_S, join
from canid.models.simulation import DriverTruth, simulate
from canid.values.errors import ConfigError
from canid.values.findings import Verdict
from canid.values.types import OutputFilter, SignalFinding, Trace
from tests.hidden_effects.planted_by_canid import by_columns
from tests.seeds import mostly

# min; alone too short for a cause of this size, together long enough
SHORT, DRIVES = 2.5, 4


def drawn(rng: np.random.Generator, **own: float) -> DriverTruth:
    low, high = (4.5, 0.4, 0.25, 4.5, 0.3, 0.2), (7.0, 0.8, 0.6, 7.0, 0.7, 0.5)
    truth = DriverTruth(*map(float, rng.uniform(low, high)), headway_desired=float(rng.uniform(1.7, 2.1)))
    return truth._replace(**own)


def drives(
    truth: DriverTruth, rng: np.random.Generator, minutes: float, n: int, **hide: tuple[float, ...]
) -> list[Trace]:
    """One driver behind several leads; what the pedal gives without an answer differs from drive to drive."""
    return [
        by_columns(
            simulate(
                minutes,
                int(rng.integers(1_000_000)),
                "mixed",
                driver=truth._replace(offset=float(level)),
                hide=hide,
            )
        )
        for level in rng.uniform(6.5, 9.5, n)
    ]


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_evidence_adds_up_over_drives_that_are_too_short(seed: int) -> None:
    """The joint evidence is above every drive's own, the cause is named, and it gains on most drives by a fit to others."""
    rng = np.random.default_rng(seed)
    traces = drives(drawn(rng), rng, SHORT, DRIVES, asymmetric_gain=(0.3,))
    report = diagnose_drives(traces, [f"drive {k}" for k in range(DRIVES)])
    assert report.verdict in (Verdict.NAMED, Verdict.ONE_OF), report.says
    joint = [one for one in report.findings if "asymmetric_gain" in (one.effect, *one.rivals)]
    assert joint, report.says
    for trace in traces[:1]:
        alone = {one.effect: one.evidence for one in diagnose(trace).findings}
        assert alone.get("asymmetric_gain", 0.0) < joint[0].evidence
    gains = [one.gains[joint[0].effect].value for one in report.drives]
    assert sum(gain > 0 for gain in gains) >= DRIVES - 1, gains


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_clean_drives_of_one_driver_stay_clean_together(seed: int) -> None:
    """With offsets that differ: no cause of the mean, no difference, and the driver's gains are inside."""
    rng = np.random.default_rng(seed)
    truth = drawn(rng)
    traces = drives(truth, rng, 4.0, 3)
    report = diagnose_drives(traces, ("a", "b", "c"))
    assert not [one for one in report.findings if one.where == "driver" and not one.surrogate], report.says
    assert not report.differ
    K1, K2 = (report.baseline.channels[name].K for name in ("headway_error", "range_rate"))
    # one in 30 of each misses by chance: not by as much again
    for K, true in ((K1, truth.K1), (K2, truth.K2)):
        wide = K.high - K.low
        assert K.low - 0.5 * wide < true < K.high + 0.5 * wide, (K, true)


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_two_drivers_are_not_taken_for_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one = drawn(rng, K2=4.0)
    other = one._replace(K2=7.5, K1=one.K1 * 1.3)
    traces = [*drives(one, rng, 5.0, 1), *drives(other, rng, 5.0, 1)]
    report = diagnose_drives(traces, ("a", "b"))
    named = {finding.effect for finding in report.findings}
    assert any("gains" in says for says in report.differ) or named & {"gain_change", "gain_drift"}, (
        report.says
    )


def test_drives_are_joined_with_pauses_in_which_nothing_counts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = drives(drawn(rng), rng, 1.0, 2)
    fault = SignalFinding("one", ("gap",), 10.0, 20.0, "", "", True)
    of = join([a._replace(findings=(fault,)), b])
    (begin, end), (second, last) = of.spans
    assert (begin, end) == (0.0, pytest.approx(a.t.size * a.dt))
    assert second - end == pytest.approx(PAUSE_S)
    assert last == pytest.approx(of.trace.t.size * a.dt)
    n, m = a.t.size, round(PAUSE_S / a.dt)
    np.testing.assert_array_equal(of.trace.output[n + m :], b.output)
    assert not of.trace.learn[n : n + m].any()
    assert of.trace.segment[n + m] > of.trace.segment[n - 1]
    assert of.time.total == pytest.approx((a.t.size + b.t.size) * a.dt)
    # a fault that stood to the end of its drive does not stand on the next one
    since = 10.0 - float(a.t[0])
    assert (of.trace.findings[0].since, of.trace.findings[0].until) == (pytest.approx(since), end)
    with pytest.raises(ConfigError, match="differ"):
        join([a, b._replace(output_filter=OutputFilter("unknown"))])
