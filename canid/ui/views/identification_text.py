"""A drive's parameters as text: a summary of some twenty lines, and with --windows every estimate and model."""

from __future__ import annotations

from collections.abc import Iterable

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.identification_verdict import IdentificationVerdict, verdict
from canid.mathematics.estimators import step_watch
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.armax.order_selection import Candidate
from canid.mathematics.systems.identified_loop import IdentifiedLoop
from canid.ui.views import signal_text
from canid.ui.views.document.document_text import wrapped
from canid.ui.views.document.screen import Part, cut
from canid.values.text import estimate_text
from canid.values.text.names import HEADLINE_MARK, readable
from canid.values.text.numbers import fit_text, gain_unit, interval, number
from canid.values.types import NAN, Identifiable, ResidualTests

# lines of a terminal of 24 and one: a verdict on one screen
MAX_LINES = 25
# findings, changes, and candidates of the order selection that are listed; the others are counted
LISTED = 3


def summary(
    drive: Identified, log: str = "", vehicle: str = "", output: str = "", windows: str = ""
) -> list[str]:
    """What `canid identify` prints: at most `MAX_LINES` of `WIDTH` columns.

    Args:
        drive: from `identify`.
        log: its name, which is never cut; default: as it was identified.
        vehicle: its name; the same.
        output: role of the driver's output, for the unit of K; the same.
        windows: how to see the estimates over sliding windows; empty: they are shown already.

    Example:
        >>> summary(Identified(60.0, 0.0, (), {}, ()), "a.blf", "car")[:2]
        ['a.blf', 'car, 0 s, driving 0 s, behind a lead 0 s, usable for identification 0 s']
    """
    output = output or drive.drive_summary.output
    said = verdict(drive, output)
    about = f"{vehicle or drive.vehicle or 'vehicle not named'}, {signal_text.time(drive.time)}"
    parts = [
        Part([log or drive.log or "drive", *wrapped(about)], 2),
        Part(wrapped(_said(drive, said)), 3),
        Part(wrapped(said.scale) if said.scale else [], 3 if is_open(drive) else 1),
        Part(_findings(drive), 2),
    ]
    for name in drive.ranked if said.identifiable else ():
        first = name == drive.ranked[0]
        parts.append(
            Part(_method(f"{HEADLINE_MARK} " * first, name, drive.whole[name], output), 3 if first else 1)
        )
    if said.identifiable:
        tests = None if drive.headline is None else drive.headline.residual_tests
        residuals = [] if tests is None else wrapped(f"residuals: {residual_sentence(tests)}")
        changed = [
            line for says in changes(drive.headline, output) for line in wrapped(says, hang=_hang(says))
        ]
        parts += [Part(changed, 1), Part(residuals, 1), Part(_loop(drive.loop, said.withheld), 1)]
        parts.append(Part(_order(drive.orders), 0))
    if windows:
        some = f"{len(drive.windows)} windows" if drive.windows else "sliding windows"
        parts.append(Part([f"{some}: {windows}"], 1))
    return cut(parts, MAX_LINES)


def text(drive: Identified, log: str, vehicle: str, output: str = "") -> list[str]:
    """What `canid identify --windows` prints first: estimates over sliding windows, then each model of the whole drive.

    `output`: role of the driver's output, for the unit of K.
    """
    lines = [f"{log}: {vehicle}, {signal_text.time(drive.time)}", *signal_text.findings(drive.findings)]
    lines += [*(f"limit: {end.says}" for end in drive.output_limits), ""]
    reported: set[float] = set()
    for e in drive.windows:
        # the minutes after a change all carry it
        if e.change is not None and e.change.t.value not in reported:
            reported.add(e.change.t.value)
            lines.append(f"           {step_watch.says(e.change)}")
        lines.append(estimate_text.estimate(e, output))
    lines += [""] if drive.windows else []
    for name in drive.ranked:
        lines += _whole(name, drive.whole[name], output)
    return [*lines, *loop_lines(drive.loop), *_orders(drive.orders)]


def several(verdicts: Iterable[tuple[str, str]]) -> list[str]:
    """One line per log, after the summaries of several logs.

    Args:
        verdicts: name of the log, and title of its verdict.

    Example:
        >>> several([("a.blf", "Nothing is identifiable"), ("b.blf", "The driver is identified")])
        ['1 of 2 logs: something is identifiable', '  a.blf: nothing is identifiable', '  b.blf: the driver is identified']
    """
    rows = list(verdicts)
    known = sum(title != "Nothing is identifiable" for _, title in rows)
    lines = [f"{known} of {len(rows)} logs: something is identifiable"]
    return lines + [f"  {log}: {title[0].lower()}{title[1:]}" for log, title in rows]


def _said(drive: Identified, said: IdentificationVerdict) -> str:
    """The verdict, without a finding that follows; of a change without the numbers, which follow stretch by stretch."""
    if not said.identifiable and any(finding.withholds for finding in drive.findings):
        return f"{said.title}: a signal that the model needs is wrong."
    return " ".join(filter(None, (f"{said.title}.", said.says * (said.kind != "changed"), said.withheld)))


def is_open(drive: Identified) -> bool:
    """Whether nothing confirms the scale of the output."""
    return drive.output_scale is not None and not drive.output_scale.confirmed


def _hang(line: str) -> str:
    """What the second and later lines begin with: two columns more than the first."""
    return " " * (len(line) - len(line.lstrip()) + 2)


def _findings(drive: Identified) -> list[str]:
    """Findings on the signals."""
    limits = [line for end in drive.output_limits for line in wrapped(f"limit: {end.says}")]
    if not drive.findings:
        return ["signals: no finding", *limits]
    lines = [line for says in signal_text.findings(drive.findings[:LISTED]) for line in wrapped(says)]
    return limits + lines + _more(len(drive.findings), "  and {} more")


def _more(count: int, says: str) -> list[str]:
    return [says.format(count - LISTED)] if count > LISTED else []


def title(name: str, result: WholeDrive | None, kind: str = "") -> str:
    """A method over the whole drive: its model, and the fit; `kind` of it, where that is to be said."""
    if result is None:
        return f"whole drive, {name.upper()}: no model (too few data, or no stable model)"
    fit = "" if result.fit_percent is None else f", fit {fit_text(result.fit_percent)}{kind and f' ({kind})'}"
    return f"whole drive, {name.upper()}{result.specification}{fit}"


def _method(mark: str, name: str, result: WholeDrive | None, output: str) -> list[str]:
    """One method's numbers over the whole drive."""
    lines = [mark + title(name, result, "" if result is None else readable(result.fit_kind))]
    if result is not None and result.details.get("changes"):
        return [*lines, "  no number holds for the whole drive: see the changes"]
    for channel_name, channel in result.channels.items() if result is not None else ():
        lines += wrapped(f"  {estimate_text.channel(channel_name, channel, output, None)}", hang="    ")
    return lines


def _whole(name: str, result: WholeDrive | None, output: str) -> list[str]:
    """The same in full."""
    if result is None:
        return [title(name, None)]
    missing = estimate_text.all_missing(result.channels, output)
    # where the gains changed, the lines hold those of each stretch
    channels = {} if result.details.get("changes") else result.channels
    lines = [estimate_text.channel(input_name, ch, output, None) for input_name, ch in channels.items()]
    lines += [*([missing] if missing else []), *result.lines, *residual_tests(result)]
    return [title(name, result), *(f"  {line}" for line in lines)]


def residual_tests(result: WholeDrive | None) -> list[str]:
    """The residual tests of a method, a line each; none where there were none."""
    tests = None if result is None else result.residual_tests
    return [] if tests is None else estimate_text.residual_tests(tests)


def changes(result: WholeDrive | None, output: str, most: int = LISTED) -> list[str]:
    """Steps of the gains, at most `most`, and the stretches between; and whether each parameter is constant."""
    if result is None:
        return []
    steps = result.details.get("changes", ())
    if steps:
        lines = [step_watch.says(c) for c in steps[:most]]
        lines += _more(len(steps), "and {} more changes") if most < len(steps) else []
        for segment in result.details.get("segments", ()):
            known = ", ".join(
                f"{readable(name)} K {interval(c.K, gain_unit(output, name) if output else '')}"
                for name, c in segment["channels"].items()
                if c.status is not Identifiable.NOT
            )
            span = f"{segment['start']:.0f}–{segment['stop']:.0f} s"
            lines.append(f"  {span}: {known or 'no gain can be estimated'}")
        return lines
    constancy = result.details.get("constancy", ())
    if not constancy:
        return [_no_step(result)] if result.details.get("segments") == [] else []
    each = ", ".join(
        f"{readable(c['input'])} {'K' if c['parameter'] == 'K' else 'τ+θ'} "
        f"{'varies' if c['p_value'] < 0.05 else 'no change shown'} (p = {c['p_value']:.2f})"
        for c in constancy
    )
    return [f"{_no_step(result)}; {each}"]


def _no_step(result: WholeDrive) -> str:
    """That no step was found, and from which size on one would have been."""
    visible = result.details.get("visible_change", {"factor": NAN, "seconds": 0.0})
    factor, seconds = visible["factor"], visible["seconds"]
    seen = (
        f" (a step of both by ×{factor:.1f} would have shown within {seconds:.0f} s)"
        if factor == factor
        else ""
    )
    return f"changes: no step of the gains found{seen}"


def residual_sentence(tests: ResidualTests) -> str:
    """The residual tests in one sentence.

    Example:
        >>> residual_sentence(ResidualTests(True, 20.0, 41.6, (), (), True, {"range_rate": 18}))
        'white, no response left over, variance stationary'
    """
    if tests.statistic != tests.statistic:
        return "not tested: too few data"
    left = [
        f"{readable(name)}{f' ({100 * share:.0f} %)' if (share := tests.left_over_share.get(name)) is not None else ''}"
        for name in tests.left_over
    ]
    parts = (
        "white" if tests.white else "not white",
        f"a response left over to {', '.join(left)}" if left else "no response left over",
        "variance stationary" if tests.stationary else "variance not stationary",
    )
    return ", ".join(parts)


def _string(loop: IdentifiedLoop) -> str:
    """Whether the motion of the lead is amplified."""
    if loop.string_peak.low > 1.0:
        return "motion of the lead is amplified"
    if loop.string_peak.high > 1.0:
        return f"amplified in {100 * loop.amplifying:.0f} % of the draws: not decided"
    return "motion of the lead is not amplified"


def loop_lines(loop: IdentifiedLoop, withheld: str = "") -> list[str]:
    """Margins and string stability with the car, or why there are none; `withheld`: what was said before of the same."""
    reason = loop.says.partition(", nor margins")[0]
    if reason and reason.casefold() in withheld.casefold():
        return ["driver and car: no margins: they depend on what may not be quoted"]
    if loop.says:
        return [f"driver and car: no margins: {loop.says}"]
    car = (
        f", car of {interval(loop.car.strength)} m/s² per %, lag {interval(loop.car.lag, 's')}"
        if loop.car
        else ""
    )
    at = f" at {number(loop.string_peak_frequency.value)} Hz" if loop.string_peak.value > 1.0 else ""
    unstable = f"; {100 * loop.unstable:.1f} % of the draws are unstable" if loop.unstable > 0.0 else ""
    return [
        f"driver and car at {loop.speed:.1f} m/s and {loop.headway:.1f} s of headway{car}",
        f"  phase margin {interval(loop.phase_margin, '°')}, gain margin {interval(loop.gain_margin)}, "
        f"delay margin {interval(loop.delay_margin, 's')}, modulus margin {interval(loop.modulus_margin)}{unstable}",
        f"  largest |v/v_lead| {interval(loop.string_peak)}{at}: {_string(loop)}",
    ]


def _loop(loop: IdentifiedLoop, withheld: str) -> list[str]:
    """The same in two lines."""
    if loop.says:
        return wrapped(loop_lines(loop, withheld)[0])
    margins = (
        f"phase margin {interval(loop.phase_margin, '°')}, delay margin {interval(loop.delay_margin, 's')}"
    )
    return [
        *wrapped(f"driver and car at {loop.speed:.1f} m/s: {margins}"),
        *wrapped(f"  largest |v/v_lead| {interval(loop.string_peak)}: {_string(loop)}", hang="    "),
    ]


def _order(candidates: tuple[Candidate, ...]) -> list[str]:
    """The best order of ARMAX by BIC."""
    return [
        f"best order of ARMAX by BIC: ({o.na},{o.nb},{o.nc}), dead time {o.nk} sample{'s' * (o.nk != 1)}"
        for o in [c.orders for c in candidates[:1]]
    ]


def _orders(candidates: tuple[Candidate, ...]) -> list[str]:
    best = ", ".join(
        f"({c.orders.na},{c.orders.nb},{c.orders.nc}) nk {c.orders.nk}{' white' if c.white else ''}"
        for c in candidates[:LISTED]
    )
    return [f"best orders of ARMAX by BIC: {best}"] if best else []
