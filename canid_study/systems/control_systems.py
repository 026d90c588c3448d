"""Transfer functions, margins and reductions by python-control: the one adapter to it, and the only file that imports it.

Fuller, Greiner, Moore, Murray, van Paassen & Yorke, "The Python Control Systems Library", CDC 2021. numpy in, values out;
`import control` takes 2.5 s (it brings matplotlib), so that every function imports it when it is called.

Nearest first-order models are in `first_order_reduction.py`, bounds above |Delta| in `first_order_envelope.py`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import NAN, Array

Complex = npt.NDArray[np.complex128]

# order of the Padé approximant where a dead time has to be rational: its phase is within 0.1 degrees of the exact one up
# to omega theta = 3.3 rad, past which a loop with that dead time has lost 190 degrees
PADE_ORDER = 4
# what `canid[study]` installs; balanced truncation solves its Lyapunov equations
SLYCOT_REMEDY = "pip install 'canid[study]' (slycot: python-control reduces by its SLICOT routines)"


class System(NamedTuple):
    """A transfer function num(s) / den(s) e^(-dead_time s), or in z with a sample interval.

    Example:
        >>> g = System((2.0,), (0.5, 1.0), dead_time=0.3)  # K 2, lag 0.5 s, dead time 0.3 s
        >>> g == first_order(2.0, 0.5, 0.3)
        True
    """

    num: tuple[float, ...]  # falling powers of s, or of z
    den: tuple[float, ...]
    dt: float | None = None  # s; None: continuous
    dead_time: float = 0.0  # s


class Margins(NamedTuple):
    """Stability margins of a loop L with negative feedback; inf: none, NaN: no such crossover."""

    gain_margin: float  # factor; of several the one nearest to 1
    phase_margin_deg: float  # of several the smallest
    crossover: float  # rad/s, |L| = 1 at the phase margin
    delay_margin_s: float  # the least additional dead time that reaches -1
    modulus_margin: float  # the least |1 + L|
    phase_crossover: float = NAN  # rad/s, at the gain margin


class DiskMargins(NamedTuple):
    """Disk margins (Seiler, Packard & Gahinet 2020): gain and phase vary together."""

    disk: float  # alpha
    gain_margin: float  # factor: gains of 1 / gain_margin to gain_margin are stable
    phase_margin_deg: float


class Damping(NamedTuple):
    """Poles as natural frequency and damping ratio."""

    natural_frequency: Array  # (n,) rad/s
    ratio: Array  # (n,)
    poles: Complex  # (n,)


class Missing(NamedTuple):
    """A step that needs a package which is not installed."""

    what: str
    remedy: str


class BalancedTruncation(NamedTuple):
    """A model of lower order (Moore 1981) and what it leaves out."""

    system: System
    hankel: Array  # (n,) Hankel singular values of the whole
    error_bound: (
        float  # max over omega of |G - G_reduced| is at most this, 2 sum of the values left out (Glover 1984)
    )


# --- systems -----------------------------------------------------------------------------------------------


def first_order(K: float, tau: float, dead_time: float = 0.0) -> System:
    """K e^(-dead_time s) / (1 + tau s) (Grover 2021, eq. 2.6, 2.2).

    >>> dc_gain(first_order(3.0, 0.4))
    3.0
    """
    return System((K,), (tau, 1.0) if tau else (1.0,), dead_time=dead_time)


def poles(system: System) -> Complex:
    """Poles, in 1/s or in z, without the dead time.

    >>> [round(float(p.real), 3) for p in poles(System((1.0,), (1.0, 3.0, 2.0)))]
    [-2.0, -1.0]
    """
    out: Complex = np.asarray(_tf(system).poles(), dtype=np.complex128)
    return out


def zeros(system: System) -> Complex:
    """Zeros, in 1/s or in z."""
    out: Complex = np.asarray(_tf(system).zeros(), dtype=np.complex128)
    return out


def dc_gain(system: System) -> float:
    """Gain of a constant input; inf of an integrator."""
    return float(np.real(_tf(system).dcgain()))


def damping(system: System) -> Damping:
    """Natural frequencies and damping ratios; those of a sampled system by its poles log(z) / dt.

    >>> d = damping(System((1.0,), (1.0, 0.4, 4.0)))
    >>> [round(float(x), 6) for x in d.natural_frequency], [round(float(x), 6) for x in d.ratio]
    ([2.0, 2.0], [0.1, 0.1])
    """
    frequency, ratio, at = _tf(system).damp()
    return Damping(np.asarray(frequency), np.asarray(ratio), np.asarray(at, dtype=np.complex128))


def stable(system: System) -> bool:
    """Whether every pole decays."""
    at = poles(system)
    return bool(np.all(at.real < 0.0 if system.dt is None else np.abs(at) < 1.0))


def frequency_response(system: System, omega: Array) -> Complex:
    """G(j omega), or G(e^(j omega dt)), with the exact dead time.

    Args:
        system: of one input and one output.
        omega: (n,) rad/s.

    Returns:
        (n,) complex.

    >>> frequency_response(first_order(2.0, 0.0, 0.5), np.array([np.pi])).round(9)
    array([0.-2.j])
    """
    omega = np.asarray(omega, dtype=np.float64)
    at = 1j * omega if system.dt is None else np.exp(1j * omega * system.dt)
    with np.errstate(divide="ignore", invalid="ignore"):
        rational = np.atleast_1d(_tf(system)(at, warn_infinite=False))
    out: Complex = rational * np.exp(-1j * omega * system.dead_time)
    return out


def step_response(system: System, t: Array) -> Array:
    """Answer to a unit step at 0, exact dead time.

    Args:
        system: continuous, or sampled with `t` at its instants.
        t: (n,) s, evenly spaced from 0.
    """
    import control

    _, y = control.step_response(_tf(system), t)
    out: Array = np.interp(t - system.dead_time, t, np.squeeze(y), left=0.0)
    return out


def series(*systems: System) -> System:
    """The product of systems; dead times add.

    Raises:
        ValueError: systems of different sample intervals.

    >>> series(first_order(2.0, 0.5, 0.1), first_order(3.0, 0.0, 0.2)).num
    (6.0,)
    """
    num, den = systems[0].num, systems[0].den
    for system in systems[1:]:
        _same_time(systems[0], system)
        num, den = _tuple(np.polymul(num, system.num)), _tuple(np.polymul(den, system.den))
    return System(num, den, systems[0].dt, math.fsum(s.dead_time for s in systems))


def rational(system: System) -> System:
    """The dead time as a Padé approximant of order `PADE_ORDER`; of a sampled system as whole samples."""
    import control

    if not system.dead_time:
        return system
    if system.dt is not None:
        delay = np.array([1.0] + [0.0] * round(system.dead_time / system.dt))
        return System(system.num, _tuple(np.polymul(system.den, delay)), system.dt)
    num, den = control.pade(system.dead_time, PADE_ORDER)
    return System(_tuple(np.polymul(system.num, num)), _tuple(np.polymul(system.den, den)))


# --- margins -----------------------------------------------------------------------------------------------


def margins(omega: Array, response: Complex) -> Margins:
    """Margins from a frequency response, between whose frequencies python-control interpolates by splines.

    They say how far a *stable* loop is from instability, not whether it is stable.

    Args:
        omega: (n,) rad/s, rising, of some hundred frequencies about the crossovers.
        response: (n,) of the loop, with its exact dead times.

    >>> w = np.geomspace(0.1, 100.0, 400)
    >>> m = margins(w, frequency_response(System((1.0,), (1.0, 0.0), dead_time=0.5), w))  # e^(-0.5 s) / s
    >>> round(m.gain_margin, 4), round(m.phase_margin_deg, 2), round(m.delay_margin_s, 4)  # pi, 90 - 28.65, pi/2 - 0.5
    (3.1416, 61.35, 1.0708)
    """
    import control

    frd = control.frd(response, omega, smooth=True)
    gains, phases, moduli, w180, wc, _ = control.stability_margins(frd, returnall=True)
    gains, phases, moduli, w180, wc = (np.atleast_1d(x) for x in (gains, phases, moduli, w180, wc))
    with np.errstate(divide="ignore"):
        nearest = int(np.argmin(np.abs(np.log(gains)))) if len(gains) else -1
    smallest = int(np.argmin(np.abs(phases))) if len(phases) else -1
    # a dead time turns L clockwise, so that a phase of less than -180 degrees has a whole turn to go
    delays = np.deg2rad(phases % 360.0) / wc
    return Margins(
        gain_margin=float(gains[nearest]) if len(gains) else math.inf,
        phase_margin_deg=float(phases[smallest]) if len(phases) else math.inf,
        crossover=float(wc[smallest]) if len(wc) else NAN,
        delay_margin_s=float(delays.min()) if len(delays) else math.inf,
        # at the ends of the range too, where no minimum is bracketed
        modulus_margin=float(min([*moduli, *np.abs(1.0 + response)])),
        phase_crossover=float(w180[nearest]) if len(w180) else NAN,
    )


def disk_margins(loop: System, omega: Array, skew: float = 0.0) -> DiskMargins:
    """Least disk margins over `omega`. A dead time is a Padé approximant: python-control takes no frequency responses.

    Args:
        loop: continuous or sampled, stable when closed.
        omega: (n,) rad/s.
        skew: 0 balanced, 1 for the sensitivity, -1 for the complementary sensitivity.

    >>> round(disk_margins(System((1.0,), (1.0, 0.0)), np.geomspace(0.01, 100.0, 200)).disk, 3)  # an integrator: 2
    2.0
    """
    import control

    disk, gain_db, phase = control.disk_margins(_tf(rational(loop)), np.asarray(omega), skew)
    return DiskMargins(float(disk), float(10.0 ** (gain_db / 20.0)), float(phase))


# --- reduction ---------------------------------------------------------------------------------------------


def balanced_truncation(system: System, order: int) -> BalancedTruncation | Missing:
    """Balanced truncation of a stable system (Moore 1981), or what to install for it.

    Args:
        system: stable, continuous, without dead time.
        order: of the result, below that of the system.

    Raises:
        ValueError: unstable, with a dead time, or no lower order.
    """
    import control

    if system.dead_time or not stable(system):
        raise ValueError("balanced truncation is defined for stable systems without dead time")
    states = len(np.trim_zeros(system.den, "f")) - 1
    if not 0 < order < states:
        raise ValueError(f"order {order}: choose 1 to {states - 1}")
    try:
        whole = control.ss(_tf(system))
        # roots of eigenvalues that are never negative, but for rounding errors: those of states without influence
        with np.errstate(invalid="ignore"):
            values = np.real(control.hankel_singular_values(whole))
        hankel = np.nan_to_num(np.asarray(values, dtype=np.float64), nan=0.0)
        reduced = control.balanced_reduction(whole, order)
    except (ImportError, control.exception.ControlSlycot):
        return Missing("balanced truncation", SLYCOT_REMEDY)
    return BalancedTruncation(
        System(*_polynomials(control.tf(reduced))), hankel, float(2.0 * hankel[order:].sum())
    )


# --- python-control's own types ------------------------------------------------------------------------------


def _tf(system: System) -> Any:
    """As control.TransferFunction, without the dead time."""
    import control

    return control.tf(np.array(system.num), np.array(system.den), 0 if system.dt is None else system.dt)


def _polynomials(tf: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return _tuple(np.asarray(tf.num[0][0])), _tuple(np.asarray(tf.den[0][0]))


def _tuple(x: npt.NDArray[Any]) -> tuple[float, ...]:
    return tuple(float(value) for value in np.real(x))


def _same_time(first: System, other: System) -> None:
    if first.dt != other.dt:
        raise ValueError(f"sample intervals {first.dt} and {other.dt} s")
