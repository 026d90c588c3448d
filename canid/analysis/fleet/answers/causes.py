"""Causes across the drives of each car, with the evidence of all of them together."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from canid.analysis.fleet.storage.database import rows
from canid.mathematics.population.pooled_causes import (
    Diagnosed,
    PooledCause,
    pooled_causes,
    random_effects_mean,
)
from canid.values.fleet_summary import Cause, interval
from canid.values.text.names import readable
from canid.values.text.numbers import interval as interval_text
from canid.values.types import NAN, Interval

_Joint = Mapping[tuple[str, str], tuple[str, str]]
# verdicts of drives in which a cause could have been named
_DIAGNOSED = "('adequate', 'named', 'one_of', 'unexplained')"


def found(db: Any) -> tuple[tuple[Cause, ...], str]:
    """Causes that some drive names, or several drives of a driver together, the surest first; and why there are none.

    Surrogates are no causes: they help, but leave structure in the residual.

    Args:
        db: from `database.opened`.
    """
    joint = _joint(db)
    by_drives, why = _by_drives(db, joint)
    there = {(cause.car, cause.effect) for cause in by_drives}
    only = tuple(
        Cause(
            car, effect, where, 0, 0, 0, Interval(), Interval(), Interval(), NAN, NAN, says, "no drive alone names it"
        )
        for (car, effect), (where, says) in sorted(joint.items())
        if (car, effect) not in there
    )  # fmt: skip
    return (*by_drives, *only), "" if only else why


def _by_drives(db: Any, joint: _Joint) -> tuple[tuple[Cause, ...], str]:
    """Causes that some drive names."""
    (total,) = rows(
        db,
        f"SELECT count(*) FILTER (verdict IS NOT NULL) AS diagnosed, count(*) FILTER (verdict IN {_DIAGNOSED}) AS enough "
        "FROM drives WHERE key IS NOT NULL",
    )
    if not total["diagnosed"]:
        return (), "no drive was diagnosed"
    named = rows(
        db,
        f"""SELECT d.key, coalesce(d.car, '') AS car, f.effect, any_value(f."where") AS "where", any_value(f.parameters) AS
       parameters, max([f.gain, f.gain_low, f.gain_high]) AS gain,
       max([f.log_score_gain, f.log_score_gain_low, f.log_score_gain_high]) AS score
FROM findings f JOIN drives d USING (key)
WHERE NOT coalesce(f.surrogate, false) AND d.verdict IN {_DIAGNOSED} GROUP BY d.key, d.car, f.effect""",
    )
    if not named:
        short = total["diagnosed"] - total["enough"]
        lacking = f"; {short:,} of {total['diagnosed']:,} drives have not enough data" if short else ""
        return (), f"the diagnosis of no drive names a cause{lacking}"
    pooled = pooled_causes(_diagnosed(db, named))
    by_cause: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in named:
        by_cause.setdefault((row["car"], row["effect"]), []).append(row)
    return tuple(_cause(cause, by_cause[cause.car, cause.effect], joint) for cause in pooled), ""


def _diagnosed(db: Any, named: list[dict[str, Any]]) -> list[Diagnosed]:
    """One entry per diagnosed drive and cause that any drive names."""
    effects = sorted({row["effect"] for row in named})
    there = {(row["key"], row["effect"]): _strength(row["parameters"]) for row in named}
    detectable = {
        (row["key"], row["effect"]): row["strength"]
        for row in rows(db, "SELECT key, effect, min(strength) AS strength FROM power GROUP BY key, effect")
    }
    drives = rows(
        db,
        f"SELECT key, coalesce(driver, '') AS driver, coalesce(car, '') AS car FROM drives WHERE verdict IN {_DIAGNOSED} "
        "AND key IS NOT NULL ORDER BY key",
    )
    cars = {(row["car"], row["effect"]) for row in named}
    out = []
    for row in drives:
        for effect in effects:
            if (row["car"], effect) in cars:
                drive_effect = (row["key"], effect)
                strength = detectable.get(drive_effect)
                out.append(
                    Diagnosed(
                        row["key"], row["driver"], row["car"], effect, drive_effect in there,
                        there.get(drive_effect, Interval()), NAN if strength is None else float(strength),
                    )
                )  # fmt: skip
    return out


def _strength(parameters: str | None) -> Interval:
    """The effect's first parameter."""
    strengths = json.loads(parameters or "{}")
    first: dict[str, float | None] = next(iter(strengths.values()), {})
    return interval(*(first.get(end) for end in ("value", "low", "high")))


def _cause(pooled: PooledCause, named: list[dict[str, Any]], joint: _Joint) -> Cause:
    gain, _ = random_effects_mean([interval(*row["gain"]) for row in named])
    score, _ = random_effects_mean([interval(*row["score"]) for row in named])
    says = (
        []
        if not math.isfinite(pooled.strength.value)
        else [f"{_parameter(named)} {interval_text(pooled.strength)}"]
    )
    return Cause(
        pooled.car, pooled.effect, named[0]["where"] or "", pooled.named, pooled.diagnosed, pooled.drivers, pooled.rate,
        gain, score, pooled.p_value, pooled.adjusted, joint.get((pooled.car, pooled.effect), ("", ""))[1],
        "; ".join(filter(None, [*says, pooled.status])),
    )  # fmt: skip


def _parameter(named: list[dict[str, Any]]) -> str:
    return readable(next(iter(json.loads(named[0]["parameters"] or "{}")), "strength"))


def _joint(db: Any) -> _Joint:
    """What the diagnoses of several drives together say of causes, by car and effect: block, and on what they rest."""
    named_rows = rows(
        db,
        """SELECT coalesce(car, '') AS car, effect, subject, any_value("where") AS "where", count(DISTINCT key) AS n,
       any_value(logs) AS logs, any_value(holds_on) AS holds_on, (SELECT count(DISTINCT o.key) FROM joint_findings o
       WHERE coalesce(o.car, '') = coalesce(j.car, '') AND o.subject = j.subject) AS made
FROM joint_findings j WHERE effect IS NOT NULL AND NOT coalesce(surrogate, false)
GROUP BY coalesce(car, ''), effect, subject, made ORDER BY subject""",
    )
    out: dict[tuple[str, str], tuple[str, str]] = {}
    for row in named_rows:
        says = f"named for {row['n']} of {row['made']} drivers"
        if row["subject"] == "car":
            holds = "" if row["holds_on"] is None else f", holds on {row['holds_on']}"
            says = f"named on {row['logs']} drives of all drivers together{holds}"
        car_effect = (row["car"], row["effect"])
        before = out.get(car_effect, ("", ""))[1]
        out[car_effect] = (row["where"] or "", "; ".join(filter(None, [before, says])))
    return out
