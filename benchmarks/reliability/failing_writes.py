"""Writes that fail now and then: a library that is loaded before the C library (LD_PRELOAD), built here.

Its calls fail with a given error while a switch is on, for files whose path contains a text.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

_SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static unsigned seed;

static int fails(const char *path, const char *call) {
    const char *on = getenv("FAULT_SWITCH");
    if (!on || access(on, F_OK) || !strstr(path, getenv("FAULT_PATH")) || !strstr(getenv("FAULT_CALLS"), call)) return 0;
    if (*getenv("FAULT_NOT") && strstr(path, getenv("FAULT_NOT"))) return 0;
    if (!seed) seed = atoi(getenv("FAULT_SEED")) + 1;
    if (rand_r(&seed) >= atof(getenv("FAULT_SHARE")) * RAND_MAX) return 0;
    if (atoi(getenv("FAULT_ONCE"))) unlink(on);
    errno = atoi(getenv("FAULT_ERRNO"));
    return 1;
}

static int fd_fails(int fd, const char *call) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    if (n <= 0) return 0;
    path[n] = 0;
    return fails(path, call);
}

#define REAL(name) static __typeof__(name) *real; if (!real) real = dlsym(RTLD_NEXT, #name)

ssize_t pwrite(int fd, const void *data, size_t n, off_t at) {
    REAL(pwrite);
    return fd_fails(fd, "write") ? -1 : real(fd, data, n, at);
}
ssize_t pwrite64(int fd, const void *data, size_t n, off64_t at) {
    REAL(pwrite64);
    return fd_fails(fd, "write") ? -1 : real(fd, data, n, at);
}
ssize_t write(int fd, const void *data, size_t n) {
    REAL(write);
    return fd_fails(fd, "write") ? -1 : real(fd, data, n);
}
int fsync(int fd) {
    REAL(fsync);
    return fd_fails(fd, "sync") ? -1 : real(fd);
}
int fdatasync(int fd) {
    REAL(fdatasync);
    return fd_fails(fd, "sync") ? -1 : real(fd);
}
int open64(const char *path, int flags, ...) {
    REAL(open64);
    va_list more;
    va_start(more, flags);
    int mode = va_arg(more, int);
    va_end(more);
    return (flags & O_CREAT) && fails(path, "create") ? -1 : real(path, flags, mode);
}
"""


def compiler() -> str:
    """Why the library cannot be built; "" where it can."""
    return "" if shutil.which("cc") else "needs a C compiler (cc), to build a library of failing writes"


class FailingWrites:
    """The library and its switch, in a folder. `calls`: some of write, sync, create."""

    def __init__(
        self,
        folder: Path,
        errno: int,
        *,
        path: Path | str,
        but: str = "",
        calls: tuple[str, ...] = ("write",),
        share: float = 1.0,
        once: bool = False,
        seed: int = 0,
    ):
        """Build it. Of the calls for files whose path contains `path` and not `but` a `share` fails; `once`: one alone."""
        self._switch = folder / "fault"
        library = folder / "fault.so"
        command = ["cc", "-shared", "-fPIC", "-O1", "-w", "-x", "c", "-", "-o", str(library), "-ldl"]
        subprocess.run(command, input=_SOURCE, text=True, check=True)
        self.environment = {
            "LD_PRELOAD": str(library),
            "FAULT_SWITCH": str(self._switch),
            "FAULT_PATH": str(path),
            "FAULT_NOT": but,
            "FAULT_CALLS": " ".join(calls),
            "FAULT_SHARE": str(share),
            "FAULT_ONCE": str(int(once)),
            "FAULT_SEED": str(seed),
            "FAULT_ERRNO": str(errno),
        }

    def on(self) -> None:
        """From now on calls fail."""
        self._switch.touch()

    def off(self) -> None:
        """No call fails any more."""
        self._switch.unlink(missing_ok=True)

    @property
    def is_on(self) -> bool:
        """Whether calls fail; of one that fails once: not yet."""
        return self._switch.exists()
