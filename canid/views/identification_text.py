"""A drive's parameters as text."""

from __future__ import annotations

from canid.drive_parameters import Identified
from canid.estimators import step_watch
from canid.estimators.estimator import WholeDrive
from canid.identification.armax.order_selection import Candidate
from canid.systems.identified_loop import IdentifiedLoop
from canid.views import estimate_text, signal_text
from canid.views.numbers import interval, number

# candidates of the order selection that are listed
ORDERS_SHOWN = 3


def text(drive: Identified, log: str, vehicle: str, output: str = "") -> list[str]:
    """What `canid identify --windows` prints first: estimates over sliding windows, then each model of the whole drive.

    `output`: role of the driver's output, for the unit of K.
    """
    lines = [f"{log}: {vehicle}, {signal_text.time(drive.time)}", *signal_text.findings(drive.findings), ""]
    reported: set[float] = set()
    for e in drive.windows:
        # the minutes after a change all carry it
        if e.change is not None and e.change.t.value not in reported:
            reported.add(e.change.t.value)
            lines.append(f"           {step_watch.says(e.change)}")
        lines.append(estimate_text.estimate(e, output))
    lines += [""] if drive.windows else []
    for name in drive.ranked:
        lines += _whole(name.upper(), drive.whole[name], output)
    return lines + _loop(drive.loop) + _orders(drive.orders)


def _whole(name: str, found: WholeDrive | None, output: str) -> list[str]:
    if found is None:
        return [f"whole drive, {name}: no model (too few data, or no stable model)"]
    fit = f", fit {number(found.fit_percent, '%')}" if found.fit_percent is not None else ""
    tests = estimate_text.residual_tests(found.residual_tests) if found.residual_tests is not None else []
    missing = estimate_text.all_missing(found.channels, output)
    # where the gains changed, the lines hold those of each stretch
    channels = {} if found.details.get("changes") else found.channels
    return [
        f"whole drive, {name}{found.specification}{fit}",
        *(f"  {estimate_text.channel(input_name, ch, output, None)}" for input_name, ch in channels.items()),
        *(f"  {line}" for line in (*([missing] if missing else []), *found.lines, *tests)),
    ]


def _loop(loop: IdentifiedLoop) -> list[str]:
    """Margins and string stability with the car, or why there are none."""
    if loop.says:
        return [f"driver and car: no margins: {loop.says}"]

    car = (
        f", car of {interval(loop.car.strength)} m/s² per %, lag {interval(loop.car.lag, 's')}"
        if loop.car
        else ""
    )
    if loop.string_peak.low > 1.0:
        verdict = "motion of the lead is amplified"
    elif loop.string_peak.high > 1.0:
        verdict = f"amplified in {100 * loop.amplifying:.0f} % of the draws: not decided"
    else:
        verdict = "motion of the lead is not amplified"
    at = f" at {number(loop.string_peak_frequency.value)} Hz" if loop.string_peak.value > 1.0 else ""
    unstable = f"; {100 * loop.unstable:.1f} % of the draws are unstable" if loop.unstable > 0.0 else ""
    return [
        f"driver and car at {loop.speed:.1f} m/s and {loop.headway:.1f} s of headway{car}",
        f"  phase margin {interval(loop.phase_margin, '°')}, gain margin {interval(loop.gain_margin)}, "
        f"delay margin {interval(loop.delay_margin, 's')}, modulus margin {interval(loop.modulus_margin)}{unstable}",
        f"  largest |v/v_lead| {interval(loop.string_peak)}{at}: {verdict}",
    ]


def _orders(candidates: tuple[Candidate, ...]) -> list[str]:
    best = ", ".join(
        f"({c.orders.na},{c.orders.nb},{c.orders.nc}) nk {c.orders.nk}{' white' if c.white else ''}"
        for c in candidates[:ORDERS_SHOWN]
    )
    return [f"best orders of ARMAX by BIC: {best}"] if best else []
