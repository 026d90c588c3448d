"""A driver who holds the pedal and moves it at intervals: what a whole drive's delays then contain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification import movement_rhythm
from canid.mathematics.identification.identifiability import gain_only
from canid.values.output_role import output_role
from canid.values.types import Trace

PEDAL = "pedal"


def with_waits(whole: Mapping[str, WholeDrive | None], trace: Trace) -> dict[str, WholeDrive | None]:
    """Withhold the delays where the pedal is held between movements: the mean hold is in τ + θ, and no model has it.

    Args:
        whole: estimator -> its result; None: it has none.
        trace: what they were made of.
    """
    says = _says(trace)
    if not says:
        return dict(whole)
    out: dict[str, WholeDrive | None] = {}
    for name, result in whole.items():
        if result is None:
            out[name] = None
            continue
        details: dict[str, Any] = {
            **result.details,
            "says": "; ".join(filter(None, (says, str(result.details.get("says", ""))))),
        }
        channels = {key: gain_only(channel, says) for key, channel in result.channels.items()}
        out[name] = result._replace(channels=channels, lines=(says, *result.lines), details=details)
    return out


def _says(trace: Trace) -> str:
    # an acceleration never stands still
    if output_role(trace) != PEDAL:
        return ""
    pedal = trace.output
    waits = movement_rhythm.waiting(np.nan_to_num(pedal), trace.learn & np.isfinite(pedal), trace.dt)
    if waits is None:
        return ""
    how = "in a rhythm of" if waits.regular else "about every"
    return (
        f"the pedal is held and moves {how} {waits.interval:.1f} s, not at all times (act and wait): the hold is in τ + θ, "
        "so τ and θ may not be quoted"
    )
