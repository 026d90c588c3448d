"""Ready questions of `canid fleet query`: SQL over the views of `canid.analysis.fleet.storage.database`, by name."""

from __future__ import annotations

from typing import NamedTuple


class Query(NamedTuple):
    """A question with its answer in SQL."""

    name: str
    what: str  # one line
    sql: str


QUERIES = (
    Query(
        "drivers",
        "drivers by K of range rate, shrunken towards the population",
        """SELECT driver, output, car, drives, range_rate_K, range_rate_K_low, range_rate_K_high,
       range_rate_K_own, range_rate_K_own_low, range_rate_K_own_high
FROM drivers WHERE range_rate_K IS NOT NULL ORDER BY output, car, range_rate_K DESC, driver""",
    ),
    Query(
        "population",
        "the pooled parameters: mean, spread between drivers and within them",
        "SELECT * FROM population ORDER BY output, unit, car",
    ),
    Query(
        "causes",
        "causes by car, with the drives and drivers whose diagnosis names them",
        """SELECT d.car, f.effect, f."where", count(DISTINCT d.key) AS drives, count(DISTINCT d.driver) AS drivers,
       (SELECT count(*) FROM drives a
        WHERE a.car IS NOT DISTINCT FROM d.car AND a.duplicate_of IS NULL AND a.verdict IN
              ('adequate', 'named', 'one_of', 'unexplained')) AS diagnosed,
       median(f.gain) AS median_gain
FROM findings f JOIN drives d USING (key) WHERE d.duplicate_of IS NULL AND NOT coalesce(f.surrogate, false)
GROUP BY d.car, f.effect, f."where" ORDER BY d.car, drives DESC, f.effect""",
    ),
    Query(
        "misfits",
        "drives whose model stopped fitting, and when",
        """SELECT d.log, d.driver, d.car, e.t, e.name AS block, e.says
FROM events e JOIN drives d USING (key) WHERE e.kind = 'monitor' AND d.duplicate_of IS NULL ORDER BY d.log, e.t""",
    ),
    Query(
        "failed",
        "logs without results by reason, with one example each",
        """SELECT failure, count(*) AS logs, arg_min(reason, log) AS reason, min(log) AS example
FROM logs WHERE status = 'failed' GROUP BY failure ORDER BY logs DESC, failure""",
    ),
    Query(
        "signals",
        "faults of signals: logs, drivers and cars that have them",
        """SELECT s.fault, count(*) AS logs, count(DISTINCT s.driver) AS drivers,
       string_agg(DISTINCT s.car, ', ' ORDER BY s.car) AS cars, min(s.log) AS example
FROM (SELECT unnest(signal_findings) AS fault, log, driver, car FROM drives WHERE duplicate_of IS NULL) s
GROUP BY s.fault ORDER BY logs DESC, s.fault""",
    ),
    Query(
        "changed",
        "drivers who changed: within a drive, or over their drives",
        """SELECT driver, car, sum(gain_steps) AS steps_within_drives,
       count(*) FILTER (gain_steps > 0) AS drives_with_steps, count(*) AS drives,
       regr_slope(range_rate_K, start_utc / 604800) AS K_per_week
FROM drives WHERE key IS NOT NULL AND duplicate_of IS NULL GROUP BY driver, car
HAVING sum(gain_steps) > 0 OR count(range_rate_K) > 2
ORDER BY steps_within_drives DESC, abs(K_per_week) DESC NULLS LAST, driver""",
    ),
    Query(
        "least-known",
        "drivers whose K of range rate is least known",
        """SELECT driver, output, car, drives, usable / 60 AS usable_min, range_rate_K_own, range_rate_K_own_low,
       range_rate_K_own_high
FROM drivers
ORDER BY (range_rate_K_own_high - range_rate_K_own_low) / abs(range_rate_K_own) DESC NULLS FIRST, usable, driver""",
    ),
    Query(
        "drives",
        "drives with their status and parameters",
        """SELECT regexp_extract(log, '[^/]*/?[^/]*$') AS drive, driver, car, status, usable / 60 AS usable_min,
       headway_error_K, headway_error_K_low, headway_error_K_high, range_rate_K, range_rate_K_low, range_rate_K_high,
       range_rate_tau_plus_dead_time, range_rate_tau_plus_dead_time_low, range_rate_tau_plus_dead_time_high, fit_percent
FROM drives ORDER BY driver, log""",
    ),
    Query(
        "cost",
        "time and memory of the analysis, the slowest logs first",
        """SELECT log, duration / 60 AS drive_min, cpu_s, wall_s, peak_bytes / 1e6 AS peak_MB
FROM drives WHERE key IS NOT NULL ORDER BY wall_s DESC, log LIMIT 20""",
    ),
)


def named(name: str) -> Query | None:
    """The question of this name; None: there is none.

    Example:
        >>> named("failed").what
        'logs without results by reason, with one example each'
    """
    return next((query for query in QUERIES if query.name == name), None)
