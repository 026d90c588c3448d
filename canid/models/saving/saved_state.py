"""Saving and restoring what a pipeline has learnt, tied to the vehicle and the configuration that give it meaning."""

from __future__ import annotations

import base64
from collections.abc import Callable
from typing import Any, NamedTuple

from canid import __version__
from canid.models.monitor import change_monitor
from canid.models.pipeline import pipeline, restart_time
from canid.models.saving import validity
from canid.models.saving.checksum import Refused, seal, unseal
from canid.models.saving.fingerprint import fingerprint
from canid.models.saving.state_codec import MAX_MESSAGE_LENGTH, Codec, MismatchError, codec
from canid.signals.signal_checks import blocks as signal_blocks
from canid.signals.signal_checks import signal_checks, standing
from canid.signals.vehicle import Vehicle
from canid.values.errors import OutputError
from canid.values.types import Event

# s; a working day of one driver, with its breaks: after a night it is another drive, perhaps another person
MAX_AGE_S = 12 * 3600.0

# s between two savings: what a crash can cost
SAVE_INTERVAL_S = 10.0

# fields of a vehicle that do not change the meaning of a number; the name is compared by itself
_DESCRIPTIVE = ("name", "path", "dbc", "warnings")
# the settings of each estimator are a part of their own
_BY_ESTIMATOR = "estimators"
_PART_NAMES = {
    "roles": "[signals] or their DBC",
    "lead": "[lead] or its DBC",
    "messages": "the DBC's messages",
    "grid": "the grid's step",
    "state": "the estimators' state",
}


class Restored(NamedTuple):
    """A saved state, whole."""

    known: pipeline.Known
    age: float  # s


class Saver(NamedTuple):
    """Saving and restoring of one vehicle's pipeline, as pure functions."""

    save: Callable[[pipeline.Known, float], bytes]  # arguments: what is known; now, s since 1970
    restore: Callable[[bytes, float], Restored | Refused]  # arguments: what was saved; now, s since 1970


def saver(vehicle: Vehicle, running: pipeline.Pipeline, dt: float = pipeline.DT) -> Saver:
    """Make the saving and restoring of one vehicle's pipeline.

    Args:
        vehicle: from `read_vehicle`.
        running: its pipeline, with estimators.
        dt: the grid's step, s.

    Returns:
        `save(known, utc) -> bytes` and `restore(bytes, utc) -> Restored | Refused`: all of it, or nothing and a
        sentence that says why. `save` raises OutputError for a state that is not what its types say.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> vehicle = read_vehicle("generic")
        >>> running = pipeline.build(vehicle)
        >>> state = running.init()
        >>> known = pipeline.known(state._replace(time=restart_time.State(t=12.3)))
        >>> save, restore = saver(vehicle, running)
        >>> restore(save(known, 1e9), 1e9 + 60.0).known.time.t
        12.3
        >>> restore(save(known, 1e9), 1e9 + 86400.0).says
        'the saved state was saved 24.0 h ago, more than 12 h: another drive, perhaps another person'
    """
    known_codec = _known_codec(running.init())
    configuration = _configuration(vehicle, dt, known_codec)

    def save(known: pipeline.Known, utc: float) -> bytes:
        try:
            encoded = known_codec.encode((*known[:-1], tuple(known.signals)))
        except MismatchError as error:
            raise OutputError(f"the state cannot be saved: {error}") from error
        return seal(
            {
                "canid": __version__,
                "vehicle": vehicle.name,
                "configuration": configuration,
                "saved_utc": float(utc),
                "session_time": known.time.t,
                "known": base64.b64encode(encoded).decode("ascii"),
            }
        )

    def restore(data: bytes, utc: float) -> Restored | Refused:
        fields = unseal(data)
        if isinstance(fields, Refused):
            return fields
        mismatch = _mismatch(fields, vehicle.name, configuration, utc)
        if mismatch:
            return Refused(f"the saved state {mismatch}")
        try:
            encoded = base64.b64decode(fields.get("known", ""), validate=True)
            known = pipeline.Known(*known_codec.decode(encoded))
            known = known._replace(signals=signal_checks.State(*known.signals))
        except (MismatchError, ValueError, TypeError) as error:
            return Refused(f"the saved state is damaged: {_brief(str(error), MAX_MESSAGE_LENGTH)}")
        wrong = validity.check(known, vehicle, dt)
        if wrong:
            return Refused(f"the saved state is implausible: {wrong}")
        return Restored(known, utc - fields["saved_utc"])

    return Saver(save, restore)


def resume(
    running: pipeline.Pipeline, saving: Saver, saved: bytes, utc: float, t: float = 0.0
) -> tuple[pipeline.State, Event]:
    """Resume from a saved state, or start fresh where it is refused.

    Args:
        running: the pipeline.
        saving: its saving and restoring.
        saved: what `saving.save` has returned, or anything else.
        utc: now, s since 1970.
        t: now, s of session time.

    Returns:
        the pipeline's state, and an event for the user.
    """
    restored = saving.restore(saved, utc)
    if isinstance(restored, Refused):
        return running.init(), Event(t, "state_refused", f"{restored.says}; the estimators start fresh")
    says = f"the estimators continue from the state saved {max(restored.age, 0.0):.0f} s ago"
    return running.resume(running.init(), restored.known), Event(t, "state_restored", says)


def _known_codec(state: pipeline.State) -> Codec:
    """Serialisation of `Known`, whose types are those of the estimators that this pipeline runs."""
    kinds = tuple(type(inner) for inner in state.estimators)
    checks = tuple(type(inner) for inner in state.signals.checks)
    signals = tuple[signal_blocks.State, standing.State, tuple[checks]]  # type: ignore[valid-type]
    return codec(
        tuple[restart_time.State, tuple[kinds], type(state.agreement), change_monitor.State, signals]  # type: ignore[valid-type, misc]
    )


def _configuration(vehicle: Vehicle, dt: float, known_codec: Codec) -> dict[str, str]:
    """Fingerprints of everything that changes the meaning of the numbers, part by part."""
    shared = {k: v for k, v in vehicle._asdict().items() if k not in (*_DESCRIPTIVE, _BY_ESTIMATOR)}
    parts: dict[str, Any] = shared | dict(vehicle.estimators)
    # what a pedal's scale rests on is a remark; the scale itself is the role's
    parts |= {"driver": vehicle.driver._replace(full_scale=None), "grid": dt, "state": known_codec.structure}
    return {name: fingerprint(settings) for name, settings in parts.items()}


def _brief(text: object, length: int = 80) -> str:
    """A text of the file for a sentence: cut, and on one line."""
    short = str(text)[:length] if isinstance(text, str) else type(text).__name__
    return "".join(c if c.isprintable() else "?" for c in short)


def _mismatch(fields: dict[str, Any], vehicle: str, configuration: dict[str, str], utc: float) -> str:
    """Say why a sound state is not for this vehicle, configuration and day; "" where it is."""
    if fields.get("canid") != __version__:
        return f"was saved by canid {_brief(fields.get('canid'))}; this is {__version__}"
    if fields.get("vehicle") != vehicle:
        return f'is of the vehicle "{_brief(fields.get("vehicle"))}", not of "{vehicle}"'
    theirs = fields.get("configuration")
    theirs = theirs if isinstance(theirs, dict) else {}
    theirs = {name: digest for name, digest in theirs.items() if len(name) < 40}
    differ = [name for name in {**configuration, **theirs} if configuration.get(name) != theirs.get(name)]
    if differ:
        shown = ", ".join(_PART_NAMES.get(name, f"[{_brief(name)}]") for name in differ[:10])
        return f"is of another configuration: {shown} changed since"
    saved = fields.get("saved_utc")
    if type(saved) is not float or not 0.0 <= saved < 1e11:
        return "does not say when it was saved"
    hours = (utc - saved) / 3600.0
    if hours > MAX_AGE_S / 3600.0:
        return f"was saved {hours:.1f} h ago, more than {MAX_AGE_S / 3600.0:g} h: another drive, perhaps another person"
    if -hours > MAX_AGE_S / 3600.0:
        return f"was saved {-hours:.1f} h after now: this clock is wrong, or the one then was"
    return ""
