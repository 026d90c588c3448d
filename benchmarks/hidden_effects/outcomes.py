"""What came of a drive, as facts: what each method said, in what time, and canid's numbers next to the planted ones.

Nothing is judged here; that is the table's. One outcome is one line of JSON.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.hidden_effects.drives import REMOVED, Drive
from benchmarks.hidden_effects.expected import Price
from benchmarks.hidden_effects.hiding import hide
from benchmarks.hidden_effects.peers.answer import ADEQUATE, BROKE, NAMED, Answer
from canid.mathematics.identification.identifiability import QUOTABLE
from canid.models.diagnosis.diagnose import diagnose
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect
from canid.values.findings import Check, Report, Verdict
from canid.values.types import Interval, Trace
from tests.plants.planted_drive import Planted

CANID = "canid"
REMNANT = "remnant"
ROOT = Path(__file__).resolve().parents[2]
# the driver's numbers that the table asks for, and their names in a report
NUMBERS = {"K2": "K", "tau2": "tau", "dead_time2": "dead_time"}

# a method that is no part of canid: what it is given, what may be named -> its answer
Method = Callable[[Trace, tuple[Effect, ...]], Answer]


class Comparison(NamedTuple):
    """An estimate and the truth."""

    effect: str  # "" for the driver's own
    name: str
    truth: float
    value: float
    low: float
    high: float


class Outcome(NamedTuple):
    """What came of one drive."""

    drive: Drive
    truth: dict[str, dict[str, float]]  # effects that were planted, with their parameters
    prices: dict[str, Price]
    answers: dict[str, Answer]  # method -> what it said
    parameters: tuple[Comparison, ...]  # of every named effect that was planted
    driver: tuple[Comparison, ...]  # K2, tau2, dead_time2 after the extension
    gain: Interval
    code: str  # which state of canid
    tests: tuple[str, ...] = ()  # adequacy tests that were made
    failed: tuple[str, ...] = ()  # those that failed
    suspected: tuple[tuple[str, ...], ...] = ()  # every finding with its rivals, named or not
    remnant: tuple[
        tuple[str, ...], ...
    ] = ()  # findings in the law of the noise, which are no causes of the mean


def run(drive: Drive, peers: dict[str, Method] | None = None) -> Outcome:
    """Plant, sense, diagnose, and ask the peers.

    Example:
        >>> from benchmarks.hidden_effects.drives import Drive
        >>> found = run(Drive(3, "one", "one", "white", "mixed", 4.0, ("periodic_task",)))
        >>> list(found.truth), found.answers["canid"].seconds > 0
        (['periodic_task'], True)
    """
    planted, prices, measured = hide(drive)
    truth = planted.truth["effects"]
    gone = set(truth) if drive.kind == REMOVED else set()
    catalogue = tuple(effect for effect in CATALOGUE if effect.id not in gone)
    began = time.process_time()
    report: Report | None = None
    try:
        report = diagnose(measured, catalogue=catalogue)
    except Exception as error:  # weak data are a verdict, so this is a result of the table, not its end
        answer = Answer((), BROKE, time.process_time() - began, f"{type(error).__name__}: {error}")
    else:
        answer = said(report, time.process_time() - began)
    answers = {CANID: answer}
    for name, method in (peers or {}).items():
        answers[name] = method(measured, catalogue)
    return Outcome(
        drive,
        truth,
        prices,
        answers,
        parameters(report, truth) if report else (),
        driver(report, planted) if report else (),
        report.gain if report else Interval(),
        code(),
        tuple(check.name for check in report.checks if driver_test(check)) if report else (),
        tuple(c.name for c in report.checks if driver_test(c) and c.passed is False) if report else (),
        tuple((f.effect, *f.rivals) for f in report.findings if f.where == "driver") if report else (),
        tuple((f.effect, *f.rivals) for f in report.findings if f.where == REMNANT) if report else (),
    )


def driver_test(check: Check) -> bool:
    """Is it an adequacy test of the driver's model?"""
    return check.gate and not check.name.startswith("vehicle")


def said(report: Report, seconds: float) -> Answer:
    """A report as the table compares it: each cause of the mean with its rivals; a surrogate is no name.

    The law of the noise is apart: a drive with nothing but a finding there has an adequate mean law.
    """
    sets = tuple((f.effect, *f.rivals) for f in report.findings if f.where != REMNANT)
    named = report.verdict in (Verdict.NAMED, Verdict.ONE_OF)
    verdict = report.verdict.value if not named else NAMED if sets else ADEQUATE
    return Answer(sets if named else (), verdict, seconds)


def parameters(report: Report, truth: dict[str, dict[str, float]]) -> tuple[Comparison, ...]:
    """Every number of a planted effect that the finding of the same name estimates too."""
    return tuple(
        Comparison(found.effect, name, float(value), *found.parameters[name])
        for found in report.findings
        for name, value in truth.get(found.effect, {}).items()
        if name in found.parameters
    )


def driver(report: Report, planted: Planted) -> tuple[Comparison, ...]:
    """The answer to relative speed in the extended model; the baseline's where nothing was found."""
    channel = report.extended.channels.get("range_rate")
    if channel is None:
        return ()
    true = dict(planted.truth["driver"])
    drift = planted.truth["effects"].get("delay_drift")
    if drift and planted.truth["simulator"] == "plant_one":
        # simulator one lets the dead time grow from what it is at first; canid reports it in the middle of the drive
        true["dead_time2"] += 0.5 * drift["rate"]
    quoted = {name: field for name, field in NUMBERS.items() if field in QUOTABLE[channel.status]}
    return tuple(Comparison("", name, true[name], *getattr(channel, field)) for name, field in quoted.items())


@cache
def code() -> str:
    """Name the state of canid's sources in eight hexadecimal digits."""
    total = hashlib.sha256()
    for path in sorted((ROOT / "canid").rglob("*.py")):
        total.update(path.read_bytes())
    return total.hexdigest()[:8]


def line(outcome: Outcome) -> str:
    """Write an outcome as one line of JSON."""
    return json.dumps(
        {
            **outcome._asdict(),
            "drive": outcome.drive._asdict(),
            "prices": {name: price._asdict() for name, price in outcome.prices.items()},
            "answers": {name: answer._asdict() for name, answer in outcome.answers.items()},
            "parameters": [each._asdict() for each in outcome.parameters],
            "driver": [each._asdict() for each in outcome.driver],
            "gain": outcome.gain._asdict(),
        }
    )


def parsed(text: str) -> Outcome:
    """Read what `line` wrote.

    Raises:
        ValueError: half a line, as a run leaves that was stopped while it wrote; or one of another table.
    """
    try:
        d: dict[str, Any] = json.loads(text)
        return Outcome(
            Drive(**{**d["drive"], "effects": tuple(d["drive"]["effects"])}),
            d["truth"],
            {name: Price(**price) for name, price in d["prices"].items()},
            {
                name: Answer(**{**a, "sets": tuple(tuple(s) for s in a["sets"])})
                for name, a in d["answers"].items()
            },
            tuple(Comparison(**each) for each in d["parameters"]),
            tuple(Comparison(**each) for each in d["driver"]),
            Interval(**d["gain"]),
            d["code"],
            tuple(d.get("tests", ())),
            tuple(d.get("failed", ())),
            tuple(tuple(s) for s in d.get("suspected", ())),
            tuple(tuple(s) for s in d.get("remnant", ())),
        )
    except (KeyError, TypeError) as error:
        raise ValueError(f"not an outcome of this table: {text[:60]}") from error


def stored(path: Path) -> Iterator[Outcome]:
    """Read the outcomes of a file; lines that are none are passed over, and a missing file holds none."""
    if not path.exists():
        return
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            yield parsed(text)
        except ValueError:
            continue


def fresh(stored: Iterable[Outcome], wanted: Iterable[Drive], methods: set[str]) -> dict[Drive, Outcome]:
    """Choose what need not be run again: drives that are wanted, that nothing broke, and that every method has answered."""
    out = {o.drive: o for o in stored if methods <= set(o.answers)}
    wished = set(wanted)
    return {
        drive: o
        for drive, o in out.items()
        if drive in wished and all(answer.says != BROKE for answer in o.answers.values())
    }
