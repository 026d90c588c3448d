"""Sensing block: two measurements of one quantity must agree, whoever drives.

Relations are estimated by `relations`; the effects of the catalogue say what a coefficient means (`redundancy`). Where
nothing else measures the same, that is reported.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.masks import mask_input
from canid.models.diagnosis.sensing.relations import RELATIONS, Related, SensorColumns, critical_value
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect
from canid.models.effects.redundancy import Pattern, Relation
from canid.values.findings import Blocked, Check, Finding, NotTestable, RivalCause
from canid.values.text.numbers import interval
from canid.values.types import Interval, Trace

# an effect, and what a coefficient says of it
Pair = tuple[Effect, Pattern]


class SensingFindings(NamedTuple):
    """Result of the block."""

    findings: tuple[Finding, ...]
    not_testable: tuple[NotTestable, ...]
    checks: tuple[Check, ...]
    block: Blocked
    tried: int  # relations that were estimated


def diagnose_sensing(trace: Trace, catalogue: tuple[Effect, ...] = CATALOGUE) -> SensingFindings:
    """Compare redundant signals.

    Args:
        trace: of a drive.
        catalogue: effects that may be named; those with a `redundancy` are tested.

    Returns:
        findings, what this drive cannot decide, the checks that were made, and the block's line.
    """
    columns = _columns(trace, catalogue)
    if columns is None:
        nothing = Blocked("sensing", "not_testable", "No gap, range rate and speed to be compared.")
        return SensingFindings((), (), (), nothing, 0)
    related: list[Related] = []
    effects = tuple(effect for effect in catalogue if effect.redundancy is not None)
    findings: tuple[Finding, ...] = ()
    for estimate in RELATIONS:
        for relation in estimate(columns):
            pairs = _recognised(relation, effects)
            related.append(relation)
            findings += tuple(_findings(relation, pairs, effects))
            if relation.relation is Relation.RANGE_RATE:
                columns = _with_right_rate(columns, pairs)
    checks = tuple(relation.check for relation in related)
    tried = sum(check.passed is not None for check in checks)
    return SensingFindings(findings, _not_testable(related, effects), checks, _line(findings, checks), tried)


def _columns(trace: Trace, catalogue: tuple[Effect, ...]) -> SensorColumns | None:
    """Lay out the columns; None: one of the three that are always needed is missing."""
    signals, n = trace.signals, trace.t.size
    gap = signals.get("gap_reported", signals.get("gap"))
    rate = signals.get("range_rate_reported", signals.get("range_rate"))
    speed = signals.get("speed")
    if gap is None or rate is None or speed is None or n < 2:
        return None
    masked, drive = np.zeros(n, dtype=bool), mask_input(trace)
    for effect in catalogue:
        if effect.mask is not None and effect.breaks_redundancy:
            masked |= effect.mask(drive)
    # a window must not extend from one lead to the next: a False between them
    masked[1:] |= np.diff(trace.segment) != 0
    return SensorColumns(gap, rate, speed, signals.get("gnss_speed"), signals.get("accel"), ~masked, trace.dt)


def _with_right_rate(columns: SensorColumns, pairs: Sequence[Pair]) -> SensorColumns:
    """Columns whose range rate has the right sign and scale, as far as that is known."""
    rivals = len(_alternatives(pairs)) > 1
    signals = {"range_rate": columns.range_rate}
    for effect, pattern in pairs:
        if effect.correct is not None and not (rivals and np.isfinite(pattern.own)):
            right = effect.correct([iv.value for iv in pattern.parameters], signals | {"gap": columns.gap})
            signals |= {"range_rate": right.get("range_rate", signals["range_rate"])}
    return columns._replace(range_rate=signals["range_rate"], scaled=not rivals)


def _recognised(related: Related, effects: tuple[Effect, ...]) -> list[Pair]:
    """Effects that a coefficient means; one without parameters first, as a sign before the scale that is left.

    Of those that mean the same coefficient, the ones whose factor of the own motion is not excluded; all, where each is.
    """
    pairs: list[Pair] = []
    for effect in effects:
        redundancy = effect.redundancy
        if (
            related.coefficient is None
            or redundancy is None
            or redundancy.relation is not related.relation
            or redundancy.recognise is None
        ):
            continue
        pattern = redundancy.recognise(related.coefficient)
        if pattern is not None:
            pairs.append((effect, pattern))
    pairs.sort(key=lambda pair: len(pair[0].parameters))
    own_factor = related.coefficient.own if related.coefficient is not None else Interval()
    either = _alternatives(pairs)
    likely = [pair for pair in either if own_factor.low <= pair[1].own <= own_factor.high] or either
    return [pair for pair in pairs if pair not in either or pair in likely]


def _alternatives(pairs: Sequence[Pair]) -> list[Pair]:
    """Effects of which one only is the cause."""
    return [pair for pair in pairs if np.isfinite(pair[1].own)]


def _findings(related: Related, pairs: Sequence[Pair], effects: tuple[Effect, ...]) -> list[Finding]:
    """One finding per cause; where several effects may be it, the others are rivals."""
    either, out = _alternatives(pairs), list[Finding]()
    for k, (effect, pattern) in enumerate(pairs):
        if (effect, pattern) in either[1:]:
            continue
        others = either[1:] if (effect, pattern) in either else []
        rivals = (*_of_relations(effects, related.confounded), *(other.id for other, _ in others))
        sizes = tuple(
            RivalCause(other.id, _estimates(other, seen), {p.name: p.unit for p in other.parameters})
            for other, seen in others
        )
        stated = _finding(effect, pattern, related, related.gain if k == 0 else Interval(), rivals)
        out.append(stated._replace(rival_causes=sizes))
    return out


def _estimates(effect: Effect, pattern: Pattern) -> dict[str, Interval]:
    return {p.name: iv for p, iv in zip(effect.parameters, pattern.parameters, strict=True)}


def _of_relations(effects: Iterable[Effect], relations: tuple[Relation, ...]) -> tuple[str, ...]:
    return tuple(e.id for e in effects if e.redundancy is not None and e.redundancy.relation in relations)


def _finding(
    effect: Effect, pattern: Pattern, related: Related, gain: Interval, rivals: tuple[str, ...]
) -> Finding:
    estimates, says = _estimates(effect, pattern), effect.says
    for name, iv in estimates.items():
        says = says.replace("{" + name + "}", interval(iv))
    return Finding(
        effect=effect.id, where=effect.where, rivals=rivals, surrogate=False, parameters=estimates,
        units={p.name: p.unit for p in effect.parameters}, gain=gain, says=says,
        evidence=(pattern.deviation / related.sd) ** 2, needed=critical_value(related.dof) ** 2,
    )  # fmt: skip


def _not_testable(related: list[Related], effects: tuple[Effect, ...]) -> tuple[NotTestable, ...]:
    """What this drive cannot decide; effects with one reason in common are one line."""
    out: dict[str, tuple[str, ...]] = {}
    reasons: dict[Relation | None, str] = {relation.relation: relation.not_testable for relation in related}
    for relation in (*reasons, None):
        for effect in effects:
            if effect.redundancy is None or effect.redundancy.relation is not relation:
                continue
            why = effect.absorbed if relation is None else reasons[relation]
            if why:
                why = f"{why}; what would decide: {effect.decides}"
                out[why] = (*out.get(why, ()), effect.id, *effect.rivals)
    return tuple(NotTestable(ids, why) for why, ids in out.items())


def _line(findings: tuple[Finding, ...], checks: tuple[Check, ...]) -> Blocked:
    if findings:
        return Blocked("sensing", "wrong", " ".join(finding.says for finding in findings))
    failed = [check.says for check in checks if check.passed is False]
    if failed:
        return Blocked("sensing", "unexplained", " ".join(failed))
    if any(check.passed for check in checks):
        numbers = " ".join(check.says for check in checks if check.passed)
        return Blocked("sensing", "adequate", f"The sensors agree. {numbers}")
    return Blocked("sensing", "not_testable", "No two signals of this drive measure the same quantity.")
