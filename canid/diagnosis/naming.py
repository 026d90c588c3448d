"""Which causes, one after another, each refitted jointly with those before it, and each still needed at the end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis import holds, likelihood, line, rhythm, search, wander
from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import K1
from canid.diagnosis.evidence import needed
from canid.diagnosis.search import Candidate
from canid.diagnosis.solved import Solved, baseline, polished, sized, solve
from canid.effects.cause import Effect
from canid.types import Array, Interval

# causes that are looked for at most: with more, no drive of an hour tells them apart
MOST = 4
# 2 Δ log likelihood within which another cause explains the same data as well: a chance of 1 in 20 of e^3
RIVAL = 6.0
# how much more evidence a cause beside a ceiling needs, in parts of what it needs alone: how far a soft limit bends the
# foot below `SOFT` is not known
CLIPPED = 0.5
# % below a ceiling from which on the foot may be bent by it
SOFT = 1.5
# 2 Δ log likelihood by which a fit from elsewhere must be better to show that the first was not the best
VALLEY = 1.0
# of the evidence of causes already named, that one beside them needs on top: nature's form of a cause is never quite
# the one that is fitted, and what that leaves looks like something else
SHADOW = 0.01
# desired headways, speeds, levels, times along a drive that are chances of their own
CHANCES = 3
# of a cause's evidence that a rival must have had at some step to be looked at again
PART = 0.3
# s after an episode in which the foot finds its way back
EDGE = 0.5


class Named(NamedTuple):
    """One cause that was accepted."""

    effect: Effect
    evidence: float
    needed: float
    rivals: tuple[str, ...]
    episodes: tuple[tuple[float, float], ...] = ()  # s
    told: Interval | None = (
        None  # of its one parameter, where that is not fitted (a wander's size, a ceiling)
    )
    level: float = np.nan


class Step(NamedTuple):
    """One candidate at one step."""

    effect: Effect
    step: int
    evidence: float
    needed: float
    accepted: bool


class Search(NamedTuple):
    """What the search ended with."""

    before: Solved  # the baseline, on all the data
    data: DriverData  # with what was taken out of it: episodes masked, a wander subtracted, a ceiling marked
    solved: Solved  # with all causes
    named: tuple[Named, ...]
    steps: tuple[Step, ...]
    wander: wander.Wander | None
    held: tuple[holds.Holds, ...]


def search_causes(
    data: DriverData, effects: tuple[Effect, ...], fitted: Solved | None = None
) -> Search | None:
    """Search, one cause after another; None: too few data for a baseline.

    Args:
        data: the driver's columns.
        effects: candidates of the driver's block.
        fitted: the baseline, where the caller has it.
    """
    before = baseline(data) if fitted is None else fitted
    if before is None:
        return None
    by = {effect.id: effect for effect in effects}
    m = len(effects)
    solved, named, steps = before, list[Named](), list[Step]()
    wandering: wander.Wander | None = None
    held: tuple[holds.Holds, ...] = ()
    measured = data.output.y
    curves = tuple(effect for effect in effects if effect.kind == "curve" and effect.planted)
    for step in range(1, MOST + 1):
        # the foot stands still in the pedal itself, not in what a wander has left of it
        found = holds.look(data._replace(output=data.output._replace(y=measured)), solved, held)
        if found.effect in by and all(n.effect.id != found.effect for n in named):
            held = (*held, found)
            data, solved = _without_holds(data, solved, found)
            named.append(_seen(by[found.effect], found, holds.NEEDED, data))
            steps.append(Step(by[found.effect], step, found.evidence, holds.NEEDED, True))
            if found.effect == "act_and_wait":
                break  # what he decides between two moments is not seen: nothing finer can be told of him
            continue
        options: list[tuple[float, Step, Candidate | wander.Wander]] = []
        capped = np.isfinite(holds.ceiling(held))
        shadow = SHADOW * sum(one.evidence for one in named)
        solved, tried = _tried(curves, data, solved)
        for candidate in tried:
            # a ceiling that was seen in the pedal itself needs no second one
            if capped and candidate.effect.id == "pedal_ceiling":
                continue
            # without the cause nothing tells what is desired, or at which speed or level or time it begins: the best
            # of these is the best of several chances (Davies 1977)
            searched = candidate.effect.centred or any(not p.starts for p in candidate.effect.parameters)
            chances = CHANCES if searched else 1
            bound = needed(candidate.parameters, m * chances) + shadow
            options.append(_option(candidate.effect, step, candidate.evidence, bound, candidate))
        if "periodic_task" in by and not any(n.effect.id == "periodic_task" for n in named):
            swing, bound = line.look(by["periodic_task"], data, solved, m)
            if swing is not None:
                options.append(_option(swing.effect, step, swing.evidence, bound, swing))
        if "act_and_wait" in by and not any(n.effect.id == "act_and_wait" for n in named):
            decided, bound = rhythm.look(by["act_and_wait"], data, solved, m)
            if decided is not None:
                options.append(_option(decided.effect, step, decided.evidence, bound, decided))
        if "headway_drift" in by and wandering is None:
            drift = wander.look(data, solved)
            if drift is not None:
                bound = needed(1, m)
                options.append(_option(by["headway_drift"], step, drift.evidence, bound, drift))
        if capped:
            options = [
                (o[0] - CLIPPED * o[1].needed, o[1]._replace(needed=(1 + CLIPPED) * o[1].needed), o[2])
                for o in options
            ]
        options = [option for option in options if not _at_bound(option[2])]
        options.sort(key=lambda option: -option[0])
        won = bool(options) and options[0][0] > 0
        steps += [option[1]._replace(accepted=won and k == 0) for k, option in enumerate(options)]
        if not won:
            break
        _, first, best = options[0]
        if isinstance(best, wander.Wander):
            wandering = best
            data = data._replace(output=data.output._replace(y=data.output.y - best.added))
            answered = float(solved.q[K1])
            solved = solve(data, solved.model.effects, solved.q, best.noise, solved.rows)
            # with the wander out of the way headway is answered more strongly: the same pedal is less of a wish
            ratio = min(abs(answered / float(solved.q[K1])), 1.0) if solved.q[K1] else 1.0
            told = Interval(*(ratio * value for value in best.sd))
            named.append(Named(first.effect, first.evidence, first.needed, (), (), told))
        elif first.effect.id == "pedal_ceiling" and data.pedal:
            # at it the noise goes one way only: what stands there is told by its limit alone
            level = float(best.solved.q[best.solved.model.where[-1].start])
            at = data.output.usable & (measured >= level - 0.5 * holds.step_size(measured))
            found = holds.Holds("pedal_ceiling", holds.standing(at, data.output.dt), first.evidence, level)
            held = (*held, found)
            data, solved = _without_holds(data, solved, found)
            named.append(_seen(first.effect, found, first.needed, data))
        else:
            solved = best.solved
            # the noise's size again, now that a cause is out of it
            noise = sized(data, solved.fitted, solved.noise, solved.rows)
            solved = solve(data, solved.model.effects, solved.q, noise, solved.rows)
            named.append(
                Named(first.effect, first.evidence, first.needed, (), (), _rhythm(first.effect, solved, data))
            )
    solved, named = _still_needed(data, solved, named, m)
    named = [_with_rivals(one, data, solved, curves, steps) for one in named]
    return Search(before, data, solved, tuple(named), tuple(steps), wandering, held)


def _tried(curves: tuple[Effect, ...], data: DriverData, solved: Solved) -> tuple[Solved, list[Candidate]]:
    """Try the parametric causes; where a fit shows that the model without it had ended in a side valley, try again."""
    found = search.candidates(curves, data, solved)
    if found:
        best = max(found, key=lambda candidate: candidate.evidence - 6 * candidate.parameters)
        k = solved.q.size
        again = solve(data, solved.model.effects, best.solved.q[:k], best.solved.noise, solved.rows)
        if again.deviance < solved.deviance - VALLEY:
            return again, search.candidates(curves, data, again)
    return solved, found


def _at_bound(what: Candidate | wander.Wander) -> bool:
    """Is a fitted strength at the limit of what people do? Then something else is meant by it."""
    if isinstance(what, wander.Wander):
        return False
    solved, ids = what.solved, [effect.id for effect in what.solved.model.effects]
    where = solved.model.where[ids.index(what.effect.id)]
    for p, k in zip(what.effect.parameters, range(where.start, where.stop), strict=True):
        near = 1e-3 * (p.high - p.low)
        limits = [limit for limit in (p.low, p.high) if limit != 0.0 and p.unit != "rad"]
        if k in solved.fitted.free and any(abs(float(solved.q[k]) - limit) < near for limit in limits):
            return True
    return False


def _option(
    effect: Effect, step: int, evidence: float, bound: float, what: Candidate | wander.Wander
) -> tuple[float, Step, Candidate | wander.Wander]:
    return evidence - bound, Step(effect, step, evidence, bound, accepted=False), what


def _rhythm(effect: Effect, solved: Solved, data: DriverData) -> Interval | None:
    """A rhythm that is off by more than this is out of step at one end of the drive."""
    if effect.id != "act_and_wait":
        return None
    interval = float(solved.q[solved.model.where[-1].start])
    off = 0.25 * interval**2 / max(data.seen.drive, 1.0)
    return Interval(interval, interval - off, interval + off)


def _seen(effect: Effect, found: holds.Holds, bound: float, data: DriverData) -> Named:
    """Name what was seen in the pedal itself."""
    t, dt = data.seen.t, data.output.dt
    spans = tuple((float(t[a]), float(t[b - 1]) + dt) for a, b in found.episodes)
    return Named(effect, found.evidence, bound, (), spans, _told(found, data), found.level)


def _told(found: holds.Holds, data: DriverData) -> Interval | None:
    if found.effect == "pedal_ceiling":
        half = holds.step_size(data.output.y[data.output.usable])
        # a soft limit lies a little above what the foot ever reaches
        return Interval(found.level, found.level - half, found.level + max(half, 0.5 * SOFT))
    return None


def _without_holds(data: DriverData, solved: Solved, found: holds.Holds) -> tuple[DriverData, Solved]:
    """Take the episodes out of what is fitted: masked, or at a ceiling, where they tell only that the demand was above."""
    n = data.seen.t.size
    at = np.zeros(n, dtype=bool)
    edge = round(EDGE / data.output.dt) if found.effect != "pedal_ceiling" else 0
    for start, stop in found.episodes:
        at[max(start - 1, 0) : min(stop + edge, n)] = True
    output = data.output
    if found.effect == "pedal_ceiling":
        # a soft limit bends the foot before it stops it: from there on only the limit speaks
        from_here = found.level - max(0.5 * holds.step_size(output.y), SOFT)
        above = output.usable & ~output.below & (output.y >= from_here)
        output = output._replace(above=above, ceiling=from_here)
    elif found.effect == "attention_gap":
        output = output._replace(usable=output.usable & ~at, below=output.below & ~at)
    data = data._replace(output=output)
    rows = likelihood.counted(output, solved.noise.A.size - 1)
    if int(rows.sum()) < 300:
        return data, solved
    return data, solve(data, solved.model.effects, solved.q, solved.noise, rows)


def _still_needed(data: DriverData, solved: Solved, named: list[Named], m: int) -> tuple[Solved, list[Named]]:
    """Drop what the others have made superfluous."""
    while len(solved.model.effects) > 1:
        priced = []
        for effect in solved.model.effects:
            without = dropped(data, solved, effect.id)
            candidate = search.priced_in(effect, solved, without, data.output.dt)
            priced.append(
                (candidate.evidence - needed(candidate.parameters, m), effect, without, candidate.evidence)
            )
        worst = min(priced, key=lambda one: one[0])
        for _, effect, _, evidence in priced:
            named = [n._replace(evidence=evidence) if n.effect.id == effect.id else n for n in named]
        if worst[0] > 0:
            break
        solved = worst[2]
        named = [n for n in named if n.effect.id != worst[1].id]
    return solved, named


def dropped(data: DriverData, solved: Solved, effect: str) -> Solved:
    """Return the model without one of its causes, by its id."""
    kept = [(e, w) for e, w in zip(solved.model.effects, solved.model.where, strict=True) if e.id != effect]
    first = solved.model.where[0].start
    q: Array = np.concatenate([solved.q[:first], *(solved.q[w] for _, w in kept)])
    return polished(data, solve(data, [e for e, _ in kept], q, solved.noise, solved.rows))


def _with_rivals(
    one: Named, data: DriverData, solved: Solved, curves: tuple[Effect, ...], steps: list[Step]
) -> Named:
    """Name the causes that explain the same as well as this one."""
    fixed = tuple(rival for rival in one.effect.rivals)
    if one.effect.id not in {effect.id for effect in solved.model.effects} or one.effect.kind != "curve":
        return one._replace(rivals=fixed)
    without = dropped(data, solved, one.effect.id)
    have = {effect.id for effect in solved.model.effects}
    # who never explained a part of it before explains no whole of it now
    worth = {step.effect.id for step in steps if step.evidence > PART * one.evidence} - have
    swaps = search.candidates(tuple(e for e in curves if e.id in worth), data, without)
    bound = {step.effect.id: step.needed for step in steps}
    # a cause with more to choose must explain as much more as that finds by chance
    close = [
        c.effect.id
        for c in swaps
        if c.solved.deviance - solved.deviance < RIVAL + max(one.needed - bound[c.effect.id], 0.0)
    ]
    return one._replace(rivals=tuple(dict.fromkeys([*fixed, *close])))
