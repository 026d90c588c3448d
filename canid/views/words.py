"""Numbers as people read them: an interval, a channel, a time, one line per estimate."""

from __future__ import annotations

import math

from canid.types import Channel, Estimate, Identifiable, Interval, ResidualTests, Screened, Status

# before the estimate whose number is the one to read
READ = "▶"
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
    if not math.isfinite(t):
        return "–"
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


def residual_tests(tests: ResidualTests) -> list[str]:
    """What the residuals say of the model, a line each.

    Example:
        >>> told = ResidualTests(True, 20.0, 41.6, (), ("range_rate",), True, {"range_rate": 18})
        >>> for line in residual_tests(told): print(line)
        residual white (Ljung–Box 20, bound 42)
        residual against range rate: nothing of the answer is left in the residual; the loop is closed
        residual steady: its size shows no trend
        excitation of order 18 in range rate
    """
    if tests.statistic != tests.statistic:
        return ["residual not tested: too few data"]
    white = "white" if tests.white else "not white: the noise or the dynamics have more order than the model"
    lines = [f"residual {white} (Ljung–Box {tests.statistic:.0f}, bound {tests.bound:.0f})"]
    for name in tests.excitation_order:
        left = (
            "part of the answer is not modelled"
            if name in tests.left_over
            else "nothing of the answer is left in the residual"
        )
        loop = "; the loop is closed" if name in tests.feedback else ""
        lines.append(f"residual against {INPUT_WORDS.get(name, name)}: {left}{loop}")
    steady = "steady: its size shows no trend" if tests.stationary else "not steady: its size has a trend"
    order = ", ".join(f"{n} in {INPUT_WORDS.get(name, name)}" for name, n in tests.excitation_order.items())
    return [*lines, f"residual {steady}", f"excitation of order {order}"]


def estimate(e: Estimate) -> str:
    """One estimate in one plain line; marked where it is the one to read.

    Example:
        >>> K = Channel(Interval(4.4, 3.6, 5.2), status=Identifiable.GAIN_ONLY)
        >>> estimate(Estimate(60.0, "fopdt", Status.OK, "range rate: K only", {"range_rate": K}, headline=True))
        '▶    60.0 s  fopdt   ok            range rate: K 4.40 [3.60, 5.20]'
    """
    parts = [f"{READ if e.headline else ' '}{e.t:8.1f} s", f"{e.estimator:6}", f"{e.status.value:12}"]
    told = [channel(name, ch) for name, ch in e.channels.items() if ch.status is not Identifiable.NOT]
    return "  ".join(parts) + "  " + (" | ".join(told) if told and e.status is Status.OK else e.says)


def misfit(s: Screened) -> str:
    """Say since when which block is suspected, or what fits.

    Example:
        >>> misfit(Screened(90.0, False, 62.0, "vehicle", "it answers the pedal less strongly than learnt", {}))
        'since 1:02.0 the model does not fit; vehicle suspected: it answers the pedal less strongly than learnt'
        >>> misfit(Screened(240.0, True, 230.0, "", "fits what was learnt: driver", {}))
        'since 3:50.0 nothing is amiss any more; fits what was learnt: driver'
    """
    if s.since != s.since:
        return s.says
    since = f"since {clock(s.since)}" if s.since >= 0 else "since before this start"
    if s.fits:
        return f"{since} nothing is amiss any more; {s.says}"
    return f"{since} the model does not fit; {s.block} suspected: {s.says}"


def screened(s: Screened) -> str:
    """What the screen says in one plain line.

    Example:
        >>> screened(Screened(90.0, True, float("nan"), "", "fits what was learnt: driver", {}))
        '     90.0 s  screen  fits          fits what was learnt: driver'
    """
    return f" {s.t:8.1f} s  {'screen':6}  {'fits' if s.fits else 'misfit':12}  {misfit(s)}"
