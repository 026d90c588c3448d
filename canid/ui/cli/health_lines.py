"""Recorder, buses and estimators in one line each: what a user must see of them, and what is wrong."""

from __future__ import annotations

from canid.analysis.session.estimator_process import Counts
from canid.analysis.session.session import World
from canid.io.recording.recorder_stats import BusStats, Stats
from canid.io.recording.trigger_gate import TriggerStats
from canid.ui.views.terminal_view.recorder_bar import MAX_LAG_S
from canid.ui.views.terminal_view.state import HealthLine
from canid.values.text.names import readable
from canid.values.text.numbers import file_size

# s after which a mapped signal that has not come is reported: slow messages come once a second
MISSING_AFTER_S = 5.0
# what to do about a bus without frames
SILENT_BUS = "check bit rate, termination, and that another node is on"


def health_lines(now: World) -> list[HealthLine]:
    """Recorder, buses and estimators, a line each; then what is missing."""
    stats, counts = now.recorder, now.estimator
    out = [recorder(stats._replace(state="stopping") if now.stopping else stats)]
    if stats.hidden:
        out.append(HealthLine(stats.hidden, wrong=True))
    if stats.trigger is not None and not now.stopping and not stats.state.startswith("failed"):
        out.append(trigger(stats.trigger))
    total = sum(each.frames for each in stats.buses) or 1
    out += [bus(each, stats.rate * each.frames / total) for each in stats.buses]
    if counts is not None:
        out.append(estimator(counts))
    out += ending(now)
    if now.scale:
        out.append(HealthLine(now.scale, wrong=True))
    if now.unsaved:
        out.append(HealthLine(now.unsaved, wrong=True))
    if now.elapsed > MISSING_AFTER_S:
        missing = now.missing if received(now) else ()
        out += [HealthLine(sentence, wrong=True) for sentence in (*silent(now), *missing)]
    return out


def received(now: World) -> bool:
    """Whether any bus has given a frame that is no error frame."""
    return any(each.frames > each.errors for each in now.recorder.buses)


def silent(now: World) -> list[str]:
    """A sentence for each bus that has given no frame but error frames, or one for all of them."""
    quiet = [each for each in now.recorder.buses if each.frames <= each.errors]
    named = (
        [(f"{each.name}: ", each.errors) for each in quiet] if received(now) else [("", now.recorder.errors)]
    )
    return [
        f"{name}no frames received{f' but {errors:,} error frames' if errors else ''}: {SILENT_BUS}"
        for name, errors in named
    ]


def recorder(stats: Stats) -> HealthLine:
    """The recorder in one line.

    Example:
        >>> from pathlib import Path
        >>> recorder(Stats("recording", Path("a.blf"), 1200, 1200, 2_500_000, 0.0, 0, 0, 0, 0.01, 0, None, ())).text
        'recording a.blf   1,200 frames, 2.5 MB'
    """
    path, files, dropped, unwritten = stats.path or "", stats.files, stats.drops_disk, stats.events_unwritten
    if stats.state.startswith("failed"):
        many = f"{files:,} files, the latest {path}" if files > 1 else path
        text = f"RECORDING {stats.state}   {stats.written:,} of {stats.frames:,} frames are in {many}"
        return HealthLine(text, wrong=True)
    if not path:
        return HealthLine(f"not recording   {stats.frames:,} frames seen")
    late = f"   the disk is {stats.lag:.1f} s behind" if stats.lag > MAX_LAG_S else ""
    lost = f"   {dropped:,} frames NOT RECORDED: the disk or the computer is too slow" if dropped else ""
    lost += f"   {unwritten:,} events are NOT IN THE JOURNAL" if unwritten else ""
    many = f" (file {files})" if files > 1 else ""
    text = f"{stats.state} {path}{many}   {stats.written:,} frames, {file_size(stats.bytes)}{late}{lost}"
    return HealthLine(text, stats.lag > MAX_LAG_S or dropped > 0 or unwritten > 0)


def trigger(stats: TriggerStats) -> HealthLine:
    """A triggered recording in one line.

    Example:
        >>> trigger(TriggerStats("armed", "", 2, 12_000)).text
        'armed   2 windows recorded   12,000 frames in memory'
    """
    state, condition, windows, buffered = stats
    many = f"{windows:,} window{'' if windows == 1 else 's'} recorded   {buffered:,} frames in memory"
    if state == "recording_all":
        return HealthLine(f"the trigger is not evaluated: everything is recorded   {many}", wrong=True)
    return HealthLine(f"{f'trigger: {condition}' if condition else 'armed'}   {many}")


def bus(stats: BusStats, rate: float) -> HealthLine:
    """One bus in one line; `rate`: frames/s.

    Example:
        >>> bus(BusStats("socketcan can0", "open", 1200, 0, 0, 0.12, "error_active"), 410.0).text
        'socketcan can0: open   1,200 frames   410/s   load 12 %   0 dropped   0 error frames'
    """
    share = f"   load {100 * stats.load:.0f} %" if stats.load == stats.load else ""
    fault = stats.controller if stats.controller not in ("", "error_active") else ""
    text = f"{stats.name}: {stats.state}   {stats.frames:,} frames   {rate:,.0f}/s{share}"
    text += f"   {stats.drops:,} dropped   {stats.errors:,} error frames"
    if stats.impossible:
        text += f"   {stats.impossible:,} invalid frames left out"
    if stats.tec is not None and stats.rec is not None:
        text += f"   TEC {stats.tec}, REC {stats.rec}"
    text += f"   controller {readable(fault)}" if fault else ""
    wrong = bool(stats.drops or stats.errors or fault or stats.impossible) or stats.state.startswith("lost")
    return HealthLine(text, wrong)


def estimator(counts: Counts) -> HealthLine:
    """The estimators' process in one line.

    Example:
        >>> estimator(Counts(offered=1000, done=990, dropped=0, restarts=0, ready=True)).text
        'estimating   10 frames behind'
    """
    dropped, restarts = counts.dropped, counts.restarts
    trouble = f"   {dropped:,} frames not estimated, {restarts} restarts" if dropped or restarts else ""
    if not counts.ready:
        waiting = f"the estimators are starting   {_behind(counts):,} frames waiting"
        return HealthLine(f"{waiting}{trouble}", bool(trouble))
    return HealthLine(f"estimating   {_behind(counts):,} frames behind{trouble}", bool(trouble))


def _behind(counts: Counts) -> int:
    return max(counts.offered - counts.done - counts.dropped, 0)


def ending(now: World) -> list[HealthLine]:
    """What the end of this session waits for; none: nothing, or it has not come."""
    behind = 0 if now.estimator is None else _behind(now.estimator)
    return stopping(now.recorder.waiting, behind) if now.stopping else []


def stopping(waiting: int, behind: int) -> list[HealthLine]:
    """What the end of a session waits for; none: nothing.

    Example:
        >>> stopping(12_000, 0)[0].text
        'stopping: 12,000 frames still to be written; a signal now ends at once'
    """
    if not (waiting or behind):
        return []
    what = (
        f"{waiting:,} frames still to be written" if waiting else f"{behind:,} frames still to be estimated"
    )
    return [HealthLine(f"stopping: {what}; a signal now ends at once", wrong=True)]
