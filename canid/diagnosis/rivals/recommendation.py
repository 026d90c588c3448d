"""Which model to take for a simulation behind another lead."""

from __future__ import annotations

import math
from collections.abc import Sequence

from canid.findings import Rival, Trajectory, nrmse

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
        >>> from canid.findings import ClosedLoopError
        >>> recommended((), (Rival("IDM", "", nrmse=ClosedLoopError(0.1, 0.02)),))
        'IDM'
    """
    errors = {one.model: one.nrmse.gap for one in rivals if math.isfinite(one.nrmse.gap)}
    if not errors:
        return ""
    best = min(errors, key=lambda name: errors[name])
    own = next((nrmse(of.after, of.measured) for of in loop if of.role == "gap"), math.nan)
    return best if not errors[best] >= (1.0 - MARGIN) * own else CANID
