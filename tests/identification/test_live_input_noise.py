"""Live estimates do not take the noise of their inputs for the driver's answer: FOPDT's windows and ARMAX's recursion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from canid.mathematics.identification.armax import box_jenkins_posterior, box_jenkins_recursive
from canid.mathematics.identification.fopdt import fopdt_fit, reduced_basis, vehicle_band
from canid.mathematics.identification.fopdt.input_noise import bands
from canid.mathematics.identification.identifiability import quotable
from canid.values.types import Array, Channel
from tests.identification.test_input_noise import DT, TAU, THETA, K, answered

MEMORIES, SETTLE_S = (0.98, 0.995, 1.0), 4.5


def window(output: Array, inputs: Array) -> Channel:
    """FOPDT of one window."""
    how = fopdt_fit.Settings(names=("range_rate",))
    return fopdt_fit.fit_process(output, inputs, np.full(len(output), True), DT, how).channels[0]


def recursion(output: Array, inputs: Array) -> Channel:
    """ARMAX, block by block."""
    layout, n = fopdt_fit.row_layout(1, DT, 3.0, 1.5), len(output)
    samples = np.column_stack([output, np.ones(n), np.zeros(n), inputs])
    state = box_jenkins_recursive.begin(layout, samples[:600], MEMORIES, None, SETTLE_S)
    assert state is not None
    for k in range(600, n, 20):
        state = box_jenkins_recursive.step(layout, state, samples[k : k + 20], MEMORIES, None, SETTLE_S)
    return box_jenkins_posterior.channels(layout, state)[0]


def drives(seed: int, noise: float) -> list[tuple[Array, Array]]:
    """Three of 5 min."""
    every = (answered(np.random.default_rng([seed, k]), noise) for k in range(3))
    return [(output[:3000], inputs[:3000]) for output, inputs in every]


@pytest.mark.long("many fits")
@pytest.mark.parametrize("estimate", [window, recursion])
def test_delays_that_noise_of_the_input_decides_are_not_quoted(
    estimate: Callable[[Array, Array], Channel], seed: int
) -> None:
    """With 0.1 m/s tau came out as 0.8 to 1.2 s instead of 0.5, quoted to 0.15 s; with 0.2 m/s the sum as 1.5 s."""
    found = [estimate(*drive) for noise in (0.1, 0.2) for drive in drives(seed, noise)]
    truth = {"tau": TAU, "dead_time": THETA, "tau_plus_dead_time": TAU + THETA}
    quoted = [(getattr(c, name), x) for c in found for name, x in truth.items() if quotable(c, name)]
    missed = [iv for iv, x in quoted if not iv.low <= x <= iv.high]
    assert len(missed) <= 2, missed
    assert all(quotable(channel, "K") for channel in found)
    assert sum(channel.K.low <= K <= channel.K.high for channel in found) >= 4


@pytest.mark.parametrize("estimate", [window, recursion])
def test_without_noise_of_the_input_the_sum_is_quoted(
    estimate: Callable[[Array, Array], Channel], seed: int
) -> None:
    """What is left of the band above 1 Hz takes nothing from a clean input."""
    found = [estimate(*drive) for drive in drives(seed, 0.0)]
    assert sum(quotable(channel, "tau_plus_dead_time") for channel in found) >= 2


def test_slow_answers_of_rows_and_of_the_basis_are_the_same() -> None:
    """Inner products of slopes smoothed row by row, and by the sum of dead times, later by the same time."""
    basis = reduced_basis.basis(reduced_basis.Box(reduced_basis.TAU_MIN, 3.0, 1.5))
    n, at = 6000, (np.array([0.4]), np.array([0.3]))
    spectrum, jw = np.fft.rfft(np.random.default_rng(1).normal(size=n)), 2j * np.pi * np.fft.rfftfreq(n, DT)
    each = zip(basis.tau, basis.dead_time, strict=True)
    answers = np.array([np.fft.irfft(spectrum * np.exp(-jw * d) / (1.0 + jw * tau), n) for tau, d in each])
    of_rows = vehicle_band.slow(reduced_basis.with_slopes(basis, *at)[:, 0] @ answers, DT)[:, 50:-50]
    of_basis = (bands(basis, *at, DT)[0][:, 0] @ answers)[:, 50:-50]
    assert np.allclose((of_rows**2).sum(axis=1), (of_basis**2).sum(axis=1), rtol=0.01)
