"""Truth of trigger conditions, frame by frame: of every reading, not of samples alone.

Three-valued logic (Kleene 1938): a signal that is not measured makes a comparison unknown, and only what is surely true
triggers. Conditions on what is made of samples (a headway, the lead of radar tracks, the monitor's report) hold from
the frame on that completed the sample, which is up to 2.4 s after its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.signals.triggers.conditions import And, Compared, Condition, Happened, Misfit, Not
from canid.signals.triggers.resolution import Names, resolve
from canid.signals.triggers.trigger import Trigger
from canid.signals.vehicle import Decoding, Vehicle, decoder, missing
from canid.signals.vehicle.decoding import Step as DecodingStep
from canid.values.types import NAN, Array, Columns, Event, MonitorReport, Sample

# s after which the last sample says nothing any more: samples come in bursts, up to 2.4 s apart
SAMPLE_MAX_AGE_S = 3.0
# 1 true, -1 false, 0 unknown: and is the minimum, or the maximum, not the negative
Truth = npt.NDArray[np.int8]


class Run(NamedTuple):
    """Rows of a chunk for which a condition is true."""

    start: int
    stop: int  # the first row after them
    says: str  # the text of the condition


class Held(NamedTuple):
    """The last value of a signal."""

    t: float = -np.inf  # s
    value: float = NAN


class State(NamedTuple):
    """What goes on from chunk to chunk."""

    decoding: Decoding
    held: Mapping[str, Held] = {}
    misfit: bool = False


Outputs = Iterable[tuple[int, object]]  # of the pipeline, with the row that caused each
Init = Callable[[], State]
Step = Callable[[State, Columns, Outputs], tuple[State, list[Run]]]


def evaluator(names: Names) -> tuple[Init, Step]:
    """Make the evaluator of conditions.

    Args:
        names: from `resolve`.

    Returns:
        `init() -> state` and `step(state, chunk, outputs of the pipeline) -> (state, runs of rows that are true)`.
        However the frames are divided into chunks, the same frames are true.

    Example:
        >>> from canid.values.frame_columns import columns_of
        >>> from canid.signals.triggers.trigger import Trigger
        >>> from canid.values.types import Frame
        >>> from canid.signals.vehicle import read_vehicle
        >>> init, step = evaluator(resolve(Trigger(("brake",)), read_vehicle("generic")))
        >>> pressed = [Frame(0.1 * k, 0, 0x140, bytes([k == 2, 0])) for k in range(4)]
        >>> step(init(), columns_of(pressed), ())[1]
        [Run(start=2, stop=3, says='brake')]
    """
    init_decoding, decode = decoder(names.vehicle)
    return lambda: State(init_decoding()), partial(_step, names, decode)


class Watch:
    """The conditions of a trigger, from chunk to chunk, in the process that decodes."""

    def __init__(self, names: Names) -> None:
        """Nothing has come yet."""
        self.names = names
        init, self._step = evaluator(names)
        self._state = init()
        self._unknown = sorted(names.sampled)  # not measured so far

    def step(self, chunk: Columns, outputs: Outputs) -> tuple[list[tuple[int, int, str]], list[str]]:
        """Runs of rows for which a condition is true; and which of its signals never came, a sentence each."""
        self._state, runs = self._step(self._state, chunk, outputs)
        held = self._state.held
        self._unknown = [name for name in self._unknown if math.isnan(held[name].value)]
        never = missing(self.names.vehicle, self._state.decoding)
        never += [f"{name}, which a trigger needs, has had no value so far" for name in self._unknown]
        return [(run.start, run.stop, run.says) for run in runs], never


def watch(trigger: Trigger, vehicle: Vehicle) -> Watch:
    """Watch a trigger's conditions. Raises ConfigError as `resolve` does."""
    return Watch(resolve(trigger, vehicle))


def _step(
    names: Names, decode: DecodingStep, state: State, chunk: Columns, outputs: Outputs
) -> tuple[State, list[Run]]:
    n = len(chunk.t)
    if not n:
        return state, []
    decoding, decoded = decode(state.decoding, chunk)
    held = dict(state.held)
    values = _Values(chunk.t, {}, np.full(n, -1, np.int8), {})
    for name, stale in names.stale.items():
        parts = [(r.row, r.value) for r in decoded.roles if r.role == name]
        rows = np.concatenate([np.zeros(0, np.int64), *(row for row, _ in parts)])
        new = np.concatenate([np.zeros(0), *(value for _, value in parts)])
        values.of[name], held[name] = _filled(held.get(name, Held()), rows, new, chunk.t, stale)
    samples, misfits = [], [(0, state.misfit)]
    for row, item in outputs:
        if isinstance(item, Sample):
            samples.append((row, item))
        elif isinstance(item, MonitorReport):
            misfits.append((row, not item.fits))
        elif isinstance(item, Event):
            values.events.setdefault(item.what, []).append(row)
    for name in names.sampled:
        rows = np.array([row for row, _ in samples], np.int64)
        new = np.array([sample.signals.get(name, NAN) for _, sample in samples], np.float64)
        values.of[name], held[name] = _filled(held.get(name, Held()), rows, new, chunk.t, SAMPLE_MAX_AGE_S)
    for row, wrong in misfits:
        values.misfit[row:] = 1 if wrong else -1
    after = State(decoding, held, misfits[-1][1])
    return after, _runs(names.texts, [_truth(condition, values) for condition in names.conditions])


def _filled(
    held: Held, rows: npt.NDArray[np.int64], new: Array, t: Array, stale: float
) -> tuple[Array, Held]:
    """Each row's value: the latest reading's, NaN where that is older than `stale`; and the last one."""
    latest = np.searchsorted(rows, np.arange(len(t)), side="right")
    values = np.concatenate([[held.value], new])[latest]
    times = np.concatenate([[held.t], t[rows]])[latest]
    # either way: a clock may be set back
    values = np.where(np.abs(t - times) <= stale, values, NAN)
    return values, Held(float(times[-1]), float(np.concatenate([[held.value], new])[latest[-1]]))


class _Values(NamedTuple):
    """A chunk's values, row by row."""

    t: Array  # (n,) s
    of: dict[str, Array]  # signal -> (n,)
    misfit: Truth
    events: dict[str, list[int]]  # name -> rows


def _truth(condition: Condition, values: _Values) -> Truth:
    if isinstance(condition, Compared):
        value = values.of[condition.name]
        true = _COMPARISONS[condition.operator](value, condition.value)
        return np.where(value == value, np.where(true, 1, -1), 0).astype(np.int8)
    if isinstance(condition, Misfit):
        return values.misfit
    if isinstance(condition, Happened):
        out = np.full(len(values.t), -1, np.int8)
        out[values.events.get(condition.event, [])] = 1
        return out
    if isinstance(condition, Not):
        inner: Truth = -_truth(condition.of, values)
        return inner
    parts = np.array([_truth(part, values) for part in condition.parts])
    joined: Truth = parts.min(axis=0) if isinstance(condition, And) else parts.max(axis=0)
    return joined


_COMPARISONS: dict[str, Callable[[Array, float], npt.NDArray[np.bool_]]] = {
    "<": lambda x, y: x < y,
    "<=": lambda x, y: x <= y,
    ">": lambda x, y: x > y,
    ">=": lambda x, y: x >= y,
    "==": lambda x, y: np.isclose(x, y, rtol=1e-9, atol=0.0),
    "!=": lambda x, y: ~np.isclose(x, y, rtol=1e-9, atol=0.0),
    "": lambda x, _: x != 0.0,
}


def _runs(texts: Sequence[str], truths: Sequence[Truth]) -> list[Run]:
    """Runs of rows for which one condition at least is true; each says which one was first."""
    true = np.array(truths) == 1
    some = np.concatenate([[False], true.any(axis=0), [False]])
    edges = np.flatnonzero(some[1:] != some[:-1]).tolist()
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [Run(start, stop, texts[int(true[:, start].argmax())]) for start, stop in pairs]
