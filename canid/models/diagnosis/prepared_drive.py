"""A drive that can be diagnosed: the driver's columns at the rate at which the output has content, and the baseline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.estimators import output_stamps, speed_difference
from canid.models.diagnosis.driver.driver_data import DriverData, prepare
from canid.models.diagnosis.driver.driver_fit import FittedDriver, baseline
from canid.signals.signal_checks.drive_time import behind_a_lead
from canid.values.findings import (
    Flags,
    Masked,
    masked_for,
)
from canid.values.types import NAN, Trace

# m/s and output units; a lead whose speed varies less excites nothing, an output that varies less answers nothing
STILL_RATE, STILL_OUTPUT = 0.05, 1e-3
# innovation over residual below which the output's noise has no content at this rate (a smoothed acceleration):
# whitening it would amplify rounding, so every second sample is left out until it has
MIN_INNOVATION_SHARE = 0.04


class Prepared(NamedTuple):
    """A drive that can be diagnosed."""

    trace: Trace
    data: DriverData
    fitted: FittedDriver


def ready(trace: Trace, usable: Flags, begins: tuple[float, ...] = ()) -> Prepared | None:
    """Fit the baseline at the rate at which the output has content of its own.

    Args:
        trace: of a drive, or of several.
        usable: (n,) samples that no mask has taken.
        begins: s, of each further drive.
    """
    trace, usable = speed_difference.without_common_noise(*output_stamps.at_own_stamps(trace, usable))
    while True:
        data = prepare(trace, usable, begins)
        fitted = baseline(data)
        if fitted is None:
            return None
        left = (data.output.y - fitted.fitted.model)[data.output.usable & ~data.output.hidden]
        has_content = fitted.noise.sd >= MIN_INNOVATION_SHARE * float(np.std(left))
        if has_content or 2 * trace.dt > speed_difference.MAX_SAMPLE_TIME_S + 1e-9:
            return Prepared(trace, data, fitted)
        trace, usable = speed_difference.thinned(trace), usable[::2]


def lacking(trace: Trace, usable: Flags, masked: tuple[Masked, ...], minimum: float) -> str:
    """Say what is missing for a diagnosis, and what to do; "": nothing."""
    need = f"drive {minimum / 60:.2g} min or more behind a lead whose speed changes"
    if trace.input_names != ("headway_error", "range_rate"):
        return (
            "several drives are diagnosed together in car following only: this vehicle's task is another one"
        )
    n = trace.t.size
    if n * trace.dt < minimum:
        return f"the log lasts {n * trace.dt:.0f} s{_rest(masked)}; {need}"
    for role in ("speed", "gap", "range_rate"):
        known = np.isfinite(trace.signals.get(role, np.full(n, NAN)))
        if known.sum() * trace.dt < minimum:
            what = "no speed" if role == "speed" else "no lead"
            return f"{what}: `{role}` is there for {known.sum() * trace.dt:.0f} s only; {need}"
    if np.isfinite(trace.output).sum() * trace.dt < minimum:
        return "the driver's output is not in the log; map it in the vehicle file ([driver] output)"
    follows = behind_a_lead(trace.gate)
    seconds = float((usable & follows).sum() * trace.dt)
    if seconds < minimum:
        return f"a person follows a lead for {seconds:.0f} s only{_rest(masked)}; {need}"
    here = usable & follows & np.isfinite(trace.output) & np.isfinite(trace.signals["range_rate"])
    if float(np.std(trace.output[here])) < STILL_OUTPUT:
        return "the driver's output never moves: is it the right signal, and does a person drive?"
    if float(np.std(trace.signals["range_rate"][here])) < STILL_RATE:
        return f"the lead's speed never changes, so nothing is answered; {need}"
    return ""


def _rest(masked: tuple[Masked, ...]) -> str:
    """Masked times, for a sentence."""
    spans = [f"{effect} for {seconds:.0f} s" for effect, seconds in masked_for(masked).items()]
    return f" ({', '.join(spans)} masked)" if spans else ""
