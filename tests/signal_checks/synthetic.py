"""Car following in a few lines, without canid's simulation: samples with the signals of a radar, wheels and satellites."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
import numpy.typing as npt

from canid.signals.signal_checks import signal_checks
from canid.values.types import Driver, LearnGate, Sample, SignalFinding

Array = npt.NDArray[np.float64]
Columns = dict[str, Array]
DT = 0.1
DRIVER = Driver()


def smooth(n: int, seconds: float, rng: np.random.Generator) -> Array:
    """A second-order lag of white noise, with standard deviation 1."""
    keep = np.exp(-DT / seconds)
    x = y = 0.0
    out = np.empty(n)
    for k, e in enumerate(rng.standard_normal(n).tolist()):
        x = keep * x + (1 - keep) * e
        y = keep * y + (1 - keep) * x
        out[k] = y
    return out / out.std()


def following(seed: int, minutes: float = 4.0) -> Columns:
    """Signals of one drive, (n,) each: the follower wants 2 s, and moves on his own account as well."""
    rng = np.random.default_rng(seed)
    n = round(minutes * 60.0 / DT)
    lead = 20.0 + 3.0 * smooth(n, 6.0, rng)
    own = 0.3 * smooth(n, 1.0, rng)
    v, gap, a, before = lead[0], 2.0 * lead[0], 0.0, 0.0
    columns = {name: np.empty(n) for name in ("gap", "range_rate", "speed", "accel", "pedal")}
    for k in range(n):
        wanted = 0.15 * (gap - 2.0 * v) / 2.0 + 0.5 * (lead[k] - v) + own[k]
        a += DT / 0.5 * (wanted - a)
        # the speed's slope at the sample; gap and speed belong to its time, not to half a step later
        row = (gap, lead[k] - v, v, 0.5 * (before + a), max(20.0 + 15.0 * a, 0.0))
        for column, value in zip(columns.values(), row, strict=True):
            column[k] = value
        faster = v + a * DT
        gap += 0.5 * DT * (lead[k] - v + lead[min(k + 1, n - 1)] - faster)
        v, before = faster, a
    columns["gnss_speed"] = columns["speed"] + 0.05 * rng.standard_normal(n)
    columns["wheel_speed"] = columns["speed"] + 0.02 * rng.standard_normal(n)
    for name, sd in (("gap", 0.15), ("range_rate", 0.08), ("speed", 0.02), ("accel", 0.05)):
        columns[name] = columns[name] + sd * rng.standard_normal(n)
    columns["brake"] = (columns["accel"] < -1.0).astype(float)
    columns["pedal"] = np.where(columns["brake"] > 0.0, 0.0, columns["pedal"])
    return columns | {"lead_valid": np.ones(n), "cruise_active": np.zeros(n)}


def samples(columns: Mapping[str, Array]) -> Iterator[Sample]:
    """The drive as the pipeline gives it; reports of gap and range rate as they are."""
    named = {**columns, "gap_reported": columns["gap"], "range_rate_reported": columns["range_rate"]}
    lists = {name: x.tolist() for name, x in named.items()}
    for k in range(len(columns["gap"])):
        signals = {name: x[k] for name, x in lists.items()}
        yield Sample(k * DT, signals["pedal"], (0.0, 0.0), LearnGate.OPEN, True, 0, signals)


def findings(
    columns: Mapping[str, Array], driver: Driver = DRIVER, *, without: tuple[str, ...] = ()
) -> tuple[SignalFinding, ...]:
    """Run the checks along a drive."""
    state, reports = signal_checks.init(), []
    for sample in samples({name: x for name, x in columns.items() if name not in without}):
        state, report = signal_checks.step(state, sample, driver, DT)
        reports += [] if report is None else [report]
    return signal_checks.episodes(reports)


def changed(role: str, what: Callable[[Array], Array], share: float = 0.0) -> Callable[[Columns], Columns]:
    """Change one signal from a share of the drive on."""

    def plant(columns: Columns) -> Columns:
        x = columns[role].copy()
        first = round(share * len(x))
        x[first:] = what(x[first:])
        return {**columns, role: x}

    return plant
