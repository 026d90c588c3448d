"""Is a gain of `identify` an average over a cause? Its model knows none; the drive may show one that moves the gain.

Every cause of the catalogue is added to the baseline alone, as in the first step of the diagnosis, and weighs what Bayesian
model averaging gives it (`driver/model_averaging.py`). Where the gain is outside of its interval of 95 % with more than 70 %
by these models, the interval is that of an average over a cause, and is not to be quoted. No cause is named: that takes
held-out data and replicates, which is what `diagnose` does.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import ndtr

from canid.mathematics.estimators import plausibility, whole_drive_agreement
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

# posterior probability that a gain is outside of its interval of 95 %, from which on it is not quoted. Of 36 drivers behind
# a lead (seeds 7300 ff.; with a cause 66 gains that do not hold, clean 128 that do) 0.25 leaves 6 of the former and
# withholds 28 of the latter, 0.5 14 and 11, 0.7 19 and 1
OUTSIDE = 0.7
# evidence, in 2 Δ log likelihood, below which a cause is hardly likelier than none
LEAST_EVIDENCE = 4.0
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
        for key, gain in gains.items():
            if outside(gain, others, GAINS[key]) >= OUTSIDE:
                out[name] = whole_drive_agreement.without_parameter(out[name], key, "K", reason(key))
    return out


def reason(key: str) -> str:
    """Why the gain of an input is withheld, and what to do; the same words in every result.

    Example:
        >>> reason("range_rate").partition(":")[0]
        'K of range rate is probably an average over a cause that the model does not have'
    """
    return (
        f"K of {readable(key)} is probably an average over a cause that the model does not have: with it the model "
        f"describes this drive better and has another K; {plausibility.SEARCH}"
    )


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


def outside(gain: Interval, others: tuple[Alternative, ...], parameter: int) -> float:
    """Posterior probability, by models with one cause, that a gain is outside of its interval.

    Args:
        gain: with its interval.
        others: models with one cause; the one without any has odds of 1, and counts as inside.
        parameter: index into their parameters.

    Example:
        >>> import numpy as np
        >>> other = Alternative("a cause", 19.0, np.full(9, 6.0), 0.01 * np.eye(9))
        >>> [round(outside(Interval(5.0, low, high), (other,), K2), 3) for low, high in ((4.5, 5.5), (3.0, 7.0))]
        [0.95, 0.0]
    """
    odds = np.array([other.odds for other in others])
    mean = np.array([other.mean[parameter] for other in others])
    sd = np.sqrt([max(float(other.covariance[parameter, parameter]), TINY) for other in others])
    inside = ndtr((gain.high - mean) / sd) - ndtr((gain.low - mean) / sd)
    return float(odds @ (1.0 - inside) / (1.0 + odds.sum()))
