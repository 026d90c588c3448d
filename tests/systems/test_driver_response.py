"""Step and frequency response of an identified driver: bands hold the truth, and the measured one needs no model."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import canid
from canid.mathematics.estimators.fopdt import FOPDT, FopdtSettings
from canid.mathematics.systems.driver_response import Band, Response, fopdt_responses
from canid.mathematics.systems.measured_response import measured_responses
from canid.values.types import Array, LearnGate, Trace
from tests.seeds import mostly
from tests.systems.test_identified_loop import drive

ROOT = Path(__file__).parents[2]
DT = 0.1


def sine(truth: dict, frequency: float) -> complex:
    w = 2.0 * math.pi * frequency
    return complex(truth["K"] * np.exp(-1j * w * truth["dead_time"]) / (1.0 + 1j * w * truth["tau"]))


def within(band: Band, x: Array, at: float, value: float) -> bool:
    low, high = (float(np.interp(at, x, end)) for end in (band.low, band.high))
    return low - 1e-9 <= value <= high + 1e-9


def held(truth: dict, of: Response) -> list[bool]:
    """Whether the truth is in the bands, at four times and three frequencies."""
    late = lambda t: max(t - truth["dead_time"], 0.0)  # noqa: E731
    out = [
        within(of.step, of.time, t, -truth["K"] * math.expm1(-late(t) / truth["tau"]))
        for t in (0.5, 1.0, 2.0, 4.0)
    ]
    for f in (0.02, 0.1, 0.3):
        lag = math.atan(2.0 * math.pi * f * truth["tau"]) + 2.0 * math.pi * f * truth["dead_time"]
        out += [
            within(of.magnitude, of.frequency, f, abs(sine(truth, f))),
            within(of.phase, of.frequency, f, -math.degrees(lag)),
        ]
    return out


@pytest.mark.slow("fits drawn drives")
@mostly(0.85)
def test_fopdts_bands_hold_the_simulated_driver(tmp_path: Path, seed: int) -> None:
    """Of 20 points, which depend on the same few parameters, nine in ten: in a drawn drive of 20 seldom fewer."""
    trace, truth = drive(tmp_path, seed)
    found = FOPDT.identify(trace, FopdtSettings(output_filter=trace.output_filter))
    of = fopdt_responses(found.model, found.channels, trace.dt)
    points = [x for name, one in of.items() for x in held(truth["channels"][name], one)]
    assert len(points) == 20
    assert np.mean(points) >= 0.9


def loop(seed: int, n: int = 12000) -> Trace:
    """A linear driver in a closed loop in which the own noise moves the inputs: gains 5 and 6, first order, no lead."""
    rng = np.random.default_rng(seed)
    lead = np.asarray(lfilter([1.0], [1.0, -0.95], 0.15 * rng.standard_normal(n)))
    noise = np.asarray(lfilter([1.0], [1.0, -0.8], 0.8 * rng.standard_normal(n)))
    gap, speed, lag1, lag2 = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    output = np.zeros(n)
    for k in range(1, n):
        speed[k] = speed[k - 1] + DT * (0.08 * output[k - 1] - 0.3 * speed[k - 1])
        gap[k] = gap[k - 1] + DT * (lead[k - 1] - speed[k - 1])
        late = max(k - 4, 0)
        lag1[k] = lag1[k - 1] + (1.0 - math.exp(-DT / 0.5)) * (gap[late] / 20.0 - lag1[k - 1])
        lag2[k] = lag2[k - 1] + (1.0 - math.exp(-DT / 0.5)) * (lead[late] - speed[late] - lag2[k - 1])
        output[k] = 5.0 * lag1[k] + 6.0 * lag2[k] + noise[k]
    inputs = np.column_stack([gap / 20.0, lead - speed])
    return Trace(
        DT, np.arange(n) * DT, output, inputs, ("headway_error", "range_rate"), (LearnGate.OPEN,) * n,
        np.ones(n, dtype=bool), np.zeros(n, dtype=np.int64), {},
    )  # fmt: skip


@mostly(0.8)
def test_the_measured_response_is_the_drivers_in_a_closed_loop(seed: int) -> None:
    """Where spectra give the inverse of the loop: the driver's own noise is what moves the inputs most."""
    trace = loop(seed)
    of = measured_responses(trace)["range_rate"]
    p = 1.0 - math.exp(-DT / 0.5)
    z = np.exp(-2j * np.pi * of.frequency * DT)
    true = 6.0 * p * z**4 / (1.0 - (1.0 - p) * z)
    inside = (of.magnitude.low <= np.abs(true)) & (np.abs(true) <= of.magnitude.high)
    assert np.mean(inside) >= 0.8
    # and is no answer that fits all: within a third where a driver is judged
    judged = (of.frequency > 0.05) & (of.frequency < 0.3)
    assert np.all(of.magnitude.high[judged] - of.magnitude.low[judged] < 0.67 * np.abs(true[judged]))
    # a cross spectrum is far off there
    u, y = trace.inputs[:, 1], trace.output
    cut = 256
    U, Y = (np.fft.rfft(x[: len(x) // cut * cut].reshape(-1, cut) * np.hanning(cut)) for x in (u, y))
    spectral = (U.conj() * Y).sum(axis=0) / (np.abs(U) ** 2).sum(axis=0)
    at = np.abs(np.fft.rfftfreq(cut, DT)[:, None] - of.frequency[judged]).argmin(axis=0)
    off = np.abs(spectral[at] - true[judged]) / np.abs(true[judged])
    measured = of.magnitude.value[judged] * np.exp(1j * np.radians(of.phase.value[judged]))
    assert np.median(np.abs(measured - true[judged]) / np.abs(true[judged])) < 0.5 * np.median(off)


def test_gaps_interrupt_it_and_few_data_give_nothing() -> None:
    trace = loop(1, 3000)
    broken = trace._replace(learn=np.arange(len(trace.t)) % 30 != 0)
    assert measured_responses(broken)
    segments = trace._replace(segment=np.arange(len(trace.t)) // 30)
    assert measured_responses(segments) == {} == measured_responses(loop(1, 400))
    assert measured_responses(trace._replace(output=np.full(len(trace.t), np.nan))) == {}


@pytest.mark.slow("identifies a drive")
def test_an_identification_draws_them() -> None:
    trace = canid.read_trace(ROOT / "replay_logs/following_mixed.blf", "generic")
    found = canid.identify(trace, select_orders=False, sliding=False)
    for method, inputs in found.responses.methods.items():
        for name, of in inputs.items():
            channel = found.whole[method].channels[name]
            # six lags after the step it is K
            assert of.step.value[-1] == pytest.approx(channel.K.value, rel=0.01)
    names = {spec["name"] for spec in found.plot("step").data}
    assert {"FOPDT", "FOPDT, 95 %", "ARMAX"} == names
    assert "measured" in {spec["name"] for spec in found.plot("frequency").data}
    with pytest.raises(ValueError, match="no kind 'bode'; there are '', 'step', 'frequency'"):
        found.plot("bode")
