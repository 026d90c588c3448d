"""What one trial says: how much was lost, and what was wrong."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from tests.fixtures.readers import by_canid, disagreement
from tests.fixtures.traffic import Traffic, number


class Outcome(NamedTuple):
    """One trial; `wrong` is "" where every promise but the loss itself was kept."""

    group: str  # trials of one row of the table
    lost: float  # s; NaN: not what this trial asks
    frames: int  # that were lost
    wrong: str = ""
    tried: int = 1  # cases in this trial
    measure: str = ""  # what `lost` is, where it is another time: "stopped within"

    def within(self, promised: float) -> Outcome:
        """The same, wrong where more than `promised` s were lost."""
        late = self.lost - promised
        return (
            self._replace(wrong=f"{late:.3f} s more than is promised")
            if late > 0 and not self.wrong
            else self
        )


def after_an_end(path: Path, traffic: Traffic, instant: float, group: str, *, whole: bool = True) -> Outcome:
    """What the file holds of what was sent before `instant`, the wall clock of a kill or a power cut.

    Lost time counts from the first frame that is missing. `whole`: no reader may find damage either.
    """
    due = traffic.before(instant)
    # a text log has no header before the first frame is known: it may be empty until its first checkpoint
    if not path.exists() or (path.stat().st_size == 0 and path.suffix != ".blf"):
        return Outcome(group, instant - traffic.sent[0] if due else 0.0, due)
    if path.stat().st_size == 0:
        return Outcome(group, float("nan"), due, "0 bytes")
    try:
        ours = by_canid(path)
    except Exception as error:
        return Outcome(group, float("nan"), due, f"canid: {error}")
    n = len(ours.frames)
    wrong = ""
    if ours.frames != [(i % 2048, number(i)) for i in range(n)]:
        wrong = "not contiguous from the first frame on"
    # 10 ms: the kernel stamps a frame after the sender's note of the time, on a busy machine well after
    elif n and not traffic.sent[0] - 0.01 <= ours.times[0] <= ours.times[-1] <= instant + 0.01:
        wrong = f"absolute time: {ours.times[0] - traffic.sent[0]:.3f} s off"
    elif whole:
        wrong = disagreement(path)
    lost = instant - traffic.sent[n] if n < due else 0.0
    return Outcome(group, lost, max(due - n, 0), wrong)
