"""What may be quoted of an identified drive, in one or two sentences, and what withholds the rest."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.response_sentence import response
from canid.mathematics.identification.identifiability import gain_only, quotable
from canid.signals.signal_checks.drive_time import too_short
from canid.signals.signal_checks.signal_checks import sentence
from canid.values.text import estimate_text
from canid.values.text.names import SYMBOLS, capitalised, readable
from canid.values.text.numbers import gain_unit, interval
from canid.values.types import QUOTED, Channel, Identifiable, LearnGate, Status


class IdentificationVerdict(NamedTuple):
    """The result of a drive in words."""

    kind: str  # "identified": all may be quoted; "partly"; "changed": per stretch only; "nothing"
    title: str
    says: str  # the numbers that may be quoted, with units
    withheld: str  # what may not be quoted, and why; "": nothing
    scale: str = (
        ""  # where K may be quoted of a pedal: what says that its scale is right, or that nothing does
    )

    @property
    def identifiable(self) -> bool:
        """Whether anything may be quoted."""
        return self.kind != "nothing"


def verdict(drive: Identified, output: str = "") -> IdentificationVerdict:
    """The verdict on a drive.

    Args:
        drive: from `identify`.
        output: role of the driver's output, for the unit of K.

    Example:
        >>> from canid.mathematics.estimators.estimator import WholeDrive
        >>> from canid.values.types import Interval
        >>> K = Channel(Interval(5.6, 5.0, 6.2), status=Identifiable.GAIN_ONLY)
        >>> result = Identified(60.0, 50.0, (), {"fopdt": WholeDrive({"range_rate": K})}, ())
        >>> verdict(result, "pedal").says
        'The driver presses the pedal by 5.6 [5.0, 6.2] % more for each m/s by which the lead is faster.'
    """
    said = _without_scale(drive, output)
    scale = drive.output_scale
    if scale is None or not said.identifiable:
        return said
    return said._replace(scale=f"{capitalised(scale.says)}.")


def _without_scale(drive: Identified, output: str) -> IdentificationVerdict:
    """The same but for the scale of the output."""
    headline = drive.headline
    if headline is not None and headline.details.get("changes"):
        return _changed(drive, output)
    known = {} if headline is None else {n: c for n, c in headline.channels.items() if QUOTED[c.status]}
    if not known or headline is None:
        return IdentificationVerdict("nothing", "Nothing is identifiable", "", why_nothing(drive, output))
    whole = all(c.status is Identifiable.OK for c in headline.channels.values())
    says = response(known, output)
    kind, title = (
        ("identified", "The driver is identified")
        if whole
        else ("partly", "The driver is identified in part")
    )
    return IdentificationVerdict(kind, title, says, _withheld(headline.channels, _against(drive), output))


def quoted(name: str, channel: Channel, output: str) -> str:
    """The numbers of a channel that may be quoted, with their 95 % intervals and units.

    Example:
        >>> from canid.values.types import Interval
        >>> K = Channel(Interval(5.6, 5.0, 6.2), status=Identifiable.GAIN_ONLY)
        >>> quoted("range_rate", K, "accel")
        'K 5.6 [5.0, 6.2] m/s² per m/s'
    """
    unit = gain_unit(output, name) if output else ""
    return ", ".join(
        f"{SYMBOLS[what]} {interval(getattr(channel, what), unit if what == 'K' else 's')}"
        for what in QUOTED[channel.status]
    )


def why_nothing(drive: Identified, output: str = "") -> str:
    """Why nothing may be quoted, and what to do; `output`: role of the driver's output, for the unit of K."""
    headline = drive.headline
    wrong = [sentence(finding) for finding in drive.findings if finding.withholds]
    if wrong:
        return f"{capitalised(wrong[0])}."
    short = too_short(drive.time)
    if short:
        return f"{capitalised(short)}."
    if drive.time.usable == 0.0:
        return f"No sample is usable for identification: {_most_frequent(drive) or LearnGate.NO_LEAD.value}."
    against = _against(drive)
    if against:
        return f"{capitalised(against)}."
    missing = "" if headline is None else estimate_text.all_missing(headline.channels, output)
    used = f"{drive.time.usable:.0f} s are usable for identification"
    few = "too few for a model: follow a vehicle whose speed changes, for longer"
    # a model that was not fitted has no number at all; else what most windows lack says more
    fitted = headline is not None and any(math.isfinite(c.K.value) for c in headline.channels.values())
    reason = missing or (fitted and _most_frequent(drive)) or few
    return f"{used}; {reason}."


def _against(drive: Identified) -> str:
    """What speaks against the model of the whole drive."""
    headline = drive.headline
    return "" if headline is None else str(headline.details.get("says", ""))


def _most_frequent(drive: Identified) -> str:
    """The sentence that most windows without an estimate give."""
    counts = Counter(e.says for e in drive.windows if e.status is not Status.OK and e.says)
    return counts.most_common(1)[0][0] if counts else ""


def _withheld(channels: Mapping[str, Channel], against: str, output: str) -> str:
    """What may not be quoted of a drive of which something may."""
    parts = []
    for name, c in channels.items():
        if c.status is Identifiable.OK:
            continue
        lacking = {
            Identifiable.SUM_ONLY: "τ and θ apart",
            Identifiable.GAIN_ONLY: "τ and θ",
            Identifiable.NOT: "K, τ and θ",
        }[c.status]
        why = (
            ""
            if c.progress is None
            else f" ({estimate_text.missing(c.progress, gain_unit(output, name) if output else '')})"
        )
        parts.append(f"{lacking} of {readable(name)}{why}")
    said = f"Not to be quoted: {'; '.join(parts)}." if parts else ""
    return " ".join(filter(None, (said, f"{capitalised(against)}." if against else "")))


def _changed(drive: Identified, output: str) -> IdentificationVerdict:
    """The gains stepped: only the numbers of the stretches may be quoted."""
    headline = drive.headline
    details = {} if headline is None else headline.details
    times = ", ".join(f"{change.t.value:.0f} s" for change in details["changes"])
    count = len(details["changes"])
    parts = []
    for segment in details["segments"]:
        known = [
            f"{readable(name)} {quoted(name, gain_only(c), output)}"
            for name, c in segment["channels"].items()
            if quotable(c, "K")
        ]
        if known:
            parts.append(f"{segment['start']:.0f}–{segment['stop']:.0f} s: {', '.join(known)}")
    kind = "changed" if parts else "nothing"
    return IdentificationVerdict(
        kind,
        "The driver changed during the drive" if parts else "Nothing is identifiable",
        f"{'; '.join(parts)}." if parts else "",
        f"The gains changed {count} time{'s' * (count > 1)} (at {times}): no number holds for the whole drive.",
    )
