"""Block of the driver's remnant: what law the innovations of the final driver model have, and what that is worth.

It does not touch the mean: an effect here changes how likely a residual is, not the simulation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.innovation_law import Law
from canid.models.diagnosis.remnant import law_intervals, law_search, log_score
from canid.models.diagnosis.remnant.innovations import Innovations
from canid.models.diagnosis.remnant.log_score import HeldOut
from canid.models.effects.effect import DriveFeatures, Effect, ScaleFeature
from canid.values.findings import Blocked, Finding, Tried
from canid.values.text.names import readable
from canid.values.text.numbers import number
from canid.values.types import NAN, Interval

WHERE = "remnant"
# samples; a law of some ten numbers is fitted to three quarters of them (on 250 samples of a measured drive of 104 s even
# the Gaussian law failed on the quarter that was left out)
MIN_ROWS = 400
FEATURE_NAMES = {
    ScaleFeature.OWN_ACCELERATION: "own |acceleration|",
    ScaleFeature.LEAD_ACCELERATION: "the lead's |acceleration|",
    ScaleFeature.PAST_INNOVATIONS: "the innovations of the last 4 s",
}


class RemnantReport(NamedTuple):
    """What the block found."""

    findings: tuple[Finding, ...]
    block: Blocked
    tried: tuple[Tried, ...] = ()
    law: Law | None = None  # None: Gaussian of the present scale
    steps: tuple[str, ...] = ()


def diagnose_remnant(
    innovations: Innovations, effects: tuple[Effect, ...], fold: npt.NDArray[np.int64], tried: int
) -> RemnantReport:
    """Name the effects that the law of the innovations needs.

    An effect is named if its evidence exceeds the threshold, its size is more than a driver of Gaussian noise shows, and
    its gain in log score on held-out data is above 0.

    Args:
        innovations: the innovations of the final driver model.
        effects: candidates of this block.
        fold: (n,) fold of each sample, for held-out data.
        tried: candidates of the driver and of this block together.
    """
    if not effects:
        return RemnantReport(
            (), Blocked(WHERE, "not_testable", "The catalogue has no effect on the remnant.")
        )
    if int(innovations.rows.sum()) < MIN_ROWS:
        return RemnantReport((), Blocked(WHERE, "not_testable", "Too few innovations for their law."))
    kept, judged = law_search.eliminated(innovations, effects, tried)
    why = {row.effect.id: "chance explains as much" for row in judged if row.effect not in kept}
    intervals: dict[str, dict[str, Interval]] = {}
    held = HeldOut(Interval(), {})
    while kept:
        intervals = law_intervals.parameters(
            innovations, kept, law_search.fitted(innovations, kept, innovations.rows)
        )
        held = log_score.held_out(innovations, kept, fold)
        weak = _refused(kept, intervals, held)
        if weak is None:
            break
        why[weak[0].id] = weak[1]
        # the others must be needed without it
        kept, again = law_search.eliminated(innovations, law_search.without(kept, weak[0]), tried)
        latest = {row.effect.id: row for row in judged} | {row.effect.id: row for row in again}
        judged = list(latest.values())
    evidence = {row.effect.id: row for row in judged}
    findings = tuple(
        Finding(
            effect=effect.id, where=WHERE, rivals=law_search.rivals(innovations, kept, effect, effects), surrogate=False,
            parameters=intervals[effect.id], units={p.name: p.unit for p in effect.parameters}, gain=Interval(),
            says=_filled(effect.says, intervals[effect.id]), evidence=evidence[effect.id].evidence,
            needed=evidence[effect.id].needed, log_score_gain=held.each[effect.id],
        )
        for effect in kept
    )  # fmt: skip
    rows = tuple(
        Tried(
            row.effect.id, WHERE, 1, row.evidence, row.needed, NAN, "accepted" if row.effect in kept else "rejected",
            why.get(row.effect.id, ""),
        )
        for row in judged
    )  # fmt: skip
    law = law_search.fitted(innovations, kept, innovations.rows).law if kept else None
    says = described(kept, intervals, held.law)
    state = "wrong" if kept else "adequate"
    steps = tuple(f"{readable(f.effect)} in the remnant: evidence {f.evidence:.0f}" for f in findings)
    return RemnantReport(findings, Blocked(WHERE, state, says), rows, law, steps)


def not_testable(why: str) -> RemnantReport:
    """Report of a drive whose innovations cannot be judged."""
    return RemnantReport((), Blocked(WHERE, "not_testable", why))


def _refused(
    kept: tuple[Effect, ...], intervals: dict[str, dict[str, Interval]], held: HeldOut
) -> tuple[Effect, str] | None:
    """The effect that fails by most though its evidence suffices, and why."""
    for effect in sorted(kept, key=lambda effect_kept: held.each[effect_kept.id].low):
        first = next(iter(intervals[effect.id].values()))
        if not held.each[effect.id].low > 0:
            return effect, "no gain on held-out data"
        if not effect.unusual(first, DriveFeatures()):
            return effect, "as small as drivers with Gaussian noise seem to have it"
    return None


def described(kept: tuple[Effect, ...], intervals: dict[str, dict[str, Interval]], gained: Interval) -> str:
    """Sentence of the block.

    Example:
        >>> described((), {}, Interval())
        'Gaussian with the present scale.'
    """
    if not kept:
        return "Gaussian with the present scale."
    tail, follows = "Gaussian", []
    for effect in kept:
        assert effect.remnant is not None
        values = list(intervals[effect.id].values())
        if effect.remnant.heavy_tailed:
            tail = f"Student's t with {_range(values.pop(0))} degrees of freedom"
        pairs = zip(effect.remnant.scale, values, strict=True)
        follows += [f"{FEATURE_NAMES[feature]} (log sd {_range(iv)} per sd)" for feature, iv in pairs]
    scale = f", scale follows {' and '.join(follows)}" if follows else ""
    return f"{tail}{scale}; {gained_by(gained)}."


def gained_by(gained: Interval) -> str:
    """A gain in log score, for a sentence.

    Example:
        >>> gained_by(Interval(45.2, 38.1, 52.3))
        '+45 [38, 52] nats/min on held-out data'
    """
    digits = 0 if abs(gained.value) >= 10 else 1
    value, low, high = (f"{x:.{digits}f}" for x in gained)
    return f"{'+' * (gained.value > 0)}{value} [{low}, {high}] nats/min on held-out data"


def _filled(says: str, estimates: dict[str, Interval]) -> str:
    for name, iv in estimates.items():
        says = says.replace("{" + name + "}", _range(iv))
    return says


def _range(iv: Interval) -> str:
    return " ".join(
        (number(iv.value, digits=2), f"[{number(iv.low, digits=2)}, {number(iv.high, digits=2)}]")
    )
