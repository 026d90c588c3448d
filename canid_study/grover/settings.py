"""Settings of the study of Grover 2021."""

from __future__ import annotations

from typing import NamedTuple


class GroverSettings(NamedTuple):
    """What may be chosen; the defaults are the paper's where it states them.

    Example:
        >>> GroverSettings(min_episode=30.0).max_order
        11
    """

    # s; the records of Fig. 10-20 last some tens of seconds; below, a lag of 0.7 s and slow noise fill the record
    min_episode: float = 20.0
    # s; longer following is cut, so that an episode has another one after it to be validated on
    max_episode: float = 60.0
    # %; episodes with a transfer function that fits less are left out of the tables; 0: none. His gate of 90 % leaves
    # nothing of most drives, so it is counted instead
    gate_fit: float = 0.0
    max_order: int = 11  # the order of eq. 2.5
    max_fitted: int = (
        12  # episodes a drive that his method is applied to, the longest ones; the others are listed
    )
    draws: int = 40  # noise realizations of each simulated case
    seed: int = 1  # of the noise


DEFAULTS = GroverSettings()
