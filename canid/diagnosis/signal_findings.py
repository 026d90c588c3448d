"""Findings of the signal checks in a diagnosis: which stretches of a drive a driver's cause must not be blamed for."""

from __future__ import annotations

from canid.effects import CATALOGUE
from canid.findings import Finding, Flags, Masked
from canid.signal_checks.drive_time import trusted
from canid.signal_checks.signal_checks import sentence
from canid.types import SignalFinding, Trace

# finding -> effects of the catalogue by which the diagnosis names and corrects the same fault; it then goes on
CORRECTED = {
    finding: frozenset(effect.id for effect in CATALOGUE if finding in effect.findings)
    for finding in {finding for effect in CATALOGUE for finding in effect.findings}
}
# findings that the diagnosis judges by itself, over the whole drive
JUDGED = frozenset(finding for effect in CATALOGUE for finding in effect.judges)


def untrusted(trace: Trace, found: tuple[Finding, ...]) -> tuple[SignalFinding, ...]:
    """Select the findings on signals that nothing has corrected.

    Args:
        trace: of a drive, with the findings on its signals.
        found: effects that the sensing block has named.
    """
    named = {finding.effect for finding in found}
    return tuple(
        one
        for one in trace.findings
        if one.withholds and one.name not in JUDGED and not named & CORRECTED.get(one.name, frozenset())
    )


def mask(trace: Trace, several: tuple[SignalFinding, ...]) -> tuple[Flags, tuple[Masked, ...]]:
    """Return the samples that no finding touches, (n,), and the stretches that one does."""
    end = float(trace.t[-1] + trace.dt) if trace.t.size else 0.0
    stretches = (Masked(one.name, one.since, one.until if one.until == one.until else end) for one in several)
    return trusted(trace.t, several), tuple(stretches)


def lacking(several: tuple[SignalFinding, ...], sound: Flags, seconds: float, dt: float) -> str:
    """Say which wrong signal leaves too little of a drive; "": enough is left.

    Args:
        several: findings that nothing has corrected.
        sound: (n,) samples that they do not touch.
        seconds: that a diagnosis needs.
        dt: s.
    """
    if not several or float(sound.sum()) * dt >= seconds:
        return ""
    return "; ".join(sentence(one) for one in several)
