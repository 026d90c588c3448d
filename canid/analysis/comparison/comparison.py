"""Two drivers compared, parameter by parameter: every verdict holds for all parameters together with 95 %."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from canid.analysis.comparison import between_drives, causes, conditions, loop_margins, multiplicity
from canid.analysis.comparison.causes import CauseCompared
from canid.analysis.comparison.conditions import Condition
from canid.analysis.comparison.drive import DriveEstimates, Quantity, Side, finite
from canid.analysis.comparison.multiplicity import Block
from canid.analysis.comparison.remarks import remarks
from canid.mathematics.identification.confidence import MISS, NORMAL_QUANTILE
from canid.values.presentation import Shown
from canid.values.types import NAN, Array, Interval

# standard normal quantile of 80 %: with this power a difference of the detectable size is found
POWER_QUANTILE = 0.8416

# between the name of a cause and that of its parameter
OF_CAUSE = ": "
OF_NOISE = ("noise_sd",)
DIFFERENT, NO_DIFFERENCE, NOT_COMPARABLE = "different", "no_difference_found", "not_comparable"


class Row(NamedTuple):
    """One parameter on both sides."""

    name: str  # "range_rate K"
    unit: str
    a: Interval
    b: Interval
    why: str = ""  # not empty: not comparable, and why; all that follows is then empty
    difference: Interval = Interval()  # b - a
    together: Interval = Interval()  # the same; all rows' intervals hold together with 95 %
    ratio: Interval = Interval()  # b / a; empty where one of them may be 0
    p: float = NAN
    p_adjusted: float = NAN  # for all rows together
    differs: bool = False
    detectable: float = NAN  # a difference that would be found with a power of 80 %
    spread: float = NAN  # sd between drives of one driver; NaN: one drive a side
    drives: tuple[int, int] = (0, 0)  # that know it

    @property
    def compared(self) -> bool:
        """Is there a verdict on it?"""
        return not self.why


class _Comparison(NamedTuple):
    a: Side
    b: Side
    verdict: str  # "different", "no_difference_found", "not_comparable"
    rows: tuple[Row, ...]
    causes: tuple[CauseCompared, ...]
    conditions: tuple[Condition, ...]
    remarks: tuple[str, ...]
    critical: float  # half-width of the intervals that hold together, in standard deviations
    point: loop_margins.Point | None  # where margins were computed

    def __repr__(self) -> str:
        lines = [f"Comparison({self.verdict}, {sum(row.compared for row in self.rows)} parameters compared"]
        lines += [f"  {row.name}: A {row.a}, B {row.b}, p {row.p_adjusted:.2g}" for row in self.different]
        return "\n".join(lines) + ")"

    @property
    def different(self) -> tuple[Row, ...]:
        """Rows that differ, the surest first; margins, which follow from the parameters, last."""
        derived = {name for name, *_ in loop_margins.MARGINS}
        differing = [row for row in self.rows if row.differs]
        return tuple(sorted(differing, key=lambda row: (row.name in derived, row.p)))


class Comparison(_Comparison, Shown):
    """Side B against side A."""

    __slots__ = ()


class Values(NamedTuple):
    """What one drive brings to the comparison."""

    quantities: Mapping[str, Quantity]
    names: tuple[str, ...]  # of the correlation
    correlation: Array | None


def compare(a: Side, b: Side) -> Comparison:
    """Compare two drivers.

    Args:
        a: one driver's drives, at least one.
        b: the other's.

    Returns:
        what differs; what is not identifiable on one side is not compared, and says why.

    Example:
        >>> def side(label, low, high):
        ...     value = Quantity(Interval(0.5 * (low + high), low, high), "% per m/s")
        ...     return Side(label, (DriveEstimates(label, "identify", "car", "pedal", 300.0, {"range_rate K": value}),))
        >>> compare(side("A", 4.5, 5.5), side("B", 7.0, 8.0)).verdict, compare(side("A", 4, 6), side("B", 4.5, 6.5)).verdict
        ('different', 'no_difference_found')
    """
    point = loop_margins.common_point([*a.drives, *b.drives])
    sides = {"A": [_values(d, point) for d in a.drives], "B": [_values(d, point) for d in b.drives]}
    names = dict.fromkeys(name for side in sides.values() for values in side for name in values.quantities)
    rows, contrasts = [], []
    for name in names:
        known = {label: [values.quantities.get(name) for values in side] for label, side in sides.items()}
        # of a cause that one side alone has, `causes` judges
        if OF_CAUSE in name and not all(any(side) for side in known.values()):
            continue
        row, contrast = _row(name, known)
        rows.append(row)
        if contrast is not None:
            contrasts.append((len(rows) - 1, contrast))
    compared = [rows[k].name for k, _ in contrasts]
    blocks = _blocks(sides, compared, [contrast for _, contrast in contrasts])
    critical = multiplicity.critical_value(len(contrasts), blocks) if contrasts else NAN
    p = multiplicity.adjusted([contrast.z for _, contrast in contrasts], blocks)
    for (k, contrast), adjusted in zip(contrasts, p, strict=True):
        rows[k] = _judged(rows[k], contrast, float(adjusted), critical)
    compared_causes = causes.compare(a, b)
    if any(row.differs for row in rows) or any(cause.differs for cause in compared_causes):
        verdict = DIFFERENT
    else:
        # equal noise alone says nothing on how both drive
        verdict = (
            NO_DIFFERENCE
            if any(row.compared and row.name not in OF_NOISE for row in rows)
            else NOT_COMPARABLE
        )
    table = conditions.table(a, b)
    joint = all(values.correlation is not None for side in sides.values() for values in side)
    said = (*conditions.warnings(table, a, b), *remarks(a, b, joint=joint))
    return Comparison(a, b, verdict, tuple(rows), compared_causes, table, said, critical, point)


def _values(drive: DriveEstimates, point: loop_margins.Point | None) -> Values:
    """Quantities of a drive, with its margins and the parameters of its causes, and how their errors go together."""
    quantities = dict(drive.quantities)
    draws = _draws(drive)
    if point is not None:
        of_loop = loop_margins.margins(drive, point)
        for name, _, unit in loop_margins.MARGINS:
            if name in of_loop:
                quantities[name] = Quantity(loop_margins.interval(of_loop[name]), unit)
                draws[name] = of_loop[name]
    for effect in drive.causes.effects if drive.causes else ():
        for parameter, value in effect.parameters.items():
            why = "" if finite(value.value) else "no interval"
            quantities[f"{effect.name}{OF_CAUSE}{parameter}"] = value._replace(why=value.why or why)
    if draws:
        return Values(quantities, tuple(draws), _rank_correlation(list(draws.values())))
    if drive.correlation is not None:
        return Values(quantities, drive.correlation.names, drive.correlation.matrix)
    return Values(quantities, (), None)


def _draws(drive: DriveEstimates) -> dict[str, Array]:
    drawn = drive.draws
    if drawn is None:
        return {}
    out: dict[str, Array] = {}
    for i, name in enumerate(drawn.inputs):
        K, tau, dead_time = drawn.K[:, i], drawn.tau[:, i], drawn.dead_time[:, i]
        columns = {"K": K, "tau": tau, "dead_time": dead_time, "tau_plus_dead_time": tau + dead_time}
        out |= {f"{name} {field}": column for field, column in columns.items()}
    return out


def _rank_correlation(columns: Sequence[Array]) -> Array:
    """Correlation of the normals behind the ranks (Pearson 1907): margins may be infinite or at their bound."""
    ranks = np.array(columns)
    moves = np.ptp(np.where(np.isfinite(ranks), ranks, 1e300), axis=1) > 0.0
    out = np.eye(len(ranks))
    if moves.sum() > 2:
        correlation = np.asarray(spearmanr(ranks[moves], axis=1).statistic)
        out[np.ix_(moves, moves)] = 2.0 * np.sin(np.pi / 6.0 * correlation)
    np.fill_diagonal(out, 1.0)
    return out


def _row(
    name: str, known: Mapping[str, Sequence[Quantity | None]]
) -> tuple[Row, between_drives.Contrast | None]:
    """A row without a verdict, and the contrast where there can be one."""
    usable = {label: [q for q in side if q is not None and not q.why] for label, side in known.items()}
    unit = next(q.unit for side in known.values() for q in side if q is not None)
    count = (len(usable["A"]), len(usable["B"]))
    whys = {label: _why(known[label], usable[label]) for label in ("A", "B")}
    same = len({*whys.values()}) == 1
    why = "; ".join(
        f"{'A and B' if same else label}: {said}" for label, said in list(whys.items())[same:] if said
    )
    units = list(dict.fromkeys(q.unit for side in usable.values() for q in side))
    if not why and len(units) > 1:
        why = f"the units differ: {' and '.join(units)}"
    if why:
        return Row(name, unit, _shown(known["A"]), _shown(known["B"]), why, drives=count), None
    contrast = between_drives.contrast([q.value for q in usable["A"]], [q.value for q in usable["B"]])
    return Row(name, units[0], contrast.a, contrast.b, spread=contrast.spread, drives=count), contrast


def _why(side: Iterable[Quantity | None], usable: Sequence[Quantity]) -> str:
    if usable:
        return ""
    reasons = dict.fromkeys(q.why for q in side if q is not None and q.why)
    return " / ".join(reasons) or "not known"


def _shown(side: Iterable[Quantity | None]) -> Interval:
    """What may be shown of a side that is not compared: its one value, if it may be quoted."""
    quoted = [q.value for q in side if q is not None and not q.why]
    return quoted[0] if len(quoted) == 1 else Interval()


def _judged(row: Row, contrast: between_drives.Contrast, p_adjusted: float, critical: float) -> Row:
    difference = contrast.difference()
    # mean of both half-widths, in standard deviations that of the critical value and of the power
    wide = contrast.difference(critical + POWER_QUANTILE)
    z = contrast.z
    return row._replace(
        difference=difference,
        together=contrast.difference(critical),
        ratio=contrast.ratio(),
        p=math.erfc(abs(z) / math.sqrt(2.0)),
        p_adjusted=p_adjusted,
        differs=p_adjusted < MISS,
        detectable=0.5 * (wide.high - wide.low),
    )


def _blocks(
    sides: Mapping[str, Sequence[Values]],
    compared: Sequence[str],
    contrasts: Sequence[between_drives.Contrast],
) -> list[Block]:
    """The block of known correlation: of one drive a side, what both sides' posteriors hold."""
    (a, *more_a), (b, *more_b) = sides["A"], sides["B"]
    if more_a or more_b or a.correlation is None or b.correlation is None:
        return []
    members = [k for k, name in enumerate(compared) if name in a.names and name in b.names]
    if len(members) < 2:
        return []
    total = np.zeros((len(members), len(members)))
    for side, values in (("a", a), ("b", b)):
        assert values.correlation is not None
        at = [values.names.index(compared[k]) for k in members]
        ends = [getattr(contrasts[k], side) for k in members]
        sd = np.array([(iv.high - iv.low) / (2.0 * NORMAL_QUANTILE) for iv in ends])
        total += values.correlation[np.ix_(at, at)] * np.outer(sd, sd)
    size = np.sqrt(np.maximum(np.diag(total), 1e-300))
    return [Block(tuple(members), total / np.outer(size, size))]
