"""Questions to every driver of a population, with the false discovery rate over all of them."""

from __future__ import annotations

from canid.fleet_summary import Kind, Questions
from canid.population.drive_table import DriveTable
from canid.population.hierarchical import Population


def asked(table: DriveTable, pool: Population, kind: Kind) -> tuple[Questions, ...]:
    """Ask whether drivers changed, whether groups differ, and whether drives are of one driver."""
    return ()
