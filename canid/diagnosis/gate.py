"""Does the model leave anything that its inputs could explain? The gate that a named cause must pass.

Whitened residuals are held against families of functions of what the driver saw, none of them a cause of the
catalogue: curves of one input, products of two, other delays, slow time. What the model's own parameters could still
absorb is taken out of them. Each family is a score test that holds under uneven noise (White 1980).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.stats import chi2

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import TAU2, THETA2, lagged, parts, seen_late
from canid.diagnosis.evidence import spread
from canid.diagnosis.likelihood import whitened
from canid.diagnosis.solved import Solved
from canid.types import Array

# chance that a drive on which the model is right fails in any family
FAMILY = 0.005
# s; the noise's colour that whitening left has died away by then
REACH = 2.0
# of the residual's variance; what is significant but smaller than this is said, and blames nobody
MATERIAL = 0.01
# of what the named causes explained: less than this left behind is a matter of form, not of another cause. A hard dead
# zone fitted to a soft one leaves 3 to 6 %
FORM = 0.1
# Hz; where the answers to a lead have their power
SLOW = 0.05
# directions of a family that are smaller than this share of its largest tell nothing of their own
INDEPENDENT = 0.05


class Family(NamedTuple):
    """One family's outcome."""

    name: str
    says: str
    p: float  # chance of more than was found
    statistic: float
    dimensions: int
    share: float  # of the residual's variance that it would explain


class Gate(NamedTuple):
    """The gate's outcome."""

    passed: bool
    families: tuple[Family, ...]
    failed: tuple[Family, ...]
    bound: float  # a family's p must not be below
    material: float  # and its share not above this
    share: float  # of the residual's variance, the largest of a failed family


def families(data: DriverData, solved: Solved) -> list[tuple[str, str, Array]]:
    """Functions of what the driver saw, through his lag: (name, sentence, (n, k))."""
    dt, q, seen = data.output.dt, solved.q, data.seen
    tau = float(q[TAU2])
    fine = data.output.usable

    def standard(x: Array) -> Array:
        sd = float(np.std(x[fine]))
        scaled = (x - np.mean(x[fine])) / max(sd, 1e-9)
        return np.asarray(np.minimum(np.maximum(scaled, -4.0), 4.0))

    bare = solved.model._replace(effects=(), where=())
    acted = parts(bare, data, q)
    e, w = standard(acted.e), standard(acted.w)
    late = seen_late(data, float(q[THETA2]))
    v, a, t = standard(late.speed), standard(late.lead_accel), standard(seen.t)
    g = standard(np.log(np.maximum(late.gap, 1.0)))

    def through(*columns: Array) -> Array:
        return np.stack([lagged(c, tau, dt) for c in columns], axis=1)

    y = standard(solved.fitted.model)
    r = standard(np.gradient(solved.fitted.model, dt))
    r5 = _late(r, 0.5, dt)
    e1, w1 = standard(_late(acted.e, 1.0, dt)), standard(_late(acted.w, 1.0, dt))
    e3, w3 = standard(_late(acted.e, 3.0, dt)), standard(_late(acted.w, 2.5, dt))
    bends = [np.maximum(np.abs(x) - k, 0.0) * np.sign(x) for x in (w,) for k in (0.5, 1.2, 2.0)]
    return [
        ("range_rate curve", "a bend in the answer to relative speed", through(w * w, np.abs(w), w**3, *bends)),
        ("headway curve", "a bend in the answer to headway", through(e * e, np.abs(e), e**3, np.sign(e))),
        ("range_rate by gap", "an answer to relative speed that depends on the gap or the speed",
         through(w * g, w * g * g, w * v, w * v * v, np.abs(w) * g)),
        ("headway by speed", "an answer to headway that depends on the speed or the gap",
         through(e * v, e * v * v, e * g, v, v * v, v**3, g, g * g)),
        ("both", "an answer to headway that depends on relative speed", through(e * w, e * np.abs(w), e * e * w, e * w * w)),
        ("delays", "answers that come later than one dead time", through(e1, w1, e3, w3)),
        ("lead", "an answer to the lead's acceleration", through(a, np.abs(a), a * a * a)),
        ("time", "answers that change along the drive", np.c_[through(t * w, t * e, t * t * w, t * t * e), t, t * t, t**3]),
        ("output", "an output that bends at its ends",
         np.stack([y * y, y**3, np.maximum(y - 1, 0), np.minimum(y + 1, 0)], axis=1)),
        ("output rate", "an output that follows unevenly: later one way than the other, or no faster than so much",
         np.stack([np.abs(r), r * np.abs(r), r**3, np.abs(r5), r5 * np.abs(r5)], axis=1)),
    ]  # fmt: skip


def _late(x: Array, delay: float, dt: float) -> Array:
    k = round(delay / dt)
    late: Array = np.r_[np.full(min(k, x.size), x[0]), x[: max(x.size - k, 0)]]
    return late


def look(data: DriverData, solved: Solved, explained: float = 0.0) -> Gate:
    """Hold what a model leaves against every family.

    Args:
        data: what is explained.
        solved: the model.
        explained: variance that its causes took from the residual, over what they left: what they leave behind is
            measured by that, as the smooth form that nature gave a cause never is quite the one that is fitted.
    """
    J, e = solved.fitted.jacobian, solved.fitted.scored.e
    Q = qr(J, mode="economic")[0]
    told = []
    slope = solved.fitted.scored.slope
    for name, says, columns in families(data, solved):
        X = np.where(solved.rows[:, None], whitened(solved.noise, columns) * slope[:, None], 0.0)
        length = np.linalg.norm(X, axis=0)
        X = X - Q @ (Q.T @ X)
        left = np.linalg.norm(X, axis=0)
        # what the model absorbs but for a thousandth is rounding
        X = X[:, left > 0.03 * length] / np.maximum(left[left > 0.03 * length], 1e-12)
        told.append(_test(name, says, X, e, data, solved))
    bound = FAMILY / len(told)
    material = max(MATERIAL, FORM * explained)
    failed = [family for family in told if family.p < bound and family.share >= material]
    share = max((family.share for family in failed), default=0.0)
    return Gate(not failed, tuple(told), tuple(failed), bound, material, share)


def _test(name: str, says: str, X: Array, e: Array, data: DriverData, solved: Solved) -> Family:
    if not X.size:
        return Family(name, says, 1.0, 0.0, 0, 0.0)
    U, S, _ = np.linalg.svd(X, full_matrices=False)
    U = U[:, INDEPENDENT * S[0] < S]
    k = U.shape[1]
    z = U.T @ e
    meat = spread(U * e[:, None], round(REACH / data.output.dt))
    # the larger of both spreads in each direction: neither few blocks nor an even noise may make a finding
    values, vectors = np.linalg.eigh(meat)
    scale = float(e @ e) / max(solved.fitted.scored.free, 1)
    turned = vectors.T @ z
    statistic = float(np.sum(turned**2 / np.maximum(values, scale)))
    share = _share(U, z, data, solved)
    return Family(name, says, float(chi2.sf(statistic, k)), statistic, k, share)


def _share(U: Array, z: Array, data: DriverData, solved: Solved) -> float:
    """Share of the residual's variance, beyond what chance explains.

    What a slow structure with variance s explains of a noise with spectrum S is T·s/S (DESIGN, measured fact 9).
    """
    n = max(solved.fitted.scored.free, 1)
    gain = max(float(z @ z) - U.shape[1], 0.0)
    residual = (data.output.y - solved.fitted.model)[solved.rows & ~data.output.below]
    A = solved.noise.A
    turn = np.exp(-2j * np.pi * SLOW * data.output.dt * np.arange(A.size))
    spectrum = solved.noise.sd**2 / float(abs(A @ turn) ** 2)
    ratio = gain / n * spectrum / max(float(np.var(residual)), 1e-12)
    return float(ratio / (1 + ratio))
