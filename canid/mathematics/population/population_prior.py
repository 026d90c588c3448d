"""Prior of a new driver's parameters from the predictive distribution of a population of drivers.

Gains are normal and correlated, the sum of lag and dead time log-normal, the dead time normal: the forms in which `Prior`
multiplies them into a window's likelihood exactly (`mathematics/identification/fopdt/gain_prior.py`). Each has the wide
component of a contaminated normal, so that a driver whom the population does not describe is left to the data.

Drives seldom know the delays of the response to headway. Where none does, they are tied to those of the response to range
rate as in a diagnosis: one perception and one pedal, the differences with a standard deviation of 0.5 s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from canid.mathematics.identification.fopdt.prior import CHANNELS, ChannelPrior, Prior
from canid.values.types import NAN, Array

# limits of what a vehicle file may state, see prior.py; a population that is narrower or wider states these
_FACTORS = (1.001, 100.0)
_TIMES_S = (1e-3, 100.0)
_MAX_DEAD_TIME_S = 10.0
_GAIN_SDS = (1e-6, 1e6)
_MAX_CORRELATION = 0.95
# s; sd of the differences of lags and of dead times between the two responses, as in models/diagnosis/driver/driver_model.py
SAME_DELAYS_SD_S = 0.5


def prior_of(names: Sequence[str], value: Array, covariance: Array) -> Prior | None:
    """Make the prior of a new drive of a new driver.

    Args:
        names: (p,) such as "range_rate.K", "range_rate.log_tau_plus_dead_time", "range_rate.dead_time"; others are left out.
        value: (p,) of the predictive distribution; NaN: not known.
        covariance: (p, p) of it.

    Returns:
        None where nothing is known. Of the delays it states the sum, and the dead time where that is known.

    Raises:
        ValueError: shapes that do not fit each other.

    Example:
        >>> names = ("headway_error.K", "range_rate.K", "range_rate.log_tau_plus_dead_time")
        >>> made = prior_of(names, np.array([6.0, 5.5, -0.5]), np.diag([1.0, 0.25, 0.04]))
        >>> made.range_rate.K_sd, round(made.range_rate.tau_plus_dead_time, 3), made.headway_error.K
        (0.5, 0.607, 6.0)
    """
    p = len(names)
    if np.shape(value) != (p,) or np.shape(covariance) != (p, p):
        raise ValueError(
            f"{p} names, values {np.shape(value)}, covariance {np.shape(covariance)}: expected (p,), (p, p)"
        )
    known = {
        name: (float(value[k]), math.sqrt(float(covariance[k, k])))
        for k, name in enumerate(names)
        if math.isfinite(value[k]) and covariance[k, k] > 0.0 and math.isfinite(covariance[k, k])
    }
    channels = {channel: made for channel in CHANNELS if (made := _channel(channel, known)) is not None}
    if not channels:
        return None
    channels = {channel: _rounded(prior) for channel, prior in channels.items()}
    unknown = [name for name in channels if math.isnan(channels[name].tau_plus_dead_time)]
    tie = SAME_DELAYS_SD_S if len(channels) == 2 and len(unknown) == 1 else NAN
    return Prior(
        same_tau=tie,
        same_dead_time=tie,
        headway_error=channels.get("headway_error"),
        range_rate=channels.get("range_rate"),
        lateral_offset=channels.get("lateral_offset"),
        gain_correlation=_correlation(names, covariance, channels),
    )


def _channel(channel: str, known: Mapping[str, tuple[float, float]]) -> ChannelPrior | None:
    stated: dict[str, float] = {}
    if f"{channel}.K" in known:
        K, sd = known[f"{channel}.K"]
        stated |= {"K": K, "K_sd": _within(sd, _GAIN_SDS)}
    if f"{channel}.log_tau_plus_dead_time" in known:
        log, sd = known[f"{channel}.log_tau_plus_dead_time"]
        stated["tau_plus_dead_time"] = _within(math.exp(log), _TIMES_S)
        stated["tau_plus_dead_time_factor"] = _within(math.exp(min(sd, 100.0)), _FACTORS)
    if f"{channel}.dead_time" in known:
        dead_time, sd = known[f"{channel}.dead_time"]
        stated["dead_time"] = _within(dead_time, (0.0, _MAX_DEAD_TIME_S))
        stated["dead_time_sd"] = _within(sd, _TIMES_S)
    return ChannelPrior(**stated) if stated else None


def _correlation(names: Sequence[str], covariance: Array, channels: Mapping[str, ChannelPrior]) -> float:
    """Correlation of the gains of both channels; NaN: fewer than two are stated, or it is not known."""
    gains = [
        list(names).index(f"{channel}.K") for channel, prior in channels.items() if not math.isnan(prior.K)
    ]
    if len(gains) != 2:
        return NAN
    i, j = gains
    r = float(covariance[i, j]) / math.sqrt(float(covariance[i, i]) * float(covariance[j, j]))
    return round(_within(r, (-_MAX_CORRELATION, _MAX_CORRELATION)), 2) if math.isfinite(r) else NAN


# significant digits that are written: of 1,000 drivers a spread is known to 2 %
DIGITS = 4


def _rounded(stated: ChannelPrior) -> ChannelPrior:
    """The numbers with `DIGITS` digits: in a file they are read."""
    return ChannelPrior(*(float(f"{x:.{DIGITS}g}") for x in stated))


def _within(x: float, ends: tuple[float, float]) -> float:
    return min(max(x, ends[0]), ends[1])
