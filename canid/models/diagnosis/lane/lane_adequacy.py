"""Adequacy of a driver who keeps the lane: score tests of the residual against families that are not in the catalogue."""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.adequacy.adequacy import (
    FAMILY_CHANCE,
    LEFT_BEHIND_SHARE,
    MATERIAL_RESIDUAL_SHARE,
    NAMED_CHANCE,
    Adequacy,
    spanned,
)
from canid.models.diagnosis.adequacy.alternatives import (
    INPUT_KNOTS,
    MEMORIES_S,
    OUTLIER_SIGMAS,
    OUTPUT_KNOTS,
    TIME_KNOTS,
    Shapes,
    hats,
)
from canid.models.diagnosis.driver.driver_model import delayed, lagged
from canid.models.diagnosis.lane.lane_fit import FittedLane
from canid.models.diagnosis.lane.lane_model import KD, PRODUCT, TAU, K, LaneData, parts, second_order
from canid.models.diagnosis.lane.lane_search import LaneSearch
from canid.values.types import Array

# s after the dead time, answers that one lag does not make
LATER_S = (1.0, 2.5)
# s that a curve is ahead
AHEAD_S = (0.0, 1.0, 2.0)


def assess(search: LaneSearch, explained: float = 0.0) -> Adequacy:
    """Test what a model leaves against every family.

    Args:
        search: what the search ended with.
        explained: variance that its causes took from the residual, over what they left.
    """
    tested = tuple(spanned(shapes(search.data, search.solved), search.data, search.solved))
    bound = (NAMED_CHANCE if search.named else FAMILY_CHANCE) / len(tested)
    material = max(MATERIAL_RESIDUAL_SHARE, LEFT_BEHIND_SHARE * explained)
    failed = tuple(family for family in tested if family.p < bound and family.share >= material)
    share = max((family.share for family in failed), default=0.0)
    return Adequacy(not failed, tested, failed, bound, material, share)


def shapes(data: LaneData, solved: FittedLane) -> list[Shapes]:
    """All families along a drive.

    Args:
        data: what is explained.
        solved: the model whose residual is tested; its dead time and lags are used, its causes are not.
    """
    q, dt, fine = solved.q, data.output.dt, solved.rows
    acted = parts(solved.model._replace(effects=(), where=()), data, q)

    def standard(x: Array) -> Array:
        scaled = (x - np.mean(x[fine])) / max(float(np.std(x[fine])), 1e-9)
        return np.asarray(np.clip(scaled, -OUTLIER_SIGMAS, OUTLIER_SIGMAS))

    def through(*columns: Array) -> Array:
        side_by_side = np.column_stack(columns)
        return np.column_stack(
            [second_order(c, float(q[TAU]), float(q[PRODUCT]), dt) for c in side_by_side.T]
        )

    y, r, t = standard(acted.position), standard(acted.rate), standard(data.t)
    both = standard(q[K] * acted.position + q[KD] * acted.rate)
    along = hats(data.t, fine, TIME_KNOTS)
    model = solved.fitted.model
    out, turn = standard(model), standard(np.gradient(model, dt))
    # fmt: off
    families = [
        Shapes("offset curve", "a bend in the answer to the offset", through(y * y, np.abs(y), y**3, y * np.abs(y))),
        Shapes("offset freely", "an answer to the offset of another form", through(hats(y, fine, INPUT_KNOTS))),
        Shapes("rate curve", "a bend in the answer to the lateral speed", through(r * r, np.abs(r), r**3, r * np.abs(r))),
        Shapes("rate freely", "an answer to the lateral speed of another form", through(hats(r, fine, INPUT_KNOTS))),
        Shapes("both", "an answer to the offset that depends on the lateral speed",
               through(y * r, y * np.abs(r), np.abs(y) * r, y * y * r)),
        Shapes("delays", "answers that come later than one dead time",
               through(*(delayed(x, s, dt) for x in (y, r) for s in LATER_S))),
        Shapes("offset long ago", "an answer to the offset of long ago",
               np.stack([lagged(y, s, dt) for s in MEMORIES_S], axis=1)),
        Shapes("time", "answers that change along the drive", np.c_[through(t * y, t * r, t * t * y, t * t * r), t, t * t]),
        Shapes("both in time", "an answer that changes at some time", through(both[:, None] * along)),
        Shapes("level", "a level that drifts along the drive", along),
        Shapes("output", "a wheel that bends at its ends",
               np.stack([out * out, out**3, np.maximum(out - 1, 0), np.minimum(out + 1, 0)], axis=1)),
        Shapes("output freely", "a wheel with steps or bends", hats(model, fine, OUTPUT_KNOTS)),
        Shapes("output rate", "a wheel that follows unevenly: later one way than the other, or with a limited rate",
               np.stack([np.abs(turn), turn * np.abs(turn), turn**3], axis=1)),
    ]
    # fmt: on
    if float(np.std(data.speed[fine])) > 0.0:
        v = standard(data.speed)
        families.append(Shapes("speed", "an answer that depends on the speed", through(y * v, r * v, v)))
    if data.curvature is not None and float(np.std(data.curvature[fine])) > 0.0:
        road = [standard(np.interp(data.t + s, data.t, data.curvature)) for s in AHEAD_S]
        families.append(Shapes("curves", "an answer to the road's curvature", through(*road)))
    return families
