"""Their method and canid's on the printed drivers simulated, whose truth is known: which numbers come back, which do not."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.values.types import Array, Trace
from canid_study.artifact import Artifact, Cell, ClaimVerdict, Study, Table
from canid_study.chen_ulsoy import between, chen_ulsoy
from canid_study.chen_ulsoy.driver_analysis import Driver
from canid_study.chen_ulsoy.segment_fits import NAMES
from canid_study.chen_ulsoy.settings import ChenUlsoySettings

# acceptance: the standard deviation that remains after sampling, against the drawn one
SPLIT_TOLERANCE = 0.10
# of constant drivers: share of intervals that hold 0, and share of |Delta| above the null
CONSTANT_SHARE, DELTA_SHARE = 0.90, 0.05
# minutes below which the standard deviation of the drawn models itself is not known to the tolerance: of 200 draws from
# a Gaussian its standard error is 5 %
_MIN_MINUTES = 200
# intervals of constant drivers below which their share says nothing: 8 drivers with 4 parameters
_MIN_INTERVALS = 32
# standard errors that a share of few values may exceed its limit by, when it is judged
_ERRORS = 2.0


class Recovered(NamedTuple):
    """Drawn and found of one parameter over all drivers that change."""

    name: str
    drawn_mean: float
    corrected_mean: float  # without the bias of the minute fits
    naive_mean: float
    drawn_sd: float
    naive_sd: float
    split_sd: float  # between minutes and drivers together, sampling taken off


def study(
    drives: Mapping[str, tuple[Trace, dict[str, Any]]],
    settings: ChenUlsoySettings = ChenUlsoySettings(),  # noqa: B008
    progress: Callable[[int, int], None] | None = None,
    run: Callable[..., Iterable[Any]] = map,
) -> Study:
    """Analyse simulated drivers and compare with their truth.

    Args:
        drives: name -> trace and truth, of `printed_drivers.drives`; one drive each.
        settings: of the analysis.
        progress: called with drivers done and their total.
        run: maps a function over drivers.

    Returns:
        The study of the drives, with the comparison in front and missed figures in `failed`.
    """
    drivers = chen_ulsoy.analysed(
        {name: [(name, trace)] for name, (trace, _) in drives.items()}, settings, progress, run
    )
    whole = chen_ulsoy.made(drivers, settings)
    truths = {name: truth for name, (_, truth) in drives.items()}
    good = [d for d in drivers if not d.why and d.name in truths]
    changing = [
        d for d in good if truths[d.name].get("kind") == "minutes" and not truths[d.name].get("hidden")
    ]
    constant = [
        d for d in good if truths[d.name].get("kind") == "constant" and not truths[d.name].get("hidden")
    ]
    planted = [d for d in good if truths[d.name].get("hidden")]
    rows: list[Artifact] = []
    tables: list[Table] = []
    failed: list[str] = []
    came_back: list[tuple[float, Recovered]] = []
    for c1 in sorted({_c1(truths[d.name]) for d in changing}):
        alike = [d for d in changing if _c1(truths[d.name]) == c1]
        made = recovered(alike, truths)
        came_back += [(c1, r) for r in made]
        rows += [_recovered_row(r, c1) for r in made]
        if sum(len(d.number) for d in alike) >= _MIN_MINUTES:
            failed += [
                f"{r.name}, c1 {c1:g}: the standard deviation without sampling is {r.split_sd:.3f}, "
                f"{abs(r.split_sd / r.drawn_sd - 1):.0%} off the drawn {r.drawn_sd:.3f} (at most {SPLIT_TOLERANCE:.0%})"
                for r in made
                if abs(r.split_sd / r.drawn_sd - 1.0) > SPLIT_TOLERANCE
            ]
    if changing:
        tables += [_recovered_table(came_back), _drawn_correlations(changing, truths)]
    if constant:
        row, missed = _constant(constant)
        rows += row
        failed += missed
    for d in planted:
        row_, missed = _planted(d, truths[d.name])
        rows.append(row_)
        failed += missed
    loop: dict[str, float] = next((t["loop"] for t in truths.values() if "loop" in t), {})
    return whole._replace(
        title="Lane keeping: the printed drivers, simulated and analysed",
        artifacts=(*rows, *whole.artifacts),
        tables=(*tables, *whole.tables),
        settings=(*whole.settings, *((f"loop: {k}", f"{v:g}") for k, v in loop.items())),
        failed=tuple(failed),
    )


def models_of(driver: Driver, truth: Mapping[str, Any]) -> Array:
    """True models (S, 4) of the segments that were used: segment k is minute k + 1 of the drive."""
    models = np.asarray(truth["models"], float)
    out: Array = models[np.minimum(driver.number + 1, len(models) - 1)]
    return out


def recovered(drivers: Sequence[Driver], truths: Mapping[str, Mapping[str, Any]]) -> list[Recovered]:
    """What came back of the drawn distribution."""
    true = [models_of(d, truths[d.name]) for d in drivers]
    drawn = np.concatenate(true)
    split = between.split(NAMES, [d.group for d in drivers])
    naive = np.concatenate([d.model for d in drivers])
    less = np.concatenate([d.model - (0.0 if d.repeated is None else d.repeated.bias) for d in drivers])
    out = []
    for j, s in enumerate(split):
        among = 0.0 if not np.isfinite(s.drivers.value) else s.drivers.value
        out.append(
            Recovered(
                s.name,
                float(drawn[:, j].mean()),
                float(less[:, j].mean()),
                float(naive[:, j].mean()),
                float(drawn[:, j].std(ddof=1)),
                s.naive,
                float(np.hypot(s.minutes.value, among)),
            )
        )
    return out


def _c1(truth: Mapping[str, Any]) -> float:
    return float(truth["loop"]["c1"])


def _recovered_row(r: Recovered, c1: float) -> Artifact:
    off = r.split_sd / r.drawn_sd - 1.0
    return Artifact(
        f"reproduction: {r.name}, c1 {c1:g}",
        "mean ± std of the drawn drivers",
        f"drawn: {r.drawn_mean:.3f} ± {r.drawn_sd:.3f}",
        f"minute fits: {r.naive_mean:.3f} ± {r.naive_sd:.3f}",
        f"without sampling: {r.corrected_mean:.3f} ± {r.split_sd:.3f}",
        ClaimVerdict.HOLDS if abs(off) <= SPLIT_TOLERANCE else ClaimVerdict.FAILS,
        f"the corrected standard deviation is {off:+.0%} off, the naive one {r.naive_sd / r.drawn_sd - 1:+.0%}",
        ("tables/recovered.csv",),
    )


def _recovered_table(made: Sequence[tuple[float, Recovered]]) -> Table:
    rows: list[list[Cell]] = [[r.name, c1, *r[1:]] for c1, r in made]
    return Table(
        "recovered",
        "The drawn distribution and what came back",
        (
            "parameter",
            "c1",
            "drawn mean",
            "mean without bias",
            "mean of minute fits",
            "drawn std",
            "std of minute fits",
            "std without sampling",
        ),
        rows,
    )


def _drawn_correlations(drivers: Sequence[Driver], truths: Mapping[str, Mapping[str, Any]]) -> Table:
    drawn = np.concatenate([models_of(d, truths[d.name]) for d in drivers])
    naive = np.concatenate([d.model for d in drivers])
    estimated = between.covariance([d.group for d in drivers])
    rows: list[list[Cell]] = []
    for what, C in (
        ("drawn", np.cov(drawn.T)),
        ("minute fits", np.cov(naive.T)),
        ("without sampling", None if estimated is None else estimated.between),
    ):
        if C is None:
            continue
        sd = np.sqrt(np.diag(C))
        rows += [
            [what, p, *(float(x) for x in row)] for p, row in zip(NAMES, C / np.outer(sd, sd), strict=True)
        ]
    return Table("drawn_correlations", "Correlations, drawn and found", ("of", "parameter", *NAMES), rows)


def _constant(drivers: Sequence[Driver]) -> tuple[list[Artifact], list[str]]:
    """Drivers who never change."""
    splits = [s for d in drivers for s in between.split(NAMES, [d.group])]
    holds = [s.minutes.low <= 0.0 for s in splits]
    share = float(np.mean(holds))
    naive = float(np.mean([np.std(d.model[:, 2], ddof=1) for d in drivers]))
    drift = [d.drift for d in drivers if d.drift is not None]
    rows = [
        Artifact(
            "reproduction: constant drivers",
            "between-minute variance 0 inside its interval",
            "minute fits have a std",
            f"std of b1 {naive:.2f}",
            f"0 inside the interval in {share:.0%} of {len(holds)}; a driver is said to change (p < 0.01) in "
            f"{sum(x.p_value < 0.01 for x in drift)} of {len(drift)}",
            ClaimVerdict.HOLDS if share >= CONSTANT_SHARE else ClaimVerdict.FAILS,
            "sampling alone",
            ("tables/structured.csv",),
        )
    ]
    failed = []
    slack = (
        _ERRORS * (CONSTANT_SHARE * (1.0 - CONSTANT_SHARE) / len(holds)) ** 0.5
        if len(holds) < 4 * _MIN_INTERVALS
        else 0.0
    )
    if len(holds) >= _MIN_INTERVALS and share < CONSTANT_SHARE - slack:
        failed.append(
            f"constant drivers: 0 is inside {share:.0%} of the intervals between minutes (at least {CONSTANT_SHARE:.0%})"
        )
    known = [d.excess for d in drivers if d.excess is not None]
    if known:
        above = float(np.mean([e.frequencies for e in known]))
        rows.append(
            Artifact(
                "reproduction: |Delta| of constant drivers",
                "frequencies above the null",
                "",
                f"median |Delta| {np.median([np.median(np.abs(d.delta)) for d in drivers]):.2f} deg/m",
                f"{above:.1%} of frequencies above the simultaneous band; "
                f"{np.mean([e.share for e in known]):.1%} of |Delta| above the band of its segment",
                ClaimVerdict.HOLDS if above <= DELTA_SHARE else ClaimVerdict.FAILS,
                "no unmodeled dynamics were simulated",
                ("tables/unmodeled.csv",),
            )
        )
        # a driver exceeds the band at all frequencies or none, so that one of n drivers may
        if above > max(DELTA_SHARE, 1.0 / len(known)):
            failed.append(
                f"constant drivers: |Delta| exceeds its null at {above:.1%} of frequencies (at most {DELTA_SHARE:.0%})"
            )
    return rows, failed


def _planted(d: Driver, truth: Mapping[str, Any]) -> tuple[Artifact, list[str]]:
    """A driver with an effect that ARMAX does not hold: |Delta| or the test of a dead zone has to show it."""
    hidden = ", ".join(truth["hidden"])
    linear = d.excess is not None and d.excess.frequencies > 0.0
    zone = d.dead_zone is not None and d.dead_zone.p_value < 0.01 and d.dead_zone.statistic > 0.0
    known = d.excess is not None or d.dead_zone is not None
    says = []
    if d.excess is not None:
        says.append(f"|Delta| exceeds its null at {d.excess.frequencies:.0%} of frequencies")
    if d.dead_zone is not None:
        says.append(f"dead zone z = {d.dead_zone.statistic:.1f}")
    row = Artifact(
        f"reproduction: {hidden}",
        f"planted in {d.name}",
        "",
        "",
        "; ".join(says),
        ClaimVerdict.HOLDS if linear or zone else ClaimVerdict.FAILS,
        "found by |Delta|"
        if linear
        else "found by the test of the innovations, not by |Delta|"
        if zone
        else "not found",
        ("tables/unmodeled.csv",),
    )
    failed = [] if linear or zone or not known else [f"{hidden} planted in {d.name} exceeds no null"]
    return row, failed
