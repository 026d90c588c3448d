"""Drives of canid's own simulator with one effect of a catalogue, and what each block of the diagnosis names on them."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Container
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import canid
from canid.io.logs import write_log
from canid.models.diagnosis import masks
from canid.models.diagnosis.driver import held_out
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.null import confirmed_search
from canid.models.diagnosis.prepared_drive import Prepared, ready
from canid.models.diagnosis.remnant.innovations import innovations
from canid.models.diagnosis.remnant.remnant_block import diagnose_remnant
from canid.models.diagnosis.sensing.sensing_block import diagnose_sensing
from canid.models.diagnosis.vehicle import vehicle_block
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect, Kind
from canid.models.simulation import START_UTC, Shares, Simulation, frames, simulate
from canid.signals.vehicle import read_vehicle
from canid.values.types import Trace
from tests import seeds
from tests.plants.measurement import trace as measured
from tests.plants.planted_drive import Planted

# min; shows two or three episodes of a mask, which repeats of a frozen signal must not dominate
MASK_MINUTES = 2.5


class Case(NamedTuple):
    """One effect at one strength in one drive."""

    effect: Effect
    strength: tuple[float, ...]
    seed: int

    def __str__(self) -> str:
        """As the test is called: effect, strength, seed."""
        return f"{self.effect.id}={','.join(f'{x:g}' for x in self.strength)} seed {self.seed}"


def cases(strengths: str, one_of: int, always: Container[str] = ()) -> list[Any]:
    """One strength of a part of the effects, the others in other runs; with CANID_ALL_CASES=1 all strengths of all.

    Which part is drawn with the run's seed; the seeds of drives depend on the effect's id alone.

    Args:
        strengths: `found_at` or `silent_at`.
        one_of: of so many effects one is drawn.
        always: effects that are in every run.
    """
    out = []
    for effect in CATALOGUE:
        of = getattr(effect, strengths)
        drawn = effect.id in always or seeds.seed(f"{strengths} {effect.id}") % one_of == 0
        for k, strength in enumerate(of):
            case = Case(effect, strength, zlib.crc32(f"{effect.id} {k} 0".encode()) % 100_000)
            taken = (drawn and k == 0) or seeds.ALL_CASES
            out.append(pytest.param(case, marks=() if taken else pytest.mark.another_run))
    return out


def drive(case: Case, catalogue: tuple[Effect, ...] = CATALOGUE) -> Trace:
    """Simulate one case as its sensors record it."""
    effect = case.effect
    minutes = MASK_MINUTES if effect.kind is Kind.MASK else effect.found_in
    hide = {effect.id: Shares(case.strength)}
    simulation = simulate(minutes, case.seed, "urban", hide=hide, catalogue=catalogue)
    return by_frames(simulation) if effect.kind is Kind.MASK else by_columns(simulation)


def by_columns(simulation: Simulation) -> Trace:
    """The trace of a drive, its sensors simulated by the tests' own plants."""
    columns = {**simulation.columns, **simulation.measured}
    truth = {"seed": simulation.seed, "effects": {}}
    return measured(Planted(simulation.dt, columns, columns["demand"], columns["noise"], truth))


def by_frames(simulation: Simulation) -> Trace:
    """The trace of a drive by way of a log: a frozen signal repeats itself exactly."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "drive.blf")
        write_log(log, frames(simulation, read_vehicle("generic")), START_UTC)
        return canid.read_trace(log, "generic")


def named(trace: Trace, block: str, catalogue: tuple[Effect, ...] = CATALOGUE) -> set[str]:
    """Effects that a block names on a drive, with those that explain it as well."""
    usable, masked = masks.recognise(trace, catalogue)
    if block == "mask":
        return {one.effect for one in masked}
    if block in ("driver", "remnant"):
        prepared = ready(trace, usable)
        assert prepared is not None
        drivers = tuple(e for e in catalogue if e.where == "driver" and e.kind is not Kind.MASK)
        search = confirmed_search.cross_validated(prepared.data, drivers, prepared.fitted).search
        if block == "remnant":
            return _in_the_remnant(prepared, search, catalogue)
        return {name for one in search.named for name in (one.effect.id, *one.rivals)}
    if block == "sensing":
        findings = diagnose_sensing(trace, catalogue).findings
    else:
        cars = tuple(effect for effect in catalogue if effect.where == "vehicle")
        findings = vehicle_block.diagnose_vehicle(trace, usable, cars).findings
    return {name for one in findings for name in (one.effect, *one.rivals)}


def _in_the_remnant(prepared: Prepared, search: Search, catalogue: tuple[Effect, ...]) -> set[str]:
    of = innovations(prepared.trace, search.data, search.solved)
    effects = tuple(effect for effect in catalogue if effect.kind is Kind.REMNANT)
    findings = diagnose_remnant(of, effects, held_out.dealt(search.data), len(catalogue)).findings
    return {name for one in findings for name in (one.effect, *one.rivals)}


def block(effect: Effect) -> str:
    """The block that names an effect."""
    return "mask" if effect.kind is Kind.MASK else effect.where
