"""What noise of the inputs says of tau and dead time is not taken for what the driver's answer says of them."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.identification.first_order import scan
from canid.mathematics.identification.fopdt import vehicle_band
from canid.mathematics.identification.fopdt.fopdt_fit import Settings, fit_process
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.identifiability import quotable
from canid.values.types import Array

DT, K, TAU, THETA = 0.1, 6.0, 0.5, 0.5


def first_order(x: Array, tau: float) -> Array:
    a = np.exp(-DT / tau)
    return scan((1.0 - a) * x, np.array([a]))


def answered(rng: np.random.Generator, noise: float) -> tuple[Array, Array]:
    """A driver's output (n,) and a measured range rate (n,) of 10 min; the own speed is averaged over 0.3 s."""
    n = 6000
    rate = first_order(first_order(first_order(rng.normal(size=n), 8.0), 1.5), 0.5)
    rate *= 0.8 / rate.std()
    pedal_noise = first_order(rng.normal(size=n), 1.0)
    output = K * first_order(np.roll(rate, round(THETA / DT)), TAU) + pedal_noise / pedal_noise.std()
    seen = rate + noise * np.convolve(rng.normal(size=n), np.full(3, 3**-0.5), "same")
    return output, seen[:, None]


def fitted(seed: int, noise: float) -> ProcessFit:
    output, inputs = answered(np.random.default_rng(seed), noise)
    return fit_process(
        output, inputs, np.full(len(output), True), DT, Settings(names=("range_rate",)), several=True
    )


def widths(fit: ProcessFit) -> Array:
    """Of the intervals of tau, dead time and their sum, s."""
    channel = fit.channels[0]
    every = (channel.tau, channel.dead_time, channel.tau_plus_dead_time)
    return np.array([each.high - each.low for each in every])


@pytest.mark.slow("fits many drives")
def test_noise_of_an_input_narrows_no_quoted_interval(seed: int) -> None:
    """Tau and dead time are no better known with noise of 0.03 m/s than without; intervals of 0.6 and 0.45 said so."""
    noisy = {k: fitted(seed + k, 0.03) for k in range(5)}
    quoted = [k for k, fit in noisy.items() if quotable(fit.channels[0], "tau")]
    assert len(quoted) > 2
    ratios = [widths(noisy[k]) / widths(fitted(seed + k, 0.0)) for k in quoted]
    tau, dead_time, total = np.median(ratios, axis=0)
    assert tau > 0.75, ratios
    assert dead_time > 0.75, ratios
    assert 0.85 < total < 1.2, ratios


def test_motion_passes_and_noise_does_not() -> None:
    """Of a motion of 0.3 Hz 2 % are lost at most, of white noise the parabola leaves 0.21 of the variance; NaN stays out."""
    t = DT * np.arange(3000)
    motion, noise = np.sin(0.6 * np.pi * t), np.random.default_rng(1).normal(size=3000)
    moved, white = vehicle_band.slow(np.vstack([motion, noise]), DT)[:, 10:-10]
    assert np.abs(moved - motion[10:-10]).max() < 0.02
    assert abs(np.var(white) - 0.207) < 0.03
    motion[100] = np.nan
    broken = vehicle_band.slow(motion[None], DT)[0]
    assert broken[100] == 0.0
    assert np.array_equal(broken[95:100], motion[95:100])
