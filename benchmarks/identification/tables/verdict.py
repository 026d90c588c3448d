"""Identifiability: canid's verdict per channel against that of the Cramér-Rao bound, by the same limits."""

from __future__ import annotations

import itertools
from functools import partial

import numpy as np

from benchmarks.identification import bounds, bus, canid_side, open_loop
from benchmarks.identification.loops import LEADS, Drive, Lead
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT, NoiseModel
from benchmarks.identification.open_loop import HISTORY, Case
from benchmarks.identification.table import Settings, Table, each
from benchmarks.identification.tables.following import LOOPS, seen_by_canid
from canid.mathematics.estimators.fopdt import FopdtSettings
from canid.values.types import Identifiable

ORDER = (Identifiable.OK, Identifiable.SUM_ONLY, Identifiable.GAIN_ONLY, Identifiable.NOT)
CUTS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # Hz
TAUS = (0.03, 0.15, 0.685)  # s
# s; canid's own default box
BOX = (FopdtSettings().tau_max, FopdtSettings().dead_time_max)
# sd beyond these is a case nobody disputes; between them a run's own luck decides on which side it falls
NEAR = 1.25


def table(settings: Settings) -> list[Table]:
    """Print agreement, and how often canid says more than the bound."""
    closed = [_closed(settings, how) for how in ("exact", "canid")]
    wrong, of = (sum(row[k] for _, *row in closed) for k in (0, 1))
    return [
        Table(
            "canid's verdict against that of the Cramér-Rao bound",
            (
                "data",
                "verdicts",
                "agreement %",
                "the same, clear cases",
                "canid says more %",
                '"ok", bound says no',
                "agreement %, bound without box",
            ),
            [_open(settings), *(cells for cells, *_ in closed)],
            (
                f"Car following: 60 s, loops {' and '.join(LOOPS)}, leads {', '.join(x.name for x in LEADS)}, both "
                f"channels. Clear: not within {NEAR} of a limit. The bound knows that tau ends at {BOX[0]} s and dead time "
                f"at {BOX[1]} s; the last column is of the bound that lets them be anything. "
                f'Headway channel "ok" where even that bound says no: {wrong} of {of}.',
            ),
        )
    ]


def _open(settings: Settings) -> tuple[object, ...]:
    cases = [
        Case(noise, cut, tau=tau, decibel=decibel, seconds=seconds)
        for noise, cut, tau, decibel, seconds in itertools.product(
            NOISE_MODELS, CUTS, TAUS, (10.0, 20.0), (20.0, 60.0)
        )
    ]
    # every case is another world: runs are spread over them
    per_case = max(1, settings.runs // 20)
    cases = cases if settings.runs >= 20 else cases[:: max(len(cases) // (4 * settings.runs), 1)]
    done = []
    for case in cases:
        done += each(settings._replace(runs=per_case), _one, case)
    return (*_agreement(f"One input at 10 Hz, {len(cases)} cases", done), "–")


def _one(seed: int, case: Case) -> tuple[Identifiable, Identifiable, bool]:
    run = open_loop.process(seed, case, every=10)
    # the bound sees the input as it was, and the output where canid sees it
    fine = open_loop.process(seed, case._replace(noise=NoiseModel("none", white=1.0)))
    truth = bounds.Lag(run.K, run.tau, run.dead_time)
    bound = bounds.process([fine.u], [truth], fine.dt, run.sigma, case.noise, fine.settle, 10)[0]
    ours = canid_side.process(run.y, run.u[:, None], run.dt).channels[0].status
    return bounds.says(truth, bound), ours, _near(truth, bound)


def _closed(settings: Settings, how: str) -> tuple[tuple[object, ...], int, int]:
    """Return the row, and how often of how many the headway channel is "ok" where the bound without a box says no."""
    done = []
    # K1's channel is the point of it: both are judged
    for loop, lead in itertools.product(LOOPS, LEADS):
        for pair in each(settings.few(4), _two, loop, lead, how):
            done += [(*row, i) for i, row in enumerate(pair)]
    way = "through a noisy radar" if how == "canid" else "inputs without sensor"
    headway = [row for row in done if row[4] == 0]
    wrong = sum(ours is Identifiable.OK and alone is not Identifiable.OK for _, ours, _, alone, _ in headway)
    same = 100.0 * float(np.mean([ours is alone for _, ours, _, alone, _ in done]))
    cells = _agreement(f"Car following, {way}", [row[:3] for row in done])
    return (*cells, f"{same:.1f}"), wrong, len(headway)


def _two(
    seed: int, loop: str, lead: Lead, how: str
) -> list[tuple[Identifiable, Identifiable, bool, Identifiable]]:
    drive: Drive = LOOPS[loop](seed, 67.0, lead=lead)
    keep = round((60.0 + HISTORY) / drive.dt)
    cut = drive._replace(
        **{x: getattr(drive, x)[-keep:] for x in ("pedal", "brake", "speed", "gap", "range_rate", "exact")}
    )
    # the bound leaves masked samples out too
    limit = partial(
        bounds.process,
        cut.inputs,
        cut.channels,
        cut.dt,
        cut.sigma,
        REMNANT,
        round(HISTORY / cut.dt),
        round(bus.GRID / cut.dt),
        usable=cut.exact,
    )
    boxed, free = limit(box=BOX), limit()
    seen = seen_by_canid(drive, seed) if how == "canid" else bus.exactly(cut)
    fit = canid_side.process(seen.output, seen.inputs, bus.GRID, seen.usable, seen.segment)
    return [
        (bounds.says(truth, bound), channel.status, _near(truth, bound), bounds.says(truth, alone))
        for truth, bound, alone, channel in zip(cut.channels, boxed, free, fit.channels, strict=True)
    ]


def _near(truth: bounds.Lag, bound: bounds.Bound) -> bool:
    """Whether the bound's verdict hangs on less than a quarter: there the runs' own luck decides."""
    verdicts = {bounds.says(truth, bounds.Bound(*(x * f for x in bound))) for f in (1.0 / NEAR, 1.0, NEAR)}
    return len(verdicts) > 1


def _agreement(name: str, done: list[tuple[Identifiable, Identifiable, bool]]) -> tuple[object, ...]:
    same = float(np.mean([bound is ours for bound, ours, _ in done]))
    clear = [bound is ours for bound, ours, near in done if not near]
    bold = sum(ORDER.index(ours) < ORDER.index(bound) for bound, ours, _ in done)
    ok = sum(ours is Identifiable.OK and bound is not Identifiable.OK for bound, ours, _ in done)
    shares = (same, float(np.mean(clear)) if clear else np.nan, bold / len(done))
    return (name, len(done), *(f"{100 * share:.1f}" for share in shares), ok)
