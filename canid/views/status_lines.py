"""Recorder, buses and estimators in one line each: what a user must see of them, and what is wrong."""

from __future__ import annotations

from canid.views.names import readable
from canid.views.numbers import file_size
from canid.views.terminal_view.state import HealthLine

# s between a frame's arrival and its writing above which the line is red: 0.25 is promised, a busy machine adds to it
MAX_LAG_S = 0.4


def recorder(
    state: str,
    path: str,
    frames: int,
    written: int,
    size: int,
    lag: float,
    dropped: int = 0,
    files: int = 1,
    events_unwritten: int = 0,
) -> HealthLine:
    """The recorder in one line.

    Example:
        >>> recorder("recording", "a.blf", 1200, 1200, 2_500_000, 0.01).text
        'recording a.blf   1,200 frames, 2.5 MB'
    """
    if state.startswith("failed"):
        return HealthLine(f"RECORDING {state}   {written:,} of {frames:,} frames are in {path}", wrong=True)
    if not path:
        return HealthLine(f"not recording   {frames:,} frames seen")
    late = f"   the disk is {lag:.1f} s behind" if lag > MAX_LAG_S else ""
    lost = f"   {dropped:,} frames NOT RECORDED: the disk is too slow" if dropped else ""
    lost += f"   {events_unwritten:,} events are NOT IN THE JOURNAL" if events_unwritten else ""
    many = f" (file {files})" if files > 1 else ""
    text = f"{state} {path}{many}   {written:,} frames, {file_size(size)}{late}{lost}"
    return HealthLine(text, lag > MAX_LAG_S or dropped > 0 or events_unwritten > 0)


def trigger(state: str, condition: str, windows: int, buffered: int) -> HealthLine:
    """A triggered recording in one line.

    Example:
        >>> trigger("armed", "", 2, 12_000).text
        'armed   2 windows recorded   12,000 frames in memory'
    """
    many = f"{windows:,} window{'' if windows == 1 else 's'} recorded   {buffered:,} frames in memory"
    if state == "recording_all":
        return HealthLine(f"the trigger is not evaluated: everything is recorded   {many}", wrong=True)
    return HealthLine(f"{f'trigger: {condition}' if condition else 'armed'}   {many}")


def stopping(waiting: int, behind: int) -> HealthLine | None:
    """What the end of a session waits for; None: nothing.

    Example:
        >>> stopping(12_000, 0).text
        'stopping: 12,000 frames still to be written; a second signal ends at once'
    """
    if not (waiting or behind):
        return None
    what = (
        f"{waiting:,} frames still to be written" if waiting else f"{behind:,} frames still to be estimated"
    )
    return HealthLine(f"stopping: {what}; a second signal ends at once", wrong=True)


def bus(
    name: str,
    state: str,
    frames: int,
    rate: float,
    load: float,
    drops: int,
    errors: int,
    controller: str,
    counters: tuple[int, int] | None = None,
    impossible: int = 0,
) -> HealthLine:
    """One bus in one line.

    Example:
        >>> bus("socketcan can0", "open", 1200, 410.0, 0.12, 0, 0, "error_active").text
        'socketcan can0: open   1,200 frames   410/s   load 12 %   0 dropped   0 error frames'
    """
    share = f"   load {100 * load:.0f} %" if load == load else ""
    fault = controller if controller not in ("", "error_active") else ""
    text = f"{name}: {state}   {frames:,} frames   {rate:,.0f}/s{share}   {drops:,} dropped   {errors:,} error frames"
    if impossible:
        text += f"   {impossible:,} invalid frames left out"
    if counters is not None:
        text += f"   TEC {counters[0]}, REC {counters[1]}"
    text += f"   controller {readable(fault)}" if fault else ""
    return HealthLine(text, bool(drops or errors or fault or impossible) or state.startswith("lost"))


def estimator(ready: bool, offered: int, done: int, dropped: int, restarts: int) -> HealthLine:
    """The estimators' process in one line.

    Example:
        >>> estimator(True, 1000, 990, 0, 0).text
        'estimating   10 frames behind'
    """
    trouble = f"   {dropped:,} frames not estimated, {restarts} restarts" if dropped or restarts else ""
    behind = max(offered - done - dropped, 0)
    if not ready:
        return HealthLine(f"the estimators are starting   {behind:,} frames waiting{trouble}", bool(trouble))
    return HealthLine(f"estimating   {behind:,} frames behind{trouble}", bool(trouble))
