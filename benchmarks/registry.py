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
        "outside_form",
        "benchmarks.outside_form",
        "60 min",
        "coverage, bias and error of every quotable number of whole drives in a world of another form; measured drives in "
        "halves and quarters",
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
        "first_sentence",
        "benchmarks.hidden_effects.first_sentence",
        "15 min",
        "whether the first sentence of a diagnosis alone holds what was planted, in 40 drives",
    ),
    Benchmark(
        "averaged_gains",
        "benchmarks.hidden_effects.averaged_gains",
        "6 min",
        "which gains identify may quote where the driver has a cause that its model has not, in 36 drives",
    ),
    Benchmark(
        "pages",
        "benchmarks.pages",
        "25 min",
        "whether the pages of 60 planted drives contradict themselves, in each kind that readers have found",
    ),
    Benchmark(
        "held_out_null",
        "benchmarks.hidden_effects.held_out_null",
        "4 min",
        "how often a cause that is not there gains surely on held-out data",
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
        "fleet_million",
        "benchmarks.fleet.million",
        "6 min",
        "a million logs: listing and planning them, questions to their tables",
        "duckdb",
    ),
    Benchmark(
        "fleet_memory",
        "benchmarks.fleet.memory",
        "5 min",
        "memory of the client: a run of a million logs that finds nothing new, tables of 60,000 drives",
        "duckdb",
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
        "prints",
        "benchmarks.papers.prints",
        "15 s",
        "no figures: the papers' printed numbers recomputed, and written anew for `canid study prints`",
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
        "radar_age",
        "benchmarks.signal_faults.radar_age",
        "1 min",
        "age of a radar's reports from the own motion: intervals that hold, findings and false ones",
    ),
    Benchmark(
        "measurement_ends",
        "benchmarks.measurement_effects.ends",
        "15 min",
        "an output at its limit: coverage, efficiency and false causes, by share of the time there",
    ),
    Benchmark(
        "signal_rates",
        "benchmarks.measurement_effects.rate",
        "15 min",
        "slow, held, joined, coarse and late signals: intervals that hold, what is withheld and named",
    ),
    Benchmark(
        "sensor_effects",
        "benchmarks.measurement_effects",
        "3 h",
        "limits, rates, steps, lags, zeros and clocks in tables: coverage, what is withheld, named, and missed silently",
    ),
    Benchmark(
        "live_intervals",
        "benchmarks.measurement_effects.live",
        "20 min",
        "live K, tau, dead time and their sum under noise of the radar and sensor effects, or a hidden cause: coverage",
    ),
    Benchmark(
        "delay_bound",
        "benchmarks.measurement_effects.delay_bound",
        "5 min",
        "delays of whole drives that a fit with the true inputs, form and noise law could quote, and that canid quotes",
    ),
    Benchmark(
        "sensor_causes",
        "benchmarks.measurement_effects.causes",
        "20 min",
        "the same drives diagnosed: causes that are named in driver and car, where there is none",
    ),
    Benchmark(
        "lane_ends",
        "benchmarks.measurement_effects.lane_ends",
        "5 min",
        "a wheel at its lock, by rate: locks found, gains that hold, false causes",
    ),
    Benchmark(
        "lane_sensors",
        "benchmarks.measurement_effects.lane_sensors",
        "90 min",
        "limits, rates, steps, lags, zeros and clocks in lane drives: gains that hold, what is named, false causes",
    ),
    Benchmark(
        "acceleration_slope",
        "benchmarks.measurement_effects.slope",
        "10 min",
        "cars whose acceleration is the slope of their speed: false causes on clean drives, planted causes found",
    ),
    Benchmark(
        "init", "benchmarks.init", "10 s", "`canid init`: the right signal of five roles in public DBC files"
    ),
    Benchmark(
        "own_car",
        "benchmarks.own_car",
        "10 min",
        "`canid init --yes`, `check` and `identify` on drives of known truth in the messages of public DBC files",
        "cantools",
    ),
    Benchmark(
        "own_car_speed",
        "benchmarks.own_car.speed",
        "2 min",
        "CPU time of `canid check` and `identify` with a radar of 64 tracks, against python-can + cantools",
        "cantools",
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
        "pooling_peers",
        "benchmarks.fleet.pooling_peers",
        "2 min",
        "partial pooling next to an exact posterior and to statsmodels' MixedLM: coverage and width of intervals",
        "statsmodels",
    ),
    Benchmark(
        "null_rates",
        "benchmarks.fleet.null_rates",
        "40 min",
        "how often comparisons of drivers and groups find what is not there",
    ),
    Benchmark(
        "formats",
        "benchmarks.formats",
        "1 min",
        "log formats: random files in every dialect of docs/formats, read back as they were written",
    ),
    Benchmark(
        "peer_files",
        "benchmarks.peer_files",
        "5 min",
        "logs and databases of peers' test suites in FOLDER, by count and value, against python-can and cantools",
        "cantools",
    ),
    Benchmark(
        "structure",
        "benchmarks.structure",
        "2 min",
        "the source tree in figures: code lines, layers, files of three traced calls, imports",
    ),
    Benchmark(
        "unchanged",
        "benchmarks.unchanged",
        "1 h",
        "results of two checkouts on the same drives: same verdicts and names, numbers within 1e-9",
    ),
)
