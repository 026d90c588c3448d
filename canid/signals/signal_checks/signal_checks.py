"""All checks of the signals, in estimator time, and which of their findings stand.

A finding stands from the block in which its check first says so until `HOLD_S` after it last did. While one stands that
touches an input or the output, no estimate is `ok`: what comes is as wrong as what was learned. A limit alone is left out
from when it is known: the estimators begin anew, and until the finding ends quote no more than the gain of the range rate.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from canid.mathematics.identification import feedback_bias
from canid.mathematics.identification.identifiability import gain_only, not_quotable
from canid.signals.samples.reading_facts import ReadingFact
from canid.signals.signal_checks import (
    blocks,
    coarse_signals,
    delayed_rate,
    frozen_values,
    gap_and_range_rate,
    integrated_acceleration,
    limited_values,
    own_motion,
    pedal_at_rest,
    pedal_scale,
    reference_speed,
    saturated_rate,
    slow_signals,
    stamp_jitter,
    standing,
)
from canid.signals.signal_checks.check import Check
from canid.values.types import NAN, Channel, Driver, Estimate, Sample, SignalFinding, SignalReport, Status

# the list is the registry: a check is a file and a line
CHECKS: tuple[Check, ...] = (
    limited_values.CHECK,
    frozen_values.CHECK,
    gap_and_range_rate.CHECK,
    *reference_speed.CHECKS,
    integrated_acceleration.CHECK,
    own_motion.CHECK,
    pedal_at_rest.CHECK,
    pedal_scale.CHECK,
    stamp_jitter.CHECK,
    *slow_signals.CHECKS,
    *coarse_signals.CHECKS,
    saturated_rate.CHECK,
    *delayed_rate.CHECKS,
)

# s; the window of FOPDT (mathematics/estimators/fopdt.py): afterwards nothing of the wrong signal is in it
HOLD_S = 60.0

# statuses that the data decide: what they say rests on the wrong signal
_FROM_DATA = (Status.OK, Status.CONVERGING, Status.NOT_EXCITED, Status.INCONSISTENT)
# roles that the inputs of a task are made of
_INPUT_ROLES = {"car_following": ("gap", "range_rate", "speed"), "lane_keeping": ("lateral_offset",)}


class State(NamedTuple):
    """What the next sample's findings depend on."""

    blocks: blocks.State
    standing: standing.State
    checks: tuple[Any, ...]  # of each in `CHECKS`


def init() -> State:
    """Return the state before the first sample."""
    return State(blocks.init(), {}, tuple(check.init() for check in CHECKS))


def put(state: State, came: ReadingFact) -> State:
    """Add what readings show."""
    return state._replace(blocks=blocks.put(state.blocks, came))


def step(state: State, sample: Sample, driver: Driver, dt: float) -> tuple[State, SignalReport | None]:
    """Take a sample.

    Args:
        state: from `init()` or the step before.
        sample: in the estimators' time.
        driver: whose response is identified.
        dt: the grid's step, s.

    Returns:
        The state, and a report where a finding begins or ends.

    Example:
        >>> from canid.values.types import LearnGate
        >>> state = init()
        >>> for k in range(400):
        ...     signals = {"speed": 72.0 + 0.1 * (k % 7), "gnss_speed": 20.0}
        ...     sample = Sample(0.1 * k, 0.0, (), LearnGate.OPEN, True, 0, signals)
        ...     state, report = step(state, sample, Driver(), 0.1)
        ...     if report is not None:
        ...         print(report.findings[0].says)
        speed is 3.62 [3.61, 3.62] times gnss_speed: km/h declared as m/s?
    """
    filling, block = blocks.step(state.blocks, sample, dt)
    if block is None:
        return State(filling, state.standing, state.checks), None
    inner, verdicts = [], {}
    for check, check_state in zip(CHECKS, state.checks, strict=True):
        check_state, verdicts[check.name] = check.step(check_state, block)
        inner.append(check_state)
    watched = frozenset((*_INPUT_ROLES[driver.task], driver.output))
    once = frozenset({limited_values.CHECK.name})
    stands, news = standing.step(state.standing, verdicts, block.t, watched, HOLD_S, once)
    after = State(filling, stands, tuple(inner))
    if not news:
        return after, None
    ended = tuple(finding for finding in news if finding.until == finding.until)
    return after, SignalReport(sample.t, (*ended, *findings(after)))


def findings(state: State) -> tuple[SignalFinding, ...]:
    """Return the findings that stand, in the order of the checks."""
    return tuple(entry.finding for entry in state.standing.values())


def remarks(state: State) -> tuple[str, ...]:
    """What the checks have measured without finding a fault, as sentences."""
    age = next(
        own_motion.measured(check_state)
        for check, check_state in zip(CHECKS, state.checks, strict=True)
        if check is own_motion.CHECK
    )
    return (age,) if age else ()


def at(several: Iterable[SignalFinding], t: float) -> tuple[SignalFinding, ...]:
    """Select the findings that were known and stood at time t [s].

    Example:
        >>> finding = SignalFinding("speed_unit", ("speed",), 0.0, 20.0, "", "", True, until=90.0)
        >>> len(at([finding], 10.0)), len(at([finding], 20.0)), len(at([finding], 90.0))
        (0, 1, 0)
    """
    return tuple(finding for finding in several if finding.raised <= t and not finding.until <= t)


def forgotten_at(several: Iterable[SignalFinding]) -> dict[float, float]:
    """Times in s after which an estimator forgets what it has learned -> s, before which.

    When a finding begins, all of it may rest on the wrong signal. When one ends that was said again since, or that left the
    gains, so does what was learned until it was last said.

    Example:
        >>> limited = SignalFinding("range_rate_limited", ("range_rate",), 3.0, 80.0, "", "", True, until=140.0)
        >>> wrong = SignalFinding("speed_unit", ("speed",), 0.0, 20.0, "", "", True, until=300.0)
        >>> sorted(forgotten_at([limited, wrong]).items())
        [(20.0, 20.0), (80.0, 80.0), (300.0, 240.0)]
    """
    out = dict[float, float]()
    for finding in several:
        lasted = finding.until - finding.raised > HOLD_S + 2.0 * blocks.BLOCK_S
        if finding.until == finding.until and (finding.withholds_delays or lasted):
            out.setdefault(finding.until, finding.until - HOLD_S)
        if finding.withholds:
            out[finding.raised] = finding.raised
    return out


def withheld(estimate: Estimate, stand: Iterable[SignalFinding]) -> Estimate:
    """Withhold the numbers of an estimate while a finding stands that touches an input or the output, but for a limit.

    Returns:
        The estimate without numbers, `stale` where a value is frozen, else `inconsistent`, with the finding's sentence;
        without delays, where the finding leaves the gains, or is a limit, which leaves that of the range rate; or as it is,
        where nothing stands, or nobody drives behind a lead.
    """
    stand = tuple(stand)
    why = next((each for each in stand if each.withholds and not limited_values.sides(each)[0]), None)
    if estimate.status not in _FROM_DATA:
        return estimate
    if why is None:
        late = next((finding for finding in stand if finding.withholds or finding.withholds_delays), None)
        if late is None:
            return estimate
        # of what has come since a limit is known delays hold in 98 of 109 cases, K of range rate in 155 of 157
        channels = {
            name: not_quotable(channel, sentence(late))
            if late.withholds and name in feedback_bias.HELD
            else gain_only(channel, sentence(late))
            for name, channel in estimate.channels.items()
        }
        return estimate._replace(channels=channels, says=f"{estimate.says}; {sentence(late)}")
    status = Status.STALE if why.name.endswith(("_frozen", "_dead")) else Status.INCONSISTENT
    return estimate._replace(
        status=status,
        says=sentence(why),
        channels=dict.fromkeys(estimate.channels, Channel()),
        fit_percent=NAN,
        headline=False,
    )


def sentence(finding: SignalFinding) -> str:
    """What, since when, and what to do, in one line.

    Example:
        >>> sentence(SignalFinding("speed_unit", ("speed",), -8.0, 2.0, "speed is 3.6 times gnss_speed", "check it", True))
        'speed is 3.6 times gnss_speed (since before this start): check it'
    """
    since = f"{finding.since:.0f} s" if finding.since >= 0.0 else "before this start"
    return f"{finding.says} (since {since}): {finding.remedy}"


def episodes(reports: Iterable[SignalReport]) -> tuple[SignalFinding, ...]:
    """Collect the findings of a drive's reports, by the time at which each was raised."""
    last = {(finding.name, finding.raised): finding for report in reports for finding in report.findings}
    return tuple(sorted(last.values(), key=lambda finding: (finding.raised, finding.name)))
