"""Is a gain of `identify` an average over a cause? Its model knows none; the drive may show one that moves the gain.

Every cause of the catalogue is added to the baseline alone, as in the first step of the diagnosis, and weighs what Bayesian
model averaging gives it (`driver/model_averaging.py`). Where models with a cause are together nine times as likely as the
one without, and an interval of 95 % holds the gain with 75 % by them at most, it is that of an average over the cause, and
is not to be quoted. No cause is named: that takes held-out data and replicates, which is what `diagnose` does.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import ndtr

from canid.mathematics.estimators import whole_drive_agreement
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.identifiability import quotable
from canid.models.diagnosis import car_following, corrections
from canid.models.diagnosis.corrections import Settings, TooLittleError
from canid.models.diagnosis.driver import driver_search
from canid.models.diagnosis.driver.driver_model import K1, K2
from canid.models.diagnosis.driver.model_averaging import Alternative, alternatives
from canid.models.diagnosis.lane import lane_keeping, lane_model, lane_search
from canid.models.effects import CATALOGUE, LANE_CATALOGUE
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.text.names import readable
from canid.values.types import TASK_INPUTS, Interval, Trace

# posterior probability of the models with a cause, from which on the one without is refuted
REFUTED = 0.9
# probability, by these, that a gain is outside of its interval, from which on it is not quoted
OUTSIDE = 0.25
# evidence, in 2 Δ log likelihood, below which no single cause is as likely as that: 2 log(0.9 / 0.1)
LEAST_EVIDENCE = 4.39
# a variance that is not 0
TINY = 1e-30
# s of driving from which on a cause can be seen, as in the diagnosis
MINIMUM_S = 90.0
GAINS = {"headway_error": K1, "range_rate": K2, "lateral_offset": lane_model.K}


def without_averages(whole: Mapping[str, WholeDrive | None], trace: Trace) -> dict[str, WholeDrive | None]:
    """Withhold the gains that a cause, which the drive shows, would move out of their intervals.

    Args:
        whole: estimator -> its result, as `arbitrated` leaves it; None: it has none.
        trace: of the drive, as it was read.
    """
    quoted = {
        name: {key: channel.K for key, channel in result.channels.items() if quotable(channel, "K")}
        for name, result in whole.items()
        if result is not None
    }
    others = shown(trace) if any(quoted.values()) else ()
    out = dict(whole)
    for name, gains in quoted.items():
        moved = [key for key, gain in gains.items() if is_average(gain, others, GAINS[key])]
        says = (
            f"K of {' and '.join(map(readable, moved))}: an average over a cause that the model has not; one with the cause "
            "describes this drive better and has another K (`canid diagnose` searches for the cause)"
        )
        for key in moved:
            out[name] = whole_drive_agreement.without_parameter(out[name], key, "K", says)
    return out


def shown(trace: Trace) -> tuple[Alternative, ...]:
    """Models of the driver with one cause, each with its odds against the one without; none where the drive is too short.

    Args:
        trace: of a drive.
    """
    given = with_limits(trace)
    try:
        if trace.input_names == TASK_INPUTS["lane_keeping"]:
            return _of_lane(given, Settings(LANE_CATALOGUE, MINIMUM_S, lambda _: None))
        return _of_following(given, Settings(CATALOGUE, MINIMUM_S, lambda _: None))
    except TooLittleError:
        return ()


def _of_following(given: Trace, settings: Settings) -> tuple[Alternative, ...]:
    context = corrections.diagnose_context(given, settings.catalogue)
    base = car_following.prepare(corrections.correct(given, context, settings))
    data = base.prepared.data
    solved, tried = driver_search.first_step(data, base.prepared.fitted, base.drivers, LEAST_EVIDENCE)
    return alternatives(tried, (), data, solved)


def _of_lane(given: Trace, settings: Settings) -> tuple[Alternative, ...]:
    base = lane_keeping.prepare(corrections.correct(given, lane_keeping.context(given), settings))
    return lane_search.alternatives(base.data, base.fitted, settings.catalogue)


def is_average(gain: Interval, others: tuple[Alternative, ...], parameter: int) -> bool:
    """Whether the model without a cause is refuted, and those with one have another gain.

    Args:
        gain: with its interval of 95 %.
        others: models with one cause; the model without any has odds of 1.
        parameter: index into their parameters.

    Example:
        >>> import numpy as np
        >>> other = Alternative("a cause", 19.0, np.full(9, 6.0), 0.25 * np.eye(9))
        >>> is_average(Interval(5.0, 4.5, 5.5), (other,), K2), is_average(Interval(5.0, 3.0, 7.0), (other,), K2)
        (True, False)
        >>> is_average(Interval(5.0, 4.5, 5.5), (other._replace(odds=3.0),), K2)
        False
    """
    odds = np.array([other.odds for other in others])
    if odds.sum() < REFUTED * (1.0 + odds.sum()):
        return False
    mean = np.array([other.mean[parameter] for other in others])
    sd = np.sqrt([max(float(other.covariance[parameter, parameter]), TINY) for other in others])
    inside = ndtr((gain.high - mean) / sd) - ndtr((gain.low - mean) / sd)
    return bool(odds @ (1.0 - inside) >= OUTSIDE * odds.sum())
