"""An acceleration made of the recorded speed gives the gains of one that is not; how it was made is hidden."""

from __future__ import annotations

import numpy as np
import pytest

from canid.analysis.drive.drive_parameters import whole_drive
from canid.mathematics.estimators.speed_difference import span
from canid.models.diagnosis.prepared_drive import ready
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.values.types import Array, Trace
from tests.plants import loop_noise

# m/s, of the speed that the acceleration is made of
NOISE = 0.003


def at(speed: Array, late: float) -> Array:
    """(n,) so many samples late, by lines between them."""
    index = np.arange(len(speed))
    return np.interp(index - late, index, speed)


def derived(own: Trace, seed: int, first: float, samples: int, step: float, late: float) -> Trace:
    """Make the acceleration of a noisy speed, over `samples` from the `first` before on; send the speed coarsely, late."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE, own.t.size)
    fine = own.signals["speed"] + noise
    output = (at(fine, first) - at(fine, first + samples)) / (samples * own.dt)
    speed = at(np.round(fine / step) * step, late)
    rate = own.signals["range_rate"] - noise
    inputs = np.column_stack([own.signals["gap"] / speed - 2.0, rate])
    signals = {**own.signals, "speed": speed, "range_rate": rate, "accel": output}
    return own._replace(output=output, inputs=inputs, signals=signals)


def drawn(seed: int) -> tuple[int, Trace, Trace]:
    """Samples that a drawn difference spans, the drive with it, and with an acceleration of its own."""
    rng = np.random.default_rng(seed)
    own = loop_noise.follower(seed, 0.0, bursts=0.5)
    samples = int(rng.choice([2, 2, 3, 4]))
    first = float(rng.choice([-samples / 2, -samples / 2, 0.0, 1.0]))
    return (
        samples,
        derived(own, seed, first, samples, rng.choice([0.001, 0.003, 0.01]), rng.choice([0.0, 0.3])),
        own,
    )


@pytest.mark.slow("draws drives of nine minutes")
@pytest.mark.parametrize("k", range(8))
def test_a_difference_is_seen_however_its_speed_is_sent(seed: int, k: int) -> None:
    """Central, late, over two to four samples, of a speed that is rounded and comes between the samples: to one sample."""
    samples, made, own = drawn(seed + k)
    assert abs(span(made, made.learn) - samples) <= 1
    assert span(own, own.learn) < 2


def test_an_acceleration_of_its_own_is_taken_whole(seed: int) -> None:
    """Whatever the speed is rounded to, and where it is no acceleration at all."""
    own = loop_noise.follower(seed, 0.0, minutes=3.0)
    assert fitted_trace(own) is own
    for step in (0.003, 0.01, 0.03):
        speed = np.round(own.signals["speed"] / step) * step
        rounded = own._replace(signals={**own.signals, "speed": speed})
        assert fitted_trace(rounded) is rounded, step
    travel = 50.0 + 10.0 * own.output
    pedal = own._replace(output=travel, signals={**own.signals, "pedal": travel})
    assert fitted_trace(pedal) is pedal


@pytest.mark.slow("identifies drives of nine minutes")
@pytest.mark.parametrize("k", range(4))
def test_its_gains_are_those_of_an_acceleration_of_its_own(seed: int, k: int) -> None:
    """Both within 2 standard deviations; at every sample K1 is 2 to 3 too large, and what is left over an answer of its own.

    Both drives have the same noise of the driver, so that 2 standard deviations are no chance.
    """
    _, made, own = drawn(seed + k)
    found, of_own = whole_drive(made).channels, whole_drive(own).channels
    for name, channel in found.items():
        sd = (channel.K.high - channel.K.low) / 3.92
        assert abs(channel.K.value - of_own[name].K.value) < 2.0 * sd, (name, channel.K, of_own[name].K)


@pytest.mark.slow("fits a drive of nine minutes")
def test_identify_and_diagnose_take_the_same_samples(seed: int) -> None:
    """One function prepares the drive of both."""
    _, made, _ = drawn(seed)
    prepared = ready(made, made.learn)
    assert prepared is not None
    assert prepared.trace.t.tolist() == fitted_trace(made).t.tolist()
