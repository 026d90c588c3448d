"""Causes across the drives of each car, with the evidence of all of them together."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import bdtrc
from scipy.stats import beta

from canid.fleet.database import rows
from canid.fleet_summary import Cause
from canid.identification.confidence import NORMAL_QUANTILE
from canid.population.false_discovery import adjusted
from canid.types import NAN, Interval

# chance that the diagnosis of a drive without the cause names it: that of naming anything on such a drive (docs/results.md)
FALSE_NAME_CHANCE = 0.05


def found(db: Any) -> tuple[tuple[Cause, ...], str]:
    """Causes, those of most drives first; and why there are none.

    Args:
        db: from `database.opened`.
    """
    (total,) = rows(
        db,
        "SELECT count(*) FILTER (verdict IS NOT NULL) AS diagnosed, "
        "count(*) FILTER (verdict IS NOT NULL AND verdict <> 'not_enough_data') AS enough FROM drives WHERE key IS NOT NULL",
    )
    if not total["diagnosed"]:
        return (), "no drive was diagnosed: the run had no diagnosis"
    listed = rows(
        db,
        """WITH named AS (
  SELECT DISTINCT ON (d.key, f.effect) coalesce(d.car, '') AS car, d.driver, d.key, f.effect, f."where", f.gain,
         f.gain_low, f.gain_high, f.log_score_gain, f.log_score_gain_low, f.log_score_gain_high
  FROM findings f JOIN drives d USING (key) WHERE NOT coalesce(f.surrogate, false)
), testable AS (
  SELECT coalesce(d.car, '') AS car, p.effect, d.key FROM power p JOIN drives d USING (key)
  UNION SELECT car, effect, key FROM named
)
SELECT n.car, n.effect, any_value(n."where") AS "where", count(DISTINCT n.key) AS drives,
       count(DISTINCT n.driver) AS drivers,
       (SELECT count(DISTINCT t.key) FROM testable t WHERE t.car = n.car AND t.effect = n.effect) AS testable,
       list([n.gain, n.gain_low, n.gain_high]) AS gains,
       list([n.log_score_gain, n.log_score_gain_low, n.log_score_gain_high]) AS scores
FROM named n GROUP BY n.car, n.effect""",
    )
    if not listed:
        why = "the diagnosis of no drive names a cause"
        short = total["diagnosed"] - total["enough"]
        return (), why + (f"; {short} of {total['all']} drives have not enough data" if short else "")
    p = [float(bdtrc(row["drives"] - 1, row["testable"], FALSE_NAME_CHANCE)) for row in listed]
    q = adjusted(np.array(p), dependent=True)
    out = [
        Cause(
            row["car"], row["effect"], row["where"] or "", row["drives"], row["testable"], row["drivers"],
            share(row["drives"], row["testable"]), mean_of(row["gains"]), mean_of(row["scores"]), p[k], float(q[k]), "", "",
        )
        for k, row in enumerate(listed)
    ]  # fmt: skip
    return tuple(sorted(out, key=lambda one: (-one.drives, one.q, one.car, one.effect))), ""


def share(count: int, of: int) -> Interval:
    """Share with its exact interval (Clopper & Pearson 1934).

    Example:
        >>> [round(x, 2) for x in share(8, 10)]
        [0.8, 0.44, 0.97]
    """
    if not of:
        return Interval()
    low = float(beta.ppf(0.025, count, of - count + 1)) if count else 0.0
    high = float(beta.ppf(0.975, count + 1, of - count)) if count < of else 1.0
    return Interval(count / of, low, high)


def mean_of(intervals: list[list[float | None]]) -> Interval:
    """Mean over drives, each weighted by its error and the spread between drives (DerSimonian & Laird 1986).

    Example:
        >>> [round(x, 2) for x in mean_of([[0.2, 0.1, 0.3], [0.4, 0.3, 0.5]])]
        [0.3, 0.1, 0.5]
    """
    known = [[float(x) for x in one if x is not None] for one in intervals]
    known = [one for one in known if len(one) == 3 and all(map(math.isfinite, one)) and one[2] > one[1]]
    if not known:
        return Interval()
    y = np.array([one[0] for one in known])
    variance = np.array([((one[2] - one[1]) / (2.0 * NORMAL_QUANTILE)) ** 2 for one in known])
    weight = 1.0 / variance
    mean = float(np.sum(weight * y) / np.sum(weight))
    excess = float(np.sum(weight * (y - mean) ** 2)) - (len(y) - 1)
    spread = (
        max(excess / float(np.sum(weight) - np.sum(weight**2) / np.sum(weight)), 0.0) if len(y) > 1 else 0.0
    )
    weight = 1.0 / (variance + spread)
    mean = float(np.sum(weight * y) / np.sum(weight))
    half = NORMAL_QUANTILE / math.sqrt(float(np.sum(weight)))
    return Interval(mean, mean - half, mean + half) if math.isfinite(half) else Interval(mean, NAN, NAN)
