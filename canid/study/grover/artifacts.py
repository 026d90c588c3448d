"""Rows of the study: each equation, table, figure and step of Grover (2021), on this log and by the joint fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.identification.confidence import NORMAL_QUANTILE
from canid.study.artifact import Artifact, ClaimVerdict
from canid.study.grover import tables
from canid.study.grover.drive_analysis import DriveAnalysis, unit_of
from canid.study.grover.episode_analysis import Analysis
from canid.study.grover.episodes import INPUTS, correlation
from canid.study.grover.output_error import OutputError
from canid.study.grover.tables import median
from canid.study.prints.printed_numbers import GROVER_DRIVERS, SELECTION_PERCENT
from canid.types import Channel, Interval

# points of percentage of fit by which two models have to differ before one is called better: noise of a median over
# some ten episodes
BETTER_PERCENT = 1.0
# share of K1: what the joint fit's median error of one minute has to stay below in the reproduction
TOLERATED_BIAS = 0.10
DATA = "the paper's data are not public"


def rows(
    drives: Sequence[DriveAnalysis], example: tuple[DriveAnalysis, Analysis], figures: Sequence[str]
) -> tuple[Artifact, ...]:
    """All rows.

    Args:
        drives: with analyses.
        example: drive and episode that stand for the paper's first record.
        figures: names of the figures that were made.
    """
    every = [a for drive in drives for a in drive.analyses]
    out = [
        _speed_factor(drives),
        *_dead_times(drives),
        *_transfer_functions(example),
        *_first_order_forms(example),
        *_reduced(example),
        _table_1(example),
        _table_2(every),
        *_figures(example, figures),
        _episodes(drives),
        _detrending(),
        _gate(drives, every),
        _reduction_step(every),
        _sum(every),
        _validation(every),
        *_cost(drives),
        _attention(every),
        _fleet(drives),
        _second_opinion(drives),
    ]
    return tuple(out)


def _show(x: Interval, unit: str = "") -> str:
    if not np.isfinite(x.value):
        return "no estimate"
    return f"{x.value:.3g} [{x.low:.3g}, {x.high:.3g}]{f' {unit}' if unit else ''}"


def _gain(channel: Channel | None, unit: str) -> str:
    if channel is None:
        return "no fit"
    status = "" if tables.inside(0.0, channel) is not None else ", not identifiable"
    return f"K {_show(channel.K, unit)}{status}"


def _speed_factor(drives: Sequence[DriveAnalysis]) -> Artifact:
    """Eq. 2.1 multiplies the headway error by the speed, eq. 2.2 does not."""
    plain, with_speed = median([d.joint.fit_percent for d in drives]), median([d.speed_fit for d in drives])
    difference = with_speed - plain
    if not np.isfinite(difference):
        verdict, why = ClaimVerdict.NOT_CHECKABLE, "no joint fit, or no speed"
    elif abs(difference) < BETTER_PERCENT:
        verdict, why = ClaimVerdict.AMBIGUOUS, "both forms fit alike on these data"
    else:
        better = "with" if difference > 0 else "without"
        verdict = ClaimVerdict.HOLDS if difference > 0 else ClaimVerdict.FAILS
        why = f"the driver of these data is described better {better} the speed as a factor"
    return Artifact(
        "eq. 2.1",
        "headway error times speed",
        "K1 is multiplied by the speed in eq. 2.1 and not in eq. 2.2",
        f"joint model with speed times headway error: {with_speed:.1f} %",
        f"joint model with headway error: {plain:.1f} %",
        verdict,
        why,
        ("tables/drives.csv",),
    )


def _dead_times(drives: Sequence[DriveAnalysis]) -> list[Artifact]:
    out = []
    for number, name in enumerate(INPUTS):
        channels = [d.joint.channels[name] for d in drives if name in d.joint.channels]
        quoted = sum(c.status.value == "ok" for c in channels)
        one = channels[0] if channels else Channel()
        out.append(
            Artifact(
                f"eq. 2.{number + 2}",
                f"dead time of the response to {tables.WORDS[name]}",
                "a dead time and no lag",
                "",
                f"dead time {_show(one.dead_time, 's')}, lag {_show(one.tau, 's')}, sum {_show(one.tau_plus_dead_time, 's')}"
                f" ({one.status.value}, first drive)",
                ClaimVerdict.SHOWN if quoted else ClaimVerdict.NOT_CHECKABLE,
                f"lag and dead time may be quoted apart in {quoted} of {len(channels)} drives",
                ("tables/drives.csv",),
            )
        )
    return out


def _model(m: OutputError, unit: str) -> str:
    unstable = f"{m.growing} unstable poles" if m.growing != 1 else "1 unstable pole"
    return f"order {m.order}, {m.fit_percent:.1f} %, {unstable}, DC gain {m.dc_gain:.3g} {unit}"


def _transfer_functions(example: tuple[DriveAnalysis, Analysis]) -> list[Artifact]:
    drive, a = example
    out = []
    published = (
        "order 4, 95.39 %, stable, DC gain 2.318",
        "order 11, 91.06 %, 6 unstable poles, DC gain -1034",
    )
    for number, (name, one) in enumerate(zip(INPUTS, a.inputs, strict=True)):
        unit = f"{unit_of(drive.output)} per {'s' if number == 0 else 'm/s'}"
        m = one.model
        reaches = "reaches" if m.fit_percent >= SELECTION_PERCENT else "does not reach"
        grows = "; no driver's response grows without bound" if m.growing else ""
        out.append(
            Artifact(
                f"eq. 2.{number + 4}",
                f"transfer function from {tables.WORDS[name]} alone",
                published[number],
                _model(m, unit),
                _gain(drive.joint.channels.get(name), unit),
                ClaimVerdict.FAILS if m.growing else ClaimVerdict.SHOWN,
                f"on this log it {reaches} 90 %{grows}",
                ("tables/orders.csv", f"figures/fig_{12 + number}.svg"),
            )
        )
    return out


def _first_order_forms(example: tuple[DriveAnalysis, Analysis]) -> list[Artifact]:
    _, a = example
    out = []
    for number, (name, one) in enumerate(zip(INPUTS, a.inputs, strict=True)):
        with_delay, lag_only = one.p1d, one.p1
        difference = with_delay.fit_percent - lag_only.fit_percent
        out.append(
            Artifact(
                f"eq. 2.{number + 6}",
                f"first-order lag from {tables.WORDS[name]}",
                "a lag in place of the dead time of eq. 2.2, 2.3",
                f"P1 fits {lag_only.fit_percent:.1f} % of the transfer function's response, P1D "
                f"{with_delay.fit_percent:.1f} %",
                "",
                ClaimVerdict.AMBIGUOUS if difference < BETTER_PERCENT else ClaimVerdict.FAILS,
                "lag and dead time fit alike here"
                if difference < BETTER_PERCENT
                else "a dead time is needed besides the lag",
                ("tables/reductions.csv",),
            )
        )
    return out


def _reduced(example: tuple[DriveAnalysis, Analysis]) -> list[Artifact]:
    drive, a = example
    out = []
    printed = GROVER_DRIVERS[0]
    published = ((printed.K1, printed.tau1), (printed.K2, printed.tau2))
    for number, (name, one) in enumerate(zip(INPUTS, a.inputs, strict=True)):
        unit = f"{unit_of(drive.output)} per {'s' if number == 0 else 'm/s'}"
        channel = drive.joint.channels.get(name)
        within = tables.inside(one.p1.K, channel)
        K, tau = published[number]
        truncated = one.truncated
        balanced = truncated.says or f"K {truncated.K:.3g}, tau {truncated.tau:.3g} s"
        out.append(
            Artifact(
                f"eq. 2.{number + 8}",
                f"reduction to first order from {tables.WORDS[name]}",
                f"K {K:g}, tau {tau:g} s",
                f"K {one.p1.K:.3g} {unit}, tau {one.p1.tau:.3g} s, {one.p1.fit_percent:.1f} % of the transfer function's "
                f"response; balanced truncation: {balanced}",
                _gain(channel, unit),
                _inside(within),
                {
                    None: "the joint fit may not quote this gain",
                    True: "inside the 95 % interval of the joint fit",
                    False: "outside the 95 % interval of the joint fit",
                }[within],
                ("tables/reductions.csv",),
            )
        )
    return out


def _inside(within: bool | None) -> ClaimVerdict:
    if within is None:
        return ClaimVerdict.NOT_CHECKABLE
    return ClaimVerdict.HOLDS if within else ClaimVerdict.FAILS


def _table_1(example: tuple[DriveAnalysis, Analysis]) -> Artifact:
    drive, a = example
    K1, K2 = (one.p1 for one in a.inputs)
    printed = GROVER_DRIVERS[0]
    within = [
        tables.inside(p.K, drive.joint.channels.get(name)) for p, name in zip((K1, K2), INPUTS, strict=True)
    ]
    known = [w for w in within if w is not None]
    verdict = _inside(all(known) if known else None)
    held = f"{sum(known)} of {len(known)} gains are inside the joint fit's 95 % intervals"
    return Artifact(
        "Table 1",
        "parameters of one record",
        f"K1 {printed.K1:g}, tau_d1 {printed.tau1:g} s, K2 {printed.K2:g}, tau_d2 {printed.tau2:g} s",
        f"K1 {K1.K:.3g}, tau_d1 {K1.tau:.3g} s, K2 {K2.K:.3g}, tau_d2 {K2.tau:.3g} s",
        "; ".join(f"K{i + 1} {_show(drive.joint.channels[n].K)}" for i, n in enumerate(INPUTS) if n in drive.joint.channels),
        verdict,
        held if known else "the joint fit may quote no gain of this drive",
        ("tables/table_1.csv",),
    )  # fmt: skip


def _table_2(every: Sequence[Analysis]) -> Artifact:
    said, spread = [], []
    for number, name in enumerate(INPUTS):
        within = [tables.inside(a.inputs[number].p1.K, a.joint.channels.get(name)) for a in every]
        known = [w for w in within if w is not None]
        values = np.array([a.inputs[number].p1.K for a in every])
        spread.append(f"K{number + 1} {values.min():.3g} to {values.max():.3g}")
        said.append((sum(known), len(known)))
    total = sum(n for _, n in said)
    joint = [
        f"K{i + 1} {min(v):.3g} to {max(v):.3g} where it may be quoted ({len(v)} episodes)"
        for i, name in enumerate(INPUTS)
        if (
            v := [
                a.joint.channels[name].K.value
                for a in every
                if name in a.joint.channels and tables.inside(0.0, a.joint.channels[name]) is not None
            ]
        )
    ]
    return Artifact(
        "Table 2",
        f"parameters of {len(every)} records",
        "K1 4.15 to 11.4, K2 4.34 to 5.63 over three records",
        ", ".join(spread),
        ", ".join(joint) or "no episode alone is long enough for a gain",
        ClaimVerdict.NOT_CHECKABLE
        if not total
        else ClaimVerdict.FAILS
        if sum(n for n, _ in said) < 0.9 * total
        else ClaimVerdict.HOLDS,
        "inside the joint fit's interval of the same episode: "
        + ", ".join(f"K{i + 1} in {n} of {of}" for i, (n, of) in enumerate(said)),
        ("tables/table_2.csv",),
    )


def _figures(example: tuple[DriveAnalysis, Analysis], figures: Sequence[str]) -> list[Artifact]:
    _, a = example
    b = a.together
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
        18: ("case 1", "curves", "", ""),
        19: ("case 2", "curves", "", ""),
        20: ("case 3", "curves", "", ""),
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


def _episodes(drives: Sequence[DriveAnalysis]) -> Artifact:
    found = [e for d in drives for e in d.episodes]
    correlations = [e.correlation for e in found]
    return Artifact(
        "sec. 4.1",
        "choice of the records",
        "chosen arbitrarily where one car follows another",
        f"{len(found)} episodes in {len(drives)} drive{'s' * (len(drives) != 1)}, {min(e.length for e in found):.0f} to "
        f"{max(e.length for e in found):.0f} s, by a rule",
        f"correlation of the inputs {min(correlations):.2f} to {max(correlations):.2f}",
        ClaimVerdict.SHOWN,
        "every stretch behind one lead, with the pedal and without the brake",
        ("tables/episodes.csv",),
    )


def _detrending() -> Artifact:
    return Artifact(
        "sec. 4.2, preprocessing",
        "trends removed",
        "trends and disturbance removed",
        "the least-squares line of each signal and episode",
        "an offset that is fitted jointly",
        ClaimVerdict.SHOWN,
        'what "disturbance" was removed is not stated',
        (),
    )


def _gate(drives: Sequence[DriveAnalysis], every: Sequence[Analysis]) -> Artifact:
    passed = [p.model.fit_percent >= SELECTION_PERCENT for a in every for p in a.inputs]
    joint = [a.joint_fit for a in every if np.isfinite(a.joint_fit)]
    rejected = [f < SELECTION_PERCENT for f in joint]
    true = [d.cost.gate_rejects for d in drives if d.cost is not None]
    share = median(true)
    return Artifact(
        "sec. 4.2, selection",
        "models that fit less than 90 % are rejected",
        "fit of 90 % and more; the published reduced model has 89.76 %",
        f"{sum(passed)} of {len(passed)} transfer functions reach it",
        f"rejects the joint model in {sum(rejected)} of {len(rejected)} episodes, and {share:.0f} % of simulated records of "
        "a driver who is exactly that model",
        ClaimVerdict.NOT_CHECKABLE if not true else ClaimVerdict.FAILS if share > 5.0 else ClaimVerdict.HOLDS,
        "the fit says how large the driver's own noise is, not whether the model is right",
        ("tables/orders.csv", "figures/orders.svg"),
    )


def _reduction_step(every: Sequence[Analysis]) -> Artifact:
    fits = [p.p1.fit_percent for a in every for p in a.inputs]
    worst = median(
        [p.truncated.error_bound / abs(p.truncated.K) for a in every for p in a.inputs if p.truncated.K]
    )
    bound = f"; error bound of balanced truncation {worst:.2g} times its gain" if np.isfinite(worst) else ""
    middle = median(fits)
    return Artifact(
        "sec. 4.3",
        "reduction to first order",
        "fit of the reduction not stated",
        f"P1 fits {middle:.1f} % (median) of the transfer functions' responses{bound}",
        "first order plus dead time is fitted to the data at once",
        ClaimVerdict.FAILS if middle < SELECTION_PERCENT else ClaimVerdict.HOLDS,
        "no first-order model is near a transfer function of high order"
        if middle < SELECTION_PERCENT
        else "the transfer functions are near to first order",
        ("tables/reductions.csv",),
    )


def _sum(every: Sequence[Analysis]) -> Artifact:
    sums, again = [a.together.high_sum for a in every], [a.together.high_refit for a in every]
    bounds = [a.together.bound[1] for a in every]
    return Artifact(
        "claim G5",
        "the sum of both transfer functions fits 96.36 %",
        "96.36 %, of models that fit 95.39 and 91.06 % alone",
        f"sum {median(sums):.1f} % (median), at most {median(bounds):.1f} % possible",
        f"weighed anew {median(again):.1f} %",
        ClaimVerdict.IMPOSSIBLE,
        "two models that each explain the output add up to twice the output; the more each explains, the less their sum",
        ("tables/miso.csv", "figures/fig_14.svg"),
    )


def _validation(every: Sequence[Analysis]) -> Artifact:
    held = [a.held for a in every if a.held is not None]
    high, low, joint = (median([getattr(h, name) for h in held]) for name in ("high", "reduced", "joint"))
    own = median([a.together.high_refit for a in every])
    better = [sum(h.joint > getattr(h, name) for h in held) for name in ("high", "reduced")]
    return Artifact(
        "sec. 4.5",
        "validation",
        "compared on the data of the fit",
        f"next episode: transfer functions {high:.1f} %, reduced {low:.1f} % (median); own episode {own:.1f} %"
        if held
        else f"own episode {own:.1f} %",
        f"next episode: joint model {joint:.1f} %" if held else "",
        ClaimVerdict.NOT_CHECKABLE
        if not held
        else ClaimVerdict.FAILS
        if joint > max(high, low)
        else ClaimVerdict.HOLDS,
        f"of {len(held)} next episodes the joint model predicts {better[0]} better than the transfer functions do, and "
        f"{better[1]} better than the reduced"
        if held
        else "one episode has no next one: drive longer",
        ("tables/next_episode.csv", "figures/next_episode.svg") if held else (),
    )


def _cost(drives: Sequence[DriveAnalysis]) -> list[Artifact]:
    out = []
    for drive in drives:
        cost = drive.cost
        name = "claim G17" if len(drives) == 1 else f"claim G17, {drive.log}"
        if cost is None:
            out.append(
                Artifact(
                    name, "one fit per input determines K1", "K1 from the headway error alone", "", "",
                    ClaimVerdict.NOT_CHECKABLE, "no joint fit of this drive: nothing to simulate", (),
                )
            )  # fmt: skip
            continue
        own = cost.recorded
        known = tables.inside(0.0, drive.joint.channels.get(INPUTS[0])) is not None
        zero = min(cost.cases[1:], key=lambda c: abs(c.correlation))
        bias = own.per_input.value - cost.K1
        factors = (own.expected / cost.K1 - 1.0, zero.per_input.value / cost.K1 - 1.0)
        out.append(
            Artifact(
                name,
                "one fit per input determines K1",
                "K1 from the headway error alone",
                f"K1 {_show(own.per_input)}, each record on its own {_show(own.per_record)}, of a driver with {cost.K1:.3g}"
                f"{f': error {bias / cost.K1:+.0%}' if known else ''} in this loop, correlation of the inputs "
                f"{own.correlation:.2f}",
                f"K1 {_show(own.joint)}{f': error {own.joint.value / cost.K1 - 1.0:+.0%}' if known else ''}",
                ClaimVerdict.NOT_CHECKABLE
                if not known
                else ClaimVerdict.FAILS
                if abs(bias) > TOLERATED_BIAS * abs(cost.K1)
                else ClaimVerdict.HOLDS,
                f"simulated on this drive's inputs; without noise {factors[0]:+.0%}, with uncorrelated inputs "
                f"{factors[1]:+.0%}"
                if known
                else "this drive's K1 may not be quoted: percentages of it mean nothing",
                ("tables/input_correlation.csv", "figures/input_correlation.svg"),
            )
        )
    return out


def _second_opinion(drives: Sequence[DriveAnalysis]) -> Artifact:
    """The unscented filter next to the joint fit."""
    said, both, overlap = [], 0, 0
    for drive in drives:
        for number, name in enumerate(INPUTS):
            channel, gain = drive.joint.channels.get(name), drive.second.gains[number]
            if channel is not None and tables.inside(0.0, channel) is not None and np.isfinite(gain.value):
                both += 1
                overlap += gain.low <= channel.K.high and channel.K.low <= gain.high
        first = ", ".join(f"K{i + 1} {_show(g)}" for i, g in enumerate(drive.second.gains))
        said.append(first if not drive.second.says else drive.second.says)
    return Artifact(
        "sec. VI, another method",
        "unscented Kalman filter of the gains",
        "proposed as future work",
        "",
        f"{said[0]} (first drive)",
        ClaimVerdict.SHOWN,
        f"its interval and the joint fit's have points in common for {overlap} of {both} gains; it knows no lag, which "
        "biases it",
        ("tables/drives.csv",),
    )


def _attention(every: Sequence[Analysis]) -> Artifact:
    """Sec. V reads attention off gains and lags: a larger gain with a shorter lag."""
    values = [
        _rank_correlation([a.inputs[i].p1.K for a in every], [a.inputs[i].p1.tau for a in every])
        for i in (0, 1)
    ]
    known = len(every) >= 5 and all(np.isfinite(values))
    said = f"rank correlation of gain and lag over the episodes {values[0]:.2f} and {values[1]:.2f}"
    return Artifact(
        "sec. V",
        "a longer reaction time means a smaller gain",
        "stated of case 3, contradicted by Table 2 for K2",
        said if known else "",
        "",
        ClaimVerdict.NOT_CHECKABLE
        if not known
        else ClaimVerdict.HOLDS
        if max(values) < 0.0
        else ClaimVerdict.FAILS,
        "gain and lag of one fit have correlated errors, so that this says little of attention"
        if known
        else "fewer than five episodes",
        ("tables/table_2.csv",),
    )


def _rank_correlation(x: Sequence[float], y: Sequence[float]) -> float:
    """Spearman's; NaN where one is constant."""
    ranks = [np.argsort(np.argsort(np.asarray(v))) for v in (x, y)]
    if len(x) < 3 or len(set(x)) < 2 or len(set(y)) < 2:
        return float("nan")
    return correlation(ranks[0].astype(np.float64), ranks[1].astype(np.float64))


def _fleet(drives: Sequence[DriveAnalysis]) -> Artifact:
    said, sets = [], {d.output for d in drives}
    for number, name in enumerate(INPUTS):
        known = [
            d.joint.channels[name].K
            for d in drives
            if len(sets) == 1 and tables.inside(0.0, d.joint.channels.get(name)) is not None
        ]
        if len(known) > 1:
            values = [K.value for K in known]
            said.append(
                f"K{number + 1} {min(values):.3g} to {max(values):.3g} in {len(known)} drives, p = "
                f"{_homogeneity(known):.2g} of one common gain"
            )
    mixed = "drives with different outputs are not compared" if len(sets) > 1 else ""
    return Artifact(
        "sec. VI",
        "compare several drivers",
        "proposed as future work",
        "",
        "; ".join(
            filter(None, [f"{len(drives)} drive{'s' * (len(drives) != 1)} in one table", *said, mixed])
        ),
        ClaimVerdict.SHOWN,
        "one row per log" if len(drives) > 1 else "name several logs to compare drives or drivers",
        ("tables/drives.csv",),
    )


def _homogeneity(gains: Sequence[Interval]) -> float:
    """p-value of one common gain (Cochran 1954): sum of squares about the weighted mean is chi-squared.

    >>> _homogeneity([Interval(5.0, 4.0, 6.0), Interval(5.0, 4.0, 6.0)])
    1.0
    >>> _homogeneity([Interval(5.0, 4.9, 5.1), Interval(6.0, 5.9, 6.1)]) < 1e-6
    True
    """
    from scipy.special import gammaincc

    values = np.array([K.value for K in gains])
    sd = np.array([max((K.high - K.low) / (2.0 * NORMAL_QUANTILE), 1e-300) for K in gains])
    mean = float((values / sd**2).sum() / (1.0 / sd**2).sum())
    return float(gammaincc(0.5 * (len(gains) - 1), 0.5 * float((((values - mean) / sd) ** 2).sum())))
