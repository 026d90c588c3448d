"""The tables of a fleet and their columns: the contract between analysis, store, queries, pooling and report.

`drives` has one row per analysed content of a log, `windows` one per window and estimator, `events` what monitor, signal
checks and step detection reported, `findings` one per cause that a diagnosis states, `power` one per effect and the strength
that would have been named. All but `logs` are joined by `key`. `logs` has one row per log of the plan.
Numbers are DOUBLE with NULL for "not known"; SI units; an interval is three columns NAME, NAME_low, NAME_high.
"""

from __future__ import annotations

from typing import NamedTuple


class Column(NamedTuple):
    """A column."""

    name: str
    type: str  # of DuckDB
    unit: str = ""
    meaning: str = ""


def interval(name: str, unit: str, meaning: str) -> tuple[Column, ...]:
    """Three columns.

    Example:
        >>> [column.name for column in interval("K", "", "gain")]
        ['K', 'K_low', 'K_high']
    """
    return (
        Column(name, "DOUBLE", unit, meaning),
        Column(f"{name}_low", "DOUBLE", unit, f"{meaning}: low end of the 95 % interval"),
        Column(f"{name}_high", "DOUBLE", unit, f"{meaning}: high end of the 95 % interval"),
    )


CHANNELS = ("headway_error", "range_rate", "lateral_offset")
# a gain's unit is the output's over the input's; [unit]: what the column `unit` of the row says
GAIN_UNITS = {"headway_error": "[unit]/s", "range_rate": "[unit]/(m/s)", "lateral_offset": "[unit]/m"}
PARAMETERS = (("K", ""), ("tau", "s"), ("dead_time", "s"), ("tau_plus_dead_time", "s"))


def _channels() -> tuple[Column, ...]:
    out: list[Column] = []
    for channel in CHANNELS:
        out.append(Column(f"{channel}_status", "VARCHAR", "", "which parameters may be quoted"))
        for parameter, unit in PARAMETERS:
            out += interval(
                f"{channel}_{parameter}", unit or GAIN_UNITS[channel], f"{parameter} of {channel}"
            )
    return tuple(out)


# the parameters whose joint estimate and sampling covariance a drive has, in this order where both inputs are identified
POOLED = (
    "headway_error.K",
    "range_rate.K",
    "headway_error.log_tau",
    "range_rate.log_tau",
    "headway_error.dead_time",
    "range_rate.dead_time",
    "headway_error.log_tau_plus_dead_time",
    "range_rate.log_tau_plus_dead_time",
)

LOGS = (
    Column("log", "VARCHAR", "", "path or URL"),
    Column("driver", "VARCHAR", "", "from folder names or the mapping file"),
    Column("car", "VARCHAR", "", "from folder names or the mapping file; else the vehicle's name"),
    Column("group_name", "VARCHAR", "", "group, such as a setting of the ACC, from the mapping file"),
    Column("source", "VARCHAR", "", "fingerprint of vehicle file and DBC files, or of the column map"),
    Column("bytes", "BIGINT", "B"),
    Column("modified_ns", "BIGINT", "ns", "since 1970, when the log was listed"),
    Column("key", "VARCHAR", "", "of its results; NULL: it has none"),
    Column("duplicate_of", "VARCHAR", "", "an earlier log of the plan with the same bytes; counted once"),
    Column("status", "VARCHAR", "", "ok, damaged or failed"),
    Column("failure", "VARCHAR", "", "why it failed, as one word"),
    Column("reason", "VARCHAR", "", "why it failed or what is damaged, as one line"),
    Column("analysed_utc", "VARCHAR", "", "ISO 8601"),
    Column("attempts", "INTEGER"),
)

DRIVES = (
    Column("key", "VARCHAR"),
    Column("sha256", "VARCHAR", "", "of the log's bytes"),
    Column("vehicle", "VARCHAR", "", "name that the vehicle file states"),
    Column("canid", "VARCHAR", "", "version"),
    Column("cpu_s", "DOUBLE", "s"),
    Column("wall_s", "DOUBLE", "s"),
    Column("peak_bytes", "BIGINT", "B", "memory of the process"),
    Column("start_utc", "DOUBLE", "s", "since 1970; NULL: the log states no date"),
    Column("frames", "BIGINT"),
    Column("missing", "VARCHAR[]", "", "signals that the vehicle file maps and the log does not hold"),
    Column(
        "counters", "VARCHAR", "", 'JSON: readings without a value, by reason ("gap: no target") -> how many'
    ),
    Column("duration", "DOUBLE", "s"),
    Column("driving", "DOUBLE", "s"),
    Column("behind_lead", "DOUBLE", "s"),
    Column("usable", "DOUBLE", "s", "for identification"),
    Column("task", "VARCHAR"),
    Column("output", "VARCHAR", "", "role of the driver's output"),
    Column("unit", "VARCHAR", "", "of the output"),
    Column("estimator", "VARCHAR", "", "the headline over the whole drive"),
    *_channels(),
    Column("fit_percent", "DOUBLE", "%"),
    *interval("noise_sd", "[unit]", "standard deviation of what the model leaves of the output"),
    *interval("wanted_headway", "s", "headway at which the acceleration is 0 behind a steady lead"),
    *interval("speed", "m/s", "median that was driven, with its 5 and 95 % points as low and high"),
    *interval("headway", "s", "median, with its 5 and 95 % points"),
    *interval("gap", "m", "median, with its 5 and 95 % points"),
    Column("excitation_headway_error", "DOUBLE", "s", "standard deviation"),
    Column("excitation_range_rate", "DOUBLE", "m/s", "standard deviation"),
    Column("gain_steps", "INTEGER", "", "changes of the gains; then the whole drive has no one estimate"),
    Column("names", "VARCHAR[]", "", "parameters of `estimate`"),
    Column("estimate", "DOUBLE[]", "", "posterior mean"),
    Column("covariance", "DOUBLE[]", "", "of the estimate's error, row by row"),
    Column("verdict", "VARCHAR", "", "of the diagnosis"),
    Column("says", "VARCHAR", "", "what the diagnosis found"),
    Column("causes", "VARCHAR[]", "", "named effects, without surrogates"),
    Column("baseline_fit", "DOUBLE", "%"),
    Column("extended_fit", "DOUBLE", "%"),
    *interval("gain", "", "relative reduction of the simulation's error variance on held-out data"),
    *interval("unexplained", "", "share of the variance"),
    Column("signal_findings", "VARCHAR[]", "", "faults of signals"),
    Column("monitor_misfits", "INTEGER", "", "times that the monitor reported a model that stopped fitting"),
    Column("identify_json", "VARCHAR", "", "of canid identify, without windows and draws"),
    Column("traffic_json", "VARCHAR", "", "models for traffic simulators, see canid/analysis/sumo"),
)

WINDOWS = (
    Column("key", "VARCHAR"),
    Column("t", "DOUBLE", "s"),
    Column("estimator", "VARCHAR"),
    Column("headline", "BOOLEAN"),
    Column("status", "VARCHAR"),
    Column("used", "DOUBLE", "s", "data that the estimate rests on"),
    Column("fit_percent", "DOUBLE", "%"),
    *_channels(),
)

EVENTS = (
    Column("key", "VARCHAR"),
    Column("t", "DOUBLE", "s"),
    Column("kind", "VARCHAR", "", "monitor, gain_step, signal, damage or bus"),
    Column("name", "VARCHAR", "", "block of the monitor, or fault of the signal"),
    Column("until", "DOUBLE", "s", "NULL: to the end"),
    Column("says", "VARCHAR"),
)

FINDINGS = (
    Column("key", "VARCHAR"),
    Column("effect", "VARCHAR"),
    Column("where", "VARCHAR", "", "driver, vehicle, sensing or remnant"),
    Column("rivals", "VARCHAR[]"),
    Column("surrogate", "BOOLEAN", "", "it helps, but is not the cause"),
    Column("parameters", "VARCHAR", "", "JSON: name -> value, low, high, unit"),
    *interval("gain", "", "relative reduction of the simulation's error variance on held-out data"),
    *interval("log_score_gain", "nats/min", "on held-out data"),
    Column("says", "VARCHAR"),
)

POWER = (
    Column("key", "VARCHAR"),
    Column("effect", "VARCHAR"),
    Column("parameter", "VARCHAR"),
    Column("strength", "DOUBLE", "[unit]", "that would have been named 9 times of 10"),
    Column("unit", "VARCHAR"),
)

# tables of one log's results, in the order in which they are stored
TABLES = {"drives": DRIVES, "windows": WINDOWS, "events": EVENTS, "findings": FINDINGS, "power": POWER}


# parameters that are pooled over drives: of the joint estimate, and two that stand alone; times and noise as logarithms
POPULATION_PARAMETERS = (*POOLED, "log_noise_sd", "log_wanted_headway")


def natural(parameter: str) -> tuple[str, bool]:
    """Name of a pooled parameter as a column has it, and whether the pool holds its logarithm.

    Example:
        >>> natural("range_rate.log_tau"), natural("range_rate.K"), natural("log_noise_sd")
        (('range_rate_tau', True), ('range_rate_K', False), ('noise_sd', True))
    """
    channel, _, name = parameter.rpartition(".")
    plain = name.removeprefix("log_")
    return f"{channel}_{plain}" if channel else plain, plain != name


def _of_drivers() -> tuple[Column, ...]:
    out: list[Column] = []
    for parameter in POPULATION_PARAMETERS:
        name, _ = natural(parameter)
        channel = parameter.rpartition(".")[0]
        unit = GAIN_UNITS[channel] if name.endswith("_K") else "[unit]" if name == "noise_sd" else "s"
        out += interval(name, unit, f"{name}, shrunken towards the population")
        out += interval(f"{name}_own", unit, f"{name}, of this driver's drives alone")
    return tuple(out)


# of the whole folder, by `canid.analysis.fleet.answers.summary`: one row per driver and kind of output
DRIVERS = (
    Column("driver", "VARCHAR"),
    Column("output", "VARCHAR", "", "role of the driver's output"),
    Column("unit", "VARCHAR", "", "of the output"),
    Column("car", "VARCHAR", "", "of pedals, whose gains depend on the car; else empty"),
    Column("drives", "INTEGER", "", "that the estimates rest on"),
    Column("usable", "DOUBLE", "s", "of these drives"),
    *_of_drivers(),
)

# one row per kind of output and pooled parameter
POPULATION = (
    Column("output", "VARCHAR"),
    Column("unit", "VARCHAR", "", "of the output"),
    Column("car", "VARCHAR", "", "of pedals; else empty"),
    Column("parameter", "VARCHAR", "", "as the drivers' columns have it"),
    Column("relative", "BOOLEAN", "", "spreads are of the natural logarithm: 0.2 is some 20 %"),
    Column("drivers", "INTEGER"),
    Column("drives", "INTEGER"),
    *interval("mean", "[of the parameter]", "over drivers"),
    *interval("between", "[of the parameter; relative: 1]", "standard deviation between drivers"),
    *interval("within", "[of the parameter; relative: 1]", "standard deviation between drives of one driver"),
    *interval("new_driver", "[of the parameter]", "of a new drive of a new driver"),
    Column("says", "VARCHAR", "", "what the drives do not show"),
)

# what the diagnosis of several drives together found: one row per driver in a car, or car, and cause
JOINT_FINDINGS = (
    Column("key", "VARCHAR", "", "of the drives that were diagnosed together"),
    Column("subject", "VARCHAR", "", "driver or car"),
    Column("driver", "VARCHAR", "", "empty for a car"),
    Column("car", "VARCHAR"),
    Column("logs", "INTEGER", "", "diagnosed together"),
    Column("usable", "DOUBLE", "s", "of these"),
    Column("verdict", "VARCHAR"),
    Column("effect", "VARCHAR", "", "NULL: no cause was named"),
    Column("where", "VARCHAR"),
    Column("rivals", "VARCHAR[]"),
    Column("surrogate", "BOOLEAN"),
    *interval("gain", "", "relative reduction of the simulation's error variance on held-out data"),
    Column("holds_on", "INTEGER", "", "drives on which it predicts better, fitted to the others"),
    Column("says", "VARCHAR"),
)

# tables of the whole folder, next to those of the logs
SUMMARIES = {"drivers": DRIVERS, "population": POPULATION, "joint_findings": JOINT_FINDINGS}


def schema() -> dict[str, dict[str, dict[str, str]]]:
    """Type, unit and meaning of every column of every table, as `fleet.json` states them.

    Example:
        >>> schema()["drives"]["range_rate_K"]["unit"]
        '[unit]/(m/s)'
    """
    return {
        table: {
            name: {"type": kind, "unit": unit, "meaning": meaning} for name, kind, unit, meaning in columns
        }
        for table, columns in {"logs": LOGS, **TABLES, **SUMMARIES}.items()
    }
