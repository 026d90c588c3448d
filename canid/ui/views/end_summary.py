"""The summary at the end of a run: the last estimates, and what was wrong with the input."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from canid.analysis.drive.response_sentence import response
from canid.ui.views.document.document import Block, Listing
from canid.ui.views.document.document_text import WIDTH, block_lines
from canid.values.text import estimate_text
from canid.values.text.names import HEADLINE_MARK, method, readable
from canid.values.text.numbers import number
from canid.values.types import Damage, Estimate, Event, MonitorReport, Sample, SignalReport, Status


class EstimateTally:
    """Per estimator: how often each status came, the last estimate, and the last one with status `ok`."""

    def __init__(self) -> None:
        """Start empty."""
        self.statuses: dict[str, dict[Status, int]] = {}
        self.last: dict[str, Estimate] = {}
        self.last_ok: dict[str, Estimate] = {}
        self.headline = ""  # estimator of the last headline estimate

    def put(self, item: Sample | Estimate | MonitorReport | SignalReport | Event) -> None:
        """Count an estimate; drop good ones from the time in which a signal was wrong and nobody knew it yet."""
        if isinstance(item, Estimate):
            counts = self.statuses.setdefault(item.estimator, {})
            counts[item.status] = counts.get(item.status, 0) + 1
            self.last[item.estimator] = item
            if item.status is Status.OK:
                self.last_ok[item.estimator] = item
            if item.headline:
                self.headline = item.estimator
        elif isinstance(item, SignalReport):
            for finding in item.findings:
                if finding.withholds:
                    self.last_ok = {
                        name: e
                        for name, e in self.last_ok.items()
                        if not finding.since <= e.t <= finding.raised
                    }


def estimates(tally: EstimateTally, output: str = "") -> list[str]:
    """The end of a run as text: the answer, and each estimator; `output`: its role, for the unit of K."""
    blocks: list[Block] = [answer(tally, output), *by_estimator(tally, output)]
    return [line for block in blocks for line in block_lines(block, WIDTH)]


def answer(tally: EstimateTally, output: str) -> str:
    """The response of the last headline estimate, in a sentence; it is of the last minute, not of the whole drive."""
    last = tally.last_ok.get(tally.headline)
    says = response(last.channels, output) if last is not None else ""
    return f"{says[:-1]} (of the window that ends at {last.t:.0f} s)." if last is not None and says else ""


def by_estimator(tally: EstimateTally, output: str) -> list[Listing]:
    """The last good estimate of each estimator, with the share of each status."""
    out = []
    for name in sorted(tally.statuses):
        total = sum(tally.statuses[name].values())
        shares = ", ".join(
            f"{readable(status.value)} {number(100 * n / total, '%', 2)}"
            for status, n in sorted(tally.statuses[name].items(), key=lambda item: -item[1])
        )
        e = tally.last_ok.get(name)
        items = [f"no estimate: {tally.last[name].says}"]
        if e is not None:
            items = [estimate_text.channel(channel, ch, output, None) for channel, ch in e.channels.items()]
            fit = f", fit {number(e.fit_percent, '%', 2)}" if e.fit_percent == e.fit_percent else ""
            items.append(f"at {e.t:.1f} s, from {e.used:.0f} s of driving{fit}")
        mark = f"{HEADLINE_MARK} " * (name == tally.headline)
        out.append(Listing(items, f"{mark}{method(name)}: {shares}"))
    return out


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
