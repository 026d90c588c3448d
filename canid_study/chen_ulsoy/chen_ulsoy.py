"""`canid study chen-ulsoy`: segments, models and uncertainties of lane keeping (Chen & Ulsoy 2001), on any logs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from canid.values.types import Trace
from canid_study.artifact import Study
from canid_study.chen_ulsoy import artifacts, between, bounds, figures, tables
from canid_study.chen_ulsoy.driver_analysis import Driver, driver_of
from canid_study.chen_ulsoy.segment_fits import NAMES
from canid_study.chen_ulsoy.settings import ChenUlsoySettings

__all__ = ["PAPER", "ChenUlsoySettings", "study"]

PAPER = "Chen & Ulsoy 2001"
TITLE = "Lane keeping: driver model and its uncertainty"
# p value below which a driver is said to change
_LEVEL = 0.01


def study(
    drivers: Mapping[str, Sequence[tuple[str, Trace]]],
    settings: ChenUlsoySettings = ChenUlsoySettings(),  # noqa: B008
    progress: Callable[[int, int], None] | None = None,
    run: Callable[..., Iterable[Any]] = map,
) -> Study:
    """Study the logs of several drivers.

    Args:
        drivers: name -> its logs, name and trace each, in time.
        settings: lengths, repetitions, speed of the assumed car.
        progress: called with the number of drivers done and their total.
        run: maps a function over drivers; a process pool's map.

    Returns:
        The study. Weak data raise nothing: `skipped` names them, and `says` what to do where nothing is left.

    Example:
        >>> from canid_study.chen_ulsoy.segments import planar_trace
        >>> made = study({"S1": [("short.blf", planar_trace(np.arange(0.0, 130.0, 0.1)))]})
        >>> made.artifacts, made.skipped[-1].what
        ((), 'the driver')
    """
    return made(analysed(drivers, settings, progress, run), settings)


def analysed(
    drivers: Mapping[str, Sequence[tuple[str, Trace]]],
    settings: ChenUlsoySettings,
    progress: Callable[[int, int], None] | None = None,
    run: Callable[..., Iterable[Any]] = map,
) -> list[Driver]:
    """Analyse each driver by itself."""
    out: list[Driver] = []
    for driver in run(driver_of, [(name, list(logs), settings) for name, logs in drivers.items()]):
        out.append(driver)
        if progress is not None:
            progress(len(out), len(drivers))
    return out


def made(analysed_drivers: Sequence[Driver], settings: ChenUlsoySettings) -> Study:
    """Combine analysed drivers."""
    good = [d for d in analysed_drivers if not d.why]
    skipped = tuple(entry for d in analysed_drivers for entry in d.skipped)
    stated = tuple((name.replace("_", " "), f"{value:g}") for name, value in settings._asdict().items())
    if not good:
        why = "; ".join(f"{d.name}: {d.why}" for d in analysed_drivers[:3]) or "no logs"
        says = (
            f"Nothing can be analysed: {why}. Lane keeping with lateral_offset and steering_angle is needed.",
        )
        return Study(PAPER, TITLE, says, (), (tables.segments(analysed_drivers),), (), skipped, stated)
    pooled = between.split(NAMES, [d.group for d in good])
    limits = bounds.bounds(good)
    robust = bounds.robust(good, limits, settings.speed)
    all_tables = (
        tables.segments(analysed_drivers),
        tables.statistics(
            "table_1",
            "Driver model parameters: each driver",
            [(d.name, part, x) for d in good for part, x in tables.halves(d).items()],
        ),
        tables.statistics(
            "table_2",
            "Driver model parameters: all drivers",
            [
                ("all", part, np.concatenate([tables.halves(d)[part] for d in good]))
                for part in ("estimation", "validation")
            ],
        ),
        tables.correlations(good),
        tables.validation(good),
        tables.structured(good, pooled),
        tables.bias(good),
        tables.stationary(good),
        tables.structures(good),
        tables.orders(good[0]),
        bounds.table(limits),
        bounds.delta_table(good),
        bounds.robust_table(robust, settings.speed),
    )
    return Study(
        PAPER,
        TITLE,
        _says(good, pooled),
        artifacts.artifacts(good, pooled, limits, robust),
        all_tables,
        figures.figures(good, limits, robust),
        skipped,
        stated,
    )


def _says(good: Sequence[Driver], pooled: Sequence[between.Split]) -> tuple[str, ...]:
    b1 = pooled[2]
    minutes = sum(len(d.number) for d in good)
    out = [
        f"{len(good)} driver{'s' if len(good) > 1 else ''}, {minutes} segments. Of the standard deviation of b1, "
        f"{b1.naive:.2f} deg/m, the fits' own error is {b1.sampling:.2f}; between segments are {b1.minutes.value:.2f} "
        f"(95 % interval {b1.minutes.low:.2f} to {b1.minutes.high:.2f})."
    ]
    # several logs of a driver differ by road and assistant as well
    known = [d.drift for d in good if d.drift is not None and d.logs == 1]
    if known:
        changed = sum(x.p_value < _LEVEL for x in known)
        out.append(f"{changed} of {len(known)} drivers change over the drive (p < {_LEVEL:g}).")
    null = [d.excess for d in good if d.excess is not None]
    if null:
        above = sum(e.frequencies > 0.0 for e in null)
        out.append(f"{above} of {len(null)} drivers have unmodeled dynamics beyond the null band of |Delta|.")
    else:
        out.append("Use --bootstraps 200 for the null band of |Delta|.")
    return tuple(out)
