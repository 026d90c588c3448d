"""The files that the kernel executes where a child process of canid is started: the interpreter, and its loader.

Libraries are mapped, not executed, and need no right but that to read (landlock(7)). So the loader, which has to be
executed, can load any program: that these files alone are executed is a hurdle. The wall is that whatever is
started has the rights of the process that started it.
"""

from __future__ import annotations

import os
import struct
import sys
from contextlib import suppress

# elf(5), of 64 bits and little-endian: the place of the program headers, their size and number, and the kind of the loader's
_ELF, _PROGRAM_HEADERS_AT, _SIZE_AT, _LOADER = b"\x7fELF\x02\x01", 32, 54, 3
# bytes of the first line of a script (execve(2)), and of the headers of a program
_LINE_BYTES, _HEADER_BYTES = 256, 4096
# a script may be run by a script (execve(2))
_MAX_DEPTH = 5


def executed() -> tuple[str, ...]:
    """Paths of the interpreter that children are started with, and of what it is started by in turn.

    Example:
        >>> executed()[0] == sys.executable
        True
    """
    starters: dict[str, None] = {}
    # where `sys.executable` is a wrapper, it executes this one
    for path in (sys.executable, "/proc/self/exe"):
        with suppress(OSError):
            _add(os.readlink(path) if path.startswith("/proc/") else path, starters)
    return tuple(starters)


def _add(path: str, starters: dict[str, None]) -> None:
    for _ in range(_MAX_DEPTH):
        starters[path] = None
        path = _starter(path)
        if not path:
            return


def _starter(path: str) -> str:
    """What the kernel executes to start a program or script; "": the file alone.

    >>> _starter("/proc/self/status")
    ''
    """
    with open(path, "rb") as file:
        head = file.read(_HEADER_BYTES)
        if head.startswith(b"#!"):
            words = head[2:_LINE_BYTES].partition(b"\n")[0].split()
            return os.fsdecode(words[0]) if words else ""
        if not head.startswith(_ELF) or len(head) < _SIZE_AT + 4:
            return ""
        (begin,) = struct.unpack_from("<Q", head, _PROGRAM_HEADERS_AT)
        size, count = struct.unpack_from("<HH", head, _SIZE_AT)
        for at in range(begin, min(begin + size * count, len(head) - size + 1), max(size, 1)):
            if struct.unpack_from("<I", head, at)[0] == _LOADER:
                place, _, _, length = struct.unpack_from("<4Q", head, at + 8)
                file.seek(place)
                return os.fsdecode(file.read(min(length, _HEADER_BYTES)).rstrip(b"\0"))
    return ""
