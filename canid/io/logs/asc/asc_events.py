"""Lines of an .asc that hold no CAN frame, and of what kind each is: a closed list.

The line forms are those of Vector's ASC specifications (CAN, Log & Trigger 1.4; LIN; FlexRay; MOST; Ethernet; K-Line;
diagnostics) and of files that CANoe, CANalyzer and python-can wrote. No pattern fits a line that holds a CAN frame in
which one byte was replaced: a bus is named by a letter and by words that no CAN frame has in these places.
"""

from __future__ import annotations

import re

_RE_FLAGS = re.ASCII | re.IGNORECASE
_DIRECTION = r"(?:rx|tx|txrq)"
# what follows the time, words separated by one blank; each group's name is its kind, with _ for a blank
_TIMED_LINE = re.compile(
    r"(?P<log_and_trigger_events>(?:can(?:fd|xl)? )?start of measurement$|start der messung$|log (?:trigger|direct|event)\b)"
    r"|(?P<bus_statistics>(?:can(?:fd|xl)? )?\d{1,5} statistic: ?[a-z])"
    r"|(?P<bus_status>can(?:fd|xl)? \d{1,5} status: ?[a-z])"
    r"|(?P<overload_frames>(?:canfd )?\d{1,5} (?:(?:rx|tx) )?overloadframe$)"
    r"|(?P<transmit_requests>(?:\d{1,5} [0-9a-f]+x? txrq [dr]\b|canfd \d{1,5} (?:txrq [0-9a-f]+x?|[0-9a-f]+x? txrq) ))"
    r"|(?P<transport_protocol>(?:canfd )?\d{1,5} j(?:1939|1708|1587)\w* )"
    r"|(?P<CAN_XL_frames>canxl \d{1,5} (?:rx|tx|txrq) (?:xlff|fdff|[a-z]{2}ff|errorframe)\b)"
    r"|(?P<LIN>l(?:i|\*|[0-9a-f]{1,3}) (?:"
    rf"\w+ {_DIRECTION} (?:-|\d{{1,2}})(?: |$)"
    r"|\w+ (?:transmerr|cserr|dlcinfo|csinfo|evtrigfrminfo)\b|(?:\w+ [-\d]+ )?(?:rcverror:|shortorslowresponse:)"
    r"|(?:syncerror|spike|dominant signal|baudrate|schedmodchng|slavetimeout|statistic|disturbanceevent"
    r"|sleepmodeevent|wakeupframe|unexpected wakeup:)))"
    r"|(?P<FlexRay>fr (?:rmsg|pdu|sce|se|ee) |fr [12*] (?:v9|startcycleevent|errorframe)\b)"
    rf"|(?P<MOST>m[0-9a-f]{{1,2}} (?:{_DIRECTION} [0-9a-f]{{4}} |(?:pkt|ll|register|regdata|hwmode|netstate|datalost"
    r"|trigger|moststatistic|statex|txlight|stress|alloctab|msg150|msg150frg|pkt150|pkt150frg|pkteth|pktethfrg|system"
    r"|at150|msg50|pkt50|ecl):))"
    rf"|(?P<Ethernet>(?:eth [0-9a-f]{{1,3}} (?:{_DIRECTION}|stat|rxer)|afdx [0-9a-f]{{1,3}} {_DIRECTION}) )"
    r"|(?P<K_Line>(?:com|kl)\d{1,3} (?:rx|tx) )"
    r"|(?P<GPS>gps(?:-device)?: ?\d)"
    r"|(?P<variables>(?:sv: ?\d|[^\s:=]{1,512} ?:= ))"
    r"|(?P<signals>(?:can |canfd )?[lfm]?\w{1,5} [^\s:=]{1,256}::[^\s:=]{1,256}::[^\s:=]{1,256} ?=)"
    r"|(?P<remarks_and_markers>comment: ?\d|(?:-?\d+ ){3}[01] gmgroup:)"
    r"|(?P<diagnostics_and_tests>diagrequest ?\[|tfs: ?\[?)",
    _RE_FLAGS,
)
# kinds whose lines have a frame's form themselves
_LIKE_FRAMES = ("transport protocol", "CAN XL frames", "FlexRay")
# Vector's tools write the first line in the words of their language. A line with a CAN frame has a number in it.
_NO_WORDS = {"rx", "tx", "txrq", "errorframe"}
_UNTIMED_LINE = re.compile(
    r"(?P<comments>//|;)"
    r"|(?P<header_lines>(?:date|begin trigger ?block)(?:\s+\S+){0,9}$|(?:no )?internal events logged$|end trigger ?block$"
    r"|version(?:\s+\S+){1,9}$)",
    _RE_FLAGS,
)
# A CAN frame that became part of another line, because a line feed or the frame's first bytes are damaged.
_FRAME = re.compile(
    r"[0-9a-fx]\s+(?:rx|tx)\s+[dr](?:\s|$)|\d\s+errorframe\b|\bcanfd\s+\d+\s+(?:rx|tx)\s", _RE_FLAGS
)
# a whole line that was commented out
_COMMENTED_OUT = re.compile(r"//\s*\d+[.,]\d+\s")


def timed(words: list[str]) -> str:
    """The kind of a line that begins with a time; "" where it is of no known kind. `words`: what follows the time.

    >>> timed("1 Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%".split()), timed("1 123 Sx d 1 AA".split())
    ('bus statistics', '')
    """
    text = " ".join(words)
    match = _TIMED_LINE.match(text)
    if match:
        kind = str(match.lastgroup).replace("_", " ")
        return "" if kind not in _LIKE_FRAMES and _FRAME.search(text) else kind
    if len(words) > 1 and all(len(word) > 1 and _letters(word) for word in words):
        return "log and trigger events"
    return ""


def untimed(text: str) -> str:
    """The kind of a line without a time; "" where it is of no known kind.

    >>> untimed("// version 9.0.0"), untimed("End TriggerBlock"), untimed("  0.p00000 1 123 Rx d 0")
    ('comments', 'header lines', '')
    """
    match = _UNTIMED_LINE.match(text)
    if not match or (_FRAME.search(text) and not _COMMENTED_OUT.match(text)):
        return ""
    return str(match.lastgroup).replace("_", " ")


def _letters(word: str) -> bool:
    """Whether a word is one of a language: letters, those beyond ASCII among them; and none that a frame's line has."""
    return all(c.isalpha() or c >= "\x80" for c in word) and word.lower() not in _NO_WORDS
