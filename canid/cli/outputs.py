"""The one place that opens the files which options name for writing: it never opens a foreign file or an input.

A command declares all its outputs, and `check` refuses them together before anything is opened. A file that is new is
created exclusively; one that exists is opened without truncation, recognised by its content through that descriptor,
and emptied with the first write only. Logs are not opened here: `canid.frames.disk` creates each of them under a name
that is free.
"""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import combinations
from pathlib import Path
from typing import NamedTuple, Protocol

from canid.cli.detached_writer import DetachedWriter
from canid.cli.output_kinds import HEAD, RECORDING, SIMULATED, Kind, promised
from canid.cli.streams import Stream
from canid.errors import ConfigError, OutputError

# bytes of JSON lines that may wait for a reader that does not read: some hours of estimates
LINES_LIMIT = 16 * 1024 * 1024


class Output(NamedTuple):
    """A file that an option names; "-" is standard output."""

    option: str  # as the user knows it: "--json", "OUT.blf"
    path: str
    kind: Kind
    replace: bool = True  # one of the same kind that exists is replaced

    @property
    def stdout(self) -> bool:
        """Is it standard output?"""
        return self.path == "-"


def check(outputs: Iterable[Output | None], inputs: Iterable[str | os.PathLike[str] | None] = ()) -> None:
    """Refuse outputs that must not be written, before any is opened.

    Args:
        outputs: all files that the command writes, also those whose names it makes itself.
        inputs: all files that it reads; names that are no files are passed over.

    Raises:
        ConfigError: a name promises another kind of file, two outputs are one file, or an output is an input.
        OutputError: a file exists that must not be replaced, or the folder cannot be written.
    """
    wanted = [output for output in outputs if output is not None and not output.stdout]
    for output in wanted:
        _name_fits(output)
    read = [(f"the input {path}", str(path)) for path in inputs if path is not None and os.path.exists(path)]
    named = [(output.option, output.path) for output in wanted]
    for (option, path), (other, of) in [*combinations(named, 2), *((o, i) for o in named for i in read)]:
        if same_file(path, of):
            raise ConfigError(f"{option} {path}: is the same file as {other}; choose another name")
    for output in wanted:
        if output.kind.recognise is None:
            continue
        if not os.path.exists(output.path):
            _creatable(output.path)
        elif not _is_stream(output.path):
            os.close(_existing(output, os.O_RDONLY))
            if not os.access(output.path, os.W_OK):
                raise OutputError(f"{output.path}: cannot be written (it is write-protected)")


def same_file(path: str, other: str) -> bool:
    """Tell whether two names are of one file, by any links; also where it does not exist yet.

    Streams (pipes, devices) keep nothing that could be lost: two options may share one.

    Example:
        >>> same_file("x/../a.json", "./a.json"), same_file("a.json", "b.json"), same_file("/dev/null", "/dev/null")
        (True, False, False)
    """
    if _is_stream(path) or _is_stream(other):
        return False
    with suppress(OSError):
        if os.path.samefile(path, other):
            return True
    return os.path.normcase(os.path.realpath(path)) == os.path.normcase(os.path.realpath(other))


@contextmanager
def opened(output: Output | None) -> Iterator[TextOutput | None]:
    """Open an output for a command that may wait for it; None gives None.

    Raises:
        OutputError: it cannot be written, or a file has come under this name that must not be replaced.
    """
    if output is None or output.stdout:
        yield StandardOutput() if output else None
        return
    with opened_file(output) as file:
        yield file


@contextmanager
def opened_file(output: Output) -> Iterator[OutputFile]:
    """Open an output that is a file, as `opened` does."""
    file = OutputFile(output)
    try:
        yield file
    finally:
        file.close()


class TextOutput(Protocol):
    """What takes the text of an output."""

    def write(self, text: str) -> object:
        """Take text."""


class StandardOutput:
    """Standard output for data: always UTF-8, and as it is (names in JSON are escaped by JSON's own rules)."""

    def write(self, text: str) -> None:
        """Write text."""
        if isinstance(sys.stdout, Stream):
            sys.stdout.write_bytes(text.encode("utf-8", "backslashreplace"))
        else:
            sys.stdout.write(text)


class OutputFile:
    """An output, as a text file: UTF-8, unbuffered; replaced only when something is written."""

    def __init__(self, output: Output):
        """Open it. A pipe or a device is opened with the first write: that may have to wait for a reader."""
        self._output = output
        self._written = False
        self._created = False
        self._fd = -1
        if not _is_stream(output.path):
            self._open()

    def write(self, data: str | bytes) -> None:
        """Write text (as UTF-8) or bytes, all of it; raises OutputError."""
        try:
            self.write_bytes(data.encode("utf-8", "backslashreplace") if isinstance(data, str) else data)
        except OSError as error:
            raise _unwritable(self._output.path, error) from error

    def write_bytes(self, data: bytes) -> None:
        """Write bytes, all of them; raises OSError, or OutputError where it cannot be opened."""
        if self._fd < 0:
            self._open()
        if not self._written:
            self._written = True
            if not self._created and stat.S_ISREG(os.fstat(self._fd).st_mode):
                os.ftruncate(self._fd, 0)
        view, done = memoryview(data), 0
        while done < len(data):
            done += os.write(self._fd, view[done:])

    def close(self) -> None:
        """Close; a file that was created and into which nothing was written is removed. Raises OutputError."""
        if self._fd < 0:
            return
        fd, self._fd = self._fd, -1
        with suppress(OSError):
            if (
                self._created
                and not self._written
                and os.path.samestat(os.fstat(fd), os.lstat(self._output.path))
            ):
                os.unlink(self._output.path)
        try:
            os.close(fd)
        except OSError as error:  # some file systems tell here that something was not written
            raise _unwritable(self._output.path, error) from error

    def _open(self) -> None:
        path = self._output.path
        flags = os.O_WRONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
        try:
            self._fd = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o666)
            self._created = True
        except FileExistsError:
            if _is_stream(path):
                self._fd = os.open(path, flags)
            else:
                self._fd = _existing(self._output, os.O_RDWR)
        except OSError as error:
            raise _unwritable(path, error) from error


class DetachedOutput:
    """A text output that may fail, block or be absent: lines are handed to a thread, and nobody waits for it."""

    def __init__(self, output: Output):
        """Open it. Raises OutputError where that can be told at once."""
        self._path = output.path
        self._file = OutputFile(output)
        self._writer = DetachedWriter(self._put, LINES_LIMIT, "canid-output")
        self._lost: str | None = None  # why something was lost, once it is finished

    def write(self, text: str) -> int:
        """Hand over text; never waits, never raises."""
        self._writer.put(text.encode("utf-8", "backslashreplace"))
        return len(text)

    @property
    def error(self) -> OSError | None:
        """Why nothing more is written."""
        return self._writer.error

    def finish(self, timeout: float) -> str:
        """Wait up to `timeout` s for what waits; returns why something was lost, or "". Once: later calls do not wait."""
        if self._lost is None:
            self._lost = self._finished(timeout)
        return self._lost

    def _finished(self, timeout: float) -> str:
        if self._writer.close(timeout):
            with suppress(OutputError):
                self._file.close()
            return ""
        error = self._writer.error
        why = (
            error.strerror or str(error)
            if error
            else f"its reader has left {self._writer.lost} pieces unread"
        )
        return f"{self._path}: cannot be written ({why})"

    def _put(self, data: bytes) -> None:
        try:
            self._file.write_bytes(data)
        except OutputError as error:
            raise OSError(0, str(error)) from error


def _name_fits(output: Output) -> None:
    real = os.path.realpath(output.path)
    # a file that holds something is protected by its own name, not by that of a link to it
    linked = os.path.isfile(real) and os.path.getsize(real)
    names = [os.path.basename(path) for path in ((output.path, real) if linked else (output.path,))]
    what = next(filter(None, (promised(name, output.kind) for name in names)), "")
    own = output.kind in (RECORDING, SIMULATED)  # which suffixes there are canid.frames tells
    if what and not own:
        raise ConfigError(
            f"{output.option} {output.path}: this option writes {output.kind.name}, and the name says {what}; "
            f"name a {output.kind.suffixes[0]} file"
        )


def _existing(output: Output, flags: int) -> int:
    """Open a regular file that exists, recognised by its content. Raises OutputError."""
    path = output.path
    try:
        fd = os.open(path, flags | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError as error:
        raise OutputError(f"{path}: is a link to nothing; choose another name") from error
    except OSError as error:
        raise _unwritable(path, error) from error
    try:
        found = os.fstat(fd)
        if not stat.S_ISREG(found.st_mode):
            raise OutputError(f"{path}: cannot be written (it is no file)")
        # the position is at the start, and is set back: Windows has no pread
        head = os.read(fd, HEAD)
        os.lseek(fd, 0, os.SEEK_SET)
        # what canid has once recognised and a failure left empty holds nothing that could be lost
        if head and not (output.kind.recognise and output.kind.recognise(head)):
            raise OutputError(
                f"{path}: exists and is not {output.kind.name}: it is left as it is; choose another name"
            )
        if not output.replace:
            raise OutputError(f"{path}: exists already; choose another name or use --force")
    except OSError as error:
        os.close(fd)
        raise _unwritable(path, error) from error
    except OutputError:
        os.close(fd)
        raise
    return fd


def _creatable(path: str) -> None:
    """Find out whether a new file may be created. Raises OutputError."""
    if os.path.islink(path):
        raise OutputError(f"{path}: is a link to nothing; choose another name")
    folder = Path(path).parent
    if not folder.is_dir():
        why = "Not a directory" if folder.exists() else "No such file or directory"
        raise OutputError(f"{path}: cannot be written ({why})")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: cannot be written (Permission denied)")


def _is_stream(path: str) -> bool:
    """Tell whether it is a pipe, a device or a socket: nothing in it can be overwritten."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or stat.S_ISSOCK(mode)


def _unwritable(path: str, error: OSError) -> OutputError:
    return OutputError(f"{path}: cannot be written ({error.strerror})")
