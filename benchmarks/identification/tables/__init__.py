"""The list of tables. A new one is a file with `table(settings)` and a line here."""

from benchmarks.identification.tables import (
    anytime,
    armax,
    coverage,
    cuts,
    deadtime,
    filters,
    floor,
    following,
    fopdt,
    progress,
    sample_times,
    speed,
    steering,
    tracking,
    verdict,
    windup,
)

TABLES = (
    ("armax", armax.table),
    ("steering", steering.table),
    ("sample_times", sample_times.table),
    ("tracking", tracking.table),
    ("windup", windup.table),
    ("anytime", anytime.table),
    ("fopdt", fopdt.table),
    ("deadtime", deadtime.table),
    ("coverage", coverage.table),
    ("following", following.table),
    ("filters", filters.table),
    ("cuts", cuts.table),
    ("progress", progress.table),
    ("verdict", verdict.table),
    ("floor", floor.table),
    ("time", speed.table),
)
