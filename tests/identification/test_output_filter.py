"""An output that was smoothed is compared with answers that were smoothed alike, and nothing depends on the cut."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.mathematics.estimators.fopdt import FOPDT, FopdtSettings
from canid.mathematics.identification.fopdt import fopdt_fit
from canid.mathematics.identification.output_filter import DELAYS_HOLD_IT, apply, equalizer, kernel
from canid.values.types import Identifiable, LearnGate, OutputFilter, Sample, Status
from tests.identification.first_order_response import response

DT = 0.1
FILTERS = [
    OutputFilter("savitzky_golay", 1.1),
    OutputFilter("savitzky_golay", 0.3),
    OutputFilter("moving_average", 0.7),
    OutputFilter("first_order", 0.5),
]
UNKNOWN = OutputFilter("unknown")


def named(of: OutputFilter) -> str:
    return f"{of.kind} {of.width}"


def driven(rng: np.random.Generator, n: int = 900) -> tuple[np.ndarray, np.ndarray]:
    """An input, and the answer 5 e^(-0.3 s)/(0.45 s + 1) to it."""
    u = response(rng.normal(size=n), DT, 0.5, 0.0).x
    return u, 5.0 * response(u, DT, 0.45, 0.3).x


@pytest.mark.parametrize("of", FILTERS, ids=named)
def test_output_and_answers_pass_the_same(of: OutputFilter) -> None:
    """G of the filtered signal is G F of the signal, to rounding."""
    made = equalizer(of, DT)
    assert made is not None
    x = np.random.default_rng(3).normal(size=600)
    inside = slice(80, -80)
    np.testing.assert_allclose(
        apply(made.output, apply(kernel(of, DT), x))[inside], apply(made.answers, x)[inside], atol=1e-9
    )


def test_a_savitzky_golay_kernel_is_that_of_scipy() -> None:
    """The kernel on accelerations does to them what scipy's derivative does to the speeds."""
    from scipy.signal import savgol_filter

    t = np.arange(0.0, 40.0, DT / 20)
    a = np.sin(2.0 * t) + 0.5 * np.cos(4.1 * t + 1.0)  # up to 0.65 Hz, as people
    speed = np.cumsum(a) * DT / 20
    one = savgol_filter(speed[::20], 11, 2, deriv=1, delta=DT)
    two = apply(kernel(FILTERS[0], DT), a[::20])
    np.testing.assert_allclose(one[20:-20], two[20:-20], atol=0.02)


@pytest.mark.slow("fits many drives")
@pytest.mark.parametrize("of", FILTERS, ids=named)
def test_the_answer_behind_a_stated_filter_is_found(of: OutputFilter) -> None:
    """Noise behind the driver passes the filter too; K, tau and dead time are those before it."""
    held = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        u, y = driven(rng)
        y = apply(kernel(of, DT), y + 0.5 * rng.normal(size=len(y)))
        c = fopdt_fit.fit_process(
            y, u[:, None], np.full(len(y), True), DT, fopdt_fit.Settings(output_filter=of)
        ).channels[0]
        assert c.status is not Identifiable.NOT
        held += [c.K.low <= 5.0 <= c.K.high, c.tau.low <= 0.45 <= c.tau.high]
        held += [c.dead_time.low <= 0.3 <= c.dead_time.high, abs(c.tau_plus_dead_time.value - 0.75) < 0.1]
    # 24 of 95 %: fewer than 20 have a chance of half a per cent
    assert sum(held) >= 20


@pytest.mark.slow("fits many drives")
def test_of_an_unknown_filter_no_delay_may_be_quoted() -> None:
    """The delay of a causal filter would be the driver's: values and reason are given."""
    rng = np.random.default_rng(1)
    u, y = driven(rng)
    y = apply(kernel(FILTERS[3], DT), y + 0.3 * rng.normal(size=len(y)))
    running = FOPDT.make(("range_rate",), DT, FopdtSettings(output_filter=UNKNOWN))
    state, last = running.init(), None
    for k, (output, value) in enumerate(zip(y.tolist(), u.tolist(), strict=True)):
        state, made = running.step(state, Sample(k * DT, output, (value,), LearnGate.OPEN, True, 0, {}))
        last = made if made is not None else last
    assert last is not None
    assert last.status is Status.OK
    channel = last.channels["range_rate"]
    assert channel.status is Identifiable.GAIN_ONLY
    assert channel.K.low <= 5.0 <= channel.K.high
    assert math.isfinite(channel.tau.value)
    assert DELAYS_HOLD_IT in last.says


def test_a_gap_costs_what_the_filter_reads_across_it() -> None:
    """A missing second costs itself, the history and the filter's reach, no more."""
    rng = np.random.default_rng(2)
    u, y = driven(rng, 1500)
    y = apply(kernel(FILTERS[0], DT), y + 0.3 * rng.normal(size=len(y)))
    every = np.full(len(y), True)
    whole = fopdt_fit.fit_process(y, u[:, None], every, DT, fopdt_fit.Settings(output_filter=FILTERS[0]))
    y[700:705] = np.nan
    holed = fopdt_fit.fit_process(y, u[:, None], every, DT, fopdt_fit.Settings(output_filter=FILTERS[0]))
    made = equalizer(FILTERS[0], DT)
    assert made is not None
    assert whole.used - holed.used == 5 + made.output.before + made.output.after
    assert abs(holed.channels[0].K.value / whole.channels[0].K.value - 1) < 0.02


def test_a_change_of_target_joins_no_two_histories() -> None:
    """What the inputs were before a break enters no row behind it, and the other way round."""
    rng = np.random.default_rng(4)
    u, y = driven(rng, 1500)
    y = apply(kernel(FILTERS[0], DT), y + 0.3 * rng.normal(size=len(y)))
    segment = np.repeat([0, 1], 750)
    after = u.copy()
    after[750:] += 40.0  # another target: the answer to it is not in y
    both = np.full(len(y), True)
    both[750:] = False
    one, two = (
        fopdt_fit.fit_process(
            y, x[:, None], both, DT, fopdt_fit.Settings(output_filter=FILTERS[0]), segment=segment
        )
        for x in (u, after)
    )
    assert one.used == two.used
    assert one.channels[0].K == two.channels[0].K
