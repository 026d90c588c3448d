"""Estimates of several drives of one driver as one: each method's, weighted by precision (fixed effects; Birge 1932).

Each drive keeps an offset, a noise and a form of the wanted gap of its own. Where the drives differ by more than their
intervals say, the pooled interval is wider by the Birge ratio.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from canid.mathematics.estimators import plausibility
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification import identifiability
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt.channel_mixture import ORDER
from canid.mathematics.identification.identifiability import PARAMETERS, QUOTABLE, quotable
from canid.values.types import Channel, Identifiable, Interval, ResidualTests


def pooled(drives: Sequence[Mapping[str, WholeDrive | None]]) -> dict[str, WholeDrive | None]:
    """Pool what the drives may quote; the residuals and the changes are those of the drive that has most.

    Args:
        drives: of each, estimator -> its result; None: it has none.

    >>> from canid.values.types import Identifiable
    >>> one, two = (Channel(Interval(K, K - 1.0, K + 1.0), status=Identifiable.GAIN_ONLY) for K in (2.0, 2.2))
    >>> made = pooled([{"armax": WholeDrive({"x": one})}, {"armax": WholeDrive({"x": two})}, {"armax": None}])["armax"]
    >>> [round(number, 2) for number in made.channels["x"].K]
    [2.1, 1.39, 2.81]
    """
    names = dict.fromkeys(name for drive in drives for name in drive)
    return {name: _method([result for drive in drives if (result := drive.get(name))]) for name in names}


def _method(results: Sequence[WholeDrive]) -> WholeDrive | None:
    if not results:
        return None
    inputs = dict.fromkeys(key for each in results for key in each.channels)
    channels = {
        key: _channel([each.channels[key] for each in results if key in each.channels]) for key in inputs
    }
    changes = [change for each in results for change in each.details.get("changes", ())]
    details: dict[str, Any] = {"changes": tuple(changes)}
    if drifts := [each.details["dead_time_trend"] for each in results if "dead_time_trend" in each.details]:
        details["dead_time_trend"] = drifts[0]
    tests = [each.residual_tests for each in results if each.residual_tests is not None]
    most = max(tests, key=_left_over, default=None)
    return WholeDrive(channels, residual_tests=most, details=details)


def _left_over(tests: ResidualTests) -> float:
    return max((share for _, share in plausibility.large_left_over(tests)), default=0.0)


def _channel(parts: Sequence[Channel]) -> Channel:
    """Each parameter of the drives that may quote it; quotable is what at least one of them may quote."""
    known = {name: [getattr(part, name) for part in parts if quotable(part, name)] for name in PARAMETERS}
    status = max((part.status for part in parts), key=ORDER.index, default=Identifiable.NOT)
    fields = (_mean(known[name]) if name in QUOTABLE[status] else Interval() for name in PARAMETERS)
    return identifiability.channel(status, *fields)


def _mean(intervals: Sequence[Interval]) -> Interval:
    value = np.array([interval.value for interval in intervals])
    sd = np.array([interval.high - interval.low for interval in intervals]) / (2.0 * NORMAL_QUANTILE)
    weight = np.maximum(sd, 1e-300) ** -2.0
    mean = float(weight @ value / weight.sum())
    ratio = 1.0
    if len(value) > 1:
        ratio = max(1.0, float(weight @ (value - mean) ** 2) / (len(value) - 1)) ** 0.5
    half = NORMAL_QUANTILE * ratio * float(weight.sum()) ** -0.5
    return Interval(mean, mean - half, mean + half)
