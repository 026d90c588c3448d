"""Which model to take for a simulation behind another lead."""

from __future__ import annotations

import math
from collections.abc import Sequence

from canid.values.findings import Rival, Trajectory, nrmse

# name of the diagnosis' own final model
CANID = "canid"
# by which a published model's error must be smaller: errors on the same stretches differ by chance
MARGIN = 0.05


def recommended(loop: Sequence[Trajectory], rivals: Sequence[Rival]) -> str:
    """Name the model with the least error of the gap in closed loop on held-out data of this drive.

    Each model is fitted to the other folds, so that one with more parameters has no advantage (Stone 1974).

    Args:
        loop: canid's own closed-loop simulation; (): it has none.
        rivals: the published models.

    Returns:
        `CANID`, or the name of a published model; "" where no rival was calibrated.

    Example:
        >>> from canid.values.findings import ClosedLoopError
        >>> recommended((), (Rival("IDM", "", nrmse=ClosedLoopError(0.1, 0.02)),))
        'IDM'
    """
    errors = {rival.model: rival.nrmse.gap for rival in rivals if math.isfinite(rival.nrmse.gap)}
    if not errors:
        return ""
    best = min(errors, key=lambda name: errors[name])
    error = next(
        (nrmse(trajectory.after, trajectory.measured) for trajectory in loop if trajectory.role == "gap"),
        math.nan,
    )
    return best if not errors[best] >= (1.0 - MARGIN) * error else CANID
