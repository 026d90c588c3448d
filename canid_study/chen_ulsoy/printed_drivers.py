"""Drivers that agree with all that Chen & Ulsoy 2001 print (Tables 1, 2, Fig. 12), simulated in closed loop.

Drawn from `steering_distribution.py`; neither c1, the noise of the driver nor the disturbance is printed, so
that they are settings. The paper's input is the lateral error, canid's the offset, of the other sign.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

import numpy as np

from canid.models.effects import LANE_CATALOGUE, NOT_IN_ARMAX
from canid.models.simulation import Simulation
from canid.models.simulation.car import Car
from canid.models.simulation.lane import Steering, keep_lane
from canid.models.simulation.planted_effects import Strength
from canid.values.types import Array
from canid_study.chen_ulsoy import steering_distribution
from canid_study.chen_ulsoy.segment_fits import reasonable
from canid_study.chen_ulsoy.steering_distribution import Parameters
from canid_study.printed_numbers import STEERING_TABLES

TABLE_2 = Parameters(
    m1=1.37916, lns1=-0.524852, m2=0.160339, lns2=0.0447736, atanh_r=-4.27203,
    mb=1.22429, lnsb=-0.819203, mz=-1.43748, lnsz=-0.264745, atanh_rb=0.0374699,
)  # fmt: skip

# m/s, steering ratio, m, s: of the car that the simulation drives, see models/simulation/lane.py
_SPEED, _RATIO, _WHEELBASE, _YAW_LAG = 25.0, 15.0, 2.7, 0.15

Kind = Literal["minutes", "constant"]
# of C, not printed: the results are shown over them
C1 = (-0.3, 0.0, 0.3)


class Loop(NamedTuple):
    """What the paper does not print.

    Example:
        >>> Loop(c1=-0.3).noise_sd
        0.25
    """

    c1: float = 0.0  # of C; the middle of those that are tried
    noise_sd: float = 0.25  # degrees, of e
    push_sd: float = 0.25  # m/s², of what wind and road push to the side: moves the car by some 0.4 m


def drives(
    seed: int,
    drivers: int = 12,
    minutes: float = 120.0,
    *,
    kind: Kind = "minutes",
    loop: Loop = Loop(),  # noqa: B008
    hide: Mapping[str, Strength] | None = None,
) -> Iterator[tuple[str, Simulation]]:
    """Simulate the printed drivers.

    Args:
        seed: of all of them.
        drivers: how many.
        minutes: of each; the first is not analysed.
        kind: "minutes": a new model each minute, of Table 2's distribution; "constant": each driver has one, drawn once.
        loop: what is not printed.
        hide: effects of the lane catalogue to plant, as in `canid.simulate`; then every driver has the means of Table 1,
            which keep the lane with a lag or a dead zone as well, and "constant" is meant.

    Yields:
        A name and the drive. Its truth holds "models" (minutes, 4), a1, a2, b1, b2 in the paper's sign, "kind" and "loop".

    Raises:
        ValueError: an unknown kind.

    Example:
        >>> name, drive = next(drives(1, drivers=1, minutes=0.5, kind="constant"))
        >>> name, len(drive.truth["models"]), sorted(drive.truth["loop"])
        ('driver 1', 1, ['c1', 'noise_sd', 'push_sd'])
    """
    if kind not in ("minutes", "constant"):
        raise ValueError(f"kind {kind!r}: minutes or constant")
    count = max(int(np.ceil(minutes)), 1)
    for number in range(drivers):
        rng = np.random.default_rng([seed, number])
        models = (
            np.array([STEERING_TABLES[0].mean])
            if hide
            else draw_stable(TABLE_2, rng, count if kind == "minutes" else 1)
        )
        schedule = tuple(_steering(model, loop) for model in models)
        made = keep_lane(
            minutes,
            1000 * seed + number,
            schedule[0],
            Car(),
            hide or {},
            LANE_CATALOGUE,
            0.0,
            schedule,
            loop.push_sd,
        )
        truth = made.truth | {
            "models": models.tolist(),
            "kind": "constant" if hide else kind,
            "loop": loop._asdict(),
        }
        yield f"driver {number + 1}", made._replace(truth=truth)


def reproduction_drives(
    seed: int,
    drivers: int = 12,
    minutes: float = 120.0,
    c1: float | None = None,
    push_sd: float = Loop().push_sd,
) -> Iterator[tuple[str, Simulation]]:
    """All drives of `--reproduce`: drivers who change, at each c1; as many who do not; a second lag and a dead zone.

    Args:
        seed: of all.
        drivers: of each kind.
        minutes: of each.
        c1: the only one; None: each of `C1`.
        push_sd: m/s².

    Yields:
        As `drives`, `count(drivers, c1)` of them.

    Example:
        >>> [name for name, _ in reproduction_drives(1, 1, 0.2, 0.3)][:2]
        ['c1 0.3, driver 1', 'constant, driver 1']
    """
    values = C1 if c1 is None else (c1,)
    for value in values:
        for name, drive in drives(seed, drivers, minutes, loop=Loop(value, push_sd=push_sd)):
            yield f"c1 {value:g}, {name}", drive
    middle = Loop(values[len(values) // 2], push_sd=push_sd)
    for name, drive in drives(seed + 1, drivers, minutes, kind="constant", loop=middle):
        yield f"constant, {name}", drive
    for effect, strength in NOT_IN_ARMAX.items():
        for name, drive in drives(seed + 2, 1, minutes, loop=middle, hide={effect: strength}):
            yield f"{effect}, {name}", drive


def count(drivers: int, c1: float | None = None) -> int:
    """Drives that `reproduction_drives` makes.

    >>> count(12), count(12, 0.3)
    (50, 26)
    """
    return drivers * ((len(C1) if c1 is None else 1) + 1) + len(NOT_IN_ARMAX)


def draw_stable(parameters: Parameters, rng: np.random.Generator, n: int) -> Array:
    """Draw models (n, 4) with which the simulated car stays in its lane: 2 to 3 % do not, and are drawn again.

    >>> draw_stable(TABLE_2, np.random.default_rng(0), 3).shape
    (3, 4)
    """
    models: list[Array] = []
    while len(models) < n:
        for model in steering_distribution.draw(parameters, rng, n).T:
            if len(models) < n and reasonable(model[None])[0] and _keeps_the_lane(model):
                models.append(model)
    return np.array(models)


def _steering(model: Array, loop: Loop) -> Steering:
    a1, a2, b1, b2 = (float(x) for x in model)
    return Steering((a1, a2), (-b1, -b2), loop.c1, loop.noise_sd)


def _keeps_the_lane(model: Array) -> bool:
    """Roots of the loop of driver and simulated car, sampled at 10 Hz with the wheel turning evenly between decisions."""
    dt = 0.1
    # states: yaw rate, heading, error; the wheel's ramp adds the response to its slope
    k = _SPEED * np.pi / 180.0 / (_RATIO * _WHEELBASE)
    A = np.array([[-1.0 / _YAW_LAG, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, _SPEED, 0.0]])
    B = np.array([k / _YAW_LAG, 0.0, 0.0])
    from scipy.linalg import expm

    block = np.zeros((5, 5))
    block[:3, :3], block[:3, 3], block[3, 4] = A, B, 1.0 / dt
    E = expm(block * dt)
    F, now, slope = E[:3, :3], E[:3, 3], E[:3, 4]
    # the angle goes from d to next within the step: now * d + slope * (next - d)
    a1, a2, b1, b2 = model
    # states: yaw rate, heading, position; angle and the one before; position before
    M = np.zeros((6, 6))
    to_next = np.array([0.0, 0.0, -b1, -a1, -a2, -b2])
    M[:3, :3] = F
    M[:3, 3] = now - slope
    M[:3] += np.outer(slope, to_next)
    M[3] = to_next
    M[4, 3] = 1.0
    M[5, 2] = 1.0
    return bool(np.abs(np.linalg.eigvals(M)).max() < 1.0)
