"""How an identified driver answers a step and a sine of each input: step and frequency response with 95 % bands.

FOPDT's band is of models drawn from its joint posterior, stretched to the stated gains, so that the step's end is the
interval of K. It holds pointwise: at one time, or one frequency, the truth is inside with 95 %. ARMAX has none: its
covariance is for one whole number of samples of dead time, and a band from it held the truth at 0.3 Hz in 5 of 8 drives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax.armax_batch import ArmaxFit
from canid.mathematics.identification.armax.box_jenkins import BoxJenkinsFit
from canid.mathematics.identification.confidence import QUANTILES
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.systems.posterior_draws import driver_draws
from canid.values.types import NAN, Array, Channel, Identifiable, Latency

# draws of a band; its ends are then known to a tenth of its width
DRAWS = 400
# of the step response: s shown, and points
STEP_S, STEP_POINTS = 6.0, 241
# Hz; of the frequency response
FREQUENCIES_HZ = np.geomspace(0.01, 2.0, 80)
Complex = npt.NDArray[np.complex128]


class Band(NamedTuple):
    """A curve with its pointwise 95 % interval; NaN: it has none."""

    value: Array  # (n,)
    low: Array  # (n,)
    high: Array  # (n,)


class Response(NamedTuple):
    """One input's answer by one method."""

    time: Array  # (n,) s since the step
    step: Band  # (n,) output units for a step of one input unit
    frequency: Array  # (m,) Hz
    magnitude: Band  # (m,) output units per input unit
    phase: Band  # (m,) degrees, unwrapped; negative: later
    poles: Complex  # in the z plane at `dt`
    zeros: Complex
    dt: float  # s
    status: Identifiable  # of the channel: which of its numbers may be quoted
    # of a sampled model, in ascending powers of 1/z with the dead time as leading zeros; empty: FOPDT
    numerator: Array = np.zeros(0)
    denominator: Array = np.zeros(0)


def fopdt_responses(
    fit: ProcessFit | None, channels: Mapping[str, Channel], dt: float, latency: Latency | None = None
) -> dict[str, Response]:
    """Responses of FOPDT, K e^(-θs) / (1 + τs); empty: there is no joint posterior of two inputs.

    Args:
        fit: of a whole drive.
        channels: input name -> channel, with the stated gains.
        dt: s, at which poles are given.
        latency: of the radar, which is added to dead times; None: none is stated.
    """
    if fit is None or fit.posterior is None or len(channels) != 2 or len(fit.posterior.cells) != 2:
        return {}
    gains = [channel.K for channel in channels.values()]
    if not all(math.isfinite(x) for c in channels.values() for x in (*c.K, c.tau.value, c.dead_time.value)):
        return {}
    drawn = driver_draws(fit.posterior, (gains[0], gains[1]), DRAWS)
    drawn_late = _late(latency)
    t, f = np.linspace(0.0, STEP_S, STEP_POINTS), FREQUENCIES_HZ
    out = {}
    for i, (name, channel) in enumerate(channels.items()):
        # the numbers that are printed; a stated latency is in them
        K, tau, dead_time = channel.K.value, channel.tau.value, channel.dead_time.value
        many = drawn.K[:, i, None], drawn.tau[:, i, None], drawn.dead_time[:, i, None] + drawn_late
        at = _first_order_sine(f, K, tau, dead_time)
        out[name] = Response(
            t,
            _band(_first_order_step(t, K, tau, dead_time), _first_order_step(t, *many)),
            f,
            *_bode(at, _first_order_sine(f, *many)),
            np.array([math.exp(-dt / tau) if tau > 0.0 else 0.0], complex),
            np.zeros(0, complex),
            dt,
            channel.status,
        )
    return out


def responses_of_draws(K: Array, tau: Array, dead_time: Array) -> tuple[Band, Band, Band]:
    """Step, magnitude and phase with pointwise 95 % bands of one input's FOPDT, from draws of its posterior.

    Args:
        K: (n,) output units per input unit.
        tau: (n,) s.
        dead_time: (n,) s.

    Returns:
        at `STEP_S` in `STEP_POINTS`, and at `FREQUENCIES_HZ` twice; the curve is that of the medians.

    Example:
        >>> one = np.ones(3)
        >>> step, magnitude, _ = responses_of_draws(5.0 * one, 0.5 * one, 0.3 * one)
        >>> float(step.value[0]), round(float(step.value[-1]), 3), round(float(magnitude.value[0]), 3)
        (0.0, 5.0, 4.998)
    """
    t, middle = np.linspace(0.0, STEP_S, STEP_POINTS), [float(np.median(x)) for x in (K, tau, dead_time)]
    many = K[:, None], tau[:, None], dead_time[:, None]
    step = _band(_first_order_step(t, *middle), _first_order_step(t, *many))
    return step, *_bode(_first_order_sine(FREQUENCIES_HZ, *middle), _first_order_sine(FREQUENCIES_HZ, *many))


def armax_responses(
    model: ArmaxFit | None,
    separate: BoxJenkinsFit | None,
    channels: Mapping[str, Channel],
    dt: float,
    latency: Latency | None = None,
) -> dict[str, Response]:
    """Responses of ARMAX: B/F of each input's own poles where they are separate, else B/A.

    Args:
        model: of a whole drive.
        separate: the model with a pole of its own for each input; None: there is none.
        channels: input name -> channel, with the stated gains; inputs without a gain are left out.
        dt: s.
        latency: of the radar, which is added to dead times; None: none is stated.
    """
    out = {}
    for i, (name, channel) in enumerate(channels.items()):
        if not all(map(math.isfinite, channel.K)):
            continue
        if separate is not None:
            nb, width = separate.orders.nb, separate.orders.nb + separate.orders.nf
            theta, delay = separate.theta[i * width : (i + 1) * width], separate.delays[i]
        elif model is not None:
            o = model.orders
            nb, delay = o.nb, o.nk
            theta = np.concatenate([model.B[i], model.A[1:]])
        else:
            continue
        response = _rational(theta, nb, delay, channel, dt, 0.0 if latency is None else latency.value)
        if response is not None:
            out[name] = response
    return out


def _late(latency: Latency | None) -> Array:
    """Draws of a stated latency, (DRAWS, 1)."""
    if latency is None:
        return np.zeros((DRAWS, 1))
    z = np.random.default_rng(2).standard_normal((DRAWS, 1))
    out: Array = np.maximum(latency.value + latency.sd * z, 0.0)
    return out


def _rational(theta: Array, nb: int, delay: int, channel: Channel, dt: float, late: float) -> Response | None:
    """The response of b(z) z^-delay / (1 + f(z)), coefficients of b first; None: it is unstable."""
    b, f = theta[:nb].copy(), np.concatenate([[1.0], theta[nb:]])
    poles = np.roots(f).astype(complex)
    if np.abs(poles).max(initial=0.0) >= 1.0:
        return None
    # scaled to the stated gain, from which the feedback's bias is taken off
    gain = float(b.sum() / f.sum())
    b *= channel.K.value / gain if abs(gain) > 1e-300 else 1.0
    b = np.concatenate([np.zeros(delay), b])
    n, most = round(STEP_S / dt) + 1, 0.5 / dt
    t: Array = np.arange(n, dtype=np.float64) * dt
    step = np.interp(t - late, t, _unit_step(b, f, n), left=0.0)
    frequency: Array = FREQUENCIES_HZ[most > FREQUENCIES_HZ]
    at = _sine(b, f, frequency, dt) * np.exp(-2j * math.pi * frequency * late)
    phase: Array = np.degrees(np.unwrap(np.angle(at)))
    zeros = np.roots(theta[:nb]).astype(complex)
    curves = _line(step), frequency, _line(np.abs(at)), _line(phase)
    return Response(t, *curves, poles, zeros, dt, channel.status, b, f)


def _unit_step(b: Array, f: Array, n: int) -> Array:
    """The first n values of b/f driven by a step, as `scipy.signal.lfilter`, whose import takes a second."""
    order = max(len(b), len(f))
    num, den = np.zeros((2, order))
    num[: len(b)], den[: len(f)] = b, f
    held, out = np.zeros(order), np.zeros(n)
    for k in range(n):
        out[k] = held[0] + num[0]
        held[:-1] = held[1:] + num[1:] - out[k] * den[1:]
    return out


def _line(value: Array) -> Band:
    """A curve without a band."""
    return Band(value, *np.full((2, len(value)), NAN))


def _sine(b: Array, f: Array, frequency: Array, dt: float) -> Complex:
    z = np.exp(-2j * math.pi * frequency * dt)
    over = np.polynomial.polynomial.polyval(z, b)
    out: Complex = over / np.polynomial.polynomial.polyval(z, f)
    return out


def _first_order_step(t: Array, K: Array | float, tau: Array | float, dead_time: Array | float) -> Array:
    """Step response, (n,) or (draws, n).

    >>> _first_order_step(np.array([0.0, 0.5, 1.0, 50.0]), 4.0, 0.5, 0.5).round(2).tolist()
    [0.0, 0.0, 2.53, 4.0]
    """
    after = np.maximum(t - dead_time, 0.0)
    out: Array = K * -np.expm1(-after / np.maximum(tau, 1e-9))
    return out


def _first_order_sine(f: Array, K: Array | float, tau: Array | float, dead_time: Array | float) -> Complex:
    w = 2.0 * math.pi * f
    out: Complex = K * np.exp(-1j * w * dead_time) / (1.0 + 1j * w * tau)
    return out


def _bode(at: Complex, many: Complex) -> tuple[Band, Band]:
    """Magnitude and phase of a frequency response and draws of it; the phase is unwrapped from the lowest frequency on.

    Args:
        at: (m,).
        many: (draws, m).
    """
    phase = np.degrees(np.unwrap(np.angle(at)))
    # each drawn phase is the one of its branches that is nearest to the point's
    drawn = np.degrees(np.unwrap(np.angle(many), axis=1))
    drawn -= 360.0 * np.round((drawn[:, :1] - phase[:1]) / 360.0)
    return _band(np.abs(at), np.abs(many)), _band(phase, drawn)


def _band(value: Array, drawn: Array) -> Band:
    low, high = np.quantile(drawn, QUANTILES, axis=0)
    # the estimate itself is in its band
    return Band(value, np.minimum(low, value), np.maximum(high, value))
