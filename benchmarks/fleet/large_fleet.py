"""A fleet of 100,000 h on paper: cores, hours, storage and what limits it, from measured numbers."""

from __future__ import annotations

from typing import NamedTuple

HOURS = 100_000.0
# min; a trip to work or to a customer: what one log holds
LOG_MIN = 20.0
# cores that a lab has, a server, and a small cluster
CORES = (8, 64, 512)
# frames/s of a car's bus, against some 155 of the logs that were measured; bytes of a compressed frame (benchmarks reading)
BUS_FRAMES_PER_S, BYTES_PER_FRAME = 2_000.0, 10.0
# bytes of memory that an operator's client machine has
CLIENT_MEMORY_BYTES = 16e9


class Measured(NamedTuple):
    """What the other parts measured."""

    cpu_s_per_hour: float  # of the analysis, per hour driven
    result_bytes_per_hour: float
    log_bytes_per_hour: float
    analysis_bytes: float  # peak of one analysis
    client_s_per_log: float  # wall time of the client per new log, without the analysis
    plan_s_per_log: float  # of a run that has nothing to do
    client_bytes_per_log: float  # growth of the client's memory
    client_bytes: float  # what it needs anyway
    dask_overhead: float  # share of wall time


def on_paper(of: Measured) -> list[str]:
    """Lines of the table."""
    logs = HOURS * 60.0 / LOG_MIN
    cpu_h = HOURS * of.cpu_s_per_hour / 3600.0 * (1.0 + max(of.dask_overhead, 0.0))
    # the client takes one result after the other
    client_h = logs * of.client_s_per_log / 3600.0
    busiest = cpu_h / client_h
    bus_bytes = HOURS * 3600.0 * BUS_FRAMES_PER_S * BYTES_PER_FRAME
    out = [
        f"| {HOURS:,.0f} h in {logs:,.0f} logs of {LOG_MIN:.0f} min, on paper | |",
        "|---|---|",
        f"| analysis, with diagnosis and the overhead of Dask | {cpu_h:,.0f} h of one core |",
    ]
    out += [f"| · on {cores} cores | {_hours(max(cpu_h / cores, client_h))} |" for cores in CORES]
    out += [
        f"| the client handles the results in | {_hours(client_h)}: it limits from {busiest:,.0f} cores on |",
        f"| a later run that finds nothing new | {logs * of.plan_s_per_log / 60.0:.0f} min |",
        f"| memory of the client, of {CLIENT_MEMORY_BYTES / 1e9:.0f} GB | "
        f"{(of.client_bytes + logs * of.client_bytes_per_log) / 1e9:.1f} GB |",
        f"| memory of each worker | {of.analysis_bytes / 1e9:.2f} GB, for logs as long as the measured ones |",
        f"| results | {HOURS * of.result_bytes_per_hour / 1e9:,.0f} GB |",
        f"| logs: as measured; of a whole bus at {BUS_FRAMES_PER_S:,.0f} frames/s | "
        f"{HOURS * of.log_bytes_per_hour / 1e12:.2f} TB; {bus_bytes / 1e12:.1f} TB |",
        f"| bandwidth of the logs at {CORES[-1]} cores, of a whole bus | "
        f"{bus_bytes / max(cpu_h / CORES[-1], client_h) / 3600.0 / 1e6:,.0f} MB/s |",
    ]
    return out


def _hours(x: float) -> str:
    """Hours as a person says them.

    Example:
        >>> _hours(0.5), _hours(30.0), _hours(200.0)
        ('30 min', '30 h', '8.3 days')
    """
    return f"{60 * x:.0f} min" if x < 2 else f"{x:.0f} h" if x < 72 else f"{x / 24:.1f} days"
