"""Reads ASAM .mf4 through python-can and asammdf, in a child process (see `mf4_child`)."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from canid.child_process import command
from canid.errors import ConfigError, LogError
from canid.logs.mf4_child import END, RECORD
from canid.logs.reader_state import ReadState
from canid.types import Damage, Frame


def read_mf4(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of time.

    Raises ConfigError without asammdf, LogError where nothing can be read.
    """
    read = 0
    first: int | None = None
    with tempfile.TemporaryFile() as errors:
        child = subprocess.Popen(
            command("canid.logs.mf4_child", os.path.abspath(path), options=("-W", "ignore")),
            stdout=subprocess.PIPE,
            stderr=errors,
        )
        pipe = child.stdout
        assert pipe is not None
        try:
            while True:
                head = pipe.read(RECORD.size)
                if head == END or len(head) < RECORD.size:
                    break
                ns, id_, bus, flags, length, count = RECORD.unpack(head)
                data = pipe.read(count)
                if len(data) < count:
                    break
                if first is None:
                    first = ns
                    state.start_ns = ns
                    # asammdf reads the whole file before the first frame
                    state.done = state.size // 2
                read += 1
                yield Frame((ns - first) * 1e-9, bus, id_, data, flags, length)
        except GeneratorExit:
            child.kill()
            raise
        finally:
            pipe.close()
            code = child.wait()
        if code == 3:
            raise ConfigError(f"{path}: reading .mf4 needs asammdf; run: pip install canid[mf4]")
        if head != END:
            errors.seek(0)
            last = errors.read().decode(errors="replace").strip().rpartition("\n")[2]
            why = f"asammdf failed ({last or f'code {code}'})"
            if code == -getattr(signal, "SIGPROF", 0):
                why = "asammdf found no frame in it for many seconds"
            if not read:
                raise LogError(f"cannot read {path}: {why}")
            state.damage = Damage(f"read {read} frames: {why}", read, -1)
    state.done = state.size
