"""What the keys do, in one line and at length."""

from __future__ import annotations

from canid.ui.terminal.spans import Line, Span, packed, wrapped

KEYS = (
    ("q", "stop", "stop cleanly: everything received is written, then the summary is printed"),
    ("m", "mark", "mark this time of the drive, with a text or without; it stands in log and journal"),
    ("d", "diagnose", "diagnose the drive so far, where --diagnose was given"),
    ("space", "pause", "pause the view; the recording goes on, and its line stays live"),
    ("u", "units", "speeds in m/s or km/h; parameters stay in SI"),
    ("?", "help", "this help; any key leaves it"),
)
# columns of the longest key
KEY_COLUMNS = 6


def footer(columns: int) -> Line:
    """The keys in one line, as many as fit; the last one always, which explains all."""
    items: list[Line] = [(Span(f"{key}", "bold"), Span(f" {short}", "dim")) for key, short, _ in KEYS]
    while len(rows := packed(items, columns)) > 1 and len(items) > 1:
        del items[-2]
    return rows[0]


def short(columns: int) -> list[Line]:
    """The keys in words, for a small terminal."""
    items: list[Line] = [(Span(key, "bold"), Span(f" {what}")) for key, what, _ in KEYS]
    return packed([(Span("keys:", "bold"),), *items], columns)


def lines(columns: int) -> list[Line]:
    """The keys with their sentences; short ones on a narrow terminal."""
    out: list[Line] = [(Span("keys", "bold"),)]
    for key, _, says in KEYS:
        out += wrapped(says, "", columns, first=f"{key:{KEY_COLUMNS}}", indent=" " * KEY_COLUMNS)
    return [*out, *wrapped("Ctrl-C stops, too.", "dim", columns)]
