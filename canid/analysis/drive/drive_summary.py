"""What a comparison of drives needs of each of them apart from its channels: conditions, noise, wanted headway, draws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.estimators import fopdt
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.confidence import student_quantile
from canid.mathematics.identification.fopdt import fopdt_residual, offset_drift
from canid.mathematics.systems.posterior_draws import Drawn, driver_draws
from canid.values.types import NAN, TASK_INPUTS, Array, Interval, Trace

Flags = npt.NDArray[np.bool_]

# %; the range that was driven is between these points, as in a diagnosis (`model.driven`)
RANGE_PERCENT = (50.0, 5.0, 95.0)
# roles whose range says at which operating point the driver was identified
CONDITIONS = ("speed", "headway", "gap")
# draws of the joint posterior: correlations are then known to 0.07
DRAWS = 200
# s of usable rows in a block: some ten correlation times of a driver's noise, so that blocks are independent
BLOCK_S = 15.0
# blocks below which their scatter gives no interval
MIN_BLOCKS = 6
# outputs of which 0 means that the wanted headway is kept
ACCELERATIONS = ("accel", "accel_command")


class DriveSummary(NamedTuple):
    """Of one drive, over its usable samples."""

    output: str = ""  # role of the driver's output; "": not known
    driven: Mapping[str, Interval] = {}  # role -> median, and the 5 and 95 % points
    excitation: Mapping[str, float] = {}  # input name -> its standard deviation
    noise_sd: Interval = Interval()  # output unit, of what the model leaves of the output
    wanted_headway: Interval = (
        Interval()
    )  # s, at which the output is 0 behind a steady lead; of accelerations
    draws: Drawn | None = None  # of FOPDT's joint posterior; None: there is none


def summarise(trace: Trace, result: WholeDrive | None, settings: fopdt.FopdtSettings) -> DriveSummary:
    """Summarise a drive.

    Args:
        trace: of the drive; only its usable samples are marked to be learned from.
        result: FOPDT's result over the whole drive; None: none.
        settings: FOPDT's.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> summary = canid.identify(drive, select_orders=False).drive_summary
        >>> summary.output, summary.noise_sd.low < 1.5 < summary.noise_sd.high, len(summary.draws.K)
        ('pedal', True, 200)
    """
    output = settings.output or _role(trace)
    learn = trace.learn
    driven = {role: _range(trace.signals[role][learn]) for role in CONDITIONS if role in trace.signals}
    moved = trace.inputs[learn]
    excitation = {
        name: float(np.nanstd(column)) if np.isfinite(column).any() else NAN
        for name, column in zip(trace.input_names, moved.T, strict=True)
    }
    base = DriveSummary(output, driven, excitation)
    if result is None or result.model is None or result.model.start is None or not result.channels:
        return base
    fit = result.model
    setup = fopdt.configure(trace.input_names, trace.dt, settings)
    rows = fopdt_residual.simulate_drive(setup.layout, trace, fit, setup.settle)
    used = rows.usable & np.isfinite(rows.output) & np.isfinite(rows.answer)
    left = np.where(used, rows.output - rows.answer - fit.point.offset, 0.0)
    left = offset_drift.of_fit(fit.drift, left, used, fit.noise, fit.stride, rows.step)
    per_block = max(round(BLOCK_S / rows.step), 1)
    base = base._replace(noise_sd=noise_size(left[used], per_block), draws=_draws(trace, result))
    if output in ACCELERATIONS and trace.input_names == TASK_INPUTS["car_following"]:
        base = base._replace(wanted_headway=_wanted(trace, result, rows, used, per_block))
    return base


def noise_size(left: Array, per_block: int) -> Interval:
    """Standard deviation of a residual of any spectrum, with an interval from the scatter of blocks.

    The logarithm of the mean square is taken for normal, its variance from the blocks' mean squares, and Student's t for
    their number.

    Args:
        left: (n,) residual, only where it is known.
        per_block: samples of a block, several correlation times.

    >>> white = np.random.default_rng(1).standard_normal(4000)
    >>> noise = noise_size(2.0 * white, 100)
    >>> noise.low < 2.0 < noise.high, noise.high / noise.low < 1.1
    (True, True)
    """
    count = len(left) // per_block
    square = float(np.mean(left**2)) if len(left) else NAN
    if count < MIN_BLOCKS or not square > 0.0:
        return Interval(math.sqrt(square) if square > 0.0 else NAN)
    blocks = np.mean(left[: count * per_block].reshape(count, per_block) ** 2, axis=1)
    relative = float(np.std(blocks, ddof=1)) / math.sqrt(count) / square
    half = 0.5 * student_quantile(count - 1) * relative
    sd = math.sqrt(square)
    return Interval(sd, sd * math.exp(-half), sd * math.exp(half))


def _wanted(
    trace: Trace, result: WholeDrive, rows: fopdt_residual.Simulated, used: Flags, per_block: int
) -> Interval:
    """Headway at which the acceleration is 0 behind a steady lead.

    desired + error - m / K, where error is the mean headway error and m the mean of the output less the answers to all that
    is not the mean headway error: in closed loop m is small, and its error is the noise's mean, by the scatter of blocks.
    """
    K = result.channels["headway_error"].K
    if not (K.low > 0.0 and math.isfinite(K.high)):
        return Interval()
    error = float(np.mean(rows.inputs[used, 0]))
    convention = trace.signals["headway"] - trace.inputs[:, 0] if "headway" in trace.signals else np.zeros(0)
    known = convention[np.isfinite(convention)]
    m = (rows.output - rows.answer)[used] + K.value * error
    count = len(m) // per_block
    if not len(known) or count < MIN_BLOCKS:
        return Interval()
    blocks = m[: count * per_block].reshape(count, per_block).mean(axis=1)
    half = student_quantile(count - 1) * float(np.std(blocks, ddof=1)) / math.sqrt(count)
    middle = float(np.median(known)) + error - float(m.mean()) / K.value
    # the mean's own error at the smallest gain that is possible, and what the gain's error moves
    reach = math.hypot(half / K.low, float(m.mean()) / K.low - float(m.mean()) / K.value)
    return Interval(middle, middle - reach, middle + reach)


def _draws(trace: Trace, result: WholeDrive) -> Drawn | None:
    fit = result.model
    if fit.posterior is None or len(trace.input_names) != 2:
        return None
    gains = [result.channels[name].K for name in trace.input_names]
    if not all(math.isfinite(x) for gain in gains for x in gain):
        return None
    return driver_draws(fit.posterior, (gains[0], gains[1]), DRAWS)


def _range(x: Array) -> Interval:
    known = x[np.isfinite(x)]
    return Interval(*(float(p) for p in np.percentile(known, RANGE_PERCENT))) if len(known) else Interval()


def _role(trace: Trace) -> str:
    """The role whose numbers the output has; "": none."""
    return next(
        (
            role
            for role in ("pedal", *ACCELERATIONS, "steering_angle")
            if role in trace.signals and np.array_equal(trace.signals[role], trace.output, equal_nan=True)
        ),
        "",
    )
