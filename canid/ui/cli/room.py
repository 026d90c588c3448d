"""Whether there is room for a command's modules, and for a session's threads and memory, tried before it creates a file."""

from __future__ import annotations

import ctypes
import mmap
import sys
import threading
from contextlib import suppress
from importlib import import_module

from canid.values.errors import OutputError, one_line, out_of_memory

# what a session imports once its log is open, or a bus is
MODULES = (
    "numpy",
    "canid.analysis.session.session",
    "canid.io.buses.bus_opener",
    "canid.io.recording.recorder",
    "canid.io.logs.log_writer",
    "canid.ui.views.end_summary",
    "canid.ui.views.terminal_view",
)
ESTIMATING = (
    "canid.signals.vehicle",
    "canid.analysis.session.estimator_process",
    "canid.io.files.state_keeper",
)
# of two buses, the log, the estimators, the outputs and the end
THREADS = 16
# for what else a session needs: its queues, the log's buffers, a bus's driver
SPARE_BYTES = 128 * 1024 * 1024
M_ARENA_MAX = -8  # malloc.h
# addresses of the modules of a command: with fewer an import ends in any exception, or in the exit of OpenBLAS
MODULE_BYTES = 256 * 1024 * 1024


def check_modules() -> None:
    """Raise OutputError where the limit of addresses leaves no room to import modules. Without a limit there is no need."""
    if not _limited():
        return
    try:
        mmap.mmap(-1, MODULE_BYTES).close()  # is not touched, so it costs nothing
    except OSError as error:
        raise OutputError(f"not enough memory ({one_line(error)}); see `ulimit -v`") from None


def check_room(*, estimating: bool) -> None:
    """Raise OutputError where there is not enough: nothing has begun then, and no file is there."""
    ended = threading.Event()
    _few_arenas()
    try:
        for name in (*MODULES, *(ESTIMATING if estimating else ())):
            import_module(name)
        from canid.io.buses import python_can

        python_can.load()
        with mmap.mmap(-1, SPARE_BYTES):  # is not touched, so it costs nothing
            for _ in range(THREADS):
                threading.Thread(target=ended.wait, daemon=True).start()
    except Exception as error:
        if not out_of_memory(error):
            raise
        raise OutputError(
            f"not enough memory for a session ({one_line(error)}): nothing was recorded; see `ulimit -v`"
        ) from None
    finally:
        ended.set()


def _few_arenas() -> None:
    """Under a limit keep glibc from giving each thread 64 MB of addresses of its own."""
    if sys.platform.startswith("linux") and _limited():
        with suppress(AttributeError, OSError):
            ctypes.CDLL(None).mallopt(M_ARENA_MAX, 1)


def _limited() -> bool:
    """Whether the process has a limit of addresses (`ulimit -v`)."""
    if sys.platform == "win32":
        return False
    import resource

    return bool(resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY)
