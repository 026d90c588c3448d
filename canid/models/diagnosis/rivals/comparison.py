"""Published car-following models on a drive: calibrated in closed loop, judged on the folds that did not calibrate them.

The stretches are those of canid's own closed-loop simulation, and so are the folds: all models are judged by the same
errors. A fold's calibration begins from that of the whole drive, as those of canid's models do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.models.diagnosis.driver.closed_loop import stretches
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.held_out import FOLDS
from canid.models.diagnosis.rivals.calibration import calibrate, intervals
from canid.models.diagnosis.rivals.rival_model import RivalModel
from canid.models.diagnosis.rivals.rival_models import MODELS
from canid.models.diagnosis.rivals.rival_simulation import Leads, leads, simulate
from canid.values.findings import ClosedLoopError, Flags, Rival, Trajectory, nrmse
from canid.values.types import Array

# stretches without which a calibration to three of four folds means nothing
MIN_STRETCHES = 6
NOT_ENOUGH_DATA = "not_enough_data"


def compare(
    data: DriverData, loop: Sequence[Trajectory], models: Sequence[RivalModel] = MODELS
) -> tuple[Rival, ...]:
    """Calibrate and judge the published models.

    Args:
        data: the driver's columns.
        loop: canid's own closed-loop simulation; (): where it has none, all usable samples count.
        models: which ones.

    Returns:
        one `Rival` per model; too few stretches give a status, and no number.
    """
    seen, dt = data.seen, data.output.dt
    where = stretches(np.isfinite(loop[0].before) if loop else data.output.usable, dt)
    if len(where) < MIN_STRETCHES:
        why = f"{len(where)} stretches behind a lead, {MIN_STRETCHES} are needed: drive longer"
        return tuple(Rival(model.name, model.source, status=NOT_ENOUGH_DATA, says=why) for model in models)
    columns = leads(seen.gap, seen.speed, seen.speed + seen.range_rate, where, dt)
    fold = np.array([stretch.block % FOLDS for stretch in where])
    return tuple(_judged(model, columns, fold) for model in models)


def _judged(model: RivalModel, columns: Leads, fold: Array) -> Rival:
    whole = calibrate(model, columns)
    q = np.empty((whole.x.size, 1, fold.size))
    for k in np.unique(fold):
        others = fold != k
        fitted = calibrate(model, columns.take(others), (whole.x,)) if others.any() else whole
        q[:, 0, ~others] = model.physical(fitted.x)[:, None]
    gap, speed = (x[:, 0] for x in simulate(model, q, columns))
    folds = tuple(_errors(gap, speed, columns, columns.inside & (fold == k)) for k in np.unique(fold))
    return Rival(
        model.name,
        model.source,
        intervals(model, whole),
        {parameter.name: parameter.unit for parameter in model.parameters},
        _errors(gap, speed, columns, columns.inside),
        folds,
    )


def _errors(gap: Array, speed: Array, columns: Leads, here: Flags) -> ClosedLoopError:
    return ClosedLoopError(nrmse(gap[here], columns.gap[here]), nrmse(speed[here], columns.speed[here]))
