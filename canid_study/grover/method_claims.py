"""Rows of the steps and claims of Grover (2021): what each step of the method does to a record of known truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.text.numbers import plural
from canid.values.types import Interval
from canid_study import verdict_tests
from canid_study.artifact import Artifact, ClaimVerdict
from canid_study.grover import tables
from canid_study.grover.drive_analysis import DriveAnalysis
from canid_study.grover.episode_analysis import Analysis
from canid_study.grover.episodes import INPUTS
from canid_study.grover.printed_models import TOLERATED_BIAS, show
from canid_study.grover.tables import median
from canid_study.printed_numbers import SELECTION_PERCENT

# share of records in which the true model may be rejected: the level of a test that would deserve the name
TOLERATED_REJECTIONS = 0.05
# of records whose gains lie in the joint fit's intervals: what a right method reaches at least (two intervals of 95 %),
# and what is too little to be called right
RIGHT_SHARE, POOR_SHARE = 0.90, 0.75


def table_2(every: Sequence[Analysis]) -> Artifact:
    """Table 2: gains and delays of the printed drivers and those of the joint fit."""
    said, spread = [], []
    for number, name in enumerate(INPUTS):
        within = [tables.inside(a.inputs[number].p1.K, a.joint.channels.get(name)) for a in every]
        known = [w for w in within if w is not None]
        values = np.array([a.inputs[number].p1.K for a in every])
        spread.append(f"K{number + 1} {values.min():.3g} to {values.max():.3g}")
        said.append((sum(known), len(known)))
    # records, not gains: the two of one record share its noise
    inside = [
        all(known)
        for a in every
        if (
            known := [
                w
                for i, name in enumerate(INPUTS)
                if (w := tables.inside(a.inputs[i].p1.K, a.joint.channels.get(name))) is not None
            ]
        )
    ]
    holds = verdict_tests.more_than(sum(inside), len(inside), POOR_SHARE)
    fails = verdict_tests.fewer_than(sum(inside), len(inside), RIGHT_SHARE)
    joint = [
        f"K{i + 1} {min(v):.3g} to {max(v):.3g} where it may be quoted ({plural(len(v), 'episode')})"
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
        verdict_tests.decided(holds, fails),
        "inside the joint fit's interval of the same episode: "
        + ", ".join(f"K{i + 1} in {n} of {n_known}" for i, (n, n_known) in enumerate(said))
        + "; "
        + verdict_tests.stated("binomial", holds, fails),
        ("tables/table_2.csv",),
    )


def episodes(drives: Sequence[DriveAnalysis]) -> Artifact:
    """Where following is: episodes of one leader."""
    every = [e for d in drives for e in d.episodes]
    correlations = [e.correlation for e in every]
    return Artifact(
        "sec. 4.1",
        "choice of the records",
        "chosen arbitrarily where one car follows another",
        f"{len(every)} episodes in {len(drives)} drive{'s' * (len(drives) != 1)}, {min(e.length for e in every):.0f} to "
        f"{max(e.length for e in every):.0f} s, by a rule",
        f"correlation of the inputs {min(correlations):.2f} to {max(correlations):.2f}",
        ClaimVerdict.SHOWN,
        "every stretch behind one lead, with the pedal and without the brake",
        ("tables/episodes.csv",),
    )


def detrending() -> Artifact:
    """Detrending of a record."""
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


def gate(drives: Sequence[DriveAnalysis], every: Sequence[Analysis], draws: int) -> Artifact:
    """The selection of records by their percentage of fit."""
    passed = [p.model.fit_percent >= SELECTION_PERCENT for a in every for p in a.inputs]
    joint = [a.joint_fit for a in every if np.isfinite(a.joint_fit)]
    rejected = [f < SELECTION_PERCENT for f in joint]
    true = [d.cost.gate_rejects for d in drives if d.cost is not None]
    share, records = median(true), draws * len(true)
    count = round(sum(true) / 100.0 * draws)
    fails = verdict_tests.more_than(count, records, TOLERATED_REJECTIONS)
    holds = verdict_tests.fewer_than(count, records, TOLERATED_REJECTIONS)
    return Artifact(
        "sec. 4.2, selection",
        "models that fit less than 90 % are rejected",
        "fit of 90 % and more; the published reduced model has 89.76 %",
        f"{sum(passed)} of {len(passed)} transfer functions reach it",
        f"rejects the joint model in {sum(rejected)} of {len(rejected)} episodes, and {share:.0f} % of simulated records of "
        "a driver who is exactly that model",
        verdict_tests.decided(holds, fails),
        "the fit says how large the driver's own noise is, not whether the model is right; "
        + verdict_tests.stated(f"binomial against {100 * TOLERATED_REJECTIONS:g} %", holds, fails),
        ("tables/orders.csv", "figures/orders.svg"),
    )


def reduction_step(every: Sequence[Analysis]) -> Artifact:
    """The reduction of a high order model to one with a dead time."""
    fits = [p.p1.fit_percent for a in every for p in a.inputs]
    worst = median(
        [p.truncated.error_bound / abs(p.truncated.K) for a in every for p in a.inputs if p.truncated.K]
    )
    bound = f"; error bound of balanced truncation {worst:.2g} times its gain" if np.isfinite(worst) else ""
    middle = median(fits)
    # the worse of an episode's two: they share its noise
    tests = verdict_tests.above([min(p.p1.fit_percent for p in a.inputs) for a in every], SELECTION_PERCENT)
    return Artifact(
        "sec. 4.3",
        "reduction to first order",
        "fit of the reduction not stated",
        f"P1 fits {middle:.1f} % (median) of the transfer functions' responses{bound}",
        "first order plus dead time is fitted to the data at once",
        verdict_tests.decided(*tests),
        f"claimed: the worse of both fits {SELECTION_PERCENT:g} % and more; "
        + verdict_tests.stated(f"signed ranks over {len(every)} episodes", *tests),
        ("tables/reductions.csv",),
    )


def summed_orders(every: Sequence[Analysis]) -> Artifact:
    """Sums of lags and dead times, of the high order and reduced."""
    sums, again = [a.together.high_sum for a in every], [a.together.high_refit for a in every]
    bounds = [a.together.bound[1] for a in every]
    impossible = max(bounds) < SELECTION_PERCENT
    tests = verdict_tests.above(sums, SELECTION_PERCENT)
    return Artifact(
        "claim G5",
        "the sum of both transfer functions fits 96.36 %",
        "96.36 %, of models that fit 95.39 and 91.06 % alone",
        f"sum {median(sums):.1f} % (median), at most {median(bounds):.1f} % possible",
        f"weighed anew {median(again):.1f} %",
        ClaimVerdict.IMPOSSIBLE if impossible else verdict_tests.decided(*tests),
        "two models that each explain the output add up to twice the output; the more each explains, the less their sum"
        + (
            ""
            if impossible
            else f"; against {SELECTION_PERCENT:g} %: "
            + verdict_tests.stated(f"signed ranks over {len(every)} episodes", *tests)
        ),
        ("tables/miso.csv", "figures/fig_14.svg"),
    )


def validation(every: Sequence[Analysis]) -> Artifact:
    """Fits on records that were not used."""
    held = [a.held for a in every if a.held is not None]
    high, low, joint = (median([getattr(h, name) for h in held]) for name in ("high", "reduced", "joint"))
    own_episode = median([a.together.high_refit for a in every])
    better = [sum(h.joint > getattr(h, name) for h in held) for name in ("high", "reduced")]
    tests = verdict_tests.above([max(h.high, h.reduced) - h.joint for h in held])
    return Artifact(
        "sec. 4.5",
        "validation",
        "compared on the data of the fit",
        f"next episode: transfer functions {high:.1f} %, reduced {low:.1f} % (median); own episode {own_episode:.1f} %"
        if held
        else f"own episode {own_episode:.1f} %",
        f"next episode: joint model {joint:.1f} %" if held else "",
        verdict_tests.decided(*tests),
        f"of {len(held)} next episodes the joint model predicts {better[0]} better than the transfer functions do, and "
        f"{better[1]} better than the reduced; {verdict_tests.stated('signed ranks', *tests)}"
        if held
        else "one episode has no next one: drive longer",
        ("tables/next_episode.csv", "figures/next_episode.svg") if held else (),
    )


def cost(drives: Sequence[DriveAnalysis]) -> list[Artifact]:
    """What a fit per input costs each gain."""
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
        recorded = cost.recorded
        known = tables.inside(0.0, drive.joint.channels.get(INPUTS[0])) is not None
        zero = min(cost.cases[1:], key=lambda c: abs(c.correlation))
        bias = recorded.per_input.value - cost.K1
        tests = verdict_tests.within(cost.K1, recorded.per_input, TOLERATED_BIAS)
        factors = (recorded.expected / cost.K1 - 1.0, zero.per_input.value / cost.K1 - 1.0)
        out.append(
            Artifact(
                name,
                "one fit per input determines K1",
                "K1 from the headway error alone",
                f"K1 {show(recorded.per_input)}, each record on its own {show(recorded.per_record)}, of a driver "
                f"with {cost.K1:.3g}{f': error {bias / cost.K1:+.0%}' if known else ''} in this loop, correlation of "
                f"the inputs {recorded.correlation:.2f}",
                f"K1 {show(recorded.joint)}{f': error {recorded.joint.value / cost.K1 - 1.0:+.0%}' if known else ''}",
                verdict_tests.decided(*tests) if known else ClaimVerdict.NOT_CHECKABLE,
                f"simulated on this drive's inputs; without noise {factors[0]:+.0%}, with uncorrelated inputs "
                f"{factors[1]:+.0%}; "
                + verdict_tests.stated(f"within {100 * TOLERATED_BIAS:g} % of K1", *tests)
                if known
                else "this drive's K1 may not be quoted: percentages of it mean nothing",
                ("tables/input_correlation.csv", "figures/input_correlation.svg"),
            )
        )
    return out


def second_opinion(drives: Sequence[DriveAnalysis]) -> Artifact:
    """The unscented filter next to the joint fit: without an interval, as its model has no lag."""
    first = drives[0].second
    gains = ", ".join(f"K{i + 1} {g.value:.3g}" for i, g in enumerate(first.gains) if np.isfinite(g.value))
    return Artifact(
        "sec. VI, another method",
        "unscented Kalman filter of the gains",
        "proposed as future work",
        "",
        f"{first.says or gains} (first drive)",
        ClaimVerdict.SHOWN,
        "its model of the driver has no lag: the gains are biased, and no interval of them is stated",
        ("tables/drives.csv",),
    )


def attention(every: Sequence[Analysis]) -> Artifact:
    """Sec. V reads attention off gains and lags: a larger gain with a shorter lag."""
    correlations = [
        verdict_tests.rank_correlation([a.inputs[i].p1.K for a in every], [a.inputs[i].p1.tau for a in every])
        for i in (0, 1)
    ]
    known = all(np.isfinite(test[0]) for test in correlations)
    # holds where both inputs show it, fails where one shows the contrary
    holds, fails = (
        max(test[1] for test in correlations),
        min(min(2.0 * test[2] for test in correlations), 1.0),
    )
    said = f"rank correlation of gain and lag over the episodes {correlations[0][0]:.2f} and {correlations[1][0]:.2f}"
    return Artifact(
        "sec. V",
        "a longer reaction time means a smaller gain",
        "stated of the two inputs of case 3; of those of case 2 it does not hold",
        said if known else "",
        "",
        verdict_tests.decided(holds, fails) if known else ClaimVerdict.NOT_CHECKABLE,
        "gain and lag of one fit have correlated errors, so that this says little of attention; "
        + verdict_tests.stated("Spearman", holds, fails)
        if known
        else "fewer than three episodes, or gains or lags that do not differ",
        ("tables/table_2.csv",),
    )


def fleet(drives: Sequence[DriveAnalysis]) -> Artifact:
    """Whether all drivers have the same gains."""
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
