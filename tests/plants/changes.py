"""What begins in the middle of a planted drive: another driver, another car, a sensor that fails.

The planting simulators change a driver's gains at an instant; the rest is made of two drives or of what is measured. Two
drives of one seed share the lead, the road and all noise, so one goes over into the other where both are equally fast;
the radar is blind for a second there, for the gaps differ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from tests.plants.planted_drive import Array, Plant, Planted

# s about the requested time, within which two drives may go over into each other
SEARCH_S = 15.0
# s in which the radar sees nobody where two drives meet
BLIND_S = 1.0


class Scene(NamedTuple):
    """A drive that is to change."""

    plant: Plant
    how: Mapping[str, Any]  # seed, minutes, noise, profile
    at: float  # s


class Changed(NamedTuple):
    """A drive that changes."""

    drive: Planted
    at: float  # s, when it really does


class Change(NamedTuple):
    """One kind of change."""

    name: str
    block: str  # of the loop, in which it happens
    make: Callable[[Scene], Changed]


def _gains(share: float) -> Callable[[Scene], Changed]:
    """He answers less strongly."""

    def make(of: Scene) -> Changed:
        return Changed(of.plant({"gain_change": {"share": share, "time": of.at}}, **of.how), of.at)

    return make


def _driver(number: Callable[[Mapping[str, float]], Mapping[str, float]]) -> Callable[[Scene], Changed]:
    return lambda of: _spliced(of, lambda truth: number(truth["driver"]))


def _car(share: float) -> Callable[[Scene], Changed]:
    """The engine pulls otherwise; its gain goes by two names."""

    def changes(truth: Mapping[str, Any]) -> Mapping[str, float]:
        name = "power" if "power" in truth["car"] else "gain"
        return {name: share * truth["car"][name]}

    return lambda of: _spliced(of, changes)


def _spliced(of: Scene, changes: Callable[[Mapping[str, Any]], Mapping[str, float]]) -> Changed:
    before = of.plant({}, **of.how)
    offset = {"offset": before.truth["driver"]["offset"]}
    after = of.plant({}, **of.how, **{**offset, **changes(before.truth)})
    a, b = before.columns, after.columns
    near = np.flatnonzero(np.abs(a["t"] - of.at) < SEARCH_S)
    apart = np.abs(a["speed"] - b["speed"]) + 0.1 * np.abs(a["pedal"] - b["pedal"])
    cut = int(near[np.argmin(apart[near])])
    columns = {role: np.concatenate([a[role][:cut], b[role][cut:]]) for role in a}
    at = float(a["t"][cut])
    blind = (a["t"] >= at) & (a["t"] < at + BLIND_S)
    columns |= {"t": a["t"], "lead_valid": np.where(blind, 0.0, columns["lead_valid"])}
    return Changed(before._replace(columns=columns), at)


def _measured(role: str, wrong: Callable[[Array], Array]) -> Callable[[Scene], Changed]:
    """A sensor measures something else from then on."""

    def make(of: Scene) -> Changed:
        drive = of.plant({}, **of.how)
        x = drive.columns[role]
        seen = np.where(drive.columns["t"] >= of.at, wrong(x), x)
        return Changed(drive._replace(columns=drive.columns | {role: seen}), of.at)

    return make


def _frozen(signal: int) -> Callable[[Scene], Changed]:
    """A sender repeats itself to the end of the drive; `signal` as in `planted.FREEZES`."""

    def make(of: Scene) -> Changed:
        drive = of.plant({}, **of.how)
        end = float(drive.columns["t"][-1]) + 1.0
        effects = {"stale_signal": {"signal": float(signal)}}
        truth = drive.truth | {"effects": effects, "episodes": {"stale_signal": [[of.at, end]]}}
        return Changed(drive._replace(truth=truth), of.at)

    return make


CHANGES = (
    Change("gains fall by 30 %", "driver", _gains(0.3)),
    Change("gains fall by 60 %", "driver", _gains(0.6)),
    Change(
        "another driver, gains doubled", "driver", _driver(lambda d: {k: 2.0 * d[k] for k in ("K1", "K2")})
    ),
    Change(
        "reacts 0.6 s later",
        "driver",
        _driver(lambda d: {k: d[k] + 0.6 for k in ("dead_time1", "dead_time2")}),
    ),
    Change("engine pulls 40 % less", "vehicle", _car(0.6)),
    Change("engine pulls 60 % more", "vehicle", _car(1.6)),
    Change("range rate off by 30 %", "sensing", _measured("range_rate", lambda x: 1.3 * x)),
    Change("range rate with the wrong sign", "sensing", _measured("range_rate", lambda x: -x)),
    Change("speed reads 8 % more", "sensing", _measured("speed", lambda x: 1.08 * x)),
    Change("pedal stands still", "sensing", _frozen(0)),
    Change("speed stands still", "sensing", _frozen(1)),
    Change("gap and range rate stand still", "sensing", _frozen(2)),
)
