"""The summary at the end of a run: the last estimates, and what was wrong with the input."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from canid.types import Damage, Estimate, SignalReport, Status
from canid.views import estimate_text
from canid.views.names import HEADLINE_MARK


class EstimateTally:
    """Per estimator: how often each status came, the last estimate, and the last one with status `ok`."""

    def __init__(self) -> None:
        """Start empty."""
        self.statuses: dict[str, dict[Status, int]] = {}
        self.last: dict[str, Estimate] = {}
        self.last_ok: dict[str, Estimate] = {}
        self.headline = ""  # estimator of the last headline estimate

    def put(self, e: Estimate) -> None:
        """Count one estimate."""
        counts = self.statuses.setdefault(e.estimator, {})
        counts[e.status] = counts.get(e.status, 0) + 1
        self.last[e.estimator] = e
        if e.status is Status.OK:
            self.last_ok[e.estimator] = e
        if e.headline:
            self.headline = e.estimator

    def distrust(self, report: SignalReport) -> None:
        """Drop good estimates from the time in which a signal was wrong and nobody knew it yet."""
        for one in report.findings:
            if one.withholds:
                self.last_ok = {
                    name: e for name, e in self.last_ok.items() if not one.since <= e.t <= one.raised
                }


def estimates(tally: EstimateTally, output: str = "") -> list[str]:
    """The last good estimate of each estimator, with the share of each status; `output`: its role, for the unit of K."""
    lines = []
    for name in sorted(tally.statuses):
        total = sum(tally.statuses[name].values())
        shares = ", ".join(
            f"{status.value} {100 * n / total:.0f} %"
            for status, n in sorted(tally.statuses[name].items(), key=lambda item: -item[1])
        )
        headline = f"  {HEADLINE_MARK} headline estimate" if name == tally.headline else ""
        lines.append(f"{name}: {shares}{headline}")
        e = tally.last_ok.get(name)
        if e is None:
            lines.append(f"  no estimate: {tally.last[name].says}")
            continue
        lines += [
            f"  {estimate_text.channel(channel, ch, output, None)}" for channel, ch in e.channels.items()
        ]
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
