"""What `canid fleet` says of a planted fleet, held against the truth: nothing here knows how canid found it."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.fleet.fleet_runs import rows
from tests.fleet.planted.hidden_population import VALUES

QUANTITIES = ("mean", "between", "within")
# what a steady wanted headway and the noise are on the road is known up to the road's slope and the loop: their truth is
# that of the driver alone
APPROXIMATE = frozenset({"log_wanted_headway", "log_noise_sd"})
# causes that say of a driver who changes over the weeks what is true
OF_CHANGE = frozenset({"gain_change", "gain_drift"})
CLEAN, HABIT, CHANGED, SWAPPED = "clean", "hidden habit", "changes", "one drive swapped"


class Held(NamedTuple):
    """One interval and its truth."""

    what: str  # parameter
    of: str  # quantity, or kind of driver
    value: float
    low: float
    high: float
    truth: float

    @property
    def hit(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.truth <= self.high


class Estimate(NamedTuple):
    """One parameter of one driver: by the own drives alone, and shrunken towards the population."""

    parameter: str
    kind: str  # of driver
    own: Held | None
    shrunken: Held
    between: float  # the hidden standard deviation between drivers, on this scale; to compare errors by


class Named(NamedTuple):
    """One cause that was planted or named."""

    subject: str  # "driver", "car" or "drive"
    who: str
    effect: str
    planted: bool
    named: bool
    surrogate: bool


class Score(NamedTuple):
    """Of one fleet."""

    seed: int
    drives: int
    drivers: int
    population: list[Held]
    estimates: list[Estimate]
    causes: list[Named]
    clean_subjects: int  # drivers and cars without a planted cause, diagnosed together


def read_truth(path: Path) -> dict[str, Any]:
    """Read the truth of a planted fleet."""
    truth: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return truth


def score(folder: Path, truth: Mapping[str, Any]) -> Score:
    """Score the tables of a folder.

    Args:
        folder: of `canid fleet -o`.
        truth: of the fleet, see `tests.fleet.planted.planted_fleet.truth`.
    """
    causes, clean = _joint(folder, truth)
    return Score(
        int(truth["seed"]),
        len(truth["drives"]),
        len(truth["drivers"]),
        _population(folder, truth),
        _estimates(folder, truth),
        causes,
        clean,
    )


def kinds(truth: Mapping[str, Any]) -> dict[str, str]:
    """Kind of each driver."""
    out = {
        name: CHANGED if of["changed"] else HABIT if of["habit"] else CLEAN
        for name, of in truth["drivers"].items()
    }
    for drive in truth["drives"].values():
        if drive["label"] != drive["driver"]:
            out[drive["label"]] = SWAPPED
    return out


def swapped(truth: Mapping[str, Any]) -> set[str]:
    """Paths of the drives that lie in another driver's folder."""
    return {path for path, drive in truth["drives"].items() if drive["label"] != drive["driver"]}


def _population(folder: Path, truth: Mapping[str, Any]) -> list[Held]:
    by_column = {_column(parameter)[0]: parameter for parameter in VALUES}
    out = []
    for row in rows(folder, "SELECT * FROM {population}"):
        parameter = by_column.get(row["parameter"])
        if parameter is None:
            continue
        true = truth["population"][parameter]
        # the mean of a logarithm stands there as the geometric mean
        log = _column(parameter)[1]
        values = {**true, "mean": math.exp(true["mean"]) if log else true["mean"]}
        for of in QUANTITIES:
            held = _held(row, of, parameter, of, values[of])
            if held is not None:
                out.append(held)
    return out


def _estimates(folder: Path, truth: Mapping[str, Any]) -> list[Estimate]:
    kind = kinds(truth)
    out = []
    for row in rows(folder, "SELECT * FROM {drivers}"):
        true = truth["drivers"].get(row["driver"])
        if true is None:
            continue
        for parameter in VALUES:
            column, log = _column(parameter)
            x = true["expected"][parameter]
            scale = truth["population"][parameter]["between"]
            of = kind[row["driver"]]
            shrunken = _held(row, column, parameter, of, math.exp(x) if log else x)
            own = _held(row, f"{column}_own", parameter, of, math.exp(x) if log else x)
            if shrunken is None:
                continue
            if log:  # errors are compared as logarithms
                shrunken, own = _log(shrunken), None if own is None else _log(own)
            out.append(Estimate(parameter, of, own, shrunken, scale))
    return out


def _column(parameter: str) -> tuple[str, bool]:
    """The column of `drivers` that holds a parameter, and whether the parameter is the column's logarithm.

    Example:
        >>> _column("range_rate.log_tau"), _column("range_rate.K")
        (('range_rate_tau', True), ('range_rate_K', False))
    """
    channel, _, name = parameter.rpartition(".")
    plain = name.removeprefix("log_")
    return f"{channel}_{plain}" if channel else plain, plain != name


def _held(row: Mapping[str, Any], column: str, what: str, of: str, truth: float) -> Held | None:
    value, low, high = (row.get(name) for name in (column, f"{column}_low", f"{column}_high"))
    if value is None or low is None or high is None:
        return None
    return Held(what, of, value, low, high, truth)


def _log(of: Held) -> Held:
    value, low, high, truth = (
        math.log(x) if x > 0 else -math.inf for x in (of.value, of.low, of.high, of.truth)
    )
    return of._replace(value=value, low=low, high=high, truth=truth)


def _joint(folder: Path, truth: Mapping[str, Any]) -> tuple[list[Named], int]:
    """Causes of drivers and cars by joint diagnoses, and how many subjects were clean."""
    if not (folder / "joint_findings.parquet").exists():
        return [], 0
    found: dict[tuple[str, str, str], list[Mapping[str, Any]]] = defaultdict(list)
    for row in rows(folder, "SELECT * FROM {joint_findings}"):
        found[row["subject"], row["driver"] or "", row["car"]].append(row)
    kind = kinds(truth)
    out, clean = [], 0
    for (subject, driver, car), each in sorted(found.items()):
        of_car = set(truth["car_causes"].get(car, {}))
        planted = set(of_car) if subject == "car" else set(truth["drivers"][driver]["habit"])
        who = car if subject == "car" else f"{driver} ({kind[driver]}) in {car}"
        clean += not planted and (subject == "car" or kind[driver] == CLEAN)
        # a driver's joint diagnosis may name what is wrong with the car: true, and not missed where it does not
        true = planted | of_car | (OF_CHANGE if subject == "driver" and kind[driver] == CHANGED else set())
        got: set[str] = set()
        for finding in each:
            if finding["effect"] is None:
                continue
            right = {finding["effect"], *(finding["rivals"] or [])} & true
            got |= right
            effect = next(iter(sorted(right)), finding["effect"])
            out.append(Named(subject, who, effect, bool(right), True, bool(finding["surrogate"])))
        out += [Named(subject, who, effect, True, False, False) for effect in sorted(planted - got)]
    return out, clean


def single_drives(folder: Path, truth: Mapping[str, Any]) -> tuple[int, int, int, int]:
    """Causes that the diagnosis of each drive alone names.

    Returns:
        drives with a planted cause, of these with one named; drives without, of these with a name.
    """
    named: dict[str, set[str]] = defaultdict(set)
    query = """
        SELECT l.log, f.effect, f.rivals FROM {logs} l JOIN {findings} f USING (key) WHERE NOT coalesce(f.surrogate, false)
    """
    for row in rows(folder, query):
        named[row["log"]] |= {row["effect"], *(row["rivals"] or [])}
    with_cause = found = without = false = 0
    for path, drive in truth["drives"].items():
        got = next((effects for log, effects in named.items() if log.endswith("/" + path)), set())
        if drive["effects"]:
            with_cause += 1
            found += bool(got & set(drive["effects"]))
        else:
            without += 1
            false += bool(got)
    return with_cause, found, without, false


def coverage(held: Iterable[Held]) -> tuple[int, int]:
    """How many intervals hold the truth, and of how many."""
    hits = [one.hit for one in held]
    return sum(hits), len(hits)


def rmse(errors: Iterable[float]) -> float:
    """Root of the mean square; NaN of none."""
    x = np.array(list(errors))
    return float(np.sqrt(np.mean(x * x))) if len(x) else math.nan
