"""The screen: predictors of driver, vehicle and sensing, held against what comes, every two seconds.

A predictor learns from what is a minute old, so that a misfit is tested before it is learnt, and learns nothing while
it is suspected; once it is told, learning goes on, and after some minutes the model fits what the drive has become.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import log
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.screening import driver, evidence, held, reference, rows, scatter, sensing, suspicion, vehicle
from canid.screening.predictor import Predictor
from canid.types import NAN, Array, Sample, Screened, Watch, Watched

# rows per look; one look every 2 s. Half as many would cost twice as much: it is the calls that cost, not the numbers
LOOK = 10
# looks before a row is learnt: a minute is what an effect may take to be told
LATE = 30
# rows (5 min of usable data) after which what was learnt has faded to 1/e: a driver's habits change over minutes
# (Chen & Ulsoy 2001), and a gain must be known to some 10 %
MEMORY = 1500.0
# rows (1 min) that must be learnt before anything is held against them: an observation for each of 17 coefficients
# every 3 s, where the rows of 1 s tell nearly the same
LEARNT = 300.0
# h; mean time between false alarms of one block, by the evidence's own bound. Twice the 20 h that are asked for:
# innovations of a model that was estimated are not quite new
BETWEEN_FALSE_ALARMS = 40.0
# looks without one usable row, after which a block counts as unseen
UNSEEN = 15
# s; nothing new is repeated this often
EVERY = 10.0
_ROUNDING = 5e-4
# in any unit of a row; what is more was measured by nobody, and its square would drown all else
LARGEST = 1e6

# Whom to suspect where several do not fit: sensors feed the models of both others, and a car that pulls otherwise
# moves its driver to where he has not been.
BLOCKS = ("sensing", "vehicle", "driver")


class Followed(NamedTuple):
    """What one predictor has learnt, and the evidence against it."""

    reference: reference.State
    misfit: evidence.State
    scatter: scatter.State
    unseen: int = UNSEEN  # looks since the last usable row


class State(NamedTuple):
    """Everything that the next sample's meaning depends on."""

    rows: rows.State
    pending: tuple[tuple[float, ...], ...]  # rows since the last look
    began: float  # s, of the first of them
    looks: tuple[Array, ...]  # (LOOK, columns) each, the newest last
    followed: tuple[Followed, ...]
    held: held.State
    suspicions: tuple[suspicion.State, ...] = (suspicion.State(),) * len(BLOCKS)
    fits: bool = True
    again: float = NAN  # s, since when all fits again; NaN: nothing was wrong so far
    said: tuple[str, ...] = ()  # what was said last
    said_at: float = NAN  # s


class Screen(NamedTuple):
    """The screen, as two pure functions."""

    init: Callable[[], State]
    step: Callable[[State, Sample], tuple[State, Screened | None]]


Places = npt.NDArray[np.intp]


class Lags(NamedTuple):
    """Where a predictor's columns are in the flattened rows of a window."""

    columns: Places  # (LOOK, m - 1)
    segments: Places  # (LOOK, lags + 1)
    outcome: Places  # (LOOK,)


def make(names: Sequence[str]) -> Screen:
    """Make the screen for a driver with these inputs.

    Example:
        >>> from canid.types import Gate, Sample
        >>> screen = make(("lateral_offset",))
        >>> state, said = screen.init(), []
        >>> for k in range(120):
        ...     state, now = screen.step(state, Sample(0.1 * k, 1.0, (0.1,), Gate.OPEN, True, 0, {"speed": 20.0}))
        ...     said += [now] if now is not None else []
        >>> print(said[0].fits, said[0].says)
        True still learning: driver; unseen: sensing, vehicle
    """
    predictors = (*sensing.PREDICTORS, vehicle.PREDICTOR, driver.predictor(names))
    width = rows.FIRST_INPUT + len(names)
    deepest = max(lag for p in predictors for _, lag in p.lagged)
    window = -(-deepest // LOOK) + 1  # looks
    lags = tuple(_lags(p, window, width) for p in predictors)
    fitted = tuple(np.array(p.fitted, dtype=np.intp) for p in predictors)
    needed = {block: _needed(block, predictors) for block in BLOCKS}

    def init() -> State:
        followed = tuple(
            Followed(
                reference.init(len(p.lagged) + 1),
                evidence.init(len(p.misfits)),
                scatter.init(),
            )
            for p in predictors
        )
        return State(rows.State(), (), NAN, (), followed, held.State())

    def step(state: State, sample: Sample) -> tuple[State, Screened | None]:
        if not rows.due(state.rows, sample.t):
            return state, None
        after, row = rows.step(state.rows, sample)
        holding = held.step(state.held, sample.t, row[rows.ANSWER], needed["driver"])
        began = state.began if state.pending else sample.t
        pending = (*state.pending, row)
        said_at = state.said_at if state.said_at == state.said_at else sample.t
        state = state._replace(rows=after, held=holding, pending=pending, began=began, said_at=said_at)
        if len(pending) < LOOK:
            return state, None
        looks = (*state.looks, np.array(pending))[-(LATE + window) :]
        state = state._replace(pending=(), looks=looks)
        if len(looks) < window:
            return state, None
        now = np.concatenate(looks[-window:]).ravel()
        late = np.concatenate(looks[:window]).ravel() if len(looks) == LATE + window else None
        followed = tuple(
            _follow(p, one, now, late, where, columns, began, needed[p.block])
            for p, one, where, columns in zip(predictors, state.followed, lags, fitted, strict=True)
        )
        state = state._replace(followed=followed)
        watched = {block: _watched(block, predictors, state, needed[block]) for block in BLOCKS}
        if holding.level >= needed["driver"] and watched["vehicle"].state is Watch.MISFIT:
            # a foot that rests moves the car as ever
            says = "the driver's output stands still, and the car moves otherwise"
            watched["sensing"] = Watched(Watch.MISFIT, holding.since, says, holding.level, needed["driver"])
        lasting = [
            suspicion.step(was, sample.t, watched[block])
            for block, was in zip(BLOCKS, state.suspicions, strict=True)
        ]
        suspicions = tuple(was for was, _ in lasting)
        watched = dict(zip(BLOCKS, (of for _, of in lasting), strict=True))
        fits = not any(of.state is Watch.MISFIT for of in watched.values())
        again = max(of.t for of in suspicions if of.t == of.t) if fits and not state.fits else state.again
        state = state._replace(suspicions=suspicions, fits=fits, again=again)
        told = _told(sample.t, watched, again)
        key = (told.block, *(of.state.value for of in watched.values()))
        # what was learnt changes by the second while it is little: no news
        fresh = key != state.said and bool(state.said)
        if not fresh and sample.t - state.said_at < EVERY - _ROUNDING:
            return state, None
        return state._replace(said=key, said_at=sample.t), told

    return Screen(init, step)


def moved(screened: Screened, by: float) -> Screened:
    """Bring what was said in another time to a time that is `by` seconds ahead of it.

    Example:
        >>> moved(Screened(90.0, False, 80.0, "driver", "", {}), -60.0).since
        20.0
    """
    if not by:
        return screened
    blocks = {name: of._replace(since=of.since + by) for name, of in screened.blocks.items()}
    return screened._replace(t=screened.t + by, since=screened.since + by, blocks=blocks)


def _lags(p: Predictor, window: int, width: int) -> Lags:
    """Prepare the look-up of a predictor's columns in a window of so many looks."""
    newest = np.arange((window - 1) * LOOK, window * LOOK, dtype=np.intp)
    columns, back = np.array(p.lagged, dtype=np.intp).T
    deepest = np.arange(back.max() + 1, dtype=np.intp)
    return Lags(
        (newest[:, None] - back) * width + columns,
        (newest[:, None] - deepest) * width + rows.SEGMENT,
        newest * width + p.outcome,
    )


def _needed(block: str, predictors: Sequence[Predictor]) -> float:
    """How much evidence is a misfit: log of K times the looks between false alarms."""
    signs_and_stakes = 2 * len(evidence.STAKES)
    k = sum(len(p.misfits) * signs_and_stakes + len(scatter.STAKES) for p in predictors if p.block == block)
    k += block == "driver"  # held
    return log(BETWEEN_FALSE_ALARMS * 3600.0 / (LOOK * rows.STEP) * k)


def _columns(where: Lags, window: Array) -> tuple[Array, Array]:
    """The rows of a look that are whole: columns (n, m) with the constant, outcomes (n,)."""
    y = window[where.outcome]
    segment = window[where.segments]
    X = np.ones((LOOK, where.columns.shape[1] + 1))
    X[:, :-1] = window[where.columns]
    # comparisons with NaN are false
    whole = (
        (segment == segment[:, :1]).all(axis=1) & (np.abs(X) < LARGEST).all(axis=1) & (np.abs(y) < LARGEST)
    )
    return X[whole], y[whole]


def _follow(
    p: Predictor,
    one: Followed,
    now: Array,
    late: Array | None,
    where: Lags,
    fitted: Places,
    t: float,
    needed: float,
) -> Followed:
    """Hold one look against a predictor, and let it learn one that is a minute old."""
    X, y = _columns(where, now)
    one = one._replace(unseen=0 if len(y) else min(one.unseen + 1, UNSEEN))
    known = one.reference
    if len(y) and known.rows >= LEARNT and known.variance > 0.0:
        e, far = reference.innovations(known, X, y), reference.far(known, X)
        # what the direction of a misfit adds is known before the innovation comes
        along = np.array([m.along(known.theta) for m in p.misfits])
        level = along @ known.mean * np.array([m.centred for m in p.misfits])
        z = X @ along.T - level
        margin = np.array([m.margin for m in p.misfits])
        doubt = np.column_stack([reference.doubt(known, X, m.learnt) for m in p.misfits])
        allowed = (margin * np.abs(z) + doubt) / known.variance**0.5 + far[:, None]
        one = one._replace(
            misfit=evidence.step(one.misfit, t, e, z, known.variance, allowed, needed),
            scatter=scatter.step(one.scatter, t, e, reference.expected(known, X, p.grows), needed),
        )
    if late is None or 0.5 * needed <= _level(one) < needed:
        return one
    X, y = _columns(where, late)
    return one._replace(reference=reference.learn(known, X, y, fitted, MEMORY))


def _level(one: Followed) -> float:
    return max(float(one.misfit.level.max()), float(one.scatter.level.max()))


def _watched(block: str, predictors: Sequence[Predictor], state: State, needed: float) -> Watched:
    """What is to be said of one block by its present evidence."""
    own = [(p, of) for p, of in zip(predictors, state.followed, strict=True) if p.block == block]
    seen = [(p, of) for p, of in own if of.unseen < UNSEEN]
    if not seen:
        needs = " or ".join(p.needs for p, _ in own)
        return Watched(Watch.UNSEEN, NAN, f"needs {needs}", 0.0, needed)
    p, strongest = max(seen, key=lambda pair: _level(pair[1]))
    level, since, says = _against(p, strongest, needed)
    # a held output is the reason of whatever else does not fit
    if block == "driver" and state.held.level >= min(level, needed):
        level, since, says = state.held.level, state.held.since, "the driver's output is held where it was"
    if level >= needed:
        return Watched(Watch.MISFIT, since, says, level, needed)
    learnt = max(of.reference.rows for _, of in seen)
    if learnt < LEARNT:
        return Watched(Watch.LEARNING, NAN, f"{learnt / LEARNT:.0%} learnt", max(level, 0.0), needed)
    return Watched(Watch.FITS, NAN, "fits what was learnt", max(level, 0.0), needed)


def _against(p: Predictor, one: Followed, needed: float) -> tuple[float, float, str]:
    """The strongest evidence against a predictor: level, since when, in words."""
    found = evidence.strongest(one.misfit)
    at = int(one.scatter.level.argmax())
    spread = float(one.scatter.level[at])
    # a direction says more than scatter, which any misfit brings with it once it is large
    if spread > found.level and found.level < 0.5 * needed:
        return spread, float(one.scatter.since[at]), f"{p.name} is foretold far worse than before"
    return (
        max(found.level, spread),
        found.since,
        p.misfits[found.direction].says.format(more="more" if found.more else "less"),
    )


def _told(t: float, watched: dict[str, Watched], again: float) -> Screened:
    """Sum the blocks up."""

    def of(state: Watch) -> str:
        return ", ".join(block for block, it in watched.items() if it.state is state)

    for block, it in watched.items():
        if it.state is Watch.MISFIT:
            return Screened(t, False, it.since, block, it.says, watched)
    parts = [
        ("fits what was learnt", Watch.FITS),
        ("still learning", Watch.LEARNING),
        ("unseen", Watch.UNSEEN),
    ]
    says = "; ".join(f"{words}: {of(state)}" for words, state in parts if of(state))
    return Screened(t, True, again, "", says, watched)
