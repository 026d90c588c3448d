"""Run as `python -m canid.frames.mf4_child FILE`: streams the frames of an .mf4 over standard output.

A process of its own because asammdf is slow to import and needs much memory.
Each frame is `RECORD` and its data; `END` says that all came.
"""

from __future__ import annotations

import sys
from struct import Struct

# ns, id, bus, flags, length, bytes of data that follow
RECORD = Struct("<qIHBbB")
END = RECORD.pack(-1, 0, 0xFFFF, 0, 0, 0)


def main(path: str) -> int:
    """Write all frames of `path`; 0 if all went well, 3 without asammdf, 4 where the file cannot be read."""
    try:
        import asammdf  # noqa: F401
    except ImportError:
        return 3
    # with asammdf there already, python-can is loaded with it
    from canid.frames import messages, python_can, stamps

    out = sys.stdout.buffer
    try:
        for message in python_can.load().MF4Reader(path):
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
