"""Which findings stand: from the block in which a check first says so until some time after it last did."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from canid.signals.signal_checks.check import Found
from canid.values.state_constraints import TIME
from canid.values.types import SignalFinding


class Entry(NamedTuple):
    """A finding that stands."""

    finding: SignalFinding
    last: Annotated[float, TIME]  # s, when its check last said so


State = Mapping[str, Entry]


def step(
    state: State,
    verdicts: Mapping[str, Found | None],
    t: float,
    watched: frozenset[str],
    hold: float,
    once: frozenset[str] = frozenset(),
) -> tuple[State, tuple[SignalFinding, ...]]:
    """Take the verdicts of one block.

    Args:
        state: by check, what stands.
        verdicts: by check, its verdict.
        t: s, of the block.
        watched: roles of the model's inputs and output.
        hold: s for which a finding stands after its check last said so.
        once: checks that say each fault once: what they say again is another one.

    Returns:
        The state, and the findings that have begun or ended.

    Example:
        >>> wrong = Found("speed_unit", ("speed",), 1.0, "speed is 3.6 times gnss_speed", "check the unit")
        >>> state, new = step({}, {"units": wrong}, 20.0, frozenset({"speed"}), 60.0)
        >>> new[0].raised, new[0].withholds
        (20.0, True)
        >>> step(state, {"units": None}, 80.0, frozenset(), 60.0)[1][0].until
        80.0
    """
    after: dict[str, Entry] = {}
    news: list[SignalFinding] = []
    for check, now in verdicts.items():
        before = state.get(check)
        if now is None:
            if before is None:
                continue
            if t - before.last < hold:
                after[check] = before
            else:
                news.append(before.finding._replace(until=t))
            continue
        touched = bool(watched & set(now.roles))
        worse = touched and not now.delays_only
        same = before is not None and before.finding.name == now.name and check not in once
        if before is not None and same and before.finding.withholds >= worse:
            # its sentence stays as it was first said: what is shown live and afterwards is the same
            after[check] = before._replace(last=t)
            continue
        if before is not None:
            news.append(before.finding._replace(until=t))
        finding = SignalFinding(
            *(now.name, now.roles, now.since, t, now.says, now.remedy),
            withholds=worse,
            withholds_delays=touched and now.delays_only,
        )
        after[check] = Entry(finding, t)
        news.append(finding)
    return after, tuple(news)
