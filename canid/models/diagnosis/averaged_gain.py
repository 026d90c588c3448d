"""Is a gain of `identify` an average over a cause? Its model knows none; the drive may show one that moves the gain.

Every cause of the catalogue is added to the baseline alone, as in the first step of the diagnosis, and weighs what Bayesian
model averaging gives it (`driver/model_averaging.py`). Where models that together are nine times as likely as all others
have a gain outside of an interval, the interval is right for an average over the cause alone, and is not to be quoted. No
cause is named: that takes held-out data and replicates, which is what `diagnose` does.
"""

from __future__ import annotations

from collections.abc import Mapping

from canid.mathematics.estimators import whole_drive_agreement
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.identifiability import quotable
from canid.models.diagnosis import car_following, corrections
from canid.models.diagnosis.corrections import Settings, TooLittleError
from canid.models.diagnosis.driver import driver_search
from canid.models.diagnosis.driver.driver_model import K1, K2
from canid.models.diagnosis.driver.model_averaging import Alternative, alternatives
from canid.models.effects import CATALOGUE
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.text.names import readable
from canid.values.text.numbers import interval
from canid.values.types import TASK_INPUTS, Interval, Trace

# posterior probability of the models that have a gain outside of an interval, from which on it is not quoted
REFUTED = 0.9
# evidence, in 2 Δ log likelihood, below which no single cause is as likely as that: 2 log(0.9 / 0.1)
LEAST_EVIDENCE = 4.39
# s of driving from which on a cause can be seen, as in the diagnosis
MINIMUM_S = 90.0
GAINS = {"headway_error": K1, "range_rate": K2}


def without_averages(whole: Mapping[str, WholeDrive | None], trace: Trace) -> dict[str, WholeDrive | None]:
    """Withhold the gains of a drive behind a lead that a cause, which the drive shows, would move out of their intervals.

    Args:
        whole: estimator -> its result, as `arbitrated` leaves it; None: it has none.
        trace: of the drive, as it was read.
    """
    quoted = [
        (name, key, channel.K)
        for name, result in whole.items()
        if result is not None
        for key, channel in result.channels.items()
        if quotable(channel, "K")
    ]
    if not quoted or trace.input_names != TASK_INPUTS["car_following"]:
        return dict(whole)
    others = shown(trace)
    out = dict(whole)
    for name, key, gain in quoted:
        share = outside(gain, others, GAINS[key])
        if share >= REFUTED:
            says = (
                f"{readable(key)}: a driver model with one more cause describes this drive better, and its K is outside "
                f"of {interval(gain)}: K is an average over the cause, not to be quoted; `canid diagnose` looks for it"
            )
            out[name] = whole_drive_agreement.without_parameter(out[name], key, "K", says)
    return out


def shown(trace: Trace) -> tuple[Alternative, ...]:
    """Models of the driver with one cause, each with its odds against the one without; none where the drive is too short.

    Args:
        trace: of a drive behind a lead.
    """
    settings = Settings(CATALOGUE, MINIMUM_S, lambda _: None)
    given = with_limits(trace)
    context = corrections.diagnose_context(given, settings.catalogue)
    try:
        base = car_following.prepare(corrections.correct(given, context, settings))
    except TooLittleError:
        return ()
    data = base.prepared.data
    solved, tried = driver_search.first_step(data, base.prepared.fitted, base.drivers, LEAST_EVIDENCE)
    return alternatives(tried, (), data, solved)


def outside(gain: Interval, others: tuple[Alternative, ...], parameter: int) -> float:
    """Posterior probability of the models that have a parameter outside of an interval.

    Args:
        gain: the interval.
        others: models with one cause; the model without any has odds of 1.
        parameter: index into `BASE`.

    Example:
        >>> import numpy as np
        >>> other = Alternative("a cause", 19.0, np.full(9, 6.0), np.zeros((9, 9)))
        >>> round(outside(Interval(4.0, 3.0, 5.0), (other,), K2), 3)
        0.95
        >>> outside(Interval(4.0, 3.0, 7.0), (other,), K2)
        0.0
    """
    every = 1.0 + sum(other.odds for other in others)
    return sum(other.odds for other in others if not gain.low <= other.mean[parameter] <= gain.high) / every
