"""What this drive can show, before anything is tested: the evidence that a typical strength of each cause would leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import DESIRED, K1, OFFSET, pedal, with_effects
from canid.diagnosis.evidence import needed
from canid.diagnosis.likelihood import whitened
from canid.diagnosis.search import starts
from canid.diagnosis.solved import Solved
from canid.effects.cause import Effect, Parameter
from canid.findings import NotTestable
from canid.types import Array

# cosine between what two causes do, above which no evidence that a drive gives tells them apart
ALIKE = 0.95
# %, standard deviation of a pedal in following (plain look at simulated and measured ones): typical strengths are told
# for such a one
PEDAL = 6.0


class Shown(NamedTuple):
    """What one cause at a typical strength would leave on this drive."""

    effect: Effect
    expected: float  # evidence
    direction: Array  # (n,) whitened, baseline's own directions taken out


def typical(parameter: Parameter, data: DriverData) -> float:
    """A parameter's typical strength; those in the output's unit are told for a pedal, and scaled where it is none."""
    if data.pedal or not parameter.unit.startswith(("%", "output")):
        return parameter.typical
    return parameter.typical * float(np.std(data.output.y[data.output.usable])) / PEDAL


def shown(effects: tuple[Effect, ...], data: DriverData, without: Solved) -> list[Shown]:
    """Price every parametric cause at its typical strength, along this drive."""
    out = []
    Q = qr(without.fitted.jacobian, mode="economic")[0]
    for effect in effects:
        if effect.kind != "curve":
            continue
        begin = list(starts(effect, data, without))
        q = begin[len(begin) // 2].copy()
        first = without.q.size
        for k, parameter in enumerate(effect.parameters):
            if parameter.starts and parameter.typical:
                q[first + k] = typical(parameter, data)
        median = float(np.median(data.seen.headway[data.output.usable]))
        if effect.centred:
            q[OFFSET] += q[K1] * (median - q[DESIRED])
            q[DESIRED] = median
        model = with_effects((*without.model.effects, effect))
        d = (
            whitened(without.noise, pedal(model, data, q) - without.fitted.model)
            * without.fitted.scored.slope
        )
        d = d - Q @ (Q.T @ d)
        out.append(Shown(effect, float(d @ d), d))
    return out


def undecided(priced: list[Shown], data: DriverData, tried: int) -> list[NotTestable]:
    """Say what this drive cannot show, and which pairs it cannot tell apart."""
    out = []
    seen = []
    for one in priced:
        bound = needed(len(one.effect.parameters), tried)
        if one.expected < bound:
            why = one.effect.absorbed or "a typical strength of it leaves too little on this drive"
            at = ", ".join(
                f"{p.name} {typical(p, data):.2g} {p.unit}".removesuffix(" 1")
                for p in one.effect.parameters
                if p.typical
            )
            at = f", at {at}" if at else ""
            says = f"{why} (expected evidence {one.expected:.0f} of the {bound:.0f} needed{at})"
            if one.effect.decides:
                says += f"; what would decide: {one.effect.decides}"
            out.append(NotTestable((one.effect.id,), says))
        else:
            seen.append(one)
    for k, a in enumerate(seen):
        for b in seen[k + 1 :]:
            cosine = abs(float(a.direction @ b.direction)) / np.sqrt(a.expected * b.expected)
            if cosine > ALIKE:
                says = f"along this drive they do the same (cosine {cosine:.2f})"
                says += f"; what would decide: {a.effect.decides or b.effect.decides}"
                out.append(NotTestable((a.effect.id, b.effect.id), says))
    return out
