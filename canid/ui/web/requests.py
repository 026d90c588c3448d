"""Requests of a page: mark, diagnosis, signals, pause, speed, seek. All are checked here, on both sides of the pipe."""

from __future__ import annotations

import json
import math
from typing import Any, TypeGuard

from canid.io.recording.controls import MAX_MARK_TEXT, Controls

# bytes of a message; a mark's text of `MAX_MARK_TEXT` characters, escaped, has 2,400
MAX_MESSAGE_BYTES = 4096
# a replay's highest speed with a pace
MAX_SPEED = 1000.0
# what the page of a session, and that of a replay, may ask for
OF_SESSION = ("mark", "diagnose", "signals")
OF_REPLAY = ("diagnose", "signals", "pause", "speed", "seek")


def parsed(text: str | bytes, allowed: tuple[str, ...]) -> dict[str, Any] | None:
    """A request, with no other keys than it needs; None where it is none, or is not allowed.

    Example:
        >>> parsed('{"do": "seek", "t": 12.5, "more": 1}', OF_REPLAY)
        {'do': 'seek', 't': 12.5}
        >>> parsed('{"do": "seek", "t": -1}', OF_REPLAY) is None, parsed('{"do": "stop"}', OF_REPLAY) is None
        (True, True)
    """
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(value, dict) or value.get("do") not in allowed:
        return None
    match value["do"]:
        case "mark":
            words = value.get("text", "")
            return (
                {"do": "mark", "text": words}
                if isinstance(words, str) and len(words) <= MAX_MARK_TEXT
                else None
            )
        case "diagnose" | "signals":
            return {"do": value["do"]}
        case "pause":
            paused = value.get("paused")
            return {"do": "pause", "paused": paused} if isinstance(paused, bool) else None
        case "speed":
            speed = value.get("speed")
            if speed == "max":
                return {"do": "speed", "speed": "max"}
            return {"do": "speed", "speed": speed} if _number(speed) and 0.0 < speed <= MAX_SPEED else None
        case _:
            t = value.get("t")
            return {"do": "seek", "t": t} if _number(t) and t >= 0.0 else None


def _number(x: Any) -> TypeGuard[float]:
    # a whole number of a thousand digits has no float
    return isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e9 and math.isfinite(x)


def obey(request: dict[str, Any], controls: Controls) -> None:
    """Do what a checked request asks for."""
    match request["do"]:
        case "mark":
            controls.mark(request["text"])
        case "diagnose":
            controls.diagnose()
        case "signals":
            controls.show_signals()
        case "pause":
            controls.pause(request["paused"])
        case "speed":
            controls.set_speed(math.inf if request["speed"] == "max" else float(request["speed"]))
        case "seek":
            controls.seek(float(request["t"]))
