"""How many more seconds of driving would do: the forecast against what it took."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.identification import acceleration, canid_side
from benchmarks.identification.acceleration import DT
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT
from benchmarks.identification.table import Settings, Table, each
from canid.values.types import Channel, Identifiable, OutputFilter

MINUTES = 20.0
STEP = 1.12  # the drive grows by this factor from one fit to the next
FIRST = 30.0  # s of the first
LEAST = 30.0  # s to go; the fits are 4 to 130 s apart
ORDER = (Identifiable.NOT, Identifiable.GAIN_ONLY, Identifiable.SUM_ONLY, Identifiable.OK)
NOISES = (*NOISE_MODELS, REMNANT)
# Shares of the way to the next status. At a half alone "as long again as so far" would always be right.
SHARES = (0.5, 0.25, 0.75)
KINDS = ("K", "tau_plus_dead_time", "tau", "dead_time")


class Forecast(NamedTuple):
    """One forecast and what became of it."""

    channel: str
    parameter: str  # that was missing
    share: float  # of the way to the next status at which it was made
    ratio: float  # forecast over what it took; NaN: none was given
    as_long_again: float  # the same of the time so far


def table(settings: Settings) -> list[Table]:
    """Forecasts at three shares of the way to a channel's next status, at least half a minute before it."""
    found = [forecast for one in each(settings, _one) for forecast in one]
    rows: list[tuple[object, ...]] = []
    for name in ("headway error", "range rate"):
        for kind in KINDS:
            of_kind = [f for f in found if f.channel == name and f.parameter == kind]
            rows += [(f"{name}: {kind}", *_summary(of_kind))] if of_kind else []
    rows.append(("all delays", *_summary([f for f in found if f.parameter != "K"])))
    rows.append(("all", *_summary(found)))
    again = [f._replace(ratio=f.as_long_again) for f in found]
    rows.append(('"as long again as so far"', *_summary(again)))
    return [
        Table(
            f"Forecast over what it took, drives of up to {MINUTES:.0f} min, six noises",
            (
                "missing",
                "half of the way",
                "no forecast",
                "median",
                "within a factor of 2",
                "at a quarter",
                "at three quarters",
            ),
            rows,
        )
    ]


def _summary(found: list[Forecast]) -> tuple[float, ...]:
    """Cases at a half, those without a forecast, median, and per share of the way how many are within a factor of 2."""
    at = [np.array([f.ratio for f in found if f.share == share]) for share in SHARES]
    given = [ratios[np.isfinite(ratios)] for ratios in at]
    within = [float(np.mean((r >= 0.5) & (r <= 2.0))) if len(r) else np.nan for r in given]
    median = float(np.median(given[0])) if len(given[0]) else np.nan
    return len(at[0]), len(at[0]) - len(given[0]), median, *within


def _one(seed: int) -> list[Forecast]:
    drive = acceleration.drive(seed, MINUTES, NOISES[seed % len(NOISES)])
    y = drive.acceleration + np.random.default_rng((seed, 2)).normal(0.0, 0.02, len(drive.acceleration))
    times = FIRST * STEP ** np.arange(int(np.log(MINUTES * 60.0 / FIRST) / np.log(STEP)) + 1)
    fits = [_channels(y, drive.inputs, round(t / DT)) for t in times]
    out = []
    for i, name in enumerate(("headway error", "range rate")):
        rank = [ORDER.index(fit[i].status) for fit in fits]
        for level in range(1, len(ORDER)):
            reached = next((k for k in range(len(rank)) if min(rank[k : k + 3]) >= level), None)
            if not reached:
                continue
            for share in SHARES:
                at = int(np.searchsorted(times, share * times[reached]))
                taken, missing = times[reached] - times[at], fits[at][i].progress
                early = share * times[reached] < FIRST / STEP  # there was no fit at this share
                if not early and taken >= LEAST and rank[at] == level - 1 and missing is not None:
                    ratios = missing.seconds / taken, times[at] / taken
                    out.append(Forecast(name, missing.parameter, share, *ratios))
    return out


def _channels(y: np.ndarray, u: np.ndarray, n: int) -> tuple[Channel, ...]:
    return canid_side.process(y[:n], u[:n], DT, output_filter=OutputFilter("none")).channels
