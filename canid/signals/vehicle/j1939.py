"""SAE J1939: parameter groups in 29-bit ids (J1939-21), and raw numbers that are no value (J1939-71)."""

from __future__ import annotations

from collections.abc import Iterable

from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.mapping import MessageMap

PROTOCOL = "j1939"
# below it, the PDU specific field is a destination address (PDU1), from it on a part of the group (PDU2)
_FIRST_PDU2_FORMAT = 240
# data pages, PDU format and PDU specific: all but priority (3 bits) and source address (8 bits)
_GROUP_BITS = 0x3FFFF
# parameters are 2 to 32 bits long; what is longer is text or a bit field
_MIN_PARAMETER_BITS, _MAX_PARAMETER_BITS = 2, 32
# lengths whose numbers that are no measurement are known by their first byte
_BYTE_WISE_LENGTHS = (8, 12, 16, 20, 24, 28, 32)


def pgn_of(id_: int) -> int:
    """Parameter group number of a 29-bit id: without priority, source and (PDU1) destination address.

    Example:
        >>> pgn_of(0x0CF00403), pgn_of(0x18F004FE), hex(pgn_of(0x18EA2103)), hex(pgn_of(0x18EAFF00))
        (61444, 61444, '0xea00', '0xea00')
    """
    group = id_ >> 8 & _GROUP_BITS
    return group if group >> 8 & 0xFF >= _FIRST_PDU2_FORMAT else group & ~0xFF


def source_of(id_: int) -> int:
    """Source address of a 29-bit id.

    Example:
        >>> source_of(0x18FEF121)
        33
    """
    return id_ & 0xFF


def with_source(id_: int, source: int | None) -> int:
    """The id as this address sends it; None: as it is."""
    return id_ if source is None else (id_ & ~0xFF) | source


def matches(message: Message | MessageMap, id_: int, extended: bool) -> bool:
    """Whether frames of an id carry a message: the same id, or (J1939) the same parameter group from any source.

    Args:
        message: of a DBC; `message.protocol` says whether it is J1939.
        id_: of the frames, as `MessageKey.id`.
        extended: whether it has 29 bits.

    Example:
        >>> one = Message("EEC1", 0x18F004FE, True, 8, 0.01, ())
        >>> matches(one, 0x0CF00400, True), matches(one._replace(protocol=PROTOCOL), 0x0CF00400, True)
        (False, True)
    """
    if message.extended != extended:
        return False
    if message.protocol == PROTOCOL and extended:
        return pgn_of(message.id) == pgn_of(id_)
    return message.id == id_


def own_source(message: Message, messages: Iterable[Message]) -> int | None:
    """The source address in a message's id, where the file has its parameter group from several sources; else None.

    Example:
        >>> one = Message("EEC1", 0x0CF00400, True, 8, 0.01, (), PROTOCOL)
        >>> own_source(one, [one]), own_source(one, [one, one._replace(name="EEC1_B", id=0x0CF00403)])
        (None, 0)
    """
    group = pgn_of(message.id)
    sources = {
        source_of(other.id) for other in messages if other.protocol == PROTOCOL and pgn_of(other.id) == group
    }
    return source_of(message.id) if len(sources) > 1 else None


def first_no_value(message: Message, signal: Signal) -> tuple[int, int, int] | None:
    """The smallest raw numbers that are no measurement, that mean an error, and "not available"; None: all are values.

    J1939-71 reserves the top of the range of each parameter: first bytes of 0xFB (an indicator of the parameter's own),
    0xFC and 0xFD (for later use), 0xFE (error) and 0xFF (not available); 0b10 and 0b11 of two bits.
    Where the file numbers the suspect parameters of a message (SPN), only these follow the rule.

    Example:
        >>> speed = Signal("S", 8, 16, False, False, False, 1 / 256, 0.0, None, None, "", {}, False, None, ())
        >>> one = Message("CCVS", 0x18FEF1FE, True, 8, 0.1, (speed,), PROTOCOL)
        >>> [hex(raw) for raw in first_no_value(one, speed)], first_no_value(one._replace(protocol=""), speed)
        (['0xfb00', '0xfe00', '0xff00'], None)
    """
    if message.protocol != PROTOCOL or signal.floating or signal.signed or signal.is_multiplexer:
        return None
    if not _MIN_PARAMETER_BITS <= signal.length <= _MAX_PARAMETER_BITS:
        return None
    if not signal.spn and any(other.spn for other in message.signals):
        return None
    if signal.length in _BYTE_WISE_LENGTHS:
        first, error, absent = (byte << (signal.length - 8) for byte in (0xFB, 0xFE, 0xFF))
        # an indicator that the file names is a value of the parameter, as "park" of a gear
        return (error if any(first <= raw < error for raw in signal.choices) else first), error, absent
    last = (1 << signal.length) - 1
    return last - 1, last - 1, last
