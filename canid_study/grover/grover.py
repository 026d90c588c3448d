"""`canid study grover`: the study of Grover (2021) on any drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import repeat
from typing import Any

from canid.values.types import Channel, Trace
from canid_study.artifact import Figure, Skipped, Study
from canid_study.grover import artifacts, figures, joint, tables
from canid_study.grover.drive_analysis import DriveAnalysis, drive_of
from canid_study.grover.episode_analysis import Analysis
from canid_study.grover.episodes import INPUTS
from canid_study.grover.settings import DEFAULTS, GroverSettings
from canid_study.grover.tables import median

__all__ = ["GroverSettings", "drive_of", "study"]

PAPER = "Grover 2021"
TITLE = "Identification of driver-specific parameters: per input and jointly"


def study(
    drives: Mapping[str, Trace],
    settings: GroverSettings = DEFAULTS,
    progress: Callable[[int, int], None] | None = None,
    run: Callable[..., Iterable[Any]] = map,
) -> Study:
    """Study drives of car following.

    Args:
        drives: log -> trace.
        settings: of the study.
        progress: takes the number of drives done and of all.
        run: maps a function over the drives, as `map` does; that of a process pool runs them in parallel.

    Returns:
        Without any episode: a sentence that says why and what to do, and no rows.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> result = study({"urban": drive})
        >>> [a.verdict.value for a in result.artifacts if a.name == "claim G5"]
        ['impossible']
    """
    analysed: list[DriveAnalysis] = []
    for analysis in run(drive_of, list(drives), list(drives.values()), repeat(settings, len(drives))):
        analysed.append(analysis)
        if progress is not None:
            progress(len(analysed), len(drives))
    return combined(analysed, {log: trace.dt for log, trace in drives.items()}, settings)


def combined(analysed: list[DriveAnalysis], dt: Mapping[str, float], settings: GroverSettings) -> Study:
    """Put drives together.

    Args:
        analysed: from `drive_of`.
        dt: s, of each log's grid.
        settings: of the study.
    """
    skipped = tuple(entry for drive in analysed for entry in drive.skipped)
    shown = tuple((name, f"{value:g}") for name, value in settings._asdict().items())
    drives = [drive for drive in analysed if drive.analyses]
    if not drives:
        return Study(PAPER, TITLE, _nothing(analysed, skipped, settings), (), skipped=skipped, settings=shown)
    cases = sorted(
        ((drive, a) for drive in drives for a in drive.analyses),
        key=lambda c: (-c[1].episode.length, c[1].episode.t),
    )
    example, others = cases[0], cases[1:4]
    made = _figures(drives, analysed, example, others, dt)
    return Study(
        PAPER,
        TITLE,
        _says(drives),
        artifacts.rows(drives, example, [f.name for f in made], settings.draws, others),
        (
            tables.table_1(*example),
            tables.table_2(drives),
            tables.episodes([d for d in analysed if d.episodes]),
            tables.orders(drives, settings.max_order),
            tables.reductions(drives),
            tables.miso(drives),
            tables.next_episode(drives),
            tables.input_correlation(drives),
            tables.fleet(drives),
        ),
        made,
        skipped,
        shown,
    )


def _figures(
    drives: list[DriveAnalysis],
    analysed: list[DriveAnalysis],
    example: tuple[DriveAnalysis, Analysis],
    others: list[tuple[DriveAnalysis, Analysis]],
    dt: Mapping[str, float],
) -> tuple[Figure, ...]:
    drive, analysis = example
    every = [a for d in drives for a in d.analyses]
    made: list[Figure | None] = [
        figures.route(analysed),
        *figures.throttle(drive, analysis),
        *figures.responses(drive, analysis, dt[drive.log]),
        figures.places(drives),
        *figures.further(others, [dt[d.log] for d, _ in others]),
        figures.orders(every),
        figures.next_episode(every),
        figures.input_correlation(drives),
    ]
    return tuple(f for f in made if f is not None)


def _says(drives: list[DriveAnalysis]) -> tuple[str, ...]:
    every = [a for d in drives for a in d.analyses]
    count = sum(len(d.episodes) for d in drives)
    growing = sum(p.model.growing > 0 for a in every for p in a.inputs)
    sums = median([a.together.high_sum for a in every])
    out = [
        f"{count} episodes of car following in {_count(len(drives), 'drive')}; of the transfer functions of the "
        f"{len(every)} longest {growing} of {2 * len(every)} have unstable poles, and the sum of both inputs' models fits "
        f"{sums:.0f} % (median)."
    ]
    for drive in drives:
        known = joint.known(drive.joint.channels.get(INPUTS[0], Channel()))
        if drive.cost is not None and known:
            K, recorded = drive.cost.K1, drive.cost.recorded
            out.append(
                f"{drive.log}: one fit per input misses K1 by {recorded.per_input.value / K - 1.0:+.0%} in this loop "
                f"(correlation of the inputs {recorded.correlation:.2f}), the joint fit by "
                f"{recorded.joint.value / K - 1.0:+.0%}; by simulation on the drive's own inputs."
            )
    held = [a.held for a in every if a.held is not None]
    if held:
        out.append(
            f"On the next episode the transfer functions fit {median([h.high for h in held]):.0f} %, the reduced ones "
            f"{median([h.reduced for h in held]):.0f} %, the joint model {median([h.joint for h in held]):.0f} % (median)."
        )
    return tuple(out)


def _nothing(
    analysed: list[DriveAnalysis], skipped: tuple[Skipped, ...], settings: GroverSettings
) -> tuple[str, ...]:
    if any(d.episodes for d in analysed):
        return ("No episode could be analysed: see what was skipped and why.",)
    reasons = list(dict.fromkeys(entry.why for entry in skipped if entry.what == "the whole log"))
    why = reasons[0] if len(reasons) == 1 else "each for its own reason, see what was skipped"
    return (
        f"No episode of {settings.min_episode:g} s and more in {_count(len(analysed), 'drive')}: {why}",
        "Record a drive of several minutes behind another vehicle, with the pedal, or lower --min-episode.",
    )


def _count(n: int, what: str) -> str:
    """Number and noun.

    >>> _count(1, "drive"), _count(2, "drive")
    ('1 drive', '2 drives')
    """
    return f"{n} {what}{'s' * (n != 1)}"
