"""What a replay gave, kept for its page: samples, estimates, reports and events, in the order of time."""

from __future__ import annotations

from canid.values.types import Estimate, Event, LearnGate, MonitorReport, Sample, SignalFinding, SignalReport

# signals of a sample that the page draws, besides the output
SIGNALS = ("speed", "gap", "headway", "range_rate", "lateral_offset")


class ReplayRecord:
    """Collects the outputs of the pipeline."""

    def __init__(self) -> None:
        """Start empty."""
        self.t: list[float] = []
        self.output: list[float] = []
        self.gates: list[LearnGate] = []
        self.learn: list[bool] = []
        self.signals: dict[str, list[float]] = {role: [] for role in SIGNALS}
        self.estimates: list[Estimate] = []
        self.monitor: list[MonitorReport] = []
        self.findings: dict[
            tuple[str, float], SignalFinding
        ] = {}  # by name and onset: as it was last reported
        self.events: list[Event] = []

    def put(self, item: Sample | Estimate | MonitorReport | SignalReport | Event) -> None:
        """Keep one output.

        Example:
            >>> record = ReplayRecord()
            >>> record.put(Event(1.0, "mark", "roundabout"))
            >>> record.events[0].says
            'roundabout'
        """
        if isinstance(item, Sample):
            self.t.append(item.t)
            self.output.append(item.output)
            self.gates.append(item.gate)
            self.learn.append(item.learn)
            for role, values in self.signals.items():
                values.append(item.signals.get(role, float("nan")))
        elif isinstance(item, Estimate):
            self.estimates.append(item)
        elif isinstance(item, MonitorReport):
            last = self.monitor[-1] if self.monitor else None
            # a report comes every second; what it says changes seldom
            if last is None or (last.fits, last.block, _states(last)) != (
                item.fits,
                item.block,
                _states(item),
            ):
                self.monitor.append(item)
        elif isinstance(item, SignalReport):
            for finding in item.findings:
                self.findings[finding.name, finding.since] = finding
        else:
            self.events.append(item)


def _states(report: MonitorReport) -> tuple[object, ...]:
    return tuple(block.state for block in report.blocks.values())
