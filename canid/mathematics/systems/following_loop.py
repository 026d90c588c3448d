"""The car-following loop of a driver with a car: transfer function, stability margins, string stability.

Linearised about a speed v0 and a headway h (Grover 2021, eq. 2.1, 2.6 to 2.9, with the car P(s) = b / (1 + lag s) of the
output and damping d):

    v (s + d) = P [K1 L1 (gap - h v) / v0 + K2 L2 (v_lead - v)],   s gap = v_lead - v,   L = e^(-dead_time s) / (1 + tau s)

so that the loop is  L(s) = P [K1 L1 (1 + h s) / v0 + K2 L2 s] / (s (s + d)),  and what reaches the follower of the lead's
speed is  v / v_lead = P [K1 L1 / v0 + K2 L2 s] / (s (s + d) (1 + L)).  A column of vehicles amplifies where that exceeds 1
(string stability; Swaroop & Hedrick 1996). All dead times are exact, and many drivers are computed at once in numpy, which
takes some hundredths of a second: python-control (`control_systems.py`) is the tests' second route.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import closed_loop_stability
from canid.mathematics.identification.closed_loop_stability import VehicleLoop
from canid.values.types import Array

Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]

# rad/s of the lowest frequency: a period of 1 h 45 min, below which no drive says anything
LOWEST = 1e-3
# rad/s of the highest: a driver and a car let nothing through there
HIGHEST = 300.0
# frequencies that are searched, 1/40 octave apart at the crossovers; what is found is refined on the exact loop
FREQUENCIES = 700
# bisections: 2^-40 of a spacing
BISECTIONS = 40
# golden sections of two spacings, to 1e-6 of them: the extremum itself is then exact to 1e-12
SECTIONS = 30
# |v / v_lead| less 1 from which on a loop is said to amplify: beyond the rounding of a curve that begins at 1
AMPLIFIES = 1e-6


class FollowingLoop(NamedTuple):
    """k drivers with their cars.

    Example:
        >>> driver = FollowingLoop(np.array([[7.8095, 6.654]]), np.array([[0.141, 0.144]]), np.zeros((1, 2)), 15.0, 2.0,
        ...     strength=np.array([0.04]), lag=np.array([0.3]), damping=np.array([0.05]))  # Grover 2021, Table 1
        >>> round(float(margins(driver).phase_margin_deg[0]), 2)
        79.0
    """

    K: Array  # (k, 2) output unit per s of headway error, and per m/s of range rate
    tau: Array  # (k, 2) s
    dead_time: Array  # (k, 2) s
    speed: float  # m/s, about which it is linearised
    headway: float  # s
    strength: Array = np.ones(1)  # (k,) or (1,) m/s² per output unit
    lag: Array = np.zeros(1)  # (k,) or (1,) s
    damping: Array = np.zeros(1)  # (k,) or (1,) 1/s


class LoopMargins(NamedTuple):
    """Of k loops. An unstable loop has no margin: gain margin 1, the others 0, an infinite peak."""

    gain_margin: Array  # (k,) factor; of several the one nearest to 1; inf: none
    phase_margin_deg: Array  # (k,) smallest; inf: the loop's gain never is 1
    crossover: Array  # (k,) rad/s, where it is; NaN: nowhere
    delay_margin_s: Array  # (k,) least dead time more that makes it unstable
    modulus_margin: Array  # (k,) least |1 + L|
    string_peak: Array  # (k,) largest |v / v_lead|, 1 at least: at frequency 0 it is 1
    string_peak_hz: Array  # (k,) where; 0: nothing is amplified
    unstable: npt.NDArray[np.bool_]  # (k,)


def loop_transfer(loop: FollowingLoop, omega: Array) -> Complex:
    """L(j omega).

    Args:
        loop: k drivers.
        omega: (n,) or (k, n) rad/s, above 0.

    Returns:
        (k, n).
    """
    s: Complex = (1j * np.atleast_2d(omega)).astype(np.complex128)
    first, second = _responses(loop, s)
    out: Complex = (first * (1.0 + loop.headway * s) + second) / (s * (s + loop.damping[:, None]))
    return out


def string_transfer(loop: FollowingLoop, omega: Array) -> Complex:
    """Follower's speed over the lead's at j omega, (k, n); arguments as of `loop_transfer`."""
    s: Complex = (1j * np.atleast_2d(omega)).astype(np.complex128)
    first, second = _responses(loop, s)
    both = first * (1.0 + loop.headway * s) + second
    out: Complex = (first + second) / (s * (s + loop.damping[:, None]) + both)
    return out


def _responses(loop: FollowingLoop, s: Complex) -> tuple[Complex, Complex]:
    """Car and answer to the gap, and car and answer to range rate times s, each (k, n)."""
    car = loop.strength[:, None] / (1.0 + loop.lag[:, None] * s)
    first, second = (
        loop.K[:, i, None] * np.exp(-loop.dead_time[:, i, None] * s) / (1.0 + loop.tau[:, i, None] * s) * car
        for i in (0, 1)
    )
    return first / loop.speed, second * s


def unstable(loop: FollowingLoop) -> npt.NDArray[np.bool_]:
    """Whether each loop has growing modes, (k,): by the argument principle, with exact dead times."""
    k = len(loop.K)
    cars = (np.broadcast_to(x, (k,)) for x in (loop.strength, loop.lag, loop.damping))
    return np.array(
        [
            closed_loop_stability.unstable_roots(
                loop.K[i : i + 1],
                loop.tau[i : i + 1],
                loop.dead_time[i : i + 1],
                loop.speed,
                loop.headway,
                VehicleLoop(*car),
            )[0]
            > 0
            for i, car in enumerate(zip(*(x.tolist() for x in cars), strict=True))
        ],
        dtype=np.bool_,
    )


def margins(loop: FollowingLoop) -> LoopMargins:
    """Margins and string stability of k loops.

    Args:
        loop: k drivers.

    Example:
        >>> slow = FollowingLoop(np.array([[0.3, 0.6]]), np.full((1, 2), 0.4), np.full((1, 2), 0.5), 20.0, 1.5)
        >>> stable = margins(slow)  # of an acceleration
        >>> round(float(stable.delay_margin_s[0]), 2), round(float(stable.string_peak[0]), 3)
        (1.64, 1.021)
    """
    k = len(loop.K)
    omega = np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
    L = loop_transfer(loop, omega)
    gain, phase, delay = np.full(k, np.inf), np.full(k, np.inf), np.full(k, np.inf)
    crossover = np.full(k, np.nan)

    # |L| = 1: phase and delay margin
    numbers, at = _roots(loop, omega, np.log(np.abs(L)), lambda x: np.log(np.abs(x)))
    angle = np.angle(-_each(loop, numbers, at))  # from the negative real axis
    for i, w, a in zip(numbers.tolist(), at.tolist(), angle.tolist(), strict=True):
        if abs(a) < abs(np.deg2rad(phase[i])):
            phase[i], crossover[i] = np.rad2deg(a), w
        delay[i] = min(delay[i], a % (2.0 * np.pi) / w)

    # L on the negative real axis: gain margin
    numbers, at = _roots(loop, omega, L.imag, lambda x: x.imag)
    on_axis = _each(loop, numbers, at).real
    for i, x in zip(numbers.tolist(), on_axis.tolist(), strict=True):
        if x < 0.0 and abs(np.log(-x)) < abs(np.log(gain[i])):
            gain[i] = -1.0 / x

    modulus = -_largest(
        loop, omega, -np.abs(1.0 + L), lambda loops, w: -np.abs(1.0 + loop_transfer(loops, w))
    )[0]
    peak, peak_at = _largest(
        loop, omega, np.abs(string_transfer(loop, omega)), lambda loops, w: np.abs(string_transfer(loops, w))
    )
    amplifies = peak > 1.0 + AMPLIFIES
    bad = unstable(loop)
    return LoopMargins(
        gain_margin=np.where(bad, 1.0, gain),
        phase_margin_deg=np.where(bad, 0.0, phase),
        crossover=crossover,
        delay_margin_s=np.where(bad, 0.0, delay),
        modulus_margin=np.where(bad, 0.0, np.minimum(modulus, 1.0)),
        string_peak=np.where(bad, np.inf, np.where(amplifies, peak, 1.0)),
        string_peak_hz=np.where(amplifies & ~bad, peak_at / (2.0 * np.pi), 0.0),
        unstable=bad,
    )


def _each(loop: FollowingLoop, numbers: Index, at: Array) -> Complex:
    """L of driver numbers[i] at frequency at[i], (r,)."""
    return loop_transfer(chosen(loop, numbers), at[:, None])[:, 0]


def chosen(loop: FollowingLoop, numbers: Index) -> FollowingLoop:
    """The loops with the given numbers.

    Args:
        loop: k drivers.
        numbers: (r,) each below k.
    """
    k = len(loop.K)
    cars = [np.broadcast_to(x, (k,))[numbers] for x in (loop.strength, loop.lag, loop.damping)]
    return FollowingLoop(
        loop.K[numbers], loop.tau[numbers], loop.dead_time[numbers], loop.speed, loop.headway, *cars
    )


def _roots(
    loop: FollowingLoop, omega: Array, values: Array, function: Callable[[Complex], Array]
) -> tuple[Index, Array]:
    """Frequencies at which a function of L changes its sign, by bisection on the exact loop.

    Args:
        loop: k drivers.
        omega: (n,) rad/s.
        values: (k, n) of the function.
        function: of L.

    Returns:
        (r,) numbers of drivers and (r,) rad/s.
    """
    numbers, left = np.nonzero(np.signbit(values[:, :-1]) != np.signbit(values[:, 1:]))
    low, high = omega[left], omega[left + 1]
    sign = np.signbit(values[numbers, left])
    few = chosen(loop, numbers)
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        before = np.signbit(function(loop_transfer(few, middle[:, None])[:, 0])) == sign
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return numbers, np.sqrt(low * high)


def _largest(
    loop: FollowingLoop, omega: Array, values: Array, function: Callable[[FollowingLoop, Array], Array]
) -> tuple[Array, Array]:
    """Largest value over the frequencies and where, (k,) each, by golden sections about the largest on the grid."""
    at = np.argmax(values, axis=1)
    low = np.log(omega[np.maximum(at - 1, 0)])
    high = np.log(omega[np.minimum(at + 1, len(omega) - 1)])
    share = 0.5 * (5.0**0.5 - 1.0)
    for _ in range(SECTIONS):
        a, b = high - share * (high - low), low + share * (high - low)
        both = function(loop, np.exp(np.column_stack([a, b])))
        left = both[:, 0] > both[:, 1]
        low, high = np.where(left, low, a), np.where(left, b, high)
    middle = np.exp(0.5 * (low + high))
    return function(loop, middle[:, None])[:, 0], middle
