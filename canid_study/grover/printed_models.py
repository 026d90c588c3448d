"""Rows of the equations, tables 1 and figures of Grover (2021): the printed models and those of this log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.values.text.names import readable
from canid.values.text.numbers import plural
from canid.values.types import Channel, Interval
from canid_study import verdict_tests
from canid_study.artifact import Artifact, ClaimVerdict
from canid_study.grover import joint as joint_fits
from canid_study.grover import tables
from canid_study.grover.drive_analysis import DriveAnalysis, unit_of
from canid_study.grover.episode_analysis import Analysis
from canid_study.grover.episodes import INPUTS
from canid_study.grover.output_error import OutputError
from canid_study.grover.tables import median
from canid_study.printed_numbers import GROVER_DRIVERS, SELECTION_PERCENT

# points of percentage of fit by which two models have to differ before one is called better
BETTER_PERCENT = 1.0
# share of a gain by which a method may miss it and still be said to find it; in the reproduction what the joint fit's
# median error of one minute has to stay below
TOLERATED_BIAS = 0.10
DATA = "the paper's data are not public"
_NEAR = f"the joint fit's gain within {100 * TOLERATED_BIAS:g} % of it"


def show(x: Interval, unit: str = "") -> str:
    """A number and its interval, with a unit."""
    if not np.isfinite(x.value):
        return "no estimate"
    return f"{x.value:.3g} [{x.low:.3g}, {x.high:.3g}]{f' {unit}' if unit else ''}"


def _gain(channel: Channel | None, unit: str) -> str:
    if channel is None:
        return "no fit"
    status = "" if tables.inside(0.0, channel) is not None else ", not identifiable"
    return f"K {show(channel.K, unit)}{status}"


def speed_factor(drives: Sequence[DriveAnalysis]) -> Artifact:
    """Eq. 2.1 multiplies the headway error by the speed, eq. 2.2 does not."""
    plain, with_speed = median([d.joint.fit_percent for d in drives]), median([d.speed_fit for d in drives])
    tests = verdict_tests.above([d.speed_fit - d.joint.fit_percent for d in drives])
    why = verdict_tests.stated(f"signed ranks of the fits of {plural(len(drives), 'drive')}", *tests)
    return Artifact(
        "eq. 2.1",
        "headway error times speed",
        "K1 is multiplied by the speed in eq. 2.1 and not in eq. 2.2",
        f"joint model with speed times headway error: {with_speed:.1f} %",
        f"joint model with headway error: {plain:.1f} %",
        verdict_tests.decided(*tests),
        why,
        ("tables/drives.csv",),
    )


def dead_times(drives: Sequence[DriveAnalysis]) -> list[Artifact]:
    """Printed dead times and those of this log."""
    out = []
    for number, name in enumerate(INPUTS):
        channels = [d.joint.channels[name] for d in drives if name in d.joint.channels]
        quoted = sum(c.status.value == "ok" for c in channels)
        first = channels[0] if channels else Channel()
        out.append(
            Artifact(
                f"eq. 2.{number + 2}",
                f"dead time of the response to {tables.WORDS[name]}",
                "a dead time and no lag",
                "",
                f"dead time {show(first.dead_time, 's')}, lag {show(first.tau, 's')}, "
                f"sum {show(first.tau_plus_dead_time, 's')} ({readable(first.status.value)}, first drive)",
                ClaimVerdict.SHOWN if quoted else ClaimVerdict.NOT_CHECKABLE,
                f"lag and dead time may be quoted apart in {quoted} of {plural(len(channels), 'drive')}",
                ("tables/drives.csv",),
            )
        )
    return out


def _model(m: OutputError, unit: str) -> str:
    unstable = f"{m.growing} unstable poles" if m.growing != 1 else "1 unstable pole"
    return f"order {m.order}, {m.fit_percent:.1f} %, {unstable}, DC gain {m.dc_gain:.3g} {unit}"


def transfer_functions(example: tuple[DriveAnalysis, Analysis]) -> list[Artifact]:
    """Printed transfer functions and the joint fit."""
    drive, a = example
    out = []
    published = (
        "order 4, 95.39 %, stable, DC gain 2.318",
        "order 11, 91.06 %, 6 unstable poles, DC gain -1034",
    )
    for number, (name, fits) in enumerate(zip(INPUTS, a.inputs, strict=True)):
        unit = f"{unit_of(drive.output)} per {'s' if number == 0 else 'm/s'}"
        m = fits.model
        reaches = "reaches" if m.fit_percent >= SELECTION_PERCENT else "does not reach"
        grows = "; no driver's response grows without bound" if m.growing else ""
        out.append(
            Artifact(
                f"eq. 2.{number + 4}",
                f"transfer function from {tables.WORDS[name]} alone",
                published[number],
                _model(m, unit),
                _gain(drive.joint.channels.get(name), unit),
                ClaimVerdict.SHOWN,
                f"on this log it {reaches} 90 %{grows}",
                ("tables/orders.csv", f"figures/fig_{12 + number}.svg"),
            )
        )
    return out


def first_order_forms(example: tuple[DriveAnalysis, Analysis], every: Sequence[Analysis]) -> list[Artifact]:
    """First order with a dead time, and what it gains."""
    _, a = example
    out = []
    for number, (name, fits) in enumerate(zip(INPUTS, a.inputs, strict=True)):
        with_delay, lag_only = fits.p1d, fits.p1
        gained = [x.inputs[number].p1d.fit_percent - x.inputs[number].p1.fit_percent for x in every]
        # claimed is that a lag does as well: what the dead time adds is less than the margin
        fails, holds = verdict_tests.above(gained, BETTER_PERCENT)
        out.append(
            Artifact(
                f"eq. 2.{number + 6}",
                f"first-order lag from {tables.WORDS[name]}",
                "a lag in place of the dead time of eq. 2.2, 2.3",
                f"P1 fits {lag_only.fit_percent:.1f} % of the transfer function's response, P1D "
                f"{with_delay.fit_percent:.1f} %",
                "",
                verdict_tests.decided(holds, fails),
                f"a dead time adds {median(gained):.1f} points (median), margin {BETTER_PERCENT:g}: "
                + verdict_tests.stated(f"signed ranks over {len(every)} episodes", holds, fails),
                ("tables/reductions.csv",),
            )
        )
    return out


def reduced(example: tuple[DriveAnalysis, Analysis]) -> list[Artifact]:
    """Reduced models and the joint fit."""
    drive, a = example
    out = []
    printed = GROVER_DRIVERS[0]
    published = ((printed.K1, printed.tau1), (printed.K2, printed.tau2))
    for number, (name, fits) in enumerate(zip(INPUTS, a.inputs, strict=True)):
        unit = f"{unit_of(drive.output)} per {'s' if number == 0 else 'm/s'}"
        channel = drive.joint.channels.get(name)
        tests = _agrees(fits.p1.K, channel)
        K, tau = published[number]
        truncated = fits.truncated
        balanced = truncated.says or f"K {truncated.K:.3g}, tau {truncated.tau:.3g} s"
        out.append(
            Artifact(
                f"eq. 2.{number + 8}",
                f"reduction to first order from {tables.WORDS[name]}",
                f"K {K:g}, tau {tau:g} s",
                f"K {fits.p1.K:.3g} {unit}, tau {fits.p1.tau:.3g} s, {fits.p1.fit_percent:.1f} % of the transfer function's "
                f"response; balanced truncation: {balanced}",
                _gain(channel, unit),
                verdict_tests.decided(*tests),
                "the joint fit may not quote this gain"
                if not np.isfinite(tests[0])
                else verdict_tests.stated(_NEAR, *tests),
                ("tables/reductions.csv",),
            )
        )
    return out


def _agrees(K: float, channel: Channel | None) -> tuple[float, float]:
    """P values of a gain that the joint fit's is near to, and of another; NaN: no gain may be quoted."""
    if channel is None or not joint_fits.known(channel):
        return float("nan"), float("nan")
    return verdict_tests.within(K, channel.K, TOLERATED_BIAS)


def table_1(example: tuple[DriveAnalysis, Analysis]) -> Artifact:
    """Table 1: K1 and K2 of the first record."""
    drive, a = example
    K1, K2 = (fits.p1 for fits in a.inputs)
    printed = GROVER_DRIVERS[0]
    tests = [_agrees(p.K, drive.joint.channels.get(name)) for p, name in zip((K1, K2), INPUTS, strict=True)]
    known = [p for p in tests if np.isfinite(p[0])]
    # holds where both do, fails where one does
    holds = max((p[0] for p in known), default=float("nan"))
    fails = min((min(len(known) * p[1], 1.0) for p in known), default=float("nan"))
    return Artifact(
        "Table 1",
        "parameters of one record",
        f"K1 {printed.K1:g}, tau_d1 {printed.tau1:g} s, K2 {printed.K2:g}, tau_d2 {printed.tau2:g} s",
        f"K1 {K1.K:.3g}, tau_d1 {K1.tau:.3g} s, K2 {K2.K:.3g}, tau_d2 {K2.tau:.3g} s",
        "; ".join(f"K{i + 1} {show(drive.joint.channels[n].K)}" for i, n in enumerate(INPUTS) if n in drive.joint.channels),
        verdict_tests.decided(holds, fails),
        verdict_tests.stated(_NEAR, holds, fails) if known else "the joint fit may quote no gain of this drive",
        ("tables/table_1.csv",),
    )  # fmt: skip


def figures(
    example: tuple[DriveAnalysis, Analysis],
    figures: Sequence[str],
    others: Sequence[tuple[DriveAnalysis, Analysis]],
) -> list[Artifact]:
    """The figures."""
    _, a = example
    b = a.together
    cases = [
        f"case {k}: episode {others[k - 1][1].episode.number} of {others[k - 1][0].log}, from "
        f"{others[k - 1][1].episode.t:.0f} s"
        if k <= len(others)
        else f"case {k}"
        for k in (1, 2, 3)
    ]
    said: dict[int, tuple[str, str, str, str]] = {
        8: ("route", "a map of the test route", "", ""),
        10: ("output against headway error", "throttle rises with the error, and on as it falls", "", ""),
        11: ("output against range rate", "throttle falls as V_F - V_L rises", "", ""),
        12: ("transfer function of headway error", "95.39 %", f"{a.inputs[0].model.fit_percent:.1f} %", ""),
        13: ("transfer function of range rate", "91.06 %", f"{a.inputs[1].model.fit_percent:.1f} %", ""),
        14: (
            "both transfer functions", "96.36 %",
            f"sum {b.high_sum:.1f} %, weighed anew {b.high_refit:.1f} %", f"{a.joint_fit:.1f} %",
        ),
        15: (
            "both reduced", "89.76 %",
            f"sum {b.reduced_sum:.1f} %, weighed anew {b.reduced_refit:.1f} %", f"{a.joint_fit:.1f} %",
        ),
        16: ("data and both models", "", f"{b.high_refit:.1f} and {b.reduced_refit:.1f} %", f"{a.joint_fit:.1f} %"),
        17: ("places of the records", "three places on the route", "", ""),
        18: (cases[0], "curves", "", ""),
        19: (cases[1], "curves", "", ""),
        20: (cases[2], "curves", "", ""),
    }  # fmt: skip
    out = []
    for number, (what, published, reproduced, corrected) in said.items():
        name = f"fig_{number:02d}"
        made = name in figures
        missing = "no position is recorded" if number in (8, 17) else "no further episode"
        out.append(
            Artifact(
                f"Fig. {number}",
                what,
                published,
                reproduced or ("drawn from this log" if made else ""),
                corrected,
                ClaimVerdict.SHOWN if made else ClaimVerdict.NOT_CHECKABLE,
                f"{DATA}; the same from this log" if made else missing,
                (f"figures/{name}.svg",) if made else (),
            )
        )
    return out
