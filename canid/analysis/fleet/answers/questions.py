"""Questions to the drivers of a population: changes, labels, pairs, groups; each with its false discovery rate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.analysis.fleet.answers.labels import unit
from canid.analysis.fleet.storage.columns import natural
from canid.mathematics.population import change_over_time, groups, same_driver
from canid.mathematics.population.drive_table import DriveTable
from canid.mathematics.population.false_discovery import RATE
from canid.mathematics.population.hierarchical import Population
from canid.values.fleet_summary import Answer, Kind, Questions
from canid.values.types import Array, Interval

# tests that a table or page may list; all are counted
MAX_TESTS = 100
# of those that were not found so many are listed: the nearest to it
NOT_FOUND = 5
# names in a sentence
MAX_NAMES = 3


def asked(table: DriveTable, pool: Population, kind: Kind) -> tuple[Questions, ...]:
    """Ask whether drivers changed over weeks, whether drives fit their drivers, which drivers differ, and groups.

    Args:
        table: the drives.
        pool: of them.
        kind: of their output.
    """
    if not len(table.driver):
        return ()
    out = [changes(table, pool, kind), labels(table, pool), pairs(table, pool)]
    if len(set(table.group) - {""}) > 1:
        out.append(between_groups(table, table.group, "groups", kind))
    if not kind.car and len(set(table.car) - {""}) > 1:
        out.append(between_groups(table, table.car, "cars", kind))
    return tuple(out)


def changes(table: DriveTable, pool: Population, kind: Kind) -> Questions:
    """Did drivers change over the weeks."""
    change = change_over_time.change_over_time(table, pool)
    tests = []
    for i in np.flatnonzero(np.isfinite(change.p_value)):
        k = _clearest(change.slope[i], (change.high[i] - change.low[i]) / 2.0)
        name = table.names[k]
        slope = Interval(float(change.slope[i, k]), float(change.low[i, k]), float(change.high[i, k]))
        effect, units = _change(slope, name, kind)
        says = f"over {change.weeks[i]:.0f} weeks, {change.drives[i]:.0f} drives"
        tests.append(
            Answer(
                table.drivers[i], name, effect, f"{units} per week", float(change.p_value[i]), float(change.adjusted[i]),
                bool(change.changed[i]), says,
            )
        )  # fmt: skip
    why = "" if tests else f"no driver was tested: {_commonest(change.status)}"
    return _questions(
        "did a driver change over the weeks?", "drivers changed", tests, why, "{} changed over the weeks"
    )


def labels(table: DriveTable, pool: Population) -> Questions:
    """Does each drive fit its driver."""
    fit = same_driver.drives_fit(table, pool)
    tests = []
    for i in np.flatnonzero(np.isfinite(fit.p_value)):
        label = table.drivers[table.driver[i]]
        says = f"it stands with {label}"
        if fit.misfit[i] and fit.closest[i] != table.driver[i]:
            says += f", but is most like {table.drivers[fit.closest[i]]}"
        k = _clearest(fit.score[i], np.ones(len(table.names)))
        p, q = float(fit.p_value[i]), float(fit.adjusted[i])
        tests.append(Answer(table.drives[i], table.names[k], Interval(), "", p, q, bool(fit.misfit[i]), says))
    why = "" if tests else f"no drive was tested: {_commonest(fit.status)}"
    return _questions(
        "is each drive by the driver it stands with?",
        "drives do not fit their driver",
        tests,
        why,
        "not like their driver's other drives: {}",
    )


def pairs(table: DriveTable, pool: Population) -> Questions:
    """Which drivers differ; listed are the pairs that may be one person."""
    compared = same_driver.pairs(table, pool)
    tested = np.flatnonzero(np.isfinite(compared.p_value))
    different = int(compared.different[tested].sum())
    alike = [m for m in tested if compared.status[m].startswith("perhaps one person")]
    unknown = sum(compared.status[m].startswith("cannot be separated") for m in tested)
    tests = [
        Answer(
            f"{table.drivers[compared.a[m]]} and {table.drivers[compared.b[m]]}", "", Interval(), "",
            float(compared.p_value[m]), float(compared.adjusted[m]), False, "perhaps one person",
        )
        for m in sorted(alike, key=lambda m: -compared.p_value[m])[:MAX_TESTS]
    ]  # fmt: skip
    says = list(compared.says)
    if unknown:
        says.append(
            f"{unknown:,} pair{'s' * (unknown != 1)} cannot be separated: their drives would not show an ordinary difference"
        )
    if alike:
        says.append(
            f"{len(alike):,} pairs are perhaps one person: two drivers of this population would mostly be seen to differ"
        )
    return Questions(
        "which pairs of drivers differ?", "pairs of drivers differ", len(tested), different, RATE, tuple(tests),
        "; ".join(says), _how_many(different, len(tested), unknown),
    )  # fmt: skip


def _how_many(different: int, tested: int, unknown: int) -> str:
    if not tested:
        return ""
    counted = f"{different:,} of {tested:,} pairs of drivers differ"
    return f"{counted}; {unknown:,} would need more drives to be separated" if unknown else counted


def between_groups(table: DriveTable, names: Sequence[str], what: str, kind: Kind) -> Questions:
    """Do groups of drives differ, each pair of them."""
    compared = groups.contrasts(table, tuple(names))
    tests = []
    for m in np.flatnonzero(np.isfinite(compared.p_value)):
        k = _clearest(compared.difference[m], (compared.high[m] - compared.low[m]) / 2.0)
        iv = Interval(float(compared.difference[m, k]), float(compared.low[m, k]), float(compared.high[m, k]))
        effect, units = _change(iv, table.names[k], kind)
        subject = f"{compared.groups[compared.b[m]]} less {compared.groups[compared.a[m]]}"
        p, q = float(compared.p_value[m]), float(compared.adjusted[m])
        tests.append(
            Answer(
                subject, table.names[k], effect, units, p, q, bool(compared.different[m]), compared.status[m]
            )
        )
    return _questions(
        f"do {what} differ?",
        f"pairs of {what} differ",
        tests,
        "; ".join(compared.says),
        f"{what} differ: {{}}",
    )


def _questions(question: str, finding: str, tests: list[Answer], says: str, sentence: str) -> Questions:
    ordered = sorted(tests, key=lambda test: (not test.found, test.q, test.p, test.subject))
    subjects = [test.subject for test in ordered if test.found]
    more = len(subjects) - MAX_NAMES
    names = ", ".join(subjects[:MAX_NAMES]) + (f" and {more:,} more" if more > 0 else "")
    shown = [
        *(test for test in ordered if test.found),
        *[test for test in ordered if not test.found][:NOT_FOUND],
    ]
    return Questions(
        question,
        finding,
        len(tests),
        len(subjects),
        RATE,
        tuple(shown[:MAX_TESTS]),
        says,
        sentence.format(names) if subjects else "",
    )


def _clearest(value: Array, half: Array) -> int:
    """The parameter that is furthest from 0 in terms of its error."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(value) / half
    return int(np.argmax(np.nan_to_num(ratio, nan=-1.0)))


def _change(iv: Interval, name: str, kind: Kind) -> tuple[Interval, str]:
    """A difference in the parameter's unit; of a logarithm in percent.

    >>> _change(Interval(0.0, 0.0, 0.0), "range_rate.log_tau", Kind("accel", "m/s²"))
    (Interval(value=0.0, low=0.0, high=0.0), '%')
    """
    if natural(name)[1]:
        return Interval(*(100.0 * float(np.expm1(min(x, 50.0))) for x in iv)), "%"
    return iv, unit(name, kind)


def _commonest(status: Sequence[str]) -> str:
    """The reason that most have."""
    named = [reason for reason in status if reason]
    return max(set(named), key=lambda reason: (named.count(reason), reason)) if named else "no drive"
