r"""File format of a saved state: a JSON object that begins with a version and a SHA-256 checksum of the rest.

    {"canid_state": 1,
    "sha256": "<of all bytes that follow this line>",
    ...

The checksum is verified on the bytes, before anything is parsed: a file that does not match is refused as a whole.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

FORMAT = 1
_VERSION = re.compile(rb'\{"canid_state": ([0-9]{1,9}),\n')
_CHECKSUM = re.compile(rb'"sha256": "([0-9a-f]{64})",\n')
# bytes in which a state file, even a damaged one, has one of its two first names
_HEAD_BYTES = 64


class Refused(NamedTuple):
    """Why nothing of a saved state is used."""

    says: str


def seal(fields: Mapping[str, Any]) -> bytes:
    """Write fields of JSON values, one a line, under a checksum.

    Raises:
        ValueError: a NaN or an infinity: JSON has none.

    Example:
        >>> print(seal({"vehicle": "Generic"}).decode(), end="")
        {"canid_state": 1,
        "sha256": "a1a3ff2cfa66604cb8e5494315a6f5b1c1a0baf98126c14d69f6cb927cba8515",
        "vehicle": "Generic"
        }
    """
    lines = [f"{json.dumps(name)}: {json.dumps(value, allow_nan=False)}" for name, value in fields.items()]
    rest = (",\n".join(lines) + "\n}\n").encode("ascii")
    digest = hashlib.sha256(rest).hexdigest()
    return f'{{"canid_state": {FORMAT},\n"sha256": "{digest}",\n'.encode("ascii") + rest


def ours(data: bytes) -> bool:
    """Whether canid has written this file, even where it is damaged; other files are never overwritten.

    Example:
        >>> ours(b'{"canid_state": 7'), ours(b""), ours(b"name = 'My car'")
        (True, True, False)
    """
    head = data[:_HEAD_BYTES]
    # the first lines may be damaged in one place, or cut off
    return b'"canid_state"' in head or b'"sha256"' in head or b'{"canid_state"'.startswith(data)


def unseal(data: bytes) -> dict[str, Any] | Refused:
    """Verify the checksum and read the fields.

    Example:
        >>> unseal(seal({"vehicle": "Generic"}))["vehicle"]
        'Generic'
        >>> unseal(seal({"vehicle": "Generic"})[:-1]).says
        'the saved state is damaged: its checksum does not fit'
        >>> unseal(b"name = 'My car'").says
        'the state file was not written by canid: it is left as it is, and nothing is saved'
    """
    version = _VERSION.match(data)
    if version and int(version[1]) > FORMAT:
        return Refused(
            f"the saved state has format {int(version[1])}, of a newer canid; this one reads {FORMAT}"
        )
    checksum = _CHECKSUM.match(data, version.end()) if version and int(version[1]) == FORMAT else None
    if checksum is None:
        if not data:
            return Refused("the state file is empty")
        if ours(data):
            return Refused("the saved state is damaged: its first lines are incomplete")
        return Refused("the state file was not written by canid: it is left as it is, and nothing is saved")
    rest = data[checksum.end() :]
    if hashlib.sha256(rest).hexdigest().encode("ascii") != checksum[1]:
        return Refused("the saved state is damaged: its checksum does not fit")
    try:
        fields = json.loads(b"{" + rest)
    except (ValueError, RecursionError):  # a number of 5,000 digits; 100,000 brackets
        fields = None
    # with a correct checksum, this is no accident
    return fields if isinstance(fields, dict) else Refused("the saved state is damaged: it is no JSON object")
