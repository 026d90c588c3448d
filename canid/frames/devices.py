"""What the system says of a CAN network device, through `ip -j -d link show`."""

from __future__ import annotations

import json
import subprocess
from typing import Any, NamedTuple

from canid.types import NAN


class Device(NamedTuple):
    """A network device."""

    kind: str = ""  # "can", "vcan", ...; "" unknown
    up: bool = False
    listen_only: bool = False
    bitrate: float = NAN  # bit/s; NaN: unknown, as on vcan
    state: str = ""  # ERROR-ACTIVE, ERROR-PASSIVE, BUS-OFF, ...; "" unknown


def parse_link(text: str) -> Device | None:
    """Find the device in the JSON that `ip` prints, None where there is none.

    >>> parse_link('[{"flags": ["NOARP", "UP"], "linkinfo": {"info_kind": "vcan"}}]').kind
    'vcan'
    """
    try:
        links = json.loads(text)
    except ValueError:
        return None
    link: dict[str, Any] = next((item for item in links if item), {}) if isinstance(links, list) else {}
    if not link:
        return None
    info = link.get("linkinfo") or {}
    data = info.get("info_data") or {}
    bitrate = (data.get("bittiming") or {}).get("bitrate", NAN)
    return Device(
        kind=str(info.get("info_kind", "")),
        up="UP" in link.get("flags", ()),
        listen_only="LISTEN-ONLY" in data.get("ctrlmode", ()),
        bitrate=float(bitrate),
        state=str(data.get("state", "")),
    )


def link(channel: str) -> Device | None:
    """Ask the system about one device; None where it has none of that name, or no `ip`."""
    try:
        done = subprocess.run(
            ["ip", "-j", "-d", "link", "show", "dev", channel],
            capture_output=True,
            text=True,
            timeout=5,  # s; it answers in milliseconds, but a start must never hang
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return parse_link(done.stdout) if done.returncode == 0 else None
