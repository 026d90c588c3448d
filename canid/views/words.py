"""Numbers as people read them: an interval, a channel, a time, one line per estimate."""

from __future__ import annotations

from canid.types import Channel, Estimate, Identifiable, Interval

SYMBOLS = {"K": "K", "tau": "τ", "dead_time": "θ", "tau_plus_dead_time": "τ+θ"}
OUTPUT_UNITS = {"pedal": "%", "accel": "m/s²", "accel_command": "m/s²", "steering_angle": "°"}
INPUT_UNITS = {"headway_error": "s", "range_rate": "m/s", "lateral_offset": "m"}
INPUT_WORDS = {
    "headway_error": "headway error",
    "range_rate": "range rate",
    "lateral_offset": "lateral offset",
}


def interval(iv: Interval, digits: int = 2) -> str:
    """Value and 95 % band.

    Example:
        >>> interval(Interval(4.412, 3.58, 5.21))
        '4.41 [3.58, 5.21]'
        >>> interval(Interval())
        '–'
    """
    if iv.value != iv.value:
        return "–"
    return f"{iv.value:.{digits}f} [{iv.low:.{digits}f}, {iv.high:.{digits}f}]"


def clock(t: float) -> str:
    """Seconds as minutes and seconds.

    Example:
        >>> clock(83.25)
        '1:23.2'
    """
    minutes, seconds = divmod(max(t, 0.0), 60.0)
    return f"{int(minutes)}:{int(seconds * 10) / 10:04.1f}"


def lag(ch: Channel) -> str:
    """What can be told of the delays.

    Example:
        >>> lag(Channel(tau_plus_dead_time=Interval(0.8, 0.7, 0.9), status=Identifiable.SUM_ONLY))
        'τ+θ 0.80 [0.70, 0.90] s'
    """
    if ch.status is Identifiable.OK:
        return f"τ {interval(ch.tau)} s  θ {interval(ch.dead_time)} s"
    if ch.status is Identifiable.SUM_ONLY:
        return f"τ+θ {interval(ch.tau_plus_dead_time)} s"
    return ""


def channel(name: str, ch: Channel) -> str:
    """One channel in one line."""
    words = INPUT_WORDS.get(name, name)
    if ch.status is Identifiable.NOT:
        return f"{words}: not identifiable"
    return f"{words}: K {interval(ch.K)}  {lag(ch)}".rstrip()


def estimate(e: Estimate) -> str:
    """One estimate in one plain line."""
    parts = [f"{e.t:8.1f} s", f"{e.estimator:6}", f"{e.status.value:12}"]
    told = [channel(name, ch) for name, ch in e.channels.items() if ch.status is not Identifiable.NOT]
    return "  ".join(parts) + "  " + (" | ".join(told) if told and e.status.value == "ok" else e.says)
