"""What of a drive is left out of every fit: stretches without a driver or without valid inputs, and wrong signals."""

from __future__ import annotations

import numpy as np

from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect, MaskInput
from canid.signals.signal_checks.drive_time import trusted
from canid.signals.signal_checks.signal_checks import sentence
from canid.values.findings import Finding, Flags, Masked
from canid.values.output_role import output_role
from canid.values.roles import assistant_of
from canid.values.runs import runs
from canid.values.types import LearnGate, SignalFinding, Trace

# finding -> effects of the catalogue by which the diagnosis names and corrects the same fault; it then goes on
CORRECTED = {
    finding: frozenset(effect.id for effect in CATALOGUE if finding in effect.findings)
    for finding in {finding for effect in CATALOGUE for finding in effect.findings}
}
# findings that the diagnosis judges by itself, over the whole drive
JUDGED = frozenset(finding for effect in CATALOGUE for finding in effect.judges)


def untrusted(trace: Trace, named_findings: tuple[Finding, ...]) -> tuple[SignalFinding, ...]:
    """Select the findings on signals that nothing has corrected.

    Args:
        trace: of a drive, with the findings on its signals.
        named_findings: effects that the sensing block has named.
    """
    named = {finding.effect for finding in named_findings}
    return tuple(
        signal_finding
        for signal_finding in trace.findings
        if signal_finding.withholds
        and signal_finding.name not in JUDGED
        and not named & CORRECTED.get(signal_finding.name, frozenset())
    )


def left_out(trace: Trace, several: tuple[SignalFinding, ...]) -> tuple[Flags, tuple[Masked, ...]]:
    """Return the samples that no finding touches, (n,), and the stretches that one does."""
    end = float(trace.t[-1] + trace.dt) if trace.t.size else 0.0
    stretches = (
        Masked(
            signal_finding.name,
            signal_finding.since,
            signal_finding.until if signal_finding.until == signal_finding.until else end,
        )
        for signal_finding in several
    )
    return trusted(trace.t, several), tuple(stretches)


def lacking_signals(several: tuple[SignalFinding, ...], sound: Flags, seconds: float, dt: float) -> str:
    """Say which wrong signal leaves too little of a drive; "": enough is left.

    Args:
        several: findings that nothing has corrected.
        sound: (n,) samples that they do not touch.
        seconds: that a diagnosis needs.
        dt: s.
    """
    if not several or float(sound.sum()) * dt >= seconds:
        return ""
    return "; ".join(sentence(signal_finding) for signal_finding in several)


# s; two stretches of one mask with less between them are reported as one
MIN_GAP_S = 1.0
# roles of the output that are a person's
PERSONAL = ("pedal", "steering_angle")


def recognise(trace: Trace, catalogue: tuple[Effect, ...] = CATALOGUE) -> tuple[Flags, tuple[Masked, ...]]:
    """Apply every mask of the catalogue to a drive.

    Args:
        trace: of a drive.
        catalogue: the effects; those without a mask are skipped.

    Returns:
        (n,) samples outside of every mask and of the driver's recovery after it; and the stretches, in the order of
        their starts, without recovery.

    Samples without a lead, at standstill, braked or hidden by the pedal's floor are handled by the learning gate and the
    likelihood: they stay True unless a mask covers them.
    """
    missing = np.array([gate is LearnGate.STALE for gate in trace.gate], dtype=bool)
    drive = mask_input(trace)._replace(missing=missing)
    usable = np.ones(trace.t.size, dtype=bool)
    masked_stretches: list[Masked] = []
    for effect in catalogue:
        if effect.mask is None:
            continue
        flags = effect.mask(drive)
        usable &= ~extended(flags, round(effect.recovery / trace.dt))
        masked_stretches += [Masked(effect.id, start, stop) for start, stop in stretches(flags, trace)]
    return usable, tuple(sorted(masked_stretches, key=lambda masked: masked.start))


def mask_input(trace: Trace) -> MaskInput:
    """Return what masks are computed from."""
    role = output_role(trace)
    signals = trace.signals
    assistant = assistant_of(role, signals)
    if assistant in signals:
        # to the masks it is what cruise control is
        signals = {**signals, "cruise_active": signals[assistant]}
    return MaskInput(trace.t, trace.dt, signals, trace.segment.astype(np.float64), role in PERSONAL)


def extended(flags: Flags, samples: int) -> Flags:
    """Extend each stretch of True by so many samples.

    Example:
        >>> extended(np.array([False, True, False, False, False]), 2)
        array([False,  True,  True,  True, False])
    """
    index = np.arange(flags.size)
    last = np.maximum.accumulate(np.where(flags, index, -1 - samples))
    out: Flags = index - last <= samples
    return out


def stretches(flags: Flags, trace: Trace) -> list[tuple[float, float]]:
    """Return start and stop of each stretch, s; those with less than `MIN_GAP_S` between them are one."""
    out: list[tuple[float, float]] = []
    for first, stop in runs(flags):
        start, end = float(trace.t[first]), float(trace.t[stop - 1] + trace.dt)
        if out and start - out[-1][1] < MIN_GAP_S:
            out[-1] = (out[-1][0], end)
        else:
            out.append((start, end))
    return out
