"""Reduction of a transfer function to first order (Grover 2021, sec. 4.3), in three ways.

P1 K / (1 + tau s) and P1D K e^(-theta s) / (1 + tau s) nearest to the model for the episode's own input, which is what he
does; the first-order model of the record itself, without the detour; and balanced truncation (Moore 1981), whose result does
not depend on an input.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from canid.models.simulation.driver import lag
from canid.values.types import NAN, Array
from canid_study.grover.output_error import OutputError
from canid_study.systems import control_systems
from canid_study.systems.first_order_reduction import first_order_reduction

# s; lags that are tried, from none to far beyond his 0.734
LAGS = np.concatenate([[0.0], np.geomspace(0.02, 8.0, 30)])
# s; dead times that are tried: a person's reaction ends well below
DEAD_TIMES = np.arange(0.0, 1.55, 0.1)


class FirstOrder(NamedTuple):
    """A first-order model of one input."""

    K: float  # output unit per input unit
    tau: float  # s
    dead_time: float  # s
    fit_percent: float  # of what it was fitted to


class Balanced(NamedTuple):
    """Balanced truncation to first order."""

    K: float  # its DC gain
    tau: float  # s
    error_bound: float  # largest error of the frequency response, in output unit per input unit
    hankel: tuple[float, ...]  # singular values
    says: str = ""  # why there is none


def response(inp: Array, tau: float, dead_time: float, dt: float) -> Array:
    """Response of e^(-theta s) / (1 + tau s), exact for an input that is straight between samples.

    Args:
        inp: (n,) or (n, m); it stood still before.
        tau: s.
        dead_time: s.
        dt: s.

    >>> response(np.ones(3), 0.5, 0.2, 0.1).tolist()
    [1.0, 1.0, 1.0]
    >>> response(np.array([0.0, 1.0, 2.0]), 0.0, 0.1, 0.1).tolist()
    [0.0, 0.0, 1.0]
    """
    x = np.asarray(inp, float)
    if dead_time > 0.0:
        at = np.arange(len(x)) - dead_time / dt
        low = np.clip(np.floor(at).astype(int), 0, len(x) - 1)
        high = np.minimum(low + 1, len(x) - 1)
        part = np.clip(at - low, 0.0, 1.0)
        part = part if x.ndim == 1 else part[:, None]
        x = (1.0 - part) * x[low] + part * x[high]
    if tau <= 0.0:
        return x
    step = lag(tau, dt)
    begin = x[:1]
    out: Array = lfilter([step.after, step.before], [1.0, -step.decay], x - begin, axis=0) + begin
    return out


def of_model(model: OutputError, inp: Array, *, dead_time: bool) -> FirstOrder:
    """P1 or P1D nearest to the model's response to the episode's own input.

    Args:
        model: of high order. Where it is unstable no simulation shows its response, and the reduction is that of its
            frequency response, which has no meaning in time.
        inp: (n,) detrended.
        dead_time: P1D.

    >>> model = OutputError(1, np.array([0.0, 0.5]), np.array([1.0, -0.9]), np.zeros(1), np.zeros(0), 100.0, 0.1)
    >>> u = np.random.default_rng(0).standard_normal(600)
    >>> np.round(of_model(model, response(u, 1.0, 0.0, 0.1), dead_time=True).K, 1)
    np.float64(5.0)
    """
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(len(inp), model.dt)[1:], np.float64)
    # tapered: the ends of a record differ, and their step would be part of the spectrum
    weight = np.asarray(np.abs(np.fft.rfft(inp * np.hanning(len(inp))))[1:] ** 2, np.float64)
    z = np.exp(-1j * omega * model.dt)
    values = np.polyval(model.num[::-1], z) / np.polyval(model.den[::-1], z)
    return FirstOrder(*first_order_reduction(omega, np.asarray(values), weight, dead_time=dead_time))


def of_record(output: Array, inp: Array, dt: float, *, dead_time: bool) -> FirstOrder:
    """First-order model of the record itself, by output error with a free initial state.

    Args:
        output: (n,) detrended.
        inp: (n,) detrended.
        dt: s.
        dead_time: P1D; otherwise P1.

    >>> u = np.random.default_rng(0).standard_normal(600)
    >>> lag = of_record(4.0 * response(u, 0.6, 0.0, 0.1), u, 0.1, dead_time=False)
    >>> round(lag.K, 2), round(lag.tau, 2)
    (4.0, 0.6)
    """
    best, error = (NAN, NAN, NAN), np.inf
    delays = DEAD_TIMES if dead_time else DEAD_TIMES[:1]
    taus = LAGS
    for width in (0.25, 0.04, 0.006, 0.0):
        # the initial state projected out of the output
        states = [decay(len(inp), float(tau), dt) for tau in taus]
        states = [state / float(np.linalg.norm(state)) for state in states]
        outputs = [output - state * float(state @ output) for state in states]
        for theta in delays:
            delayed = response(inp, 0.0, float(theta), dt)
            for tau, state, y in zip(taus, states, outputs, strict=True):
                x = response(delayed, float(tau), 0.0, dt)
                x = x - state * float(state @ x)
                power, product = float(x @ x), float(x @ y)
                left = float(y @ y) - product * product / power if power > 0.0 else np.inf
                if left < error:
                    best, error = (product / power, float(tau), float(theta)), left
        # again about the best, between its neighbours
        _, middle, delay = best
        taus = middle + (width * middle + 0.02 * width / 0.25) * np.linspace(-1.0, 1.0, 11)
        taus = np.clip(taus, 0.0, None)
        delays = (
            np.clip(delay + width / 0.25 * np.linspace(-0.08, 0.08, 5), 0.0, None) if dead_time else delays
        )
    power = float(np.linalg.norm(output - output.mean()))
    fit = 100.0 * (1.0 - max(error, 0.0) ** 0.5 / power) if power > 0.0 else NAN
    return FirstOrder(*best, fit)


def decay(n: int, tau: float, dt: float) -> Array:
    """What an initial state of one contributes, (n,)."""
    out: Array = np.exp(-np.arange(n) * dt / tau) if tau > 0.0 else np.eye(1, n)[0]
    return out


def balanced(model: OutputError) -> Balanced:
    """Balanced truncation to first order; none of an unstable model, and none without slycot.

    By the bilinear transform z = (1 + s dt / 2) / (1 - s dt / 2), which keeps stability and Hankel singular values
    (Al-Saggaf & Franklin 1988).

    >>> grows = OutputError(1, np.array([0.0, 0.5]), np.array([1.0, -1.1]), np.zeros(1), np.zeros(0), 99.0, 0.1)
    >>> balanced(grows).says
    '1 unstable pole: balanced truncation is defined for stable models'
    """
    nothing = Balanced(NAN, NAN, NAN, ())
    if model.growing:
        count = f"{model.growing} unstable pole{'s' * (model.growing > 1)}"
        return nothing._replace(says=f"{count}: balanced truncation is defined for stable models")
    if model.order < 2:
        return nothing._replace(says="the model is of first order itself")
    num, den = _bilinear(model.num, model.dt), _bilinear(model.den, model.dt)
    system = control_systems.System(tuple(num.tolist()), tuple(den.tolist()))
    try:
        truncation = control_systems.balanced_truncation(system, 1)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        return nothing._replace(says=f"no balanced realization in double precision ({type(error).__name__})")
    if isinstance(truncation, control_systems.Missing):
        return nothing._replace(says=f"not made: {truncation.remedy}")
    reduced = truncation.system
    a, b = reduced.den[0], reduced.den[-1]
    tau = a / b if len(reduced.den) > 1 and b else 0.0
    gain = reduced.num[-1] / b if b else NAN
    return Balanced(gain, tau, truncation.error_bound, tuple(float(x) for x in truncation.hankel))


def _bilinear(coefficients: Array, dt: float) -> Array:
    """Polynomial of q^-1 as one of s, falling powers, times (1 + s dt / 2)^order."""
    n = len(coefficients) - 1
    plus, minus = np.array([0.5 * dt, 1.0]), np.array([-0.5 * dt, 1.0])
    out = np.zeros(n + 1)
    for k, c in enumerate(coefficients):
        term = np.array([c])
        for factor, power in ((minus, k), (plus, n - k)):
            for _ in range(power):
                term = np.convolve(term, factor)
        out += term
    return out
