"""Data types of what a fleet says: counts, the population, tests with their false discovery rate, causes, what is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.values.types import NAN, Interval


class Kind(NamedTuple):
    """Drives whose gains can be compared: one output in one unit; of pedals, in one car."""

    output: str  # role
    unit: str
    car: str = ""  # "": of any car

    def text(self) -> str:
        """In words.

        Example:
            >>> Kind("accel", "m/s²").text(), Kind("pedal", "%", "tesla").text()
            ('accel (m/s²)', 'pedal (%) of tesla')
        """
        unit = f" ({self.unit})" if self.unit else ""
        return f"{self.output}{unit}" + (f" of {self.car}" if self.car else "")


class Excluded(NamedTuple):
    """A drive that is no part of the population."""

    log: str
    driver: str
    why: str


class Counts(NamedTuple):
    """How much there is. Logs with the same bytes as another one are in `duplicates` alone."""

    logs: int
    ok: int
    damaged: int
    failed: int
    duplicates: int
    open: int  # not analysed yet
    drivers: int
    cars: int
    duration: float  # s
    behind_lead: float  # s
    usable: float  # s


class Counted(NamedTuple):
    """Logs or drives of which the same is to be said."""

    what: str
    number: int
    says: str  # of one of them
    examples: tuple[str, ...]  # names, a few


class Parameter(NamedTuple):
    """One parameter of the population."""

    name: str  # as `columns.POPULATION_PARAMETERS` has it
    unit: str
    log: bool  # the numbers of `between` and `within` are of the natural logarithm; those of `mean` are not
    drivers: int
    drives: int
    mean: Interval  # over drivers; of a logarithm the geometric mean
    between: Interval  # standard deviation between drivers
    within: Interval  # between drives of one driver
    new_driver: Interval  # where a new drive of a new driver lies, 95 %
    says: str  # what the drives do not show; "": nothing


class Driver(NamedTuple):
    """One driver, by parameter."""

    name: str
    drives: int
    usable: float  # s
    shrunken: Mapping[str, Interval]  # towards the population
    own: Mapping[str, Interval]  # of his own drives alone


class Answer(NamedTuple):
    """The answer to one question to one driver, or to a pair of groups, among all that were asked."""

    subject: str
    parameter: str  # "": all together
    effect: Interval  # what differs, per what it is counted; unknown: the test has no size
    unit: str
    p: float
    q: float  # p adjusted for the false discovery rate over all tests of this question
    found: bool
    says: str


class Questions(NamedTuple):
    """All tests of one question."""

    question: str
    finding: str  # what `found` of the `asked` do: "drivers changed"
    asked: int
    found: int
    rate: float  # false discovery rate that is kept
    tests: tuple[Answer, ...]  # the found ones first, then those with the smallest q
    says: str  # what could not be asked, and why; ""
    sentence: str  # what was found; "": nothing


class Population(NamedTuple):
    """What is pooled of one kind of output."""

    kind: Kind
    parameters: tuple[Parameter, ...]
    drivers: tuple[Driver, ...]
    outliers: tuple[str, ...]  # drives or drivers that do not fit the rest
    says: tuple[str, ...]
    questions: tuple[Questions, ...]


class Cause(NamedTuple):
    """One cause in one car, with the evidence of all its drives."""

    car: str
    effect: str
    where: str
    drives: int  # that name it
    diagnosed: int  # of this car, in which it could have been named
    drivers: int
    share: Interval  # of drives with it, among those in which it could have been named
    gain: Interval  # relative reduction of the simulation's error variance, over the drives that name it
    log_score_gain: Interval  # nats/min, likewise
    p: float  # that the drives name it by chance
    q: float
    joint: str  # what the diagnosis of several drives together says; "": none was made
    says: str


class Next(NamedTuple):
    """What to drive next."""

    driver: str
    what: str
    why: str


class FleetSummary(NamedTuple):
    """All that a fleet says."""

    folder: str
    verdict: str  # the answer in a few words
    sentences: tuple[str, ...]  # the answer, plainly
    counts: Counts
    failures: tuple[Counted, ...]
    damaged: tuple[Counted, ...]
    signals: tuple[Counted, ...]
    excluded: tuple[Counted, ...]  # drives that are no part of a population
    drivers_excluded: tuple[Counted, ...]  # drivers none of whose drives is part of one
    misfits: tuple[Counted, ...]  # drives whose model stopped fitting
    populations: tuple[Population, ...]
    causes: tuple[Cause, ...]
    no_causes: str  # why there are none; ""
    next_drives: tuple[Next, ...]
    provenance: Mapping[str, str]  # what of the folder makes these numbers: versions, hashes, settings
    logs_sha256: str = ""  # of logs.parquet as it was when these numbers were made


def interval(value: float | None, low: float | None, high: float | None) -> Interval:
    """An interval of plain numbers; None and NaN are not known.

    Example:
        >>> interval(1.0, 0.5, None)
        Interval(value=1.0, low=0.5, high=nan)
    """
    return Interval(*(NAN if x is None else float(x) for x in (value, low, high)))
