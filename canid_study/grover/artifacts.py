"""Rows of the study: each equation, table, figure and step of Grover (2021), on this log and by the joint fit."""

from __future__ import annotations

from collections.abc import Sequence

from canid_study.artifact import Artifact
from canid_study.grover import method_claims, printed_models
from canid_study.grover.drive_analysis import DriveAnalysis
from canid_study.grover.episode_analysis import Analysis


def rows(
    drives: Sequence[DriveAnalysis],
    example: tuple[DriveAnalysis, Analysis],
    figures: Sequence[str],
    draws: int,
    others: Sequence[tuple[DriveAnalysis, Analysis]] = (),
) -> tuple[Artifact, ...]:
    """All rows.

    Args:
        drives: with analyses.
        example: drive and episode that stand for the paper's first record.
        figures: names of the figures that were made.
        draws: simulated records of each drive.
        others: drive and episode that stand for cases 1 to 3.
    """
    every = [a for drive in drives for a in drive.analyses]
    out = [
        printed_models.speed_factor(drives),
        *printed_models.dead_times(drives),
        *printed_models.transfer_functions(example),
        *printed_models.first_order_forms(example, every),
        *printed_models.reduced(example),
        printed_models.table_1(example),
        method_claims.table_2(every),
        *printed_models.figures(example, figures, others),
        method_claims.episodes(drives),
        method_claims.detrending(),
        method_claims.gate(drives, every, draws),
        method_claims.reduction_step(every),
        method_claims.summed_orders(every),
        method_claims.validation(every),
        *method_claims.cost(drives),
        method_claims.attention(every),
        method_claims.fleet(drives),
        method_claims.second_opinion(drives),
    ]
    return tuple(out)
