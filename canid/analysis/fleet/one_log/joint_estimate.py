"""The joint estimate of a drive's parameters and its sampling covariance, from the draws of FOPDT's posterior."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.fleet.storage.columns import POOLED
from canid.mathematics.estimators.fopdt import FOPDT
from canid.mathematics.systems.posterior_draws import Drawn
from canid.values.types import TASK_INPUTS, Array

# s; a lag of which a logarithm is taken is at least this: a tenth of a sample, in no data distinct from 0
MIN_TAU_S = 0.01


class JointEstimate(NamedTuple):
    """Mean and covariance of `POOLED`, p parameters."""

    names: tuple[str, ...]
    mean: Array  # (p,)
    covariance: Array  # (p, p)


def joint_estimate(identified: Identified) -> JointEstimate | None:
    """Mean and covariance of the draws; None: there is no joint posterior, or the gains changed during the drive.

    Args:
        identified: of a drive.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> of = joint_estimate(canid.identify(drive, select_orders=False, sliding=False))
        >>> of.names[1], 5.0 < of.mean[1] < 6.2, of.covariance.shape
        ('range_rate.K', np.True_, (8, 8))
    """
    draws, whole = identified.drive_summary.draws, identified.whole.get(FOPDT.name)
    if draws is None or whole is None or whole.details.get("changes"):
        return None
    if tuple(whole.channels) != TASK_INPUTS["car_following"]:
        return None
    columns = _columns(draws)
    if not np.isfinite(columns).all():
        return None
    return JointEstimate(POOLED, columns.mean(axis=0), np.cov(columns, rowvar=False))


def _columns(draws: Drawn) -> Array:
    """The draws as columns, in the order of `POOLED`, (k, 8)."""
    log_tau = np.log(np.maximum(draws.tau, MIN_TAU_S))
    log_sum = np.log(np.maximum(draws.tau + draws.dead_time, MIN_TAU_S))
    return np.column_stack([draws.K, log_tau, draws.dead_time, log_sum])
