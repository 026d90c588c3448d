"""First order plus dead time for every input jointly, y = b + sum K_i x_i(tau_i, theta_i) + AR(p) noise.

One window or a whole drive. The search is the posterior's own grid: it starts on the whole physical box (or
where the last window's posterior lay), closes in, and refits the noise's colour each time; there is no
descent that could stop in a side valley. K and the offset are linear inside (Golub & Pereyra 1973).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.identification import autoregression, first_order, posterior, residuals
from canid.types import NAN, Array, Channel

# s; an input that is missing for less than this is joined by a line: a driver's lag hardly sees the
# difference. Beyond it the history is broken.
BRIDGE = 0.5

# Highest order of the noise. Ornstein-Uhlenbeck noise is AR(1), a resonance AR(2), coloured plus white noise
# ARMA(1,1), which AR(4) follows to a per cent at 10 Hz.
NOISE_ORDER = 5

# Every how many samples may be used. An output that was smoothed (an acceleration from speeds) has noise
# without content above some frequency. Whitening would lift that empty band and fit K, tau and dead time to
# what leaked into it: on data/openacc at 10 Hz the halves of one drive then disagree by ten of their own sd.
# Point samples further apart limit the likelihood to the band that is left; the model is exact at any of them.
STRIDES = (1, 2, 4, 8)
# Least share of the differenced residual's power in the upper half of the band. Differencing flattens noise that
# falls with 1/f², as Ornstein-Uhlenbeck noise does: 0.5. A resonance at 0.6 Hz has 0.05 to 0.15 at 10 Hz, a
# Savitzky-Golay derivative over 1.1 s less than 0.01 at 10 and 5 Hz.
CONTENT = 0.2

# Passes of the grid. From the whole box to 5 ms takes five; the rest is for an odd start.
PASSES = 10
# Passes after which the noise's colour is kept: with few samples two colours can lead to each other for ever.
SETTLED = 5

# %. Below this fit the noise has twice the output's variance: it must cancel the answer that it is said to be
# independent of, and the numbers rest on the last few samples' changes alone. A feedback loop makes the two oppose
# each other too, but not so far: of 690 estimates on simulated drives 4 were there, on real logs only absurd ones
# (a gain ten times the rest at a fit of -1240 %). This is no gate on a good fit, which proves nothing.
CANCELLING = 100.0 * (1.0 - 2.0**0.5)


class Point(NamedTuple):
    """One value of every parameter, noise aside."""

    K: Array  # (m,)
    tau: Array  # (m,) s
    dead_time: Array  # (m,) s
    offset: float


class Start(NamedTuple):
    """What the next window takes over from this one: only where to look first."""

    point: Point
    regions: tuple[posterior.Region, ...]


class ProcessFit(NamedTuple):
    """The joint fit. NaN values and `Identifiable.NOT` where the data cannot tell."""

    channels: tuple[Channel, ...]
    point: Point  # the posterior's mean
    noise: Array  # (p,) autoregression
    sigma: float  # of the whitened residual
    temper: float  # >= 1: how much the residual's left-over colour widens the intervals
    fit_percent: float  # of the simulated answer
    used: int  # samples
    start: Start | None  # for the next window


class Prepared(NamedTuple):
    """Data made ready: finite inputs, where history starts, which samples count."""

    y: Array  # (n,)
    u: Array  # (m, n)
    usable: npt.NDArray[np.bool_]  # (n,)
    starts: tuple[int, ...]


def prepare(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    dt: float,
    segment: npt.NDArray[np.int64] | None,
    settle: float,
) -> Prepared:
    """Bridge short gaps of the inputs, find the breaks, drop `settle` seconds after each.

    Args:
        output: (n,), NaN where not measured.
        inputs: (n, m), NaN where not measured.
        usable: (n,) samples whose output may be learnt from.
        dt: s.
        segment: (n,), changes where the inputs' history breaks.
        settle: s after a break in which the unknown history still speaks.
    """
    n = len(output)
    known = np.isfinite(inputs).all(axis=1)
    good = usable & known & np.isfinite(output)
    starts = {0}
    if segment is not None:
        starts.update(int(i) + 1 for i in np.flatnonzero(np.diff(segment)))
    if not known.all() and known.any():
        at = np.flatnonzero(known)
        starts.add(int(at[0]))
        longer = np.flatnonzero(np.diff(at) > BRIDGE / dt + 1.0)
        starts.update(int(at[i + 1]) for i in longer)
        inputs = np.column_stack([np.interp(np.arange(n), at, column[at]) for column in inputs.T])
    ordered = tuple(sorted(starts))
    hold = round(settle / dt)
    for k in ordered:
        good[k : k + hold] = False
    return Prepared(np.where(good, output, 0.0), np.ascontiguousarray(inputs.T, dtype=float), good, ordered)


def fit_process(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    dt: float,
    *,
    segment: npt.NDArray[np.int64] | None = None,
    tau_max: float = 3.0,
    dead_time_max: float = 1.5,
    start: Start | None = None,
) -> ProcessFit:
    """Fit all channels jointly.

    Args:
        output: (n,) in its unit, NaN where not measured.
        inputs: (n, m), one or two columns, each in its unit, NaN where not measured.
        usable: (n,) whether the output may be learnt from; the inputs drive the lags all the same.
        dt: s.
        segment: (n,), changes where the inputs' history breaks.
        tau_max: s, end of the box.
        dead_time_max: s, end of the box.
        start: of an overlapping window: saves passes, changes nothing else.

    Raises:
        ValueError: shapes that do not fit, or more than two inputs.

    >>> rng = np.random.default_rng(0)
    >>> u = first_order.response(rng.normal(size=600), 0.1, 0.5, 0.0).x
    >>> y = 3.0 + 5.6 * first_order.response(u, 0.1, 0.4, 0.25).x + 0.05 * rng.normal(size=600)
    >>> fit = fit_process(y, u[:, None], np.full(600, True), 0.1)
    >>> fit.channels[0].K.low < 5.6 < fit.channels[0].K.high
    True
    """
    inputs = np.asarray(inputs, float)
    if (
        inputs.ndim != 2
        or inputs.shape[1] not in (1, 2)
        or len(output) != len(inputs)
        or len(usable) != len(inputs)
    ):
        raise ValueError(
            f"output {np.shape(output)}, inputs {inputs.shape}: expected (n,) and (n, 1) or (n, 2)"
        )
    m = inputs.shape[1]
    box = posterior.Box(dt / 5.0, tau_max, dead_time_max)
    # the slowest lag in the box has then forgotten two thirds of an unknown history, usual ones 99 %
    data = prepare(np.asarray(output, float), inputs, usable, dt, segment, dead_time_max + tau_max)
    # a tenth of a window: below this the colour of the noise cannot be told from the answer
    if int(data.usable.sum()) < 20 * (m + 1) or not float(np.ptp(data.y[data.usable])) > 0.0:
        return nothing(m, int(data.usable.sum()))
    known = start if start is not None else _cold(data, m, box)
    colour = _colour(data, dt, known.point)
    for turn in range(PASSES):
        grid = _look(data, dt, box, known.regions, colour)
        regions = tuple(posterior.gather(grid, i, box) for i in range(m))
        fine = all(_fine(r, c) for r, c in zip(regions, grid.cells, strict=True))
        known = Start(_middle(data, dt, grid, colour if fine else None), regions)
        if turn >= SETTLED:
            if fine:
                break
            continue
        before, colour = colour, _colour(data, dt, known.point, colour.stride)
        if fine and _same(before, colour):
            break
    residual, rows = colour.residual, data.usable
    around = float(np.linalg.norm(data.y[rows] - data.y[rows].mean()))
    fit_percent = 100.0 * (1.0 - float(np.linalg.norm(residual[rows])) / around)
    told = fit_percent >= CANCELLING
    if not told and start is not None:
        # the window before may have led here: once more from the whole box
        return fit_process(
            output, inputs, usable, dt, segment=segment, tau_max=tau_max, dead_time_max=dead_time_max
        )
    return ProcessFit(
        channels=tuple(posterior.channel(grid, i, box) if told else Channel() for i in range(m)),
        point=known.point,
        noise=colour.noise,
        sigma=(grid.residual / int(colour.rows.sum())) ** 0.5,
        temper=colour.temper,
        fit_percent=fit_percent,
        used=int(rows.sum()),
        start=known,
    )


class _Colour(NamedTuple):
    """The noise as it looks from one point."""

    noise: Array  # (p,) at every lag up to the highest
    stride: int  # samples from one that is used to the next
    rows: npt.NDArray[np.bool_]  # (n,) whose predecessors are usable too
    residual: Array  # (n,) not whitened, zero where not usable
    temper: float


def nothing(m: int, used: int = 0) -> ProcessFit:
    """Return the fit of m inputs that tells nothing."""
    point = Point(np.full(m, NAN), np.full(m, NAN), np.full(m, NAN), NAN)
    return ProcessFit((Channel(),) * m, point, np.zeros(0), NAN, 1.0, NAN, used, None)


def _cold(data: Prepared, m: int, box: posterior.Box) -> Start:
    """Guess static gains, a usual lag, and the whole box to look in."""
    # 0.4 and 0.25 s: a driver as published (Grover 2021); it only colours the first look
    usual = np.full(m, min(0.4, box.tau_max)), np.full(m, min(0.25, box.dead_time_max))
    point = _plain(data, list(data.u), *usual)
    return Start(point, (posterior.whole_box(box),) * m)


def _residual(data: Prepared, dt: float, at: Point) -> tuple[Array, list[first_order.Response]]:
    answers = [
        first_order.response(u, dt, float(tau), float(dead_time), data.starts)
        for u, tau, dead_time in zip(data.u, at.tau, at.dead_time, strict=True)
    ]
    residual = data.y - at.offset
    for K, answer in zip(at.K, answers, strict=True):
        residual = residual - K * answer.x
    return np.where(data.usable, residual, 0.0), answers


def _colour(data: Prepared, dt: float, at: Point, least: int = 1) -> _Colour:
    """Look at the noise from one point; a stride below `least` was found too short in this fit already."""
    residual, answers = _residual(data, dt, at)
    # counted from the newest sample, which is always taken
    phase = (len(residual) - 1) % STRIDES[-1]
    for stride in STRIDES[STRIDES.index(least) :]:
        first = phase % stride
        if _regular(residual[first::stride], data.usable[first::stride]):
            break
    every = autoregression.fit(residual[first::stride], data.usable[first::stride], NOISE_ORDER)
    noise = np.zeros(len(every) * stride)
    noise[stride - 1 :: stride] = every
    rows = autoregression.whole(data.usable, len(noise))
    rows[np.arange(len(rows)) % stride != first] = False
    e = autoregression.whiten(residual, noise)[rows]
    score = np.array([column for answer in answers for column in answer])
    score = autoregression.whiten(score, noise, data.starts)[:, rows]
    score -= score.mean(axis=1, keepdims=True)
    sd = float(e @ e / max(len(e), 1)) ** 0.5
    temper = residuals.left_over(score * e, score * sd, round(residuals.CORRELATED / dt / stride))
    return _Colour(noise, stride, rows, residual, temper)


def _regular(r: Array, usable: npt.NDArray[np.bool_]) -> bool:
    """Whether the noise has content up to the end of the band, see CONTENT."""
    both = usable[1:] & usable[:-1]
    power = np.abs(np.fft.rfft(np.where(both, np.diff(r), 0.0))) ** 2
    return bool(power[len(power) // 2 :].sum() >= CONTENT * power.sum())


def _look(
    data: Prepared, dt: float, box: posterior.Box, regions: Sequence[posterior.Region], colour: _Colour
) -> posterior.Grid:
    rows = colour.rows
    y = autoregression.whiten(data.y, colour.noise)[rows]
    past = autoregression.lagged(colour.residual, len(colour.noise))[rows, colour.stride - 1 :: colour.stride]
    Z = np.column_stack([np.ones(int(rows.sum())), past])
    cells = [posterior.lay(region, box) for region in regions]
    # whitening the input once is whitening every answer to it: both are linear and do not change with time
    X = [
        posterior.columns(autoregression.whiten(u, colour.noise, data.starts), dt, c, data.starts)[:, rows]
        for u, c in zip(data.u, cells, strict=True)
    ]
    return posterior.evaluate(y, X, Z, cells, colour.temper)


def _middle(data: Prepared, dt: float, grid: posterior.Grid, colour: _Colour | None) -> Point:
    """Take the posterior's mean: where a lag cannot be told, the most likely cell is an accident.

    Without a colour, the gains are those of plain least squares. On a coarse grid the weighted ones may be far off,
    leave a residual that drifts, and a noise that drifts would then excuse any gain: a vicious circle.
    """
    m = len(grid.cells)
    weights = [posterior.marginal(grid, i) for i in range(m)]
    taus = np.array([float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)])
    dead_times = np.array([float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)])
    answers = [
        first_order.delayed(
            u, first_order.lags(u, dt, np.array([tau]), data.starts)[0], dt, float(tau), np.array([theta])
        )[0]
        for u, tau, theta in zip(data.u, taus, dead_times, strict=True)
    ]
    if colour is None:
        return _plain(data, answers, taus, dead_times)
    gains = np.array([float(np.sum(grid.weight * K)) for K in grid.K])
    residual = data.y - sum(K * x for K, x in zip(gains, answers, strict=True))
    white = autoregression.whiten(residual, colour.noise)[colour.rows]
    return Point(gains, taus, dead_times, float(white.mean()) / (1.0 - float(np.sum(colour.noise))))


def _plain(data: Prepared, answers: Sequence[Array], taus: Array, dead_times: Array) -> Point:
    """Gains and offset by plain least squares on given answers."""
    X = np.column_stack([*answers, np.ones(len(data.y))])[data.usable]
    theta: Array = np.asarray(np.linalg.lstsq(X, data.y[data.usable], rcond=None)[0], dtype=np.float64)
    return Point(theta[:-1], taus, dead_times, float(theta[-1]))


def _same(a: _Colour, b: _Colour) -> bool:
    """Whether two looks at the noise agree, so that another pass would change nothing that counts.

    Coefficients to a quarter of their sd (1/sqrt(samples)), the residual itself to 5 %: its colour alone can
    agree by chance while the gains still move.
    """
    apart = float(np.linalg.norm(a.residual - b.residual))
    return (
        len(a.noise) == len(b.noise)
        and bool(np.all(np.abs(a.noise - b.noise) < 0.25 * int(b.rows.sum()) ** -0.5))
        and apart <= 0.05 * float(np.linalg.norm(b.residual))
    )


def _fine(region: posterior.Region, cells: posterior.Cells) -> bool:
    """Whether the grid resolved the posterior: cells about as wide as one sd."""
    low, high = 0.95, posterior.CELLS / 2.0
    # a spacing of zero happens where the box is only touched
    return all(
        low * space <= sd <= high * space
        for sd, space in ((region.tau_sd, cells.spacing[0]), (region.rest_sd, cells.spacing[1]))
    )
