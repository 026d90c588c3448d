"""Run as `python -m canid.frames.mf4_child FILE`: streams the frames of an .mf4 over standard output.

A process of its own because asammdf is slow to import and needs much memory.
Each frame is `RECORD` and its data; `END` says that all came.
"""

from __future__ import annotations

import os
import signal
import sys
from struct import Struct

# ns, id, bus, flags, length, bytes of data that follow
RECORD = Struct("<qIHBbB")
END = RECORD.pack(-1, 0, 0xFFFF, 0, 0, 0)


# What asammdf may take for a file before it gives a frame, and from there to the next thousand of them: CPU s, and
# s per MiB of the file. A sound hour takes a tenth.
_SECONDS, _SECONDS_PER_MIB, _EVERY = 10.0, 1.0, 1000
# What it may take in memory beyond its own modules, and times the size of the file: columns of all frames, unpacked
_MEMORY, _TIMES = 256 << 20, 16


def _limit(path: str) -> float:
    """Bound the memory of this process, where the system can, and return how many CPU s it has for each step."""
    size = os.path.getsize(path)
    if sys.platform == "linux":
        import resource

        with open("/proc/self/status") as status:
            used = next(int(line.split()[1]) << 10 for line in status if line.startswith("VmData"))
        most = used + _MEMORY + _TIMES * size
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    return _SECONDS + _SECONDS_PER_MIB * size / (1 << 20)


def _begin(seconds: float) -> None:
    """End this process after so many CPU s, unless it comes here again."""
    if hasattr(signal, "ITIMER_PROF"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def main(path: str) -> int:
    """Write all frames of `path`; 0 if all went well, 3 without asammdf, 4 where the file cannot be read."""
    try:
        import asammdf  # noqa: F401
    except ImportError:
        return 3
    # with asammdf there already, python-can is loaded with it
    from canid.frames import messages, python_can, stamps

    out = sys.stdout.buffer
    seconds = _limit(path)
    try:
        _begin(seconds)
        for k, message in enumerate(python_can.load().MF4Reader(path)):
            if k % _EVERY == 0:
                _begin(seconds)
            data = bytes(message.data)
            length = message.dlc if message.is_remote_frame else -1
            bus = message.channel if isinstance(message.channel, int) else 0
            out.write(
                RECORD.pack(
                    stamps.from_float(message.timestamp),
                    message.arbitration_id,
                    bus,
                    messages.flags_of(message),
                    length,
                    len(data),
                )
            )
            out.write(data)
    except BrokenPipeError:
        raise
    except Exception as error:  # asammdf raises whatever it stumbles over in a damaged file
        out.flush()
        sys.stderr.write(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}\n")
        return 4
    out.write(END)
    out.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1]))
