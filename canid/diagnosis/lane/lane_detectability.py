"""Which causes a lane drive cannot show: the evidence that each would leave at its typical strength."""

from __future__ import annotations

from canid.diagnosis.fitting.candidates import direction, model_directions
from canid.diagnosis.fitting.fitted_model import extended
from canid.diagnosis.fitting.robust_covariance import needed
from canid.diagnosis.lane import lane_candidates
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.effects.effect import Effect, Kind
from canid.findings import NotTestable


def expected(effects: tuple[Effect, ...], data: LaneData, without: FittedLane) -> dict[str, float]:
    """Evidence of each effect that is fitted here, at its typical strength: effect id -> evidence."""
    out, Q = {}, model_directions(without)
    for effect in lane_candidates.searchable(effects, data):
        begin = list(lane_candidates.starts(effect, data, without))
        q = begin[len(begin) // 2].copy()
        q[without.q.size :] = [p.typical for p in effect.parameters]
        simulated = extended(without.model, effect).bind(data)(q)
        d = direction(data, without, Q, simulated - without.fitted.model)
        out[effect.id] = float(d @ d)
    return out


def undecided(effects: tuple[Effect, ...], evidence: dict[str, float], named: set[str]) -> list[NotTestable]:
    """Effects that this drive cannot show.

    Args:
        effects: candidates.
        evidence: from `expected`.
        named: those that were found.
    """
    out = []
    for effect in effects:
        if effect.kind is not Kind.PARAMETRIC or effect.id in named:
            continue
        tail = f"; what would decide: {effect.decides}" if effect.decides else ""
        bound = needed(len(effect.parameters), len(effects))
        if effect.id not in evidence:
            why = effect.absorbed or f"{', '.join(effect.needs)} is not measured"
            out.append(NotTestable((effect.id,), why + tail))
        elif evidence[effect.id] < bound:
            at = ", ".join(f"{p.name} {p.typical:.2g} {p.unit}".removesuffix(" 1") for p in effect.parameters)
            why = "a typical strength of it leaves too little on this drive"
            of = f" (expected evidence {evidence[effect.id]:.0f} of the {bound:.0f} needed, at {at})"
            out.append(NotTestable((effect.id,), why + of + tail))
    return out
