"""`canid study grover --reproduce`: the printed drivers simulated through DBC and log, and what each method finds again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np

from canid.values.types import NAN, Trace
from canid_study.artifact import Artifact, Cell, ClaimVerdict, Curve, Figure, Panel, Skipped, Study, Table
from canid_study.grover import episodes, joint
from canid_study.grover.episode_analysis import analyse
from canid_study.grover.episodes import INPUTS
from canid_study.grover.joint import Joint
from canid_study.grover.settings import DEFAULTS, GroverSettings
from canid_study.grover.tables import median
from canid_study.printed_numbers import SELECTION_PERCENT

TITLE = "Reproduction: the printed drivers simulated, and identified per input and jointly"
# share of 95 % intervals that have to hold the true gain: of some hundred, fewer than 90 % is chance once in a hundred
COVERAGE = 0.90
# largest |median error| of the joint K1 where it may be quoted, share of K1; of drives of LONG_MIN and more the second
MEDIAN_ERROR, MEDIAN_ERROR_LONG = 0.10, 0.05
LONG_MIN = 10.0  # min
# standard error of the median of n normal errors, in their sd over the root of n: (pi / 2)^(1/2)
OF_MEDIAN = 1.2533
# episodes of each drive that his method is applied to: the longest ones
FITTED = 3


class Recovered(NamedTuple):
    """One simulated drive: what each method finds, and the truth."""

    log: str
    driver: str  # "Table 1"
    minutes: float
    truth: tuple[float, float]  # K1, K2
    correlation: float  # of the inputs, over the usable samples
    joint: Joint
    alone: tuple[Joint, Joint]  # FOPDT of one input, same noise model
    his: tuple[tuple[float, float], ...]  # K1, K2 of his method per episode
    own_fits: tuple[float, ...]  # %, of the joint model per episode
    order_fits: tuple[float, ...]  # %, of the transfer functions
    skipped: tuple[Skipped, ...]


def recovered_of(
    log: str, trace: Trace, truth: Mapping[str, Any], settings: GroverSettings
) -> Recovered | Skipped:
    """Identify one simulated drive.

    Args:
        log: its name.
        trace: as read back.
        truth: of the simulation.
        settings: of the study.
    """
    channels = truth.get("channels", {})
    if trace.input_names != INPUTS or set(channels) != set(INPUTS):
        return Skipped(log, "the whole log", "it is no simulated drive of car following")
    selected = episodes.episodes_of(trace, settings)
    whole = joint.of_drive(trace)
    his, joint_fits, order_fits = [], [], []
    longest = sorted(selected.episodes, key=lambda e: (-e.length, e.first))[:FITTED]
    for episode in longest:
        analysis = analyse(trace, episode, None, whole, settings)
        if not isinstance(analysis, str):
            his.append((analysis.inputs[0].p1.K, analysis.inputs[1].p1.K))
            joint_fits.append(analysis.joint_fit)
            order_fits += [p.model.fit_percent for p in analysis.inputs]
    used = trace.learn & np.isfinite(trace.inputs).all(axis=1)
    return Recovered(
        log,
        str(truth.get("printed_driver", log)),
        float(truth["minutes"]),
        (channels[INPUTS[0]]["K"], channels[INPUTS[1]]["K"]),
        episodes.correlation(*trace.inputs[used].T) if used.any() else NAN,
        whole,
        (joint.one_input(trace, 0), joint.one_input(trace, 1)),
        tuple(his),
        tuple(joint_fits),
        tuple(order_fits),
        episodes.skipped_of(log, selected),
    )


def study(
    drives: Mapping[str, tuple[Trace, dict[str, Any]]],
    settings: GroverSettings = DEFAULTS,
    progress: Callable[[int, int], None] | None = None,
    run: Callable[..., Iterable[Any]] = map,
) -> Study:
    """Study simulated drives, see `printed_drivers.drives`, against their truth.

    Args:
        drives: log -> trace as read back, and the simulation's truth.
        settings: of the study.
        progress: takes the number of drives done and of all.
        run: maps a function over the drives.

    Returns:
        Missed acceptance figures are in `failed`, each as a sentence.
    """
    n = len(drives)
    traces, truths = [d[0] for d in drives.values()], [d[1] for d in drives.values()]
    every: list[Recovered] = []
    skipped: list[Skipped] = []
    for count, recovered in enumerate(
        run(recovered_of, list(drives), traces, truths, repeat(settings, n)), 1
    ):
        if isinstance(recovered, Skipped):
            skipped.append(recovered)
        else:
            every.append(recovered)
            skipped += recovered.skipped
        if progress is not None:
            progress(count, n)
    shown = tuple((name, f"{value:g}") for name, value in settings._asdict().items())
    if not every:
        return Study(
            "Grover 2021", TITLE, ("No simulated drive could be identified.",), (), skipped=tuple(skipped)
        )
    figures = acceptance(every)
    return Study(
        "Grover 2021",
        TITLE,
        _says(every),
        tuple(_artifacts(every, figures)),
        (_drivers(every), _drives(every)),
        (_figure(every),),
        tuple(skipped),
        shown,
        tuple(f.says for f in figures if not f.reached),
    )


# --- acceptance --------------------------------------------------------------------------------------------


class AcceptanceFigure(NamedTuple):
    """A figure to reach."""

    name: str
    reached: bool
    says: str  # with the number


def acceptance(every: Sequence[Recovered]) -> tuple[AcceptanceFigure, ...]:
    """The figures to reach: coverage of the joint intervals, and the median error of the joint K1 by length."""
    held = [h for recovered in every for h in _held(recovered) if h is not None]
    out = []
    if held:
        share = sum(held) / len(held)
        out.append(
            AcceptanceFigure(
                "coverage",
                share >= COVERAGE,
                f"joint gains: {sum(held)} of {len(held)} 95 % intervals hold the truth ({share:.0%}; to reach "
                f"{COVERAGE:.0%})",
            )
        )
    else:
        out.append(AcceptanceFigure("coverage", False, "no drive has a joint fit"))
    for minutes in sorted({recovered.minutes for recovered in every}):
        most = MEDIAN_ERROR_LONG if minutes >= LONG_MIN else MEDIAN_ERROR
        group = [recovered for recovered in every if recovered.minutes == minutes]
        known = [_joint_error(recovered, 0) for recovered in group if _quoted(recovered, 0)]
        middle, drives_known = median(known), f"{len(known)} of {len(group)} drives that know it"
        uncertain = OF_MEDIAN * float(np.std(known, ddof=1)) / len(known) ** 0.5 if len(known) > 1 else NAN
        error = f", standard error {uncertain:.1%}" if np.isfinite(uncertain) else ""
        says = f"joint K1 in {minutes:g} min: median error {middle:+.1%}{error}, in the {drives_known} (to reach {most:.0%})"
        if not known:
            says = f"joint K1 in {minutes:g} min: none of {len(group)} drives knows it"
        out.append(AcceptanceFigure(f"K1 in {minutes:g} min", bool(known) and abs(middle) <= most, says))
    return tuple(out)


def _held(recovered: Recovered) -> list[bool | None]:
    """Whether each interval holds its gain; None: no fit."""
    out: list[bool | None] = []
    for name, K in zip(INPUTS, recovered.truth, strict=True):
        channel = recovered.joint.channels.get(name)
        known = channel is not None and np.isfinite(channel.K.low + channel.K.high)
        out.append(channel.K.low <= K <= channel.K.high if known and channel is not None else None)
    return out


def _joint_error(recovered: Recovered, index: int) -> float:
    channel = recovered.joint.channels.get(INPUTS[index])
    return NAN if channel is None else channel.K.value / recovered.truth[index] - 1.0


def _quoted(recovered: Recovered, index: int) -> bool:
    channel = recovered.joint.channels.get(INPUTS[index])
    return channel is not None and joint.known(channel)


def _alone_error(recovered: Recovered, index: int) -> float:
    models = recovered.alone[index].models
    return models[0].K / recovered.truth[index] - 1.0 if models else NAN


def _his_errors(recovered: Recovered, index: int) -> list[float]:
    return [pair[index] / recovered.truth[index] - 1.0 for pair in recovered.his]


# --- presentation ------------------------------------------------------------------------------------------


def _groups(every: Sequence[Recovered]) -> list[list[Recovered]]:
    keys = dict.fromkeys((recovered.minutes, recovered.driver) for recovered in every)
    return [
        [recovered for recovered in every if (recovered.minutes, recovered.driver) == key] for key in keys
    ]


def _drivers(every: Sequence[Recovered]) -> Table:
    columns = (
        "driver", "length (min)", "drives", "correlation of the inputs", "joint K1 error", "joint K1 error_low",
        "joint K1 error_high", "joint K2 error", "joint K2 error_low", "joint K2 error_high", "K1 intervals that hold",
        "K2 intervals that hold", "K1 quotable", "tau1 quotable", "tau2 quotable", "K1 alone error", "K1 alone error_low",
        "K1 alone error_high", "K2 alone error", "his K1 error", "his K1 error_low", "his K1 error_high", "his K2 error",
        "fit joint (%)", "fit K1 alone (%)", "fit K2 alone (%)", "episodes below 90 %",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for group in _groups(every):
        joint_errors = [
            [_joint_error(recovered, i) for recovered in group if _quoted(recovered, i)] for i in (0, 1)
        ]
        alone = [[_alone_error(recovered, i) for recovered in group] for i in (0, 1)]
        his = [[e for recovered in group for e in _his_errors(recovered, i)] for i in (0, 1)]
        held = [[h for recovered in group if (h := _held(recovered)[i]) is not None] for i in (0, 1)]
        fits = [f for recovered in group for f in recovered.own_fits if np.isfinite(f)]
        rows.append(
            (
                group[0].driver, group[0].minutes, len(group), median([recovered.correlation for recovered in group]),
                *_range(joint_errors[0]), *_range(joint_errors[1]), *(f"{sum(h)} of {len(h)}" for h in held),
                _quotable(group, 0, ("ok", "sum_only", "gain_only")), _quotable(group, 0, ("ok",)),
                _quotable(group, 1, ("ok",)), *_range(alone[0]), median(alone[1]), *_range(his[0]), median(his[1]),
                median([recovered.joint.fit_percent for recovered in group]),
                *(median([recovered.alone[i].fit_percent for recovered in group]) for i in (0, 1)),
                f"{sum(f < SELECTION_PERCENT for f in fits)} of {len(fits)}",
            )
        )  # fmt: skip
    note = (
        "Errors as shares of the true gain: median, least and largest; joint ones where the gain may be quoted. "
        "Alone: one first-order model with dead time of one "
        "input, same noise model. His: output error of order 1 to 11 and P1 per episode, all episodes of the drives. Below "
        "90 %: episodes in which the joint model, which has the true structure, would be rejected."
    )
    return Table("reproduction", "Printed drivers found again", columns, rows, note)


def _quotable(group: Sequence[Recovered], index: int, statuses: tuple[str, ...]) -> str:
    channels = [recovered.joint.channels.get(INPUTS[index]) for recovered in group]
    return f"{sum(c is not None and c.status.value in statuses for c in channels)} of {len(group)}"


def _drives(every: Sequence[Recovered]) -> Table:
    columns = (
        "log", "true K1", "joint K1", "joint K1_low", "joint K1_high", "joint K1 status", "K1 alone", "his K1",
        "true K2", "joint K2", "joint K2_low", "joint K2_high", "joint K2 status", "K2 alone", "his K2",
        "correlation of the inputs", "fit joint (%)", "remarks",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for recovered in every:
        cells: list[Cell] = [recovered.log]
        for index, name in enumerate(INPUTS):
            c = recovered.joint.channels.get(name)
            models = recovered.alone[index].models
            cells += [recovered.truth[index]]
            cells += (
                [None, None, None, "no fit"] if c is None else [c.K.value, c.K.low, c.K.high, c.status.value]
            )
            cells += [models[0].K if models else None, median([pair[index] for pair in recovered.his])]
        rows.append((*cells, recovered.correlation, recovered.joint.fit_percent, recovered.joint.says))
    return Table(
        "reproduction_drives", "Each simulated drive", columns, rows, "His: median over its episodes."
    )


def _show(x: tuple[float, float, float]) -> str:
    """Median and range of errors in words.

    >>> _show((0.1, 0.0, 0.2)), _show((NAN, NAN, NAN))
    ('+10% (+0% to +20%)', 'not identifiable')
    """
    return f"{x[0]:+.0%} ({x[1]:+.0%} to {x[2]:+.0%})" if np.isfinite(x[0]) else "not identifiable"


def _range(x: Sequence[float]) -> tuple[float, float, float]:
    known = [v for v in x if np.isfinite(v)]
    return (median(known), min(known), max(known)) if known else (NAN, NAN, NAN)


def _says(every: Sequence[Recovered]) -> tuple[str, ...]:
    out = []
    for minutes in sorted({recovered.minutes for recovered in every}):
        group = [recovered for recovered in every if recovered.minutes == minutes]
        joint_error = _range([_joint_error(recovered, 0) for recovered in group if _quoted(recovered, 0)])
        his = _range([e for recovered in group for e in _his_errors(recovered, 0)])
        alone = _range([_alone_error(recovered, 0) for recovered in group])
        out.append(
            f"{minutes:g} min, {len(group)} drives: joint K1 {_show(joint_error)}, "
            f"{sum(_quoted(recovered, 0) for recovered in group)} drives know it; by his "
            f"method {_show(his)}; headway error alone {alone[0]:+.0%}."
        )
    fits = [f for recovered in every for f in recovered.own_fits if np.isfinite(f)]
    if fits:
        out.append(
            f"The gate of {SELECTION_PERCENT:g} % rejects the joint model in {sum(f < SELECTION_PERCENT for f in fits)} of "
            f"{len(fits)} episodes (median fit {median(fits):.0f} %)."
        )
    return tuple(out)


def _artifacts(every: Sequence[Recovered], figures: Sequence[AcceptanceFigure]) -> Iterable[Artifact]:
    table = ("tables/reproduction.csv", "tables/reproduction_drives.csv")
    for group in _groups(every):
        joint_error, his = (
            _range([_joint_error(recovered, 0) for recovered in group if _quoted(recovered, 0)]),
            _range([e for recovered in group for e in _his_errors(recovered, 0)]),
        )
        alone = _range([_alone_error(recovered, 0) for recovered in group])
        second = (
            median([_joint_error(recovered, 1) for recovered in group if _quoted(recovered, 1)]),
            median([e for recovered in group for e in _his_errors(recovered, 1)]),
        )
        known = np.isfinite(his[0])
        yield Artifact(
            f"claim G17, {group[0].driver}, {group[0].minutes:g} min",
            f"driver with K1 {group[0].truth[0]:g}, K2 {group[0].truth[1]:g}; drives: {len(group)}",
            "identified by one fit per input",
            f"K1 {_show(his)}, K2 {second[1]:+.0%}; headway error alone over the drive: K1 {alone[0]:+.0%}"
            if known
            else f"no episode is long enough; headway error alone over the drive: K1 {alone[0]:+.0%}",
            f"K1 {_show(joint_error)}, K2 {second[0]:+.0%}",
            ClaimVerdict.NOT_CHECKABLE
            if not known
            else ClaimVerdict.FAILS
            if abs(his[0]) > MEDIAN_ERROR
            else ClaimVerdict.HOLDS,
            f"median error (range) in this loop, correlation of the inputs "
            f"{median([recovered.correlation for recovered in group]):.2f}",
            table,
        )
    fits = [f for recovered in every for f in recovered.own_fits if np.isfinite(f)]
    order_fits = [f for recovered in every for f in recovered.order_fits]
    rejected = sum(f < SELECTION_PERCENT for f in fits)
    yield Artifact(
        "claim G13",
        "models that fit less than 90 % are rejected",
        "fit of 90 % and more",
        f"{sum(f >= SELECTION_PERCENT for f in order_fits)} of {len(order_fits)} transfer functions reach it",
        f"rejects the joint model in {rejected} of {len(fits)} episodes, median fit {median(fits):.1f} %",
        ClaimVerdict.NOT_CHECKABLE
        if not fits
        else ClaimVerdict.FAILS
        if rejected > 0.05 * len(fits)
        else ClaimVerdict.HOLDS,
        "the noise of the simulated drivers is 1.5 % of pedal: a right model does not fit better",
        table,
    )
    delays = [_quotable(every, i, ("ok",)) for i in (0, 1)]
    yield Artifact(
        "claim G10",
        "lags tau_d1 and tau_d2 of the printed size can be identified",
        "0.026 to 0.734 s",
        "",
        f"lag quotable apart from the dead time: tau1 in {delays[0]} drives, tau2 in {delays[1]}",
        ClaimVerdict.SHOWN,
        "the inputs have next to no power where such lags show",
        table,
    )
    for figure in figures:
        yield Artifact(
            f"acceptance: {figure.name}",
            "figure to reach",
            "",
            "",
            figure.says,
            ClaimVerdict.HOLDS if figure.reached else ClaimVerdict.FAILS,
            "",
            table,
        )


def _figure(every: Sequence[Recovered]) -> Figure:
    """Error of K1 by driver."""
    panels = []
    for minutes in sorted({recovered.minutes for recovered in every}):
        group = [recovered for recovered in every if recovered.minutes == minutes]
        names = list(dict.fromkeys(recovered.driver for recovered in group))
        place = {name: float(k + 1) for k, name in enumerate(names)}

        def points(
            label: str,
            role: str,
            pairs: list[tuple[str, float]],
            shift: float,
            place: dict[str, float] = place,
        ) -> Curve:
            x = np.array([place[name] + shift for name, _ in pairs])
            y = np.array([100.0 * v for _, v in pairs])
            return Curve(x, y, label, points=True, role=role)

        curves = (
            points(
                "joint",
                "corrected",
                [
                    (recovered.driver, _joint_error(recovered, 0))
                    for recovered in group
                    if _quoted(recovered, 0)
                ],
                -0.15,
            ),
            points(
                "his method, per episode",
                "reproduced",
                [(recovered.driver, e) for recovered in group for e in _his_errors(recovered, 0)],
                0.0,
            ),
            points(
                "headway error alone",
                "other",
                [(recovered.driver, _alone_error(recovered, 0)) for recovered in group],
                0.15,
            ),
            Curve(np.array([0.5, len(names) + 0.5]), np.zeros(2), "truth", role="measured", dashed=True),
        )
        label = "driver: " + ", ".join(f"{int(place[name])} {name}" for name in names)
        panels.append(Panel(label, "error of K1 (%)", curves, title=f"{minutes:g} min"))
    return Figure(
        "reproduction",
        "Error of K1 of the printed drivers",
        tuple(panels),
        "Each point a drive or an episode.",
    )
