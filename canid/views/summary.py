"""What a run has shown, as plain text for its end."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from canid.types import Damage, Estimate, Status
from canid.views import words


class Tally:
    """Counts, per estimator, how the time went and what was said last."""

    def __init__(self) -> None:
        """Start empty."""
        self.statuses: dict[str, dict[Status, int]] = {}
        self.last: dict[str, Estimate] = {}
        self.last_ok: dict[str, Estimate] = {}
        self.read = ""  # whose number was the one to read, last

    def put(self, e: Estimate) -> None:
        """Count one estimate."""
        of = self.statuses.setdefault(e.estimator, {})
        of[e.status] = of.get(e.status, 0) + 1
        self.last[e.estimator] = e
        if e.status is Status.OK:
            self.last_ok[e.estimator] = e
        if e.headline:
            self.read = e.estimator


def estimates(tally: Tally) -> list[str]:
    """The last good estimate of each estimator, with the shares of each status."""
    lines = []
    for name in sorted(tally.statuses):
        total = sum(tally.statuses[name].values())
        shares = ", ".join(
            f"{status.value} {100 * n / total:.0f} %"
            for status, n in sorted(tally.statuses[name].items(), key=lambda item: -item[1])
        )
        lines.append(f"{name}: {shares}{f'  {words.READ} the one to read' if name == tally.read else ''}")
        e = tally.last_ok.get(name)
        if e is None:
            lines.append(f"  no estimate: {tally.last[name].says}")
            continue
        lines += [f"  {words.channel(channel, ch)}" for channel, ch in e.channels.items()]
        fit = f", fit {e.fit_percent:.0f} %" if e.fit_percent == e.fit_percent else ""
        lines.append(f"  at {e.t:.1f} s, from {e.used:.0f} s of driving{fit}")
    return lines


def health(
    damage: Damage | None, back_in_time: str, counters: Mapping[str, int], missing: Iterable[str]
) -> list[str]:
    """What was wrong with the input, one sentence each."""
    lines = [damage.says] if damage else []
    if back_in_time:
        lines.append(back_in_time)
    lines += [f"{what}: {n} times" for what, n in sorted(counters.items())]
    lines += list(missing)
    return lines
