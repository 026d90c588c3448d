"""Whether the signals of a message overlap or leave their frame."""

from __future__ import annotations

from canid.signals.dbc_text.content import Message, Signal

# signals that are compared pair by pair; a frame of 64 bytes has room for 512
_MAX_COMPARED = 600
# nested selectors
_MAX_DEPTH = 16


def overlaps(message: Message) -> bool:
    """Whether two signals that come together share bits, or one ends behind the message.

    Example:
        >>> signal = Signal("A", 0, 8, False, False, False, 1.0, 0.0, None, None, "", {}, False, None, ())
        >>> overlaps(Message("M", 1, False, 8, 0.1, (signal, signal._replace(start=4))))
        True
    """
    bits = 8 * message.length
    masks = [_mask(signal, bits) for signal in message.signals]
    if any(mask is None for mask in masks):
        return True
    total, sum_of_bits = 0, 0
    for mask in masks:
        total |= mask or 0
        sum_of_bits += (mask or 0).bit_count()
    if total.bit_count() == sum_of_bits or len(masks) > _MAX_COMPARED:
        return False
    known = {signal.name: signal for signal in message.signals}
    pages = [_pages(signal, known) for signal in message.signals]
    return any(
        (masks[i] or 0) & (masks[k] or 0) and _together(pages[i], pages[k])
        for i in range(len(masks))
        for k in range(i)
    )


def _mask(signal: Signal, bits: int) -> int | None:
    """The bits of a signal, the most significant of the first byte first; None: outside the message."""
    if signal.length < 1 or signal.length > bits or signal.start >= bits:
        return None
    if signal.motorola:
        begin = 8 * (signal.start // 8) + 7 - signal.start % 8
        end = begin + signal.length
        return ((1 << signal.length) - 1) << (bits - end) if end <= bits else None
    if signal.start + signal.length > bits:
        return None
    little = ((1 << signal.length) - 1) << signal.start
    return int.from_bytes(little.to_bytes(bits // 8, "little"), "big")


def _pages(signal: Signal, known: dict[str, Signal]) -> dict[str, frozenset[int]]:
    pages: dict[str, frozenset[int]] = {}
    while signal.multiplexer is not None and len(pages) < _MAX_DEPTH and signal.multiplexer not in pages:
        pages[signal.multiplexer] = frozenset(signal.pages)
        parent = known.get(signal.multiplexer)
        if parent is None:
            break
        signal = parent
    return pages


def _together(first: dict[str, frozenset[int]], other: dict[str, frozenset[int]]) -> bool:
    return all(not other.get(name, pages).isdisjoint(pages) for name, pages in first.items())
