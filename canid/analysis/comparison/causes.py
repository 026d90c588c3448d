"""Causes that diagnoses of both sides name: in both, or in one only, and whether the other one's data exclude them."""

from __future__ import annotations

import math
from typing import NamedTuple

from canid.analysis.comparison.drive import Causes, Effect, Side, finite

# A diagnosis states the strength that it would name nine times out of ten. Its evidence grows with the square of the
# strength, and is normal about its square root: of 15 that are needed, (√15 + 1.28)² give 9 of 10 and (√15 + 2.33)² 99 of
# 100, a strength 1.2 times as large. Then an effect that was not named is excluded.
EXCLUDED_FACTOR = 1.2


class CauseCompared(NamedTuple):
    """One cause."""

    effect: str
    where: str
    found: str  # "A", "B", "both"
    differs: bool | None  # None: not testable; of a cause in both its parameters are compared as such
    says: str


def compare(a: Side, b: Side) -> tuple[CauseCompared, ...]:
    """Compare the causes of two sides; none where one of them has no diagnosis."""
    by_side = {
        name: [drive.causes for drive in side.drives if drive.causes] for name, side in (("A", a), ("B", b))
    }
    if not all(by_side.values()):
        return ()
    out = []
    names = dict.fromkeys(
        e.name for causes in by_side.values() for diagnosis in causes for e in diagnosis.effects
    )
    for effect in names:
        effects = {
            side: [e for diagnosis in causes for e in diagnosis.effects if e.name == effect]
            for side, causes in by_side.items()
        }
        where = next(e.where for side in effects.values() for e in side)
        if all(effects.values()):
            out.append(CauseCompared(effect, where, "both", None, _in_both(effects)))
            continue
        here, there = ("A", "B") if effects["A"] else ("B", "A")
        differs, says = _in_one(effects[here], len(by_side[here]), by_side[there], there)
        out.append(CauseCompared(effect, where, here, differs, says))
    return tuple(out)


def _in_both(effects: dict[str, list[Effect]]) -> str:
    parameters = any(
        finite(q.value) for side in effects.values() for e in side for q in e.parameters.values()
    )
    return "found in both" + ("; its parameters are compared" if parameters else "")


def _in_one(
    effects: list[Effect], diagnosed: int, others: list[Causes], there: str
) -> tuple[bool | None, str]:
    """Whether the other side differs; None: not testable."""
    if len(effects) < diagnosed:
        return None, f"found in {len(effects)} of {diagnosed} drives: not the same on one side already"
    if any(e.surrogate for e in effects):
        return None, "it leaves structure in the residual, and is not the cause itself"
    name = effects[0].name
    for diagnosis in others:
        rival = next(
            (e.name for e in diagnosis.effects if e.name in effects[0].rivals or name in e.rivals), None
        )
        if rival is not None:
            return None, f"not testable in {there}, where {rival.replace('_', ' ')} explains the same"
        why = _why_not(diagnosis, effects, there)
        if why:
            return None, why
    parameter, strength, unit = others[0].shown[name]
    least = min(e.parameters[parameter].value.low for e in effects)
    return True, (
        f"{there} excludes it: {parameter.replace('_', ' ')} is at least {least:.3g} {unit} here, and {strength:.3g} {unit} "
        f"would have been named in {there} nine times out of ten"
    ).replace(" 1 ", " ")


def _why_not(diagnosis: Causes, effects: list[Effect], there: str) -> str:
    """Why one drive's diagnosis does not exclude an effect; "": it does."""
    name = effects[0].name
    if diagnosis.verdict not in ("adequate", "named", "one_of"):
        return f"not testable in {there}, whose verdict is {diagnosis.verdict.replace('_', ' ')}"
    if name in diagnosis.not_testable:
        return f"not testable in {there}: a typical strength would leave too little on that drive"
    parameter, strength, unit = diagnosis.shown.get(name, ("", math.nan, ""))
    if not math.isfinite(strength):
        return f"not testable in {there}: from which strength on it would have shown there is not known"
    for e in effects:
        known = e.parameters.get(parameter)
        if known is None or known.unit != unit or not finite(known.value):
            return f"not testable in {there}: its strength here has no interval"
        if known.value.low < EXCLUDED_FACTOR * strength:
            return (
                f"not testable in {there}: only from {strength:.3g} {unit} on it would have shown there, here "
                f"{parameter.replace('_', ' ')} may be {known.value.low:.3g} {unit}"
            )
    return ""
