"""All estimators over a whole drive, and what each may quote of it: of `identify`, and what `diagnose` is compared with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from canid.mathematics.estimators import (
    ESTIMATORS,
    held_pedal,
    output_stamps,
    speed_difference,
    stated_latency,
    wanted_gap_form,
    whole_drive_agreement,
)
from canid.mathematics.estimators.estimator import AnyEstimator, WholeDrive
from canid.mathematics.estimators.fopdt import FOPDT
from canid.mathematics.identification.confidence import SIGMAS
from canid.values.types import Latency, Trace


def estimates(fitted: Trace, trace: Trace, settings: Mapping[str, Any]) -> dict[str, WholeDrive | None]:
    """Every estimator's result, in their order, and of each only what no other speaks against.

    Args:
        fitted: the drive as it is fitted, with what may be learned from it.
        trace: as it was read.
        settings: by the estimators' names; those of one that is missing are its defaults.
    """
    whole = held_pedal.with_waits(_whole(fitted, trace, settings), trace)
    stand = output_stamps.standing(trace)
    return whole_drive_agreement.without_delays(whole_drive_agreement.arbitrated(whole), stand)


def _whole(fitted: Trace, trace: Trace, settings: Mapping[str, Any]) -> dict[str, WholeDrive | None]:
    """Every estimator's own result; the wanted gap that FOPDT finds is that of the others."""
    first = FOPDT.identify(fitted, settings_of(FOPDT, trace, settings)) if FOPDT.identify else None
    standstill = 0.0 if first is None else float(first.details.get("standstill", 0.0))
    wanted = wanted_gap_form.with_standstill(fitted, standstill)
    several = first is not None and first.details.get("form_open", False)
    spread = 0.0 if first is None else float(first.details.get("form_spread", 0.0))
    # an offset that drifts is in FOPDT's model alone: of 8 drives on which it does, ARMAX's K1 held on 4
    drifts = first is not None and first.model.drift > 0
    out: dict[str, WholeDrive | None] = {}
    for estimator in ESTIMATORS:
        if estimator.name == FOPDT.name:
            out[FOPDT.name] = first
        elif estimator.identify is not None:
            result = estimator.identify(wanted, settings_of(estimator, trace, settings))
            if result is not None:
                result = wanted_gap_form.with_spread(result, spread)
                for is_so, reason in ((several, wanted_gap_form.ONE_FORM), (drifts, wanted_gap_form.STAYS)):
                    result = wanted_gap_form.without_gain(result, reason) if is_so else result
            out[estimator.name] = result
    if fitted.dt > trace.dt:
        # the drive of `fitted` has its own readings alone
        said = output_stamps.says(trace) or speed_difference.SAID
        out = {
            name: _with_step(result, f"{said}: samples every {fitted.dt:.1f} s")
            for name, result in out.items()
        }
    return {name: _with_latency(result, trace.latency) for name, result in out.items()}


def _with_step(result: WholeDrive | None, said: str) -> WholeDrive | None:
    """Say of the result of a whole drive that not all samples were used, and why."""
    if result is None:
        return None
    return result._replace(lines=(*result.lines, said))


def _with_latency(result: WholeDrive | None, latency: Latency | None) -> WholeDrive | None:
    """Add a stated latency to the result of a whole drive and of its segments; None: none is stated."""
    if result is None or latency is None:
        return result
    details: dict[str, Any] = dict(result.details)
    if "segments" in details:
        details["segments"] = [
            {**segment, "channels": stated_latency.channels(segment["channels"], latency)}
            for segment in details["segments"]
        ]
    added = f"{latency.value:.2f} s ± {SIGMAS * latency.sd:.2f} s"
    said = f"θ is from what the radar saw: its stated latency of {added} is added"
    return result._replace(
        channels=stated_latency.channels(result.channels, latency),
        details=details,
        lines=(*result.lines, said),
    )


def settings_of(estimator: AnyEstimator, trace: Trace, given: Mapping[str, Any]) -> Any:
    """Return the given settings or the defaults, with what the drive says of its output where they say nothing.

    Args:
        estimator: whose settings.
        trace: of the drive.
        given: by the estimators' names.
    """
    settings = given.get(estimator.name) or estimator.settings()
    if hasattr(settings, "output_filter") and settings.output_filter is None:
        settings = settings._replace(output_filter=trace.output_filter)
    if hasattr(settings, "latency") and settings.latency is None:
        settings = settings._replace(latency=trace.latency)
    return settings
