"""A model fitted to one drive, simulated in closed loop behind the lead of another: canid's and the published ones.

All of them are judged on the same stretches of at most a minute, each from the measured state (as in the report, where
stretches are half as long), by the rms error over the rms of what was measured.
"""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis import corrections
from canid.models.diagnosis.driver import baseline_form, closed_loop
from canid.models.diagnosis.driver.closed_loop import Ride, Road
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.null import confirmed_search
from canid.models.diagnosis.prepared_drive import Prepared, ready
from canid.models.diagnosis.rivals.calibration import calibrate
from canid.models.diagnosis.rivals.recommendation import CANID
from canid.models.diagnosis.rivals.rival_models import MODELS
from canid.models.diagnosis.rivals.rival_simulation import leads, simulate
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Kind
from canid.models.effects.wanted_gap import Form
from canid.values.findings import ClosedLoopError, Report, nrmse
from canid.values.types import Trace

STRETCH_S = 60.0
BASELINE, CHOSEN, RECOMMENDED = "baseline", "chosen", "recommended"
Errors = dict[str, ClosedLoopError]


def prepared(trace: Trace) -> Prepared | None:
    """Fit the baseline, after the masks and corrections of a diagnosis; None: too few samples."""
    context = corrections.diagnose_context(trace, CATALOGUE)
    return ready(context.trace, context.usable)


def chosen(of: Prepared, report: Report) -> FittedDriver:
    """Return the model that the diagnosis stands for: the baseline in its form, extended by what the report names.

    Args:
        of: the drive.
        report: its diagnosis. Surrogates are no cause by its own words, and do not count.
    """
    drivers = tuple(e for e in CATALOGUE if e.where == "driver" and e.kind is not Kind.MASK)
    fitted = baseline_form.choose(of.trace, of.data, of.fitted, drivers).fitted
    if not any(one.where == "driver" and not one.surrogate for one in report.findings):
        return fitted
    if fitted.model.form is not Form.TIME_HEADWAY:
        drivers = tuple(effect for effect in drivers if not effect.wanted_gap)
    found = confirmed_search.cross_validated(of.data, drivers, fitted).search
    return found.solved if found.named else fitted


def carried(here: Prepared, there: Prepared, models: dict[str, FittedDriver]) -> Errors:
    """Errors on the drive `there` of models fitted to the drive `here`.

    Args:
        here: a drive whose output is an acceleration.
        there: the other drive, at any step.
        models: canid's, fitted to `here`, by name.

    Returns:
        by name of the model, the published ones included; {}: no stretch is long enough.
    """
    data = there.data
    seen, dt = data.seen, data.output.dt
    where = closed_loop.stretches(data.output.usable, dt, STRETCH_S)
    train = here.data
    own = closed_loop.stretches(train.output.usable, train.output.dt, STRETCH_S)
    if not where or not own:
        return {}
    lead = seen.speed + seen.range_rate
    road = Road(data, lead, there.trace.output)
    out: Errors = {}
    for name, model in models.items():
        gap, speed = closed_loop.drive(road, Ride((model,), (None,), (), None), where)
        out[name] = ClosedLoopError(nrmse(gap, seen.gap), nrmse(speed, seen.speed))
    known = train.seen
    fitted_to = leads(known.gap, known.speed, known.speed + known.range_rate, own, train.output.dt)
    judged_on = leads(seen.gap, seen.speed, lead, where, dt)
    inside = judged_on.inside
    for rival in MODELS:
        found = calibrate(rival, fitted_to)
        gap, speed = (x[:, 0] for x in simulate(rival, rival.physical(found.x[:, None]), judged_on))
        error = nrmse(gap[inside], judged_on.gap[inside]), nrmse(speed[inside], judged_on.speed[inside])
        out[rival.name] = ClosedLoopError(*error)
    return out


def with_recommended(errors: Errors, report: Report) -> Errors:
    """Add the errors of the model that the diagnosis of the first drive recommends.

    Args:
        errors: of all models on the other drive.
        report: of the first drive, with its rivals.
    """
    name = CHOSEN if report.recommended in ("", CANID) else report.recommended
    return errors | {RECOMMENDED: errors[name]} if errors else errors


def best_rival(errors: Errors) -> ClosedLoopError:
    """The published model with the smallest error of the gap."""
    return min((errors[one.name] for one in MODELS), key=lambda error: error.gap)


def summary(rows: list[Errors]) -> list[str]:
    """Lines of a table: median and mean over the drives, and how often a model is no worse than the best rivals.

    Of all drives that is the one with the smallest median; of each drive it is known afterwards only.
    """
    names = [
        *(name for name in (BASELINE, CHOSEN, RECOMMENDED) if name in rows[0]),
        *(one.name for one in MODELS),
        "best rival",
    ]
    single = min(
        (one.name for one in MODELS), key=lambda name: float(np.median([row[name].gap for row in rows]))
    )
    rows = [{**row, "best rival": best_rival(row)} for row in rows]
    out = [
        "| model | NRMSE of the gap, median | mean | of the speed, median | mean "
        f"| gap no worse than {single}'s | than the best rival's of each drive |"
    ]
    out.append("|---|---|---|---|---|---|---|")
    for name in names:
        gap, speed = (np.array([row[name][k] for row in rows]) for k in (0, 1))
        shares = [
            np.mean([row[name].gap <= row[other].gap for row in rows]) for other in (single, "best rival")
        ]
        figures = (np.median(gap), np.mean(gap), np.median(speed), np.mean(speed))
        cells = " | ".join(f"{x:.3f}" for x in figures)
        better = " | ".join(f"{100 * share:.0f} % ({len(rows)})" for share in shares)
        out.append(f"| {name} | {cells} | {better} |")
    return out
