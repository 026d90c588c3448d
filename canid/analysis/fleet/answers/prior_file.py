"""The prior of a new driver that a fleet teaches, as the section [fopdt.prior] of a vehicle file."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.analysis.fleet.answers import estimates
from canid.analysis.fleet.storage.database import opened
from canid.mathematics.identification.fopdt.prior import CHANNELS, ChannelPrior, Prior
from canid.mathematics.population import drive_table as tables
from canid.mathematics.population.hierarchical import MIN_DRIVERS, Population, pool
from canid.mathematics.population.population_prior import prior_of
from canid.values.errors import ConfigError
from canid.values.fleet_summary import Excluded, Kind

# first words of the file, by which canid knows it again
MARK = "# Prior of a new driver by canid fleet prior"
# characters of a line
WIDTH = 100
# of the population's parameters those that a prior states
_PREFIXES = tuple(f"{channel}." for channel in CHANNELS)


class FleetPrior(NamedTuple):
    """A prior, and what it rests on."""

    prior: Prior
    kind: Kind  # of the drives
    population: Population
    left_out: tuple[str, ...]  # drivers that were not to count
    folder: str


def fleet_prior(
    folder: str | Path,
    *,
    output: str | None = None,
    unit: str | None = None,
    car: str | None = None,
    leave_out: Sequence[str] = (),
) -> FleetPrior:
    """Make the prior of a new drive of a new driver from the drives of a fleet folder.

    Args:
        folder: of `canid fleet -o`.
        output: role of the driver's output, where the folder has several kinds of output.
        unit: of the output, likewise.
        car: likewise: gains of a pedal are those of a car.
        leave_out: drivers who do not count.

    Raises:
        ConfigError: no folder of canid fleet; none or several kinds of output; no such driver; too few drivers.
    """
    with opened(folder) as db:
        there = estimates.kinds(db)
        asked = (output, unit, car)
        fitting = [kind for kind in there if all(a in (None, b) for a, b in zip(asked, kind, strict=True))]
        if len(fitting) != 1:
            listed = "; ".join(kind.text() for kind in there) or "none"
            raise ConfigError(
                f"{folder}: gains of different outputs are different numbers: choose one with --role, --unit, --car; "
                f"here are: {listed}"
            )
        names: tuple[str, ...] = estimates.LANE if fitting[0].output == "steering_angle" else estimates.MAIN
        names = tuple(name for name in names if name.startswith(_PREFIXES))
        chosen = estimates.selection(db, fitting[0], names)
    table = chosen.table
    for driver in leave_out:
        if driver not in table.drivers:
            near = get_close_matches(driver, table.drivers, n=1)
            hint = f' (did you mean "{near[0]}"?)' if near else ""
            raise ConfigError(f'{folder}: no drive of a driver "{driver}"{hint} is in its population')
    kept = [k for k, place in enumerate(table.driver) if table.drivers[place] not in leave_out]
    table = tables.rows(table, np.array(kept, dtype=np.intp))
    found_population = pool(table)
    new = found_population.new_driver
    # of fewer drivers the spread is what the prior of the spread is
    enough = found_population.counts[:, 1] >= MIN_DRIVERS
    value = np.where(enough, new.value, np.nan)
    prior = prior_of(table.names, value, new.covariance) if len(kept) else None
    if prior is None:
        drivers = int(found_population.counts[:, 1].max(initial=0.0))
        raise ConfigError(
            f"{folder}: a population needs {MIN_DRIVERS} drivers whose gains are known; here are {drivers} "
            f"({fitting[0].text()}){_left_out(chosen.excluded)}"
        )
    return FleetPrior(prior, fitting[0], found_population, tuple(leave_out), str(folder))


def _left_out(excluded: Sequence[Excluded]) -> str:
    """Why most of the drives that do not count do not."""
    if not excluded:
        return ""
    (why, n), *_ = Counter(drive.why for drive in excluded).most_common(1)
    return f"; {n:,} drives do not count: {why}"


def toml_of(result: FleetPrior, date: str) -> str:
    """The section as text, with comments that say what it rests on.

    Args:
        result: from `fleet_prior`.
        date: of its making, such as "2026-01-06".
    """
    of_input = f"{result.kind.unit or '?'} per unit of the input"
    lines = [
        f"{MARK}, {date}: of {_text(result.kind.text())}.",
        f"From {_text(result.folder)}: drivers and drives by parameter stand behind each line.",
    ]
    if result.left_out:
        lines.append(f"Left out: {', '.join(map(_text, result.left_out))}.")
    lines += [
        "Append it to a vehicle file of the same output, unit and car; K is in "
        f"{of_input}. One driver of ten may be unlike these: see `atypical` in docs/vehicles.md.",
    ]
    if not math.isnan(result.prior.same_tau):
        lines.append(
            "same_tau and same_dead_time are not from these drives: no drive knew the delays of one of the responses."
        )
    out = [line for text in lines for line in _comment(text)]
    out += ["[fopdt.prior]", *_fields(result.prior)]
    for channel in CHANNELS:
        stated: ChannelPrior | None = getattr(result.prior, channel)
        if stated is None:
            continue
        out += ["", f"[fopdt.prior.{channel}]"]
        for line in _fields(stated):
            out.append(line + _rests_on(result.population, channel, line.partition(" ")[0]))
    return "\n".join(out) + "\n"


def _rests_on(population: Population, channel: str, key: str) -> str:
    """From how many drivers and drives a number is, as a comment behind it."""
    name = f"{channel}.{f'log_{key}' if key.startswith('tau') else key}"
    if name not in population.names:
        return ""
    drives, drivers = population.counts[population.names.index(name)]
    return f"  # {drivers:.0f} drivers, {drives:.0f} drives"


def _fields(stated: Prior | ChannelPrior) -> list[str]:
    """Lines of the numbers that are stated; those of a channel follow as tables."""
    return [
        f"{name} = {value!r}"
        for name, value in stated._asdict().items()
        if isinstance(value, float) and not math.isnan(value)
    ]


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text.removeprefix("# "), WIDTH, initial_indent="# ", subsequent_indent="# ")


def _text(name: str) -> str:
    """A name in one line of a comment: what is not to be printed is escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in name)
