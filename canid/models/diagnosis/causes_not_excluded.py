"""What `identify` may quote of a driver whose model knows no causes, where the drive does not exclude all of them.

Every cause of the catalogue is added to the baseline alone, as in the first step of the diagnosis, and weighs what Bayesian
model averaging gives it (`driver/model_averaging.py`); all causes together are as likely as none, before the drive. An
interval is widened until it holds 95 % by all these models. Where a parameter is outside of its own interval with more
than 70 %, it is an average over a cause, and is not to be quoted. No cause is named: that takes held-out data and
replicates, which is what `diagnose` does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.special import ndtr

from canid.mathematics.estimators import plausibility, whole_drive_agreement
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.confidence import SIGMAS
from canid.mathematics.identification.identifiability import QUOTABLE, quotable
from canid.models.diagnosis import car_following, corrections
from canid.models.diagnosis.corrections import Settings, TooLittleError
from canid.models.diagnosis.driver import driver_search
from canid.models.diagnosis.driver.driver_model import HIGH, K1, K2, TAU1, TAU2, THETA1, THETA2
from canid.models.diagnosis.driver.model_averaging import Alternative, alternatives, averaged
from canid.models.diagnosis.lane import lane_keeping, lane_model, lane_search
from canid.models.effects import CATALOGUE, LANE_CATALOGUE
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.types import TASK_INPUTS, Interval, Trace

# evidence, in 2 Δ log likelihood, below which a cause is hardly likelier than none
LEAST_EVIDENCE = 4.0
# a variance that is not 0
TINY = 1e-30
# s of driving from which on a cause can be seen, as in the diagnosis
MINIMUM_S = 90.0
# input -> what may be quoted of it -> the parameters of the models with causes that it is, or is the sum of
PARAMETERS: Mapping[str, Mapping[str, tuple[int, ...]]] = {
    "headway_error": {
        "K": (K1,),
        "tau": (TAU1,),
        "dead_time": (THETA1,),
        "tau_plus_dead_time": (TAU1, THETA1),
    },
    "range_rate": {"K": (K2,), "tau": (TAU2,), "dead_time": (THETA2,), "tau_plus_dead_time": (TAU2, THETA2)},
    "lateral_offset": {"K": (lane_model.K,)},
}


def averaged_over(whole: Mapping[str, WholeDrive | None], trace: Trace) -> dict[str, WholeDrive | None]:
    """Widen intervals by the causes that the drive does not exclude, and withhold what a cause moves out of its own.

    Args:
        whole: estimator -> its result, as `arbitrated` leaves it; None: it has none.
        trace: of the drive, as it was read.
    """
    some = any(
        QUOTABLE[each.status] for result in whole.values() if result for each in result.channels.values()
    )
    others = shown(trace) if some else ()
    return {name: _judged(result, others) if others else result for name, result in whole.items()}


def _judged(result: WholeDrive | None, others: tuple[Alternative, ...]) -> WholeDrive | None:
    out = result
    given = {} if result is None else result.channels
    for key, channel in given.items():
        for what, parameters in PARAMETERS.get(key, {}).items():
            if out is None or not quotable(channel, what):
                continue
            narrow = getattr(channel, what)
            wide = _widened(narrow, what, others, parameters)
            moved = outside(narrow, others, parameters) >= plausibility.OUTSIDE
            if moved or (what == "K" and not wide.low * wide.high > 0.0):
                out = whole_drive_agreement.without_parameter(
                    out, key, what, plausibility.average_over_cause(key, what)
                )
            else:
                changed: dict[str, Any] = {what: wide}
                out = out._replace(channels={**out.channels, key: out.channels[key]._replace(**changed)})
    return out


def _widened(
    narrow: Interval, what: str, others: tuple[Alternative, ...], parameters: tuple[int, ...]
) -> Interval:
    low, high = (-np.inf, np.inf) if what == "K" else (0.0, sum(HIGH[k] for k in parameters))
    sd = (narrow.high - narrow.low) / (2.0 * SIGMAS)
    bounds = min(low, narrow.low), max(high, narrow.high)
    return averaged(narrow, sd, others, parameters, 1.0, *bounds).interval


def shown(trace: Trace) -> tuple[Alternative, ...]:
    """Models of the driver with one cause, each with its odds against the one without; none where the drive is too short.

    Args:
        trace: of a drive.
    """
    given = with_limits(trace)
    try:
        lane = trace.input_names == TASK_INPUTS["lane_keeping"]
        catalogue = LANE_CATALOGUE if lane else CATALOGUE
        by_cause = (_of_lane if lane else _of_following)(
            given, Settings(catalogue, MINIMUM_S, lambda _: None)
        )
    except TooLittleError:
        return ()
    return tuple(each._replace(odds=each.odds / len(catalogue)) for each in by_cause)


def _of_following(given: Trace, settings: Settings) -> tuple[Alternative, ...]:
    context = corrections.diagnose_context(given, settings.catalogue)
    base = car_following.prepare(corrections.correct(given, context, settings))
    data = base.prepared.data
    solved, tried = driver_search.first_step(data, base.prepared.fitted, base.drivers, LEAST_EVIDENCE)
    return alternatives(tried, (), data, solved)


def _of_lane(given: Trace, settings: Settings) -> tuple[Alternative, ...]:
    base = lane_keeping.prepare(corrections.correct(given, lane_keeping.context(given), settings))
    return lane_search.alternatives(base.data, base.fitted, settings.catalogue)


def outside(narrow: Interval, others: tuple[Alternative, ...], parameters: tuple[int, ...]) -> float:
    """Posterior probability, by models with one cause, that a parameter is outside of its interval.

    Args:
        narrow: of the parameter, or of a sum of parameters.
        others: models with one cause; the one without any has odds of 1, and counts as inside.
        parameters: index into their parameters; of several, their sum.

    Example:
        >>> import numpy as np
        >>> other = Alternative("a cause", 19.0, np.full(9, 6.0), 0.01 * np.eye(9))
        >>> [round(outside(Interval(5.0, low, high), (other,), (K2,)), 3) for low, high in ((4.5, 5.5), (3.0, 7.0))]
        [0.95, 0.0]
    """
    index = list(parameters)
    odds = np.array([other.odds for other in others])
    mean = np.array([other.mean[index].sum() for other in others])
    sd = np.sqrt([max(float(other.covariance[np.ix_(index, index)].sum()), TINY) for other in others])
    inside = ndtr((narrow.high - mean) / sd) - ndtr((narrow.low - mean) / sd)
    return float(odds @ (1.0 - inside) / (1.0 + odds.sum()))
