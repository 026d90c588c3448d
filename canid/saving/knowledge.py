"""What a pipeline knows, saved and restored; tied to the vehicle and to all that gives its numbers their meaning."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from canid import __version__, downtime, pipeline
from canid.errors import OutputError
from canid.saving import validity
from canid.saving.fingerprint import fingerprint
from canid.saving.plain import Form, MismatchError, form
from canid.saving.sealed import Refused, seal, unseal
from canid.screening import watch
from canid.types import Event
from canid.vehicle import Vehicle

# s; a working day of one driver, with its breaks: after a night it is another drive, maybe another person
MAX_AGE = 12 * 3600.0

# s between two savings: what a crash can cost
EVERY = 10.0

# Parts of a vehicle that give no number its meaning; the name is compared by itself.
_WORDS_ONLY = ("name", "path", "dbc", "warnings")
_SHOWN = {
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


class Keeping(NamedTuple):
    """How one vehicle's pipeline is saved and restored: pure functions."""

    save: Callable[[pipeline.Known, float], bytes]  # of what is known, and now in s since 1970
    restore: Callable[[bytes, float], Restored | Refused]  # the same way round


def keeping(vehicle: Vehicle, running: pipeline.Pipeline, dt: float = pipeline.DT) -> Keeping:
    """Make saving and restoring of one vehicle's pipeline.

    Args:
        vehicle: from `read_vehicle`.
        running: its pipeline, with estimators.
        dt: the grid's step, s.

    Returns:
        `save(known, utc) -> bytes` and `restore(bytes, utc) -> Restored | Refused`: all of it, or nothing and a
        sentence that says why. `save` raises OutputError for a state that is not what its types say.

    Example:
        >>> from canid.vehicle import read_vehicle
        >>> vehicle = read_vehicle("generic")
        >>> running = pipeline.build(vehicle)
        >>> state = running.init()
        >>> known = pipeline.Known(downtime.State(t=12.3), state.estimators, state.agreement, state.screen)
        >>> save, restore = keeping(vehicle, running)
        >>> restore(save(known, 1e9), 1e9 + 60.0).known.time.t
        12.3
        >>> restore(save(known, 1e9), 1e9 + 86400.0).says
        'the saved state was saved 24.0 h ago, more than 12 h: another drive, maybe another person'
    """
    body = _form(running.init())
    configuration = _configuration(vehicle, dt, body)

    def save(known: pipeline.Known, utc: float) -> bytes:
        try:
            plain = body.encode(tuple(known))
        except MismatchError as error:
            raise OutputError(f"the state cannot be saved: {error}") from error
        return seal(
            {
                "canid": __version__,
                "vehicle": vehicle.name,
                "configuration": configuration,
                "saved_utc": float(utc),
                "session_time": known.time.t,
                "known": plain,
            }
        )

    def restore(data: bytes, utc: float) -> Restored | Refused:
        fields = unseal(data)
        if isinstance(fields, Refused):
            return fields
        foreign = _foreign(fields, vehicle.name, configuration, utc)
        if foreign:
            return Refused(f"the saved state {foreign}")
        try:
            known = pipeline.Known(*body.decode(fields.get("known")))
        except MismatchError as error:
            return Refused(f"the saved state is damaged: {error}")
        wrong = validity.check(known, vehicle, dt)
        if wrong:
            return Refused(f"the saved state makes no sense: {wrong}")
        return Restored(known, utc - fields["saved_utc"])

    return Keeping(save, restore)


def go_on(
    running: pipeline.Pipeline, keep: Keeping, saved: bytes, utc: float, t: float = 0.0
) -> tuple[pipeline.State, Event]:
    """Begin from a saved state, or anew where it is refused.

    Args:
        running: the pipeline.
        keep: its saving and restoring.
        saved: what `keep.save` has returned, or anything else.
        utc: now, s since 1970.
        t: now, s of session time.

    Returns:
        the pipeline's state, and what the user is told.
    """
    found = keep.restore(saved, utc)
    if isinstance(found, Refused):
        return running.init(), Event(t, "state_refused", f"{found.says}; the estimators start anew")
    says = f"the estimators go on from the state that was saved {max(found.age, 0.0):.0f} s ago"
    return running.resume(running.init(), found.known), Event(t, "state_restored", says)


def _form(state: pipeline.State) -> Form:
    """The plain form of `Known`, whose types are those of the estimators that this pipeline runs."""
    kinds = tuple(type(inner) for inner in state.estimators)
    return form(tuple[downtime.State, tuple[kinds], type(state.agreement), watch.State])  # type: ignore[valid-type, misc]


def _configuration(vehicle: Vehicle, dt: float, body: Form) -> dict[str, str]:
    """Fingerprints of everything that gives the numbers meaning, part by part."""
    parts: dict[str, Any] = {k: v for k, v in vehicle._asdict().items() if k not in _WORDS_ONLY}
    parts |= {"grid": dt, "state": body.structure}
    return {name: fingerprint(of) for name, of in parts.items()}


def _brief(text: object) -> str:
    """A text of the file as it stands in a sentence: cut, and on one line."""
    short = str(text)[:80] if isinstance(text, str) else type(text).__name__
    return "".join(c if c.isprintable() else "?" for c in short)


def _foreign(fields: dict[str, Any], vehicle: str, configuration: dict[str, str], utc: float) -> str:
    """Why a whole state is not for this vehicle, configuration and day; "" where it is."""
    if fields.get("canid") != __version__:
        return f"was saved by canid {_brief(fields.get('canid'))}; this is {__version__}"
    if fields.get("vehicle") != vehicle:
        return f'is of the vehicle "{_brief(fields.get("vehicle"))}", not of "{vehicle}"'
    theirs = fields.get("configuration")
    theirs = theirs if isinstance(theirs, dict) else {}
    theirs = {name: of for name, of in theirs.items() if len(name) < 40}
    differ = [name for name in {**configuration, **theirs} if configuration.get(name) != theirs.get(name)]
    if differ:
        shown = ", ".join(_SHOWN.get(name, f"[{_brief(name)}]") for name in differ[:10])
        return f"is of another configuration: {shown} changed since"
    saved = fields.get("saved_utc")
    if type(saved) is not float or not 0.0 <= saved < 1e11:
        return "does not tell when it was saved"
    hours = (utc - saved) / 3600.0
    if hours > MAX_AGE / 3600.0:
        return f"was saved {hours:.1f} h ago, more than {MAX_AGE / 3600.0:g} h: another drive, maybe another person"
    if -hours > MAX_AGE / 3600.0:
        return f"was saved {-hours:.1f} h after now: this clock, or the one then, is wrong"
    return ""
