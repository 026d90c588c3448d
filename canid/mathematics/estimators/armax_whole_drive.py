"""One ARMAX model of a whole drive: fit, gains and delays, residual tests, and their presentation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.estimators import dead_time_trend, output_stamps, plausibility, pooling
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification import feedback_bias, identifiability, residual_tests, rounding
from canid.mathematics.identification.armax import (
    arx_recursive,
    arx_slopes,
    box_jenkins,
    box_jenkins_channels,
    gain_and_delay,
    measurement_noise,
    order_selection,
)
from canid.mathematics.identification.armax.armax_batch import ArmaxFit, Orders, fit_armax
from canid.mathematics.identification.armax.box_jenkins import BoxJenkinsFit
from canid.mathematics.identification.armax.simulated_fit import armax_fit_percent
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.identifiability import gain_only, not_quotable
from canid.mathematics.identification.output_filter import is_unknown
from canid.values.types import Array, Channel, LearnGate, ResidualTests, Trace

# a wheel crosses its range in half a second: what its limits leave is in pieces as long as the model's memory. With 5 % of
# the time at either limit K of two simulated lane keepers was -0.57 and -0.73 instead of -0.93
AT_LIMIT = "the output is at its limit too often for a model of one input: steer within its limits"
# of 48 drives of 10 min with a limit K held on 46 of 47, the dead time on 9 of 14 (`python -m benchmarks measurement_ends`)
DELAYS_AT_LIMIT = (
    "the output is at its limit: what is left of it is in pieces, of which ARMAX quotes the gains alone"
)

# standard deviations: 1 of 10,000 drives without such an answer
ANSWER_SIGMAS = 3.9
INPUT_LATE = (
    "the output moves before the input that it answers: the input is recorded late, by another clock, or in steps that hide "
    "how it moves, and no gain holds"
)
# s within which a car's offset answers its wheel: on clean drives of 10 min by 12 standard deviations and more
CAR_ANSWERS_S = 0.4
# s after which a step of the wheel has moved a car: by 4 standard deviations and more after 90 s of clean drives
CAR_MOVES_S = 1.0
CAR_LATE = (
    "the offset does not answer the wheel as a car does, within 0.4 s and not before: one of both is recorded late, by "
    "another clock, or in steps that hide how the car moves, and no gain holds"
)
# of the way that a step of the wheel has moved a car after 1 s, what it has after 0.5 s: 0.22 to 0.24 of the cars of two
# simulators, 0.24 to 0.27 where the wheel follows a road that is not measured; 0.20 to 0.25, 0.18 to 0.22 and 0.16 to 0.19
# where the offset lags by 0.1, 0.2 and 0.4 s (seeds 1010500 ff.), so that delays come out as much too short
MIN_WAY_SHARE = 0.21
CAR_SLOW = (
    "the offset answers the wheel later than that of a car: it is smoothed or recorded late by some 0.2 s or more, and no "
    "delay holds; record it as it is measured"
)
# s; a clock that runs off by more over the drive, at the upper limit of 95 %, moves the input to where no gain holds
MAX_CLOCK_DRIFT_S = 0.3
# of the samples, in which an input has not moved since the last one: what rounding hides of its motion is then no noise of
# its own (Widrow & Kollar 2008), and K comes out too small
MAX_STILL_SHARE = 0.2
# of the largest value; a smaller change is the rounding of floats
STILL = 1e-9


def identify(trace: Trace, orders: Orders) -> WholeDrive | None:
    """Fit all usable samples of a drive; None: too few data, or no stable model."""
    at_limit = any(gate is LearnGate.OUTPUT_LIMIT for gate in trace.gate)
    several = len(trace.input_names) > 1
    too_slow = "" if several else output_stamps.too_slow_to_steer(trace)
    trace = pooling.pooled(trace)
    usable = trace.learn & np.isfinite(trace.output) & np.isfinite(trace.inputs).all(axis=1)
    fitted = _fitted(trace, usable, orders)
    if fitted is None:
        return None
    fit, tests = fitted
    separate = _separate_poles(trace, usable) if several else None
    which, coarse, late, steady = "", "", "", True
    if separate is not None:
        channels = separate.channels
    elif several:  # what inputs that share their poles cost each other is in no covariance
        channels = {name: Channel() for name in trace.input_names}
    else:
        channels, which = _by_arx(trace, usable, orders.nk)
        coarse, (late, steady) = input_coarse(trace, usable), own_motion(trace, usable)
    explained = (
        armax_fit_percent(fit, trace.output, trace.inputs, usable, trace.segment, trace.dt)
        if separate is None
        else separate.fit.fit_percent
    )
    verdict = plausibility.judge(channels, explained, plausibility.UNLIMITED)
    limited = AT_LIMIT if at_limit and not several else ""
    reasons = (*verdict.refused, *filter(None, (limited, too_slow, coarse or ("" if steady else late))))
    if reasons:
        channels = dict.fromkeys(channels, not_quotable(Channel(), "; ".join(reasons)))
    elif at_limit:
        channels = {name: gain_only(channel, DELAYS_AT_LIMIT) for name, channel in channels.items()}
        reasons = (DELAYS_AT_LIMIT,)
    return WholeDrive(
        channels,
        fit,
        explained,
        residual_tests=tests,
        specification=_specification(orders),
        details=_details(fit, trace.dt, channels, tests)
        | ({} if separate is None else {"box_jenkins": _box_jenkins(separate.fit, trace)})
        | ({"dead_time_trend": late} if late else {})
        | {"says": "; ".join(reasons)},
        separate=None if separate is None else separate.fit,
        lines=(
            *reasons,
            *_polynomials(fit, trace.input_names),
            f"poles {', '.join(map(_pole, fit.poles))}",
            *filter(None, (which,)),
            *(() if separate is None else _separate_lines(separate.fit, trace)),
        ),
    )


def _fitted(
    trace: Trace, usable: npt.NDArray[np.bool_], orders: Orders
) -> tuple[ArmaxFit, ResidualTests] | None:
    """Fit, without the bias by measurement noise, and with a covariance widened for what the residuals still hold."""
    fit = fit_armax(trace.output, trace.inputs, usable, orders, segment=trace.segment, dt=trace.dt)
    if fit is None:
        return None
    if trace.variance is not None:
        variances = _noise_variances(trace.variance[usable], (trace.output[usable], *trace.inputs[usable].T))
        fit = measurement_noise.without_bias(fit, variances[0], variances[1:])
    tests = residual_tests.run_tests(fit.residual, trace.inputs, trace.input_names, orders.na + orders.nc)
    return fit._replace(covariance=residual_tests.variance_inflation(tests) * fit.covariance), tests


def _by_arx(trace: Trace, usable: npt.NDArray[np.bool_], nk: int) -> tuple[dict[str, Channel], str]:
    """Gain and delays of one input, by an ARX model of the order that AIC prefers, and which.

    In a loop a noise model that is too small biases the answer (Ljung 1999, sec. 13.4): on 24 drives of 10 min K of
    ARMAX(2,2,1) was 0.6 to 1.3 times the truth. ARX models hold every noise as their order grows (sec. 10.4), and AIC lets
    it grow with what is known (Shibata 1980).
    """
    best = _arx_orders(trace, usable, nk)
    fitted = _fitted(trace, usable, best)
    if fitted is None:
        return dict.fromkeys(trace.input_names, Channel()), ""
    fit = fitted[0]
    channels = gain_and_delay.channels(trace.input_names, fit.A, fit.B, nk, fit.covariance, trace.dt)
    which = f"K and delays from an ARX model of {best.na} lags, by AIC"
    return feedback_bias.without_all(channels), which


def _arx_orders(trace: Trace, usable: npt.NDArray[np.bool_], nk: int) -> Orders:
    """Orders that AIC prefers; the margin of live estimates (arx_recursive.py) brings nothing to a drive of 10 min."""
    candidates = [Orders(n, n, 0, nk) for n in arx_recursive.lags(trace.dt)]
    compared = order_selection.compare(
        trace.output, trace.inputs, usable, candidates, segment=trace.segment, dt=trace.dt
    )
    return min(compared, key=lambda each: np.nan_to_num(each.aic, nan=np.inf)).orders


def input_coarse(trace: Trace, usable: npt.NDArray[np.bool_], limit: float = MAX_STILL_SHARE) -> str:
    """Why no gain of one input holds; "": its steps are fine enough to show how it moves.

    Args:
        trace: of a drive.
        usable: (n,) samples that are fitted.
        limit: share of them in which an input may stand still.

    Example:
        >>> from canid.values.types import LearnGate
        >>> x, every = 0.3 * np.sin(0.05 * np.arange(900)), np.ones(900, dtype=bool)
        >>> rest = ("x",), (LearnGate.OPEN,) * 900, every, np.zeros(900, int), {}
        >>> both = [np.round(x / step) * step for step in (0.005, 0.05)]
        >>> [input_coarse(Trace(0.1, 0.1 * np.arange(900), x, y[:, None], *rest), every)[:26] for y in both]
        ['', 'the input stands still for']
    """
    x = trace.inputs[usable]
    moves = np.abs(np.diff(x, axis=0)) > STILL * np.abs(x).max(initial=0.0)
    still = 1.0 - float(moves.mean(axis=0).min(initial=1.0)) if len(moves) else 0.0
    if still <= limit:
        return ""
    return (
        f"the input stands still for {100.0 * still:.0f} % of the samples: its steps, or how rarely it comes, hide how it "
        "moves, and no gain holds; record it in finer steps"
    )


def _at_once(trace: Trace, usable: npt.NDArray[np.bool_], best: Orders) -> tuple[float, float]:
    """Answer of the output to one input within the sample, and the sum of all, in standard deviations; 0: there is no fit.

    By plain least squares: without the bias by measurement noise the coefficients of an input that is known to millimetres
    have a far larger variance than is stated, and of 8 drives with nothing wrong one was taken to be late.
    """
    fitted = _fitted(trace._replace(variance=None), usable, Orders(best.na, best.nb + 1, 0, 0))
    if fitted is None:
        return 0.0, 0.0
    fit, of_B = fitted[0], slice(best.na, best.na + best.nb + 1)
    sd = max(float(fit.covariance[of_B, of_B].sum()), 0.0) ** 0.5
    return float(fit.B[0, 0] / fit.standard_errors.B[0, 0]), float(fit.B[0].sum()) / max(sd, 1e-300)


def own_motion(trace: Trace, usable: npt.NDArray[np.bool_]) -> tuple[str, bool]:
    """Why no dead time holds of a wheel and an offset of which one is late, or has another clock, and whether a gain does.

    A car answers its wheel soon, never before, and alike along a drive, whoever drives: where that delay drifts, two
    clocks stamp them, and what they move is no delay. "": nothing speaks against them.

    Args:
        trace: of a drive.
        usable: (n,) samples that are fitted.

    Example:
        >>> from scipy.signal import lfilter
        >>> from canid.values.types import LearnGate
        >>> rng, t, every = np.random.default_rng(0), 0.1 * np.arange(6000), np.ones(6000, dtype=bool)
        >>> angle, offset = lfilter([0.3], [1, -0.7], rng.normal(size=6000)), np.zeros(6000)
        >>> for k in range(2, 6000): offset[k] = 0.9 * offset[k-1] + angle[k-2] + 0.1 * rng.normal()
        >>> rest = offset[:, None], ("x",), (LearnGate.OPEN,) * 6000, every, np.zeros(6000, int), {}
        >>> both = [Trace(0.1, t, np.interp((1 + ppm) * t, t, angle), *rest) for ppm in (0.0, 1e-3)]
        >>> [(says[:26], gain) for says, gain in (own_motion(trace, every) for trace in both)]
        [('', True), ('the clocks of wheel and of', False)]
    """
    trace = pooling.pooled(trace._replace(learn=trace.learn & usable))
    usable = trace.learn & np.isfinite(trace.output) & np.isfinite(trace.inputs).all(axis=1)
    at_once, gain = _at_once(trace, usable, _arx_orders(trace, usable, Orders().nk))
    late = INPUT_LATE if is_at_once(at_once, gain) else ""
    car = trace._replace(output=trace.inputs[:, 0], inputs=trace.output[:, None], variance=None)
    fitted = _fitted(car, usable, _arx_orders(car, usable, Orders().nk))
    if fitted is None:
        return late, not late
    fit, at_once = fitted[0], _at_once(car, usable, fitted[0].orders)[0]
    covariance = fit.covariance[fit.orders.na :, fit.orders.na :]
    if not late and car_is_late(fit.A, fit.B[0], covariance, at_once, gain, car.dt):
        late = CAR_LATE
    drift = dead_time_trend.fit(*arx_slopes.products(fit, car.output, car.inputs[:, 0], car.dt))
    if drift is None or not drift.found:
        p = fit.orders.na + fit.orders.nb
        slow = not late and _is_slow(fit.A, fit.B[0], fit.covariance[:p, :p], car.dt)
        return CAR_SLOW if slow else late, not late
    wide = NORMAL_QUANTILE * drift.sd
    value, low, high = (1e6 * (abs(drift.rate) + x) for x in (0.0, -wide, wide))
    says = (
        f"the clocks of wheel and offset run apart by {value:.0f} ppm [{low:.0f}, {high:.0f}], by how the car answers the "
        "wheel: no one dead time holds for all of the drive; stamp both by one clock"
    )
    return says, not late and 1e-6 * high * car.dt * len(car.t) <= MAX_CLOCK_DRIFT_S


def is_at_once(at_once: float, gain: float) -> bool:
    """Whether an output moves before its input: neither driver nor car answers within the sample.

    Args:
        at_once: the answer within the sample, in standard deviations.
        gain: of the side that is answered to.

    >>> is_at_once(-4.0, -0.9), is_at_once(4.0, -0.9)
    (True, False)
    """
    return bool(np.sign(gain) * at_once > ANSWER_SIGMAS)


def car_is_late(A: Array, B: Array, covariance: Array, at_once: float, gain: float, dt: float) -> bool:
    """Whether the offset of a car answers its wheel not by more than chance within `CAR_ANSWERS_S`, or does before it.

    To the side against which its driver steers, or where that is not known the one to which a step of the wheel has moved it
    after `CAR_MOVES_S`, the pole that integrates it aside: a car integrates its wheel twice, so that the sum of its own
    coefficients is about 0, of either sign.

    Args:
        A: of an ARX model, with the leading one.
        B: likewise, the first coefficient at a lag of one sample.
        covariance: of B.
        at_once: answer within the sample, in standard deviations.
        gain: the sum of the driver's coefficients, in standard deviations.
        dt: s.

    Example:
        >>> A, B = np.array([1.0, -1.9, 0.9]), np.array([0.4, 0.3, -0.2, -0.3, -0.1, -0.101])
        >>> [car_is_late(A, side * B, 1e-4 * np.eye(6), 0.0, gain, 0.1) for side, gain in ((1, 0), (-1, 0), (-1, -3))]
        [False, False, True]
    """
    step = _step_response(A, B, max(round(CAR_MOVES_S / dt), 1))[-1]
    side = float(np.sign(-gain if abs(gain) > NORMAL_QUANTILE else step))
    count = min(max(round(CAR_ANSWERS_S / dt), 1), len(B))
    weights = np.arange(count, 0.0, -1.0)
    variance = max(float(weights @ covariance[:count, :count] @ weights), 0.0)
    soon = side * float(weights @ B[:count]) > ANSWER_SIGMAS * math.sqrt(variance)
    return not soon or is_at_once(at_once, side)


def _step_response(A: Array, B: Array, n: int) -> Array:
    """Of B/A, n samples; without scipy.signal, which a live run would import in the middle of a drive.

    >>> _step_response(np.array([1.0, -0.5]), np.array([1.0, 1.0]), 3)
    array([1.  , 2.5 , 3.25])
    """
    out = np.zeros(n)
    for k, moved in enumerate(np.cumsum(np.r_[B, np.zeros(max(n - len(B), 0))])[:n]):
        past = out[max(k - len(A) + 1, 0) : k][::-1]
        out[k] = (moved - A[1 : 1 + len(past)] @ past) / A[0]
    return out


def _is_slow(A: Array, B: Array, covariance: Array, dt: float) -> bool:
    """Whether an offset has moved by less than `MIN_WAY_SHARE` after half of `CAR_MOVES_S`, at the limit of 95 %.

    >>> A, B = np.array([1.0, -2.0, 1.0]), np.array([0.005, 0.005, 0.0, 0.0, 0.0])
    >>> [_is_slow(A, np.roll(B, k), 1e-12 * np.eye(7), 0.1) for k in (0, 2)]
    [False, True]
    """
    half, p = max(round(0.5 * CAR_MOVES_S / dt), 1), np.r_[A[1:], B]

    def share(p: Array) -> float:
        way = _step_response(np.r_[1.0, p[: len(A) - 1]], np.r_[0.0, p[len(A) - 1 :]], 2 * half + 1)
        return float(way[half] / way[-1])

    size = 1e-4 * max(float(np.abs(B).max()), 1e-12)
    slope = np.array([share(p + row) - share(p - row) for row in size * np.eye(len(p))]) / (2.0 * size)
    return share(p) + NORMAL_QUANTILE * math.sqrt(max(float(slope @ covariance @ slope), 0.0)) < MIN_WAY_SHARE


class _Separate(NamedTuple):
    """The model in which each input has a pole of its own, and what it says of each."""

    fit: BoxJenkinsFit
    channels: dict[str, Channel]


def _separate_poles(trace: Trace, usable: npt.NDArray[np.bool_]) -> _Separate | None:
    """Fit separate poles per input and noise: an answer's gain and delay are then its own."""
    output_filter = trace.output_filter
    rows = box_jenkins.ready_rows(
        trace.output, trace.inputs, usable, segment=trace.segment, dt=trace.dt, output_filter=output_filter
    )
    fit = box_jenkins.fit_rows(rows, trace.dt, output_filter)
    if fit is None:
        return None
    if fit.stride == 1:
        noise_order = fit.orders.nc + fit.orders.nd
        tests = residual_tests.run_tests(fit.residual, trace.inputs, trace.input_names, noise_order)
        inflation = residual_tests.variance_inflation(tests)
        fit = fit._replace(covariance=inflation * fit.covariance, sandwich=inflation * fit.sandwich)
    channels = feedback_bias.without_all(
        box_jenkins_channels.channels(trace.input_names, fit, rows, trace.dt)
    )
    if is_unknown(output_filter):
        # the delays found are those of the driver and of the filter
        channels = {name: identifiability.gain_only(channel) for name, channel in channels.items()}
    return _Separate(fit, channels)


def _box_jenkins(fit: BoxJenkinsFit, trace: Trace) -> dict[str, Any]:
    """Its keys in JSON."""
    sd = fit.standard_errors
    return {
        "B": dict(zip(trace.input_names, fit.B, strict=True)),
        "F": dict(zip(trace.input_names, fit.F, strict=True)),
        "C": fit.C,
        "D": fit.D,
        "standard_errors": {
            "B": dict(zip(trace.input_names, sd.B, strict=True)),
            "F": dict(zip(trace.input_names, sd.F, strict=True)),
            "C": sd.C,
            "D": sd.D,
        },
        "nk": dict(zip(trace.input_names, fit.delays, strict=True)),
        "noise_dt": fit.stride * trace.dt,
        "sigma": fit.sigma,
    }


def _separate_lines(fit: BoxJenkinsFit, trace: Trace) -> list[str]:
    sd = fit.standard_errors
    rows = [
        (f"{which} {name.replace('_', ' ')}", values, errors)
        for which, all_values, all_errors in (("B", fit.B, sd.B), ("F", fit.F[:, 1:], sd.F[:, 1:]))
        for name, values, errors in zip(trace.input_names, all_values, all_errors, strict=True)
    ]
    return ["K and delays from a model with separate poles (Box-Jenkins):", *_coefficients(rows)]


def _noise_variances(variance: Array, columns: Sequence[Array]) -> list[float]:
    """Variance of the measurement noise of each column; where no reading shows it, that of its rounding.

    Args:
        variance: (n, 1 + m), NaN where not known.
        columns: (n,) each, output and inputs.

    >>> unknown = np.full((4, 2), np.nan)
    >>> [round(x, 5) for x in _noise_variances(unknown, [np.array([0.0, 0.1, 0.3, 0.2]), np.array([0.1, 0.17, 0.9, 0.4])])]
    [0.00083, 0.0]
    """
    means = _means(variance).tolist()
    return [
        mean if mean == mean else rounding.variance(column)
        for mean, column in zip(means, columns, strict=True)
    ]


def _means(variance: Array) -> Array:
    """Mean of each column; NaN where it has none."""
    known = np.isfinite(variance)
    total = np.where(known, variance, 0.0).sum(axis=0)
    out: Array = np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan)
    return out


def _specification(o: Orders) -> str:
    return f"({o.na},{o.nb},{o.nc}), dead time {o.nk} sample{'s' * (o.nk > 1)}"


def _polynomials(fit: ArmaxFit, names: tuple[str, ...]) -> list[str]:
    """One line per polynomial: each coefficient with its standard error."""
    sd = fit.standard_errors
    rows = [("A", fit.A[1:], sd.A[1:])]
    rows += [(f"B {name.replace('_', ' ')}", b, s) for name, b, s in zip(names, fit.B, sd.B, strict=True)]
    rows += [("C", fit.C[1:], sd.C[1:])]
    return _coefficients(rows)


def _coefficients(rows: list[tuple[str, Array, Array]]) -> list[str]:
    return [
        f"{name}: {', '.join(f'{x:.4g} ± {s:.2g}' for x, s in zip(values, errors, strict=True))}"
        for name, values, errors in rows
        if len(values)
    ]


def _pole(p: complex) -> str:
    return f"{p.real:.3f}{p.imag:+.3f}j" if p.imag else f"{p.real:.3f}"


def _details(fit: ArmaxFit, dt: float, channels: dict[str, Channel], tests: ResidualTests) -> dict[str, Any]:
    """Keys of `armax` in JSON, see docs/json.md."""
    sd = fit.standard_errors
    return {
        "orders": fit.orders,
        "dt": dt,
        "A": fit.A,
        "B": dict(zip(channels, fit.B, strict=True)),
        "C": fit.C,
        "standard_errors": {
            "A": sd.A,
            "B": dict(zip(channels, sd.B, strict=True)),
            "C": sd.C,
            "offset": sd.offset,
        },
        "offset": fit.offset,
        "sigma": float(fit.sigma),
        "K": {name: channel.K for name, channel in channels.items()},
        "poles": [[float(p.real), float(p.imag)] for p in fit.poles],
        "whiteness": {
            "white": tests.white,
            "statistic": tests.statistic,
            "bound": tests.bound,
            "lags": fit.whiteness.lags,
        },
        "cross": {
            name: {"causal": name not in tests.left_over, "feedback": name in tests.feedback}
            for name in channels
        },
    }
