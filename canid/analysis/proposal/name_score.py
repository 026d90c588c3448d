"""Score of a signal for a role by what the DBC says: name, message, unit, range, bits, value table."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from canid.analysis.proposal.name_patterns import ROLE_PATTERNS, STRONG, RolePatterns
from canid.analysis.proposal.optional_patterns import OPTIONAL_PATTERNS
from canid.analysis.proposal.signal_words import EITHER_SPEED, dbc_unit, words
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc, carried, condition_of
from canid.signals.vehicle.j1939 import first_no_value
from canid.signals.vehicle.units import factor_to, unit_of
from canid.values.roles import ROLES

PATTERNS: dict[str, RolePatterns] = {**ROLE_PATTERNS, **OPTIONAL_PATTERNS}

# points, in the same unit as those of the names (2, 4, 6)
_UNIT_FITS, _MESSAGE_FITS, _MESSAGE_AGAINST, _MESSAGE_BOTH = 3.0, 1.0, -3.0, -1.0
# a range of 0 to 100 without a unit is that of a share
_RANGE_FITS = 1.0
# a coarse copy of a value that comes finely elsewhere: displays and old protocols
_COARSE = -1.5
# each word that the pattern does not explain makes another quantity likelier
_UNEXPLAINED_WORD, _MOST_UNEXPLAINED = -0.4, -2.0
# more than any car drives, but only because the bits hold it
_ALL_BITS = -1.0
# a state with several values of unknown meaning
_UNKNOWN_STATES = -2.0
# text entries of a value table with which a number would be a state; numbers have one to three ("fault", "not available")
_MAX_TEXTS = 4
# words that say nothing about the quantity: value, actual, percent, raw, numbers
_NEUTRAL = re.compile(
    r"\b(actl|act|actual|val|value|wert|rohwert|raw|roh|pc|pct|percent\w*|pos|posn|position|sig\w*|signal|\w?\d+\w?|filt\w*|fd|can|cf|cr|avg|average|drvn|driven"
    r"|nondriven|arb|in|the|kph|kmh|mph|est|comp|ecu|ecm|rat|ratio|abs|di|esp|esc|eng|mo|\w)\b"
)
# raw numbers of a pedal without a unit: 12 bits of a converter
_MOST_PEDAL_STEPS = 4096.0
# in the role's unit: the largest value that a signal must and may be able to take
_REACH: dict[str, tuple[float, float]] = {
    "speed": (25.0, 400.0),
    "gap": (35.0, 2000.0),
    "range_rate": (8.0, 1100.0),
    "pedal": (40.0, 1100.0),
    "accel": (2.0, 400.0),
    "yaw_rate": (0.3, 40.0),
    "steering_angle": (180.0, 40000.0),
    "engine_speed": (3000.0, 70000.0),
}
# roles whose values are on both sides of zero
_SIGNED = {"range_rate", "accel", "yaw_rate", "steering_angle", "lateral_offset", "accel_command"}
# texts of value tables that mean "yes"; the texts of the others are no, off, not pressed, fault
_YES = re.compile(
    r"^(\W|_)*(.*\b)?(pressed|applied|active|activated|on|engaged|depressed|yes|true|braking|actuated|brake|bremst|betaetigt|enabled|closed)\b",
    re.IGNORECASE,
)
_NO = re.compile(
    r"\b(not|no|non|un\w+|in(active|valid)|off|false|released|standby|init\w*|fault\w*|fail\w*|err\w*|reserved|sna|disabled|cancel\w*|available"
    r"|override|nicht)\b",
    re.IGNORECASE,
)


class Candidate(NamedTuple):
    """A signal that may be a role's."""

    role: str
    file: int  # index of its DBC
    message: Message
    signal: Signal
    name_points: float  # of the name alone
    score: float  # with unit, range, message
    unit: str  # as canid writes it; "": the DBC is silent
    scale: float = 1.0
    on: tuple[int, ...] | None = None  # switches: the values that mean true; None: all but 0
    remarks: tuple[str, ...] = ()
    bus: int | None = None  # where the log has it
    against: bool = False  # its message is that of another quantity

    @property
    def where(self) -> str:
        """MESSAGE.SIGNAL."""
        return f"{self.message.name}.{self.signal.name}"


def candidates(role: str, files: Sequence[Dbc]) -> list[Candidate]:
    """List the signals that may be the role by the DBC alone, best first.

    Example:
        >>> from canid.signals.dbc_text.parsing import Parser
        >>> from canid.signals.vehicle.database import load
        >>> from canid.values.shipped_files import shipped
        >>> with Parser() as parser:
        ...     dbc = load(shipped() / "generic.dbc", None, parser)[0]
        >>> candidates("pedal", [dbc])[0].where
        'ENGINE_DATA.PedalPosition'
    """
    scored = []
    for index, file in enumerate(files):
        for message in file.messages.values():
            for signal in message.signals:
                made = candidate(role, index, message, signal)
                if made is not None:
                    scored.append(made)
    return sorted(scored, key=lambda item: -item.score)


def candidate(role: str, file: int, message: Message, signal: Signal) -> Candidate | None:
    """Score one signal for a role; None where it cannot be it."""
    patterns = PATTERNS[role]
    if not patterns.narrowest <= signal.length <= patterns.widest or signal.is_multiplexer:
        return None
    name = words(signal.name)
    message_words = words(message.name)
    points, unexplained = name_points(role, name)
    if points <= 0.0 or not carried(signal) or condition_of(message, signal) is None:
        return None
    left = sum(word not in message_words.split() for word in unexplained)
    score = points + max(_MOST_UNEXPLAINED, _UNEXPLAINED_WORD * left)
    here, elsewhere = re.search(patterns.here, message_words), re.search(patterns.elsewhere, message_words)
    # a pedal or a brake of the driver is one in any message; a speed or a gap that a display sends is not
    mild = (here and role == "pedal") or points > STRONG
    against = bool(elsewhere) and not mild
    score += _MESSAGE_AGAINST if against else _MESSAGE_BOTH if elsewhere else _MESSAGE_FITS if here else 0.0
    made = _made(role, file, message, signal, points, score)
    return made._replace(against=against) if made is not None else None


def _made(
    role: str, file: int, message: Message, signal: Signal, points: float, score: float
) -> Candidate | None:
    if ROLES[role].kind == "bool":
        return _switch(role, file, message, signal, points, score)
    if ROLES[role].kind == "state":
        return Candidate(role, file, message, signal, points, score, "")
    return _number(role, file, message, signal, points, score)


@cache
def name_points(role: str, name: str) -> tuple[float, tuple[str, ...]]:
    """Points of a name in words, and the words that nothing explains.

    Example:
        >>> name_points("pedal", "accelerator pedal position"), name_points("speed", "speed up button")
        ((6.0, ()), (0.0, ()))
    """
    patterns = PATTERNS[role]
    best: float = 0.0
    rest: tuple[str, ...] = ()
    for pattern, points in patterns.found:
        match = re.search(pattern, name)
        if match and points > best:
            left = _NEUTRAL.sub(" ", f"{name[: match.start()]} {name[match.end() :]}").split()
            best, rest = points, tuple(left)
    if best and re.search(patterns.excluded, name):
        return 0.0, ()
    return best, rest


def _switch(
    role: str, file: int, message: Message, signal: Signal, points: float, score: float
) -> Candidate | None:
    on: tuple[int, ...] | None = None
    remarks: tuple[str, ...] = ()
    if signal.length > 1 and first_no_value(message, signal) is None:
        yes = tuple(raw for raw, text in signal.choices.items() if is_yes(text))
        if yes and len(yes) < len(signal.choices):
            on = yes
        elif signal.choices and len(signal.choices) > 2:
            score += _UNKNOWN_STATES
            remarks = ("which of its states mean yes is not known: set on = [...]",)
        elif not signal.choices and not (signal.minimum == 0 and signal.maximum == 1):
            score += _UNKNOWN_STATES if signal.length > 1 else 0.0
            remarks = ("several states without a value table: set on = [...]",)
    elif signal.choices.get(0) and is_yes(signal.choices[0]) and not is_yes(signal.choices.get(1, "")):
        on = (0,)
    return Candidate(role, file, message, signal, points, score, "", 1.0, on, remarks)


def is_yes(text: str) -> bool:
    """Whether an entry of a value table means "yes".

    Example:
        >>> is_yes("Brake_pressed"), is_yes("NOT_PRESSED"), is_yes("off"), is_yes("Driver applying brakes")
        (True, False, False, True)
    """
    plain = words(text)
    return bool(_YES.search(plain) or re.search(r"\bapplying\b", plain)) and not _NO.search(plain)


def _number(
    role: str, file: int, message: Message, signal: Signal, points: float, score: float
) -> Candidate | None:
    if (
        signal.length <= 1
        or sum(not re.match(r"[+-]?\d", text) for text in signal.choices.values()) > _MAX_TEXTS
    ):
        return None
    wanted, unit = ROLES[role].unit, dbc_unit(signal.unit)
    if unit == EITHER_SPEED:
        if unit_of(wanted) is None or unit_of(wanted).dimension != "speed":  # type: ignore[union-attr]
            return None
        unit = ""
        score -= 1.0
    elif unit and factor_to(unit, wanted) is None:
        return None  # it has a unit of another dimension
    elif unit:
        score += _UNIT_FITS
    low, high = reach(signal)
    if role in _SIGNED and not (low < 0.0 < high or low < 0.0 == high):
        score -= 2.0
        if role == "range_rate":
            return None
    if role not in _SIGNED and signal.signed and role in ("pedal", "gap"):
        score -= 1.0
    made = Candidate(role, file, message, signal, points, score, unit)
    return _plausible(made, low, high)


# a step of a pedal that is given as a share: five bits resolve 3 %
_SHARE_STEP = 0.05


def reach(signal: Signal) -> tuple[float, float]:
    """The least and largest value that the bits can hold, in the DBC's unit; limits of the DBC where they are tighter."""
    if signal.floating:
        ends = [-math.inf, math.inf]
    else:
        top = 2 ** (signal.length - 1) if signal.signed else 2**signal.length
        raws = (-top, top - 1) if signal.signed else (0, top - 1)
        ends = sorted(raw * signal.scale + signal.offset for raw in raws)
    low, high = signal.minimum, signal.maximum
    if signal.signed and low is not None and low >= 0.0:
        low = None  # a range of raw numbers, or of another signal
    if (
        low is not None
        and high is not None
        and ends[0] - 1e-9 <= low < high <= ends[1] * (1 + 1e-9) + 1e-9
        and high > 1
    ):
        return low, high
    return ends[0], ends[1]


def _plausible(made: Candidate, low: float, high: float) -> Candidate | None:
    """Compare what the signal can hold with what the role needs; find a silent unit where only one is possible."""
    role, unit = made.role, made.unit
    if role not in _REACH:
        return made
    least, most = _REACH[role]
    if unit:
        factor = factor_to(unit, ROLES[role].unit) or 1.0
        largest = max(abs(low), abs(high)) * factor
        if not least <= largest <= most and math.isfinite(largest):
            if role == "speed" and largest > most and _all_bits(made.signal, low, high):
                made = made._replace(score=made.score + _ALL_BITS)
            elif role != "pedal" or largest > most:
                return None
            else:
                return _pedal_share(made, high)
        if role == "speed" and abs(made.signal.scale) * factor > 0.2 and not made.signal.floating:
            made = made._replace(score=made.score + _COARSE)
        if role == "gap" and unit == "cm":
            return made._replace(score=made.score - 3.0)
        return made
    if role == "pedal":
        return _pedal_share(made, high)
    if role == "speed" and abs(made.signal.scale) >= 0.5:
        made = made._replace(score=made.score + _COARSE)
    return made


def _all_bits(signal: Signal, low: float, high: float) -> bool:
    """Whether a range is only what the bits of a usual width hold: the author of the DBC stated none."""
    top = 2 ** (signal.length - 1) if signal.signed else 2**signal.length
    full = (top - 1) * abs(signal.scale)
    return signal.length in (8, 12, 13, 15, 16) and math.isclose(max(abs(low), abs(high)), full, rel_tol=1e-3)


def _pedal_share(made: Candidate, high: float) -> Candidate | None:
    """A pedal without a unit: what counts as 100 %."""
    signal = made.signal
    stated = signal.maximum
    if stated is not None and 0.9 <= stated <= 1.1 < high and abs(signal.scale) <= _SHARE_STEP:
        return made._replace(unit="0..1", remarks=("no unit in the DBC; its stated range is 0 to 1",))
    if 0.9 <= high <= 1.1:
        return made._replace(unit="0..1", remarks=("no unit in the DBC; its range is 0 to 1",))
    if 90.0 <= high <= 110.0:
        return made._replace(
            unit="%", score=made.score + _RANGE_FITS, remarks=("no unit in the DBC; its range is that of %",)
        )
    if not math.isfinite(high) or high <= 0.0 or high > _MOST_PEDAL_STEPS or signal.signed:
        return made._replace(score=made.score - 1.0)
    scale = float(f"{100.0 / high:.4g}")
    return made._replace(
        unit="%", scale=scale, remarks=(f"no unit in the DBC; {high:g} is taken as 100 %: check the scale",)
    )
