"""The list of tables. A new one is a file with `table(settings)` and a line here."""

from benchmarks.identification.tables import (
    anytime,
    armax,
    constancy,
    coverage,
    cuts,
    deadtime,
    filters,
    floor,
    following,
    fopdt,
    gain_steps,
    progress,
    speed,
    tracking,
    verdict,
    windup,
)

TABLES = (
    ("armax", armax.table),
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
    ("gain_steps", gain_steps.table),
    ("constancy", constancy.table),
    ("time", speed.table),
)
