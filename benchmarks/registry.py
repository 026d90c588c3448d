"""Every benchmark: its name, its module, its usual duration and what it measures."""

from __future__ import annotations

from typing import NamedTuple


class Benchmark(NamedTuple):
    """An entry of the list that `python -m benchmarks` prints."""

    name: str
    module: str  # runs as `python -m MODULE`
    duration: str  # of the usual form, on two cores
    measures: str
    needs: str = ""  # an optional package without which it does not start


BENCHMARKS = (
    Benchmark(
        "live",
        "benchmarks.live",
        "2 min",
        "latency from frame to estimate, CPU and start-up of the live path",
    ),
    Benchmark(
        "listener",
        "benchmarks.listener",
        "30 s",
        "cost of `canid.Listener` per frame on the bus's thread, against python-can's own listeners",
    ),
    Benchmark(
        "export",
        "benchmarks.export",
        "2 min",
        "time and memory of `canid export` by format; against pandas, python-can with cantools, and asammdf",
        "mcap",
    ),
    Benchmark(
        "web",
        "benchmarks.web",
        "2 min",
        "start-up, latency and CPU of the live page, with 20 clients of which one stalls and one floods",
        "websockets",
    ),
    Benchmark(
        "terminal",
        "benchmarks.terminal",
        "2 min",
        "cost of the terminal view, and of recording with and without it",
    ),
    Benchmark(
        "diagnosis_report",
        "benchmarks.diagnosis_report.screenshots",
        "1 min",
        "no figures: the pictures of the diagnosis report in docs/images",
        "playwright",
    ),
    Benchmark("replay", "benchmarks.replay", "1 min", "speed of `canid replay --speed max`, by stage"),
    Benchmark(
        "reading", "benchmarks.reading", "3 min", "reading and decoding logs, against python-can and asammdf"
    ),
    Benchmark(
        "tables",
        "benchmarks.tables",
        "1 min",
        "reading CSV and Parquet, against numpy, pandas, polars and duckdb",
    ),
    Benchmark("look", "benchmarks.look", "20 s", "a first look at a log, against python-can and cantools"),
    Benchmark(
        "recording", "benchmarks.recording", "2 min", "CPU and losses of `canid record`, against can.logger"
    ),
    Benchmark(
        "triggers",
        "benchmarks.triggers",
        "2 min",
        "CPU and memory of an armed recording, against a plain one",
    ),
    Benchmark(
        "reliability",
        "benchmarks.reliability",
        "1 h",
        "promises about kills, power cuts, faulty disks and buses",
    ),
    Benchmark(
        "damaged_logs",
        "benchmarks.damaged_logs",
        "10 min",
        "mutated and hostile logs: frames lost, time, memory",
    ),
    Benchmark(
        "fuzz",
        "benchmarks.damaged_logs.fuzz",
        "unlimited",
        "coverage-guided fuzzing of the log readers",
        "atheris",
    ),
    Benchmark(
        "truth", "benchmarks.estimates.truth", "3 min", "coverage of the live intervals on simulated drives"
    ),
    Benchmark(
        "agreement",
        "benchmarks.estimates.agreement",
        "5 min",
        "how often the two estimators contradict each other",
    ),
    Benchmark(
        "identification",
        "benchmarks.identification",
        "2 h",
        "estimators against peers and the Cramér–Rao bound",
    ),
    Benchmark(
        "hidden_effects", "benchmarks.hidden_effects", "2 h", "diagnosis of effects planted in 500 drives"
    ),
    Benchmark(
        "another_lead",
        "benchmarks.hidden_effects.another_lead",
        "6 min",
        "stated gains on fresh drives of the same driver behind other leads",
    ),
    Benchmark(
        "missed",
        "benchmarks.hidden_effects.missed",
        "8 min",
        "the driver's intervals where a weak effect was not named",
    ),
    Benchmark(
        "hidden_effects_lane",
        "benchmarks.hidden_effects.lane",
        "10 min",
        "diagnosis of effects planted in lane drives",
    ),
    Benchmark(
        "hidden_effects_tuning",
        "benchmarks.hidden_effects.peers.tuning",
        "1 h",
        "settings of the peers of hidden_effects",
    ),
    Benchmark(
        "measured_drives",
        "benchmarks.measured_drives",
        "5 min",
        "diagnosis of the measured drives, and of halves",
    ),
    Benchmark(
        "compare",
        "benchmarks.compare",
        "8 min",
        "`canid compare`: one driver called two, and two drivers found",
    ),
    Benchmark(
        "sumo",
        "benchmarks.sumo",
        "20 min",
        "seven driver models of Eclipse SUMO: identify, diagnose, a second lead, rivals",
    ),
    Benchmark(
        "planted_fleet",
        "benchmarks.fleet.planted_fleet",
        "25 min",
        "`canid fleet` on 200 drives of a hidden population, scored by the truth",
        "duckdb",
    ),
    Benchmark(
        "population_prior",
        "benchmarks.fleet.population_prior",
        "10 min",
        "a new driver's first minute with the prior of a population: width of intervals, coverage, atypical drivers",
    ),
    Benchmark(
        "fleet_cost",
        "benchmarks.fleet.cost",
        "2 h",
        "cost and scale of `canid fleet`: workers, Dask, 10,000 logs, a long log among short ones",
        "distributed",
    ),
    Benchmark(
        "measured_fleet",
        "benchmarks.fleet.measured_fleet",
        "5 min",
        "`canid fleet` on the measured drives: drivers, groups, causes",
        "duckdb",
    ),
    Benchmark(
        "exported_drivers",
        "benchmarks.sumo.exported_drivers",
        "3 min",
        "drivers exported as SUMO vehicle types: distributions in SUMO against the logs', planted drivers come back",
        "libsumo",
    ),
    Benchmark(
        "papers",
        "benchmarks.papers",
        "15 min",
        "both papers by `canid study`: prints, and the printed drivers simulated and identified again",
    ),
    Benchmark(
        "planted",
        "benchmarks.measured_drives.planted",
        "15 min",
        "effects planted on measured drives: found, and nothing where nothing is planted",
    ),
    Benchmark(
        "change_detection",
        "benchmarks.monitor",
        "30 min",
        "false alarms, delay and cost of the change monitor",
    ),
    Benchmark(
        "signal_faults",
        "benchmarks.signal_faults",
        "5 min",
        "signal checks: planted faults caught and named, false alarms",
    ),
    Benchmark(
        "init", "benchmarks.init", "10 s", "`canid init`: the right signal of five roles in public DBC files"
    ),
    Benchmark(
        "dbc", "benchmarks.dbc", "1 min", "DBC files under folders: read, repaired or refused, and why"
    ),
    Benchmark(
        "pooling",
        "benchmarks.fleet.pooling",
        "5 min",
        "partial pooling: coverage of intervals on simulated fleets, outliers, against plug-in intervals",
    ),
    Benchmark(
        "null_rates",
        "benchmarks.fleet.null_rates",
        "40 min",
        "how often comparisons of drivers and groups find what is not there",
    ),
    Benchmark("structure", "benchmarks.structure", "10 s", "readability of the source tree in figures"),
)
