"""Tables of the study, one per printed table or step (Grover 2021); intervals as x, x_low, x_high."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.values.types import Channel, Interval
from canid_study.artifact import Cell, Table
from canid_study.grover import joint
from canid_study.grover.drive_analysis import DriveAnalysis, unit_of
from canid_study.grover.episode_analysis import Analysis
from canid_study.grover.episodes import INPUTS
from canid_study.printed_numbers import GROVER_DRIVERS, SELECTION_PERCENT

WORDS = {"headway_error": "headway error", "range_rate": "range rate"}


def interval(x: Interval) -> tuple[float, float, float]:
    """Three cells."""
    return x.value, x.low, x.high


def gain(channel: Channel | None) -> tuple[Cell, ...]:
    """Gain with interval and what may be quoted; an interval is given where it is no number to quote, too."""
    if channel is None:
        return None, None, None, "no fit"
    return (*interval(channel.K), channel.status.value)


def episodes(drives: Sequence[DriveAnalysis]) -> Table:
    """The episodes of sec. 4.1."""
    columns = (
        "log", "episode", "start (s)", "length (s)", "headway (s)", "speed (m/s)", "correlation of the inputs",
        "band of headway error (Hz)", "band of range rate (Hz)", "sd of headway error (s)", "sd of range rate (m/s)",
        "sd of output", "transfer functions",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for drive in drives:
        fitted = {a.episode.number for a in drive.analyses}
        rows += [
            (
                drive.log, e.number, e.t, e.length, e.headway, e.speed, e.correlation, *e.band, *e.sd,
                "yes" if e.number in fitted else "no",
            )
            for e in drive.episodes
        ]  # fmt: skip
    note = (
        "One lead, a person at the pedal, no brake, nothing missing. Band: frequency below which 95 % of the power lies. "
        "Transfer functions are fitted to the longest episodes of each drive."
    )
    return Table("episodes", "Car-following episodes (sec. 4.1)", columns, rows, note)


def orders(drives: Sequence[DriveAnalysis], max_order: int) -> Table:
    """Percentages of fit of each order (sec. 4.2)."""
    columns = (
        "log", "episode", "input", *(f"fit of order {n} (%)" for n in range(1, max_order + 1)), "selected order",
        "fit (%)", "unstable poles", "DC gain", "slowest pole (rad/s)", "reaches 90 %",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for drive, a in _analyses(drives):
        for name, per_input in zip(INPUTS, a.inputs, strict=True):
            fits = (*per_input.fits, *([None] * (max_order - len(per_input.fits))))
            m = per_input.model
            slowest = float(np.max(m.continuous_poles.real))
            rows.append(
                (
                    drive.log, a.episode.number, WORDS[name], *fits, m.order, m.fit_percent, m.growing, m.dc_gain,
                    slowest, "yes" if m.fit_percent >= SELECTION_PERCENT else "no",
                )
            )  # fmt: skip
    note = (
        "Output error per input, percentage of fit of the simulation with a free initial state, on the data of the fit. "
        "Selected: the first order that reaches 90 %, else the best. Slowest pole: the largest real part, above 0 it grows."
    )
    return Table("orders", "Transfer functions of order 1 to 11 per input (sec. 4.2)", columns, rows, note)


def reductions(drives: Sequence[DriveAnalysis]) -> Table:
    """Reduction of each transfer function (sec. 4.3)."""
    columns = (
        "log", "episode", "input", "order", "K of P1", "tau of P1 (s)", "fit of P1 (%)", "K of P1D", "tau of P1D (s)",
        "theta of P1D (s)", "fit of P1D (%)", "K of the record", "tau of the record (s)", "theta of the record (s)",
        "fit of the record (%)", "K by balanced truncation", "tau by balanced truncation (s)", "error bound", "why none",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for drive, a in _analyses(drives):
        for name, fits in zip(INPUTS, a.inputs, strict=True):
            p, b = fits.p1, fits.truncated
            rows.append(
                (
                    drive.log, a.episode.number, WORDS[name], fits.model.order, p.K, p.tau, p.fit_percent, *fits.p1d,
                    *fits.record, b.K, b.tau, b.error_bound, b.says,
                )
            )  # fmt: skip
    note = (
        "P1 and P1D: nearest to the transfer function for the spectrum of the episode's own input; their fit is that of its "
        "response. Record: P1D fitted to the data themselves. Error bound: of balanced truncation, over all frequencies."
    )
    return Table("reductions", "Reduction to first order (sec. 4.3)", columns, rows, note)


def miso(drives: Sequence[DriveAnalysis]) -> Table:
    """Both inputs together (sec. 4.5)."""
    columns = (
        "log", "episode", "fit of headway error alone (%)", "fit of range rate alone (%)", "least possible sum (%)",
        "largest possible sum (%)", "fit of the sum (%)", "fit of the sum weighed anew (%)", "fit of the reduced sum (%)",
        "fit of the reduced sum weighed anew (%)", "fit of the joint model (%)",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (
            drive.log, a.episode.number, a.inputs[0].model.fit_percent, a.inputs[1].model.fit_percent,
            *a.together.bound, a.together.high_sum, a.together.high_refit, a.together.reduced_sum,
            a.together.reduced_refit, a.joint_fit,
        )
        for drive, a in _analyses(drives)
    ]  # fmt: skip
    note = (
        "Least and largest possible: by the triangle inequality from the two fits. Weighed anew: one factor per input, "
        "fitted to the output; the models are then no longer those that were identified."
    )
    return Table("miso", "Both inputs together (sec. 4.5, Fig. 14 to 16)", columns, rows, note)


def next_episode(drives: Sequence[DriveAnalysis]) -> Table:
    """Validation on data that were not fitted."""
    columns = (
        "log", "episode", "fit of the transfer functions (%)", "fit of the reduced (%)", "fit of the joint model (%)",
        "fit of the drive's joint model (%)",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (drive.log, a.episode.number, a.held.high, a.held.reduced, a.held.joint, a.held.joint_drive)
        for drive, a in _analyses(drives)
        if a.held is not None
    ]
    note = (
        "Each model of an episode on the next one: its first third gives the initial states, the rest is simulated and "
        "compared; -1000: it diverges. The transfer functions begin there or at rest, whichever fits better; they and the "
        "reduced models are weighed as fits their own episode best, without which their sum fits nothing. "
        "The drive's joint model has seen all episodes."
    )
    return Table("next_episode", "Percentage of fit on the next episode", columns, rows, note)


def table_1(drive: DriveAnalysis, a: Analysis) -> Table:
    """Table 1: the parameters of one record."""
    unit = unit_of(drive.output)
    columns = (
        "parameter", "unit", "published", "by his method", "joint", "joint_low", "joint_high", "joint of the drive",
        "joint of the drive_low", "joint of the drive_high", "status of the drive",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    published = GROVER_DRIVERS[0]
    printed = ((published.K1, published.tau1), (published.K2, published.tau2))
    units = (f"{unit} per s", f"{unit} per m/s")
    for number, (name, fits) in enumerate(zip(INPUTS, a.inputs, strict=True)):
        joint, whole = a.joint.channels.get(name, Channel()), drive.joint.channels.get(name, Channel())
        numbers = printed[number]
        rows += [
            (
                f"K{number + 1}", units[number], numbers[0], fits.p1.K, *interval(joint.K), *interval(whole.K),
                whole.status.value,
            ),
            (
                f"tau_d{number + 1}", "s", numbers[1], fits.p1.tau, *interval(joint.tau_plus_dead_time),
                *interval(whole.tau_plus_dead_time), whole.status.value,
            ),
        ]  # fmt: skip
    note = (
        f"Log {drive.log}, episode {a.episode.number}, the longest. Published numbers are of another car and driver. The "
        "joint tau_d is lag plus dead time, which identify together where each alone does not. Status: what may be quoted "
        "of the drive; not_identifiable: the interval is shown, no number may be quoted."
    )
    return Table("table_1", "Table 1: parameters of one record", columns, rows, note)


def table_2(drives: Sequence[DriveAnalysis]) -> Table:
    """Table 2: the parameters of several records."""
    columns = (
        "log", "record", "east (m)", "north (m)", "K1", "tau_d1 (s)", "K2", "tau_d2 (s)", "joint K1", "joint K1_low",
        "joint K1_high", "joint K1 status", "joint K2", "joint K2_low", "joint K2_high", "joint K2 status",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        ("published", p.name, None, None, p.K1, p.tau1, p.K2, p.tau2, *([None] * 8))
        for p in GROVER_DRIVERS[1:]
    ]
    for drive, a in _analyses(drives):
        first, second = (fits.p1 for fits in a.inputs)
        rows.append(
            (
                drive.log, f"episode {a.episode.number}", a.episode.east, a.episode.north, first.K, first.tau, second.K,
                second.tau, *gain(a.joint.channels.get(INPUTS[0])), *gain(a.joint.channels.get(INPUTS[1])),
            )
        )  # fmt: skip
    note = (
        "K1 in output unit per s, K2 in output unit per m/s. By his method: P1 of the selected transfer function, one fit "
        "per input. Joint: both inputs at once on the same samples, 95 % intervals."
    )
    return Table("table_2", "Table 2: parameters of several records", columns, rows, note)


def input_correlation(drives: Sequence[DriveAnalysis]) -> Table:
    """What one fit per input costs."""
    columns = (
        "log", "inputs", "correlation", "K1 per input", "K1 per input_low", "K1 per input_high",
        "K1 per input without noise", "K1 per record", "K1 per record_low", "K1 per record_high", "K1 joint",
        "K1 joint_low", "K1 joint_high", "true K1",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for drive in drives:
        if drive.cost is not None:
            rows += [
                (
                    drive.log, "recorded" if c.loop else "turned", c.correlation, *interval(c.per_input), c.expected,
                    *interval(c.per_record), *interval(c.joint), drive.cost.K1,
                )
                for c in drive.cost.cases
            ]  # fmt: skip
    note = (
        "Simulation: the jointly identified driver (true K1) on the inputs of the drive's longest episodes, the range rate "
        "turned to each correlation, with noise of the joint fit's residual; median and range of 95 % over the noise. Per "
        "input: headway error alone, all episodes in one fit; without noise: the bias of an omitted variable added to the "
        "truth. Per record: each episode on its own, range over the episodes as well. Joint: both inputs, all episodes in "
        "one fit. These numbers belong to this drive's loop and to no other."
    )
    return Table(
        "input_correlation", "K1 per input and joint by the correlation of the inputs", columns, rows, note
    )


def fleet(drives: Sequence[DriveAnalysis]) -> Table:
    """Several drives or drivers next to each other (sec. VI)."""
    columns = (
        "log", "output", "usable (s)", "episodes", "correlation of the inputs", "K1 by his method", "K2 by his method",
        "joint K1", "joint K1_low", "joint K1_high", "joint K1 status", "joint K2", "joint K2_low", "joint K2_high",
        "joint K2 status", "fit of the joint model (%)", "steps of the gains", "filter K1", "filter K2",
        "remarks",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for drive in drives:
        his = [median([a.inputs[i].p1.K for a in drive.analyses]) for i in (0, 1)]
        rows.append(
            (
                drive.log, drive.output, drive.time.usable, len(drive.episodes),
                median([e.correlation for e in drive.episodes]), *his, *gain(drive.joint.channels.get(INPUTS[0])),
                *gain(drive.joint.channels.get(INPUTS[1])), drive.joint.fit_percent, drive.joint.changes,
                *(g.value for g in drive.second.gains), drive.joint.says or drive.second.says,
            )
        )  # fmt: skip
    note = (
        "Medians over the episodes where nothing else is stated. Joint: FOPDT over the whole drive. Filter: an unscented "
        "Kalman filter of gap, range rate and gains without lag and dead time (arXiv 2306.03458); "
        "it shares no step with the joint fit and is biased by what it leaves out, so that no interval is stated. "
        "Gains of a pedal and of an "
        "acceleration have different units."
    )
    return Table("drives", "Drives and drivers compared (sec. VI)", columns, rows, note)


def median(x: Sequence[float]) -> float:
    """Median of the finite values; NaN: none.

    >>> median([1.0, float("nan"), 3.0])
    2.0
    """
    known = np.asarray([v for v in x if np.isfinite(v)])
    return float(np.median(known)) if known.size else float("nan")


def _analyses(drives: Sequence[DriveAnalysis]) -> list[tuple[DriveAnalysis, Analysis]]:
    return [(drive, a) for drive in drives for a in drive.analyses]


def inside(value: float, channel: Channel | None) -> bool | None:
    """Whether a number lies in the 95 % interval of a gain; None: the gain may not be quoted.

    >>> inside(5.0, Channel()) is None
    True
    """
    if channel is None or not joint.known(channel):
        return None
    return channel.K.low <= value <= channel.K.high
