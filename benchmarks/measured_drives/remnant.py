"""Does the law of one person's remnant predict another person's? The shape is taken over, the size is the drive's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import minimize

from benchmarks.other_drive import prepared
from canid.models.diagnosis.fitting.log_score_gain import gain
from canid.models.diagnosis.remnant import law_search
from canid.models.diagnosis.remnant.innovations import Innovations, innovations
from canid.models.diagnosis.remnant.law_search import Law, log_density
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect, Kind
from canid.values.types import Array, Interval, Trace

REMNANT = tuple(effect for effect in CATALOGUE if effect.kind is Kind.REMNANT)


def of_drive(trace: Trace) -> Innovations | None:
    """Innovations of the baseline; None: too few samples."""
    made = prepared(trace)
    return None if made is None else innovations(made.trace, made.data, made.fitted)


def scored(of: Innovations, law: Law, effects: Sequence[Effect]) -> Array:
    """Log densities (n,) by a law of which size and present scale are fitted here; 0 where nothing counts.

    Args:
        of: the innovations.
        law: its degrees of freedom, and the slopes of the effects before those of the present scale.
        effects: of the law.
    """
    F, x = law_search.features_of(of, effects, of.rows), of.x[of.rows]
    held = law.slopes[: len(F) - len(of.present)]

    def densities(own: Array) -> Array:
        return log_density(Law(law.freedom, float(np.exp(own[0])), np.r_[held, own[1:]]), x, F)

    start = np.r_[np.log(np.std(x)), np.zeros(len(of.present))]
    best = minimize(lambda own: -float(densities(own).sum()), start, method="L-BFGS-B").x
    out = np.zeros(of.x.size)
    out[of.rows] = densities(best)
    return out


def gained(of: Innovations, law: Law) -> Interval:
    """Gain over a Gaussian, what every law has fitted here, nats/min."""
    plain = scored(of, Law(np.inf, law.sd, np.zeros(0)), ())
    return gain(scored(of, law, REMNANT) - plain, of.rows, of.dt)


def table(traces: Mapping[str, Trace]) -> list[str]:
    """Lines of a table: on each drive, the gain by its own law and by those of the others of the same step."""
    known = {name: of for name, trace in traces.items() if (of := of_drive(trace)) is not None}
    laws = {name: law_search.fitted(of, REMNANT, of.rows).law for name, of in known.items()}
    out = ["| scored on | by its own law, nats/min | by the others' laws |", "|---|---|---|"]
    for name, of in known.items():
        own = gained(of, laws[name])
        others = [gained(of, laws[other]) for other in known if other != name and known[other].dt == of.dt]
        out.append(f"| {name} | {_text(own)} | {', '.join(map(_text, others)) or '–'} |")
    return out


def _text(iv: Interval) -> str:
    return f"{iv.value:.1f} [{iv.low:.1f}, {iv.high:.1f}]"
