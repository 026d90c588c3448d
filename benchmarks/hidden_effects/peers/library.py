"""The candidates as columns: what each cause of canid's catalogue would add to the baseline's pedal on this drive.

All peers get them from canid's own definitions and causal inputs, at canid's own fit of the baseline. That is more than
they come with: with raw inputs and a baseline of their own the driver's noise alone fills the residual with false terms.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.models.diagnosis import masks
from canid.models.diagnosis.driver.driver_candidates import starts
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import K1, TAU1, lagged, pedal
from canid.models.diagnosis.driver.pedal_holds import MIN_HOLD_S
from canid.models.diagnosis.fitting.fitted_model import extended
from canid.models.diagnosis.prepared_drive import lacking, ready
from canid.models.effects.effect import Effect, Kind
from canid.values.findings import Flags
from canid.values.types import Trace
from tests.plants.planted_drive import Array

LEAST = 90.0  # s, as canid
# of a parameter's scale; a difference over which the baseline is straight
DIFFERENCE_STEP = 1e-3
# s at which a driver may decide, and phases of each that are tried
INTERVALS, PHASES = (0.5, 0.7, 1.0, 1.4, 2.0), 4
# %; far below the step of any sensor
SAME = 1e-6
# Hz within which a line is searched: below it is the driver's slow noise, above it no driver moves the pedal
LINE_HZ = (0.03, 0.5)
# cosines over the drive of the random walk of the desired headway
WALK_COSINES = 4
# of a column's variance that the baseline's own directions must leave
LEFT = 1e-4


class Library(NamedTuple):
    """Columns on the samples where the pedal is free; the baseline's own directions are taken out of all."""

    names: tuple[str, ...]  # of each column; an effect may have several
    X: Array  # (m, k), variance 1
    y: Array  # (m,) what the baseline leaves, variance 1
    at: npt.NDArray[np.int64]  # (m,) sample of the drive


class Fitted(NamedTuple):
    """A drive at canid's fit of the baseline."""

    data: DriverData
    solved: FittedDriver
    rows: Flags  # (n,) samples that are measured, and free of the floor


def fitted(trace: Trace) -> Fitted | None:
    """Fit the baseline; None: canid would say that there is not enough."""
    usable, masked = masks.recognise(trace)
    if lacking(trace, usable, masked, LEAST):
        return None
    prepared = ready(trace, usable)
    if prepared is None:
        return None
    output = prepared.data.output
    return Fitted(prepared.data, prepared.fitted, output.usable & ~output.below)


def library(at: Fitted, catalogue: Sequence[Effect]) -> Library:
    """Lay out the columns of all causes of the driver.

    A cause with a corner or a power is not linear in its parameter: of the strengths at which canid's search begins,
    the one whose column goes best with the residual stands for it, and none whose sign is impossible.

    Args:
        at: from `fitted`.
        catalogue: what may be named.
    """
    data, solved, rows = at
    Q = np.linalg.qr(slopes(data, solved, rows))[0]

    def cleared(x: Array) -> Array:
        out: Array = x[rows] - Q @ (Q.T @ x[rows])
        return out

    y = cleared(data.output.y - solved.fitted.model)
    names, columns = [], []
    for effect in catalogue:
        for choices in made(effect, at):
            best, most = None, 0.0
            for column, either in choices:
                x = cleared(column)
                size = float(x @ x)
                along = float(x @ y)
                if size <= LEFT * len(x) * max(float(np.var(column[rows])), 1e-12):
                    continue
                explains = along * along / size if either or along > 0 else 0.0
                if explains > most:
                    best, most = x, explains
            if best is not None:
                names.append(effect.id)
                columns.append(best / best.std())
    X = np.column_stack(columns) if columns else np.empty((len(y), 0))
    return Library(tuple(names), X, y / y.std(), np.flatnonzero(rows))


def slopes(data: DriverData, solved: FittedDriver, rows: Flags) -> Array:
    """Derivatives (m, k) of the baseline's pedal by its free parameters."""
    model, function = solved.model, solved.model.bind(data)
    here = function(solved.q)
    columns = []
    for k in model.free():
        h = (
            DIFFERENCE_STEP
            * model.scale[k]
            * (-1.0 if solved.q[k] + DIFFERENCE_STEP * model.scale[k] > model.high[k] else 1.0)
        )
        moved = solved.q.copy()
        moved[k] += h
        columns.append((function(moved) - here)[rows] / h)
    J = np.column_stack(columns)
    scale = np.linalg.norm(J, axis=0)
    out: Array = J[:, scale > 0] / scale[scale > 0]
    return out


Choices = list[tuple[Array, bool]]  # (column, may its coefficient have either sign?)


def made(effect: Effect, at: Fitted) -> list[Choices]:
    """Columns of an effect: of each list one will be chosen."""
    if effect.where != "driver" or not effect.found_at:
        return []
    if effect.kind is Kind.PARAMETRIC:
        return [[(column, False) for column in bent(effect, at)]]
    if effect.id == "periodic_task":
        return [[(wave, True)] for wave in rhythm(at)]
    if effect.id == "headway_drift":
        return [[(wave, True)] for wave in waves(at)]
    if effect.id == "attention_gap":
        return [[(stood_still(at), False)]]
    if effect.id == "act_and_wait":
        return [[(column, False) for column in decided(at)]]
    return []


def bent(effect: Effect, at: Fitted) -> list[Array]:
    """What a parametric cause adds, at each strength at which a search begins."""
    model = extended(at.solved.model, effect)
    here = at.solved.fitted.model
    return [pedal(model, at.data, q) - here for q in starts(effect, at.data, at.solved)]


def rhythm(at: Fitted) -> list[Array]:
    """Sine and cosine at the highest peak of the residual's spectrum."""
    data, solved, rows = at
    left = np.where(rows, data.output.y - solved.fitted.model, 0.0)
    f = np.fft.rfftfreq(len(left), data.output.dt)
    power = np.abs(np.fft.rfft(left)) ** 2
    within = (f >= LINE_HZ[0]) & (f <= LINE_HZ[1])
    turn = 2.0 * np.pi * f[np.flatnonzero(within)[np.argmax(power[within])]] * data.seen.t
    return [np.sin(turn), np.cos(turn)]


def waves(at: Fitted) -> list[Array]:
    """What a slow random walk of the desired headway adds: cosines of half a period and more, answered as the headway is."""
    t, q = at.data.seen.t, at.solved.q
    return [
        lagged(q[K1] * np.cos(np.pi * k * t / t[-1]), float(q[TAU1]), at.data.output.dt)
        for k in range(1, WALK_COSINES + 1)
    ]


def stood_still(at: Fitted) -> Array:
    """Where the pedal does not move for a second and more: what it stands off from the model."""
    y, dt = at.data.output.y, at.data.output.dt
    # a pedal that is held says the same number again and again
    moves = np.flatnonzero(np.r_[True, np.abs(np.diff(y)) > SAME, True])
    still = np.zeros(len(y), dtype=bool)
    top = float(y[at.rows].max())
    for a, b in pairwise(moves.tolist()):
        # at its end the pedal rests for other reasons
        if (b - a) * dt >= MIN_HOLD_S and y[a] < top:
            still[a:b] = True
    return np.where(still & at.rows, y - at.solved.fitted.model, 0.0)


def decided(at: Fitted) -> list[Array]:
    """What it changes to take up the demand now and then only."""
    here, dt = at.solved.fitted.model, at.data.output.dt
    k = np.arange(len(here))
    out = []
    for interval in INTERVALS:
        every = max(round(interval / dt), 1)
        for phase in range(0, every, max(every // PHASES, 1)):
            last = np.maximum((k - phase) // every * every + phase, 0)
            out.append(here[last] - here)
    return out


def remembered(lib: Library, memory: int) -> tuple[tuple[str, ...], Array, Array]:
    """Add what was before: the residual's and the columns' own last samples, for autocorrelated noise.

    Args:
        lib: a library.
        memory: samples; 0 for white noise.

    Returns:
        Names ("" for the residual's own past, which names nothing), columns, target; where all of it is known.

    Example:
        >>> lib = Library(("a",), np.array([[1.0], [2.0], [4.0]]), np.array([5.0, 6.0, 8.0]), np.array([0, 1, 2]))
        >>> names, X, y = remembered(lib, 1)
        >>> names, X.tolist(), y.tolist()
        (('a', 'a', ''), [[2.0, 1.0, 5.0], [4.0, 2.0, 6.0]], [6.0, 8.0])
    """
    if not memory:
        return lib.names, lib.X, lib.y
    known = np.flatnonzero(lib.at[memory:] - lib.at[:-memory] == memory) + memory
    past = np.column_stack([lib.y[known - lag] for lag in range(1, memory + 1)])
    X = np.column_stack([lib.X[known], lib.X[known - 1], past])
    return (*lib.names, *lib.names, *[""] * memory), X, lib.y[known]


def strongest(terms: Sequence[tuple[str, float]]) -> tuple[tuple[str, ...], ...]:
    """Make an answer's sets of terms and their strengths: each effect once, strongest first.

    Example:
        >>> strongest([("a", 0.1), ("b", 0.5), ("a", 0.2), ("", 3.0)])
        (('b',), ('a',))
    """
    best: dict[str, float] = {}
    for name, strength in terms:
        if name:
            best[name] = max(best.get(name, 0.0), strength)
    return tuple((name,) for name in sorted(best, key=lambda name: -best[name]))
