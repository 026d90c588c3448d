"""The arbiter of a whole drive: what methods contradict each other in, none of them may quote.

A method judges its own fit. Here alone the methods are held against each other, those of `identify` and the diagnosis:
disjoint intervals that no cause explains which the diagnosis names, a response that is left over, which no method with the
same form of answer has either, gains that only one of them knows, and changes or drifts during the drive, which hold for
all. The same engine as live
(agreement.py), without its five seconds: a whole drive has no burst to wait for. Live it is one status for an estimate;
here each parameter of each input is judged for itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import combinations

from canid.mathematics.estimators import agreement, plausibility
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.identifiability import (
    PARAMETERS,
    QUOTABLE,
    apart,
    gain_only,
    not_quotable,
    quotable,
    sum_only,
)
from canid.values.text.names import method as in_words
from canid.values.text.names import readable
from canid.values.text.numbers import interval, number
from canid.values.types import Channel, SignalFinding

# What each estimator's model takes to be so.
NEEDS: Mapping[str, str] = {
    "fopdt": "an answer of first order after one dead time",
    "armax": "a steady answer with one pole and no floor of the pedal",
    "diagnose": "the causes that it names, and no other",
}


# The diagnosis among the methods.
DIAGNOSIS = "diagnose"

# said of a method that finds no changes itself, where another has found some
CHANGED = "the gains changed during the drive: none of these holds for all of it"


def arbitrated(
    whole: Mapping[str, WholeDrive | None], explained: Mapping[str, Mapping[str, Channel]] | None = None
) -> dict[str, WholeDrive | None]:
    """Withhold what methods contradict each other in, and say what each would need to be right.

    Disjoint intervals count, of those that a method may quote by its own residuals: where more of a response is left over
    than the model gives, it may not (`plausibility.MAX_LEFT_OVER_OF_GAIN`). So does a gain that only one of them may quote,
    where the other's model explains no more than the mean, or where residuals still hold a response that is too large for
    a delay (`plausibility.MAX_LEFT_OVER`): with such a response no answer of first order has delays, whoever fitted it.

    Args:
        whole: method -> its result; None: it has none.
        explained: methods with causes, which explain what the residuals of others hold and what changes for them -> what
            the same method finds without these; None: there are none.
    """
    explained = explained or {}
    out = {name: _without_gains_left_over(result) for name, result in whole.items()}
    made = {name: result for name, result in out.items() if result is not None}
    inputs = {key for result in made.values() for key in result.channels}
    wrong = agreement.wrong_for(inputs)
    for method, says in ((name, _left_over(result)) for name, result in made.items()):
        # steering is of higher order: there it speaks against the estimator of first order alone
        for name in set(out if not wrong else wrong & {method}) - set(explained):
            of_other = says.replace("the residuals", f"the residuals of {in_words(method)}")
            out[name] = _without_delays(out[name], says if name == method else of_other)
    for a, b in combinations(agreement.by_headline(made, inputs), 2):
        for name, what in disjoint(made[a].channels, made[b].channels):
            if any(
                _agree(without, made[other].channels, name, what)
                for method, without in explained.items()
                for other in {a, b} - {method}
                if method in (a, b)
            ):
                continue
            key = (a, b, name, what)
            says = agreement.both(key, made[a].channels, made[b].channels)
            if (a in wrong) != (b in wrong):
                other, right = (a, b) if a in wrong else (b, a)
                reason = f"{says}: steering is of higher order than one lag and a dead time: use {in_words(right)}'s"
                out[other] = without_parameter(out[other], name, what, reason)
                continue
            reason = _neither(says, (a, b))
            for method in (a, b):
                out[method] = without_parameter(out[method], name, what, reason)
        if not {a, b} & wrong:
            for method, other in ((a, b), (b, a)):
                if method not in explained:
                    for name, reason in _unconfirmed(made, method, other):
                        out[method] = without_parameter(out[method], name, "K", reason)
    for reason in _drifts(made):
        out = {name: _without_delays(result, reason) for name, result in out.items()}
    return _with_changes(out, explained)


def without_delays(
    whole: Mapping[str, WholeDrive | None], findings: Iterable[SignalFinding]
) -> dict[str, WholeDrive | None]:
    """Withhold the delays of a drive on whose signals a finding stood that leaves the gains alone.

    Args:
        whole: estimator -> its result; None: it has none.
        findings: on the drive's signals.
    """
    out = dict(whole)
    for finding in findings:
        if finding.withholds_delays:
            reason = f"{finding.says}: {finding.remedy}"
            out = {name: _without_delays(result, reason) for name, result in out.items()}
    return out


def diagnosed(
    channels: Mapping[str, Channel],
    whole: Mapping[str, WholeDrive | None],
    baseline: Mapping[str, Channel] | None,
    findings: Iterable[SignalFinding] = (),
) -> tuple[dict[str, Channel], tuple[str, ...], tuple[str, ...]]:
    """What the diagnosis may quote next to the estimators of `identify`, why not the rest, and what differs by its causes.

    A model without a cause averages over it: where the diagnosis without its causes agrees with an estimator, these are
    the whole difference, and its own number holds.

    Args:
        channels: of the diagnosis.
        whole: estimator -> its result, as `arbitrated` leaves it; None: it has none.
        baseline: its channels without the causes that it has found, with which its answer is of first order no longer;
            None: it has found none.
        findings: on the drives' signals.

    >>> from canid.values.types import Identifiable, Interval
    >>> one, other = (Channel(Interval(K, K - 1, K + 1), status=Identifiable.GAIN_ONLY) for K in (2.0, 5.0))
    >>> left, why, _ = diagnosed({"range_rate": one}, {"fopdt": WholeDrive({"range_rate": other})}, None)
    >>> left["range_rate"].status.value, why[0].partition(":")[0]
    ('not_identifiable', 'range rate')
    >>> _, _, says = diagnosed({"range_rate": one}, {"fopdt": WholeDrive({"range_rate": other})}, {"range_rate": other})
    >>> says[0].partition(", as")[0]
    'Without the cause K of range rate is 5.0 [4.0, 6.0] by FOPDT'
    """
    others = {name: result for name, result in whole.items() if name not in agreement.wrong_for(channels)}
    mine = without_delays({DIAGNOSIS: WholeDrive(channels)}, findings)
    out = arbitrated({**others, **mine}, None if baseline is None else {DIAGNOSIS: baseline})[DIAGNOSIS]
    assert out is not None
    return dict(out.channels), out.lines, tuple(_without_causes(out.channels, others))


def _agree(first: Mapping[str, Channel], other: Mapping[str, Channel], name: str, what: str) -> bool:
    """Whether two methods give a number of an input, and one that both intervals hold."""
    both = [getattr(channels.get(name, Channel()), what) for channels in (first, other)]
    return all(math.isfinite(iv.value) for iv in both) and not apart(both)


def _without_causes(mine: Mapping[str, Channel], others: Mapping[str, WholeDrive | None]) -> Iterator[str]:
    """What estimators without the causes give for what the diagnosis quotes, where that is another number."""
    given: dict[tuple[str, str], list[str]] = {}
    for method, result in others.items():
        if result is None:
            continue
        for name, what in disjoint(mine, result.channels):
            text = interval(getattr(result.channels[name], what), "" if what == "K" else "s")
            given.setdefault((name, what), []).append(f"{text} by {in_words(method)}")
    for (name, what), said in given.items():
        yield (
            f"Without the cause {plausibility.WORDS[what][0]} of {readable(name)} is {' and '.join(said)}, as in "
            "`identify`: an average over the cause, not to be quoted."
        )


def _neither(says: str, methods: tuple[str, str]) -> str:
    needs = "; ".join(f"{in_words(method)} needs {NEEDS[method]}" for method in methods if method in NEEDS)
    return f"{says}: no point in common, neither may be quoted ({needs}, and a driver who stays the same)"


def disjoint(first: Mapping[str, Channel], other: Mapping[str, Channel]) -> list[tuple[str, str]]:
    """(input, parameter) that both methods may quote, with intervals that have no point in common.

    Args:
        first: input -> Channel, of one method.
        other: of another.
    """
    return agreement.disjoint_parameters(first, other, PARAMETERS)


def _left_over(result: WholeDrive) -> str:
    return "" if result.residual_tests is None else plausibility.left_over(result.residual_tests)


def _without_gains_left_over(result: WholeDrive | None) -> WholeDrive | None:
    if result is None or result.residual_tests is None:
        return result
    out: WholeDrive | None = result
    for name, reason in plausibility.gains_left_over(result.residual_tests).items():
        if quotable(result.channels.get(name, Channel()), "K"):
            out = without_parameter(out, name, "K", reason)
    return out


def _drifts(made: Mapping[str, WholeDrive]) -> list[str]:
    """What methods say of dead times that drift."""
    return [
        result.details["dead_time_trend"] for result in made.values() if "dead_time_trend" in result.details
    ]


def _unconfirmed(made: Mapping[str, WholeDrive], method: str, other: str) -> Iterator[tuple[str, str]]:
    """Inputs whose gain only one quotes though something speaks against its model, and what."""
    fit = made[other].fit_percent
    against: dict[str, str] = {}
    for each in (method, other):
        tests = made[each].residual_tests
        for name, share in [] if tests is None else plausibility.large_left_over(tests):
            against[name] = (
                f"the residuals of {in_words(each)} still hold a response of {100 * share:.0f} % of the model's own"
            )
    for name, channel in made[method].channels.items():
        rival = made[other].channels.get(name, Channel())
        if not quotable(channel, "K") or quotable(rival, "K"):
            continue
        reason = against.get(name, "")
        if fit is not None and fit <= 0.0:
            reason = f"{in_words(other)}'s model explains no more than the mean (fit {number(fit, '%', 2)})"
        if reason:
            yield (
                name,
                f"{name.replace('_', ' ')}: {reason}, and {in_words(other)} confirms no gain: K may not be quoted",
            )


def without_parameter(result: WholeDrive | None, name: str, what: str, reason: str) -> WholeDrive | None:
    """Withhold a parameter of an input.

    Args:
        result: of a method; None: it has none.
        name: of the input.
        what: the parameter.
        reason: why, in one line.
    """
    if result is None:
        return None
    channel = result.channels[name]
    if what in QUOTABLE[channel.status]:
        channel = _LEAVE[what](channel, reason)
    return _said(result, {**result.channels, name: channel}, reason)


# what is left of a channel without a parameter
_LEAVE: Mapping[str, Callable[[Channel, str], Channel]] = {
    "K": not_quotable,
    "tau": sum_only,
    "dead_time": sum_only,
    "tau_plus_dead_time": gain_only,
}


def _without_delays(result: WholeDrive | None, reason: str) -> WholeDrive | None:
    """Withhold the delays of all inputs; what quotes none says nothing more."""
    if result is None or not reason:
        return result
    channels = {name: gain_only(channel, reason) for name, channel in result.channels.items()}
    return result if channels == result.channels else _said(result, channels, reason)


def _without_all(result: WholeDrive | None, reason: str) -> WholeDrive | None:
    if result is None:
        return None
    return _said(
        result, {name: not_quotable(channel, reason) for name, channel in result.channels.items()}, reason
    )


def _said(result: WholeDrive, channels: Mapping[str, Channel], reason: str) -> WholeDrive:
    if reason in result.lines:
        return result._replace(channels=channels)
    # the lines are printed with every model, what `says` holds with the verdict
    says = "; ".join(filter(None, (reason, str(result.details.get("says", "")))))
    return result._replace(
        channels=channels, lines=(reason, *result.lines), details={**result.details, "says": says}
    )


def _with_changes(
    whole: dict[str, WholeDrive | None], explained: Mapping[str, object]
) -> dict[str, WholeDrive | None]:
    """Where one method finds that the gains changed, nothing that another says of the whole drive may be quoted."""
    if not any(result.details.get("changes") for result in whole.values() if result is not None):
        return whole
    return {
        name: result
        if result is None or name in explained or result.details.get("changes")
        else _without_all(result, CHANGED)
        for name, result in whole.items()
    }
