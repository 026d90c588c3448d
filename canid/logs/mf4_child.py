"""Run as `python -m canid.logs.mf4_child FILE`: streams the frames of an .mf4 over standard output.

A process of its own because asammdf is slow to import and needs much memory.
Each frame is `RECORD` and its data; `END` confirms that the stream is complete.
"""

from __future__ import annotations

import os
import signal
import sys
from struct import Struct

# ns, id, bus, flags, length, bytes of data that follow
RECORD = Struct("<qIHBbB")
END = RECORD.pack(-1, 0, 0xFFFF, 0, 0, 0)


# Limit of asammdf's CPU time up to the first frame, and for each thousand frames from there: s, and s per MiB of the
# file. An undamaged log of an hour takes a tenth.
_CPU_S, _CPU_S_PER_MIB, _LIMITED_FRAMES = 10.0, 1.0, 1000
# Limit of its memory: bytes beyond its own modules, and bytes per byte of the file for the unpacked columns
_EXTRA_BYTES, _BYTES_PER_FILE_BYTE = 256 << 20, 16


def _limit_memory(path: str) -> float:
    """Bound the memory of this process, where the system can, and return how many CPU s it has for each step."""
    size = os.path.getsize(path)
    if sys.platform == "linux":
        import resource

        with open("/proc/self/status") as status:
            used = next(int(line.split()[1]) << 10 for line in status if line.startswith("VmData"))
        limit = used + _EXTRA_BYTES + _BYTES_PER_FILE_BYTE * size
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    return _CPU_S + _CPU_S_PER_MIB * size / (1 << 20)


def _restart_cpu_limit(seconds: float) -> None:
    """End this process after so many CPU s, unless this is called again."""
    if hasattr(signal, "ITIMER_PROF"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def main(path: str) -> int:
    """Write all frames of `path`; 0 if all went well, 3 without asammdf, 4 where the file cannot be read."""
    try:
        import asammdf  # noqa: F401
    except ImportError:
        return 3
    # with asammdf there already, python-can is loaded with it
    from canid import timestamps
    from canid.buses import messages, python_can

    out = sys.stdout.buffer
    seconds = _limit_memory(path)
    try:
        _restart_cpu_limit(seconds)
        for k, message in enumerate(python_can.load().MF4Reader(path)):
            if k % _LIMITED_FRAMES == 0:
                _restart_cpu_limit(seconds)
            data = bytes(message.data)
            length = message.dlc if message.is_remote_frame else -1
            bus = message.channel if isinstance(message.channel, int) else 0
            out.write(
                RECORD.pack(
                    timestamps.from_float(message.timestamp),
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
    except Exception as error:  # asammdf raises errors of any kind on damaged files
        out.flush()
        sys.stderr.write(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}\n")
        return 4
    out.write(END)
    out.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1]))
