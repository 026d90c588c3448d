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
    peers_following,
    progress,
    residuals,
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
    ("peers_following", peers_following.table),
    ("filters", filters.table),
    ("cuts", cuts.table),
    ("residuals", residuals.table),
    ("progress", progress.table),
    ("verdict", verdict.table),
    ("floor", floor.table),
    ("time", speed.table),
)
