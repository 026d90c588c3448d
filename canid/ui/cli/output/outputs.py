"""Output files: those that options name for writing.

A command declares all its outputs, and `check` refuses them together before anything is opened. A new file is created
exclusively. An existing one is opened without truncation, recognised by its content through that descriptor, and
truncated by the first write only; inputs and files of another kind are never written. Logs are not opened here:
`canid.io.files.new_file` creates each of them under a free name.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import combinations
from pathlib import Path
from typing import NamedTuple, Protocol

from canid.io.files import opening
from canid.ui.cli.output.output_kinds import HEAD_BYTES, RECORDING, SIMULATED, Kind, foreign_kind
from canid.ui.terminal.detached_writer import DetachedWriter
from canid.ui.terminal.streams import Stream
from canid.values.errors import ConfigError, OutputError

# bytes of JSON lines that may wait for a reader that does not read: some hours of estimates
LINES_LIMIT_BYTES = 16 * 1024 * 1024


class Output(NamedTuple):
    """A file that an option names; "-" is standard output."""

    option: str  # as the user knows it: "--json", "OUT.blf"
    path: str
    kind: Kind
    replace: bool = True  # an existing file of the same kind

    @property
    def stdout(self) -> bool:
        """Whether it is standard output."""
        return self.path == "-"


def check(outputs: Iterable[Output | None], inputs: Iterable[str | os.PathLike[str] | None] = ()) -> None:
    """Refuse outputs that must not be written, before any is opened.

    Args:
        outputs: all files that the command writes, including those that it names itself.
        inputs: all files that it reads; names without a file are ignored.

    Raises:
        ConfigError: a name has the suffix of another kind, two outputs are one file, or an output is an input.
        OutputError: a file exists that must not be replaced, or the folder cannot be written.
    """
    files = [output for output in outputs if output is not None and not output.stdout]
    for output in files:
        _name_fits(output)
    read = [(f"the input {path}", str(path)) for path in inputs if path is not None and os.path.exists(path)]
    named = [(output.option, output.path) for output in files]
    for (option, path), (other, other_path) in [
        *combinations(named, 2),
        *((o, i) for o in named for i in read),
    ]:
        if same_file(path, other_path):
            raise ConfigError(f"{option} {path}: is the same file as {other}; choose another name")
    for output in files:
        if output.kind.recognise is None:
            continue
        if not os.path.exists(output.path):
            _creatable(output.path)
        elif not is_stream(output.path):
            os.close(_existing(output, write=False))
            if not os.access(output.path, os.W_OK):
                raise OutputError(f"{output.path}: cannot be written (it is write-protected)")


def same_file(path: str, other: str) -> bool:
    """Whether two names are the same file, through any links, even if it does not exist yet.

    Streams (pipes, devices) hold nothing that could be lost: two options may share one.

    Example:
        >>> same_file("x/../a.json", "./a.json"), same_file("a.json", "b.json"), same_file("/dev/null", "/dev/null")
        (True, False, False)
    """
    if is_stream(path) or is_stream(other):
        return False
    with suppress(OSError):
        if os.path.samefile(path, other):
            return True
    return os.path.normcase(os.path.realpath(path)) == os.path.normcase(os.path.realpath(other))


@contextmanager
def opened_file(output: Output) -> Iterator[OutputFile]:
    """Open an output that is a file, and whose writes may block.

    Raises:
        OutputError: it cannot be written, or a file that must not be replaced has appeared under this name.
    """
    file = OutputFile(output)
    try:
        yield file
    finally:
        file.close()


class TextOutput(Protocol):
    """A sink for text."""

    def write(self, text: str) -> object:
        """Write text."""


class StandardOutput:
    """Standard output for data: always UTF-8, unescaped (JSON escapes names by its own rules)."""

    def write(self, text: str) -> None:
        """Write text."""
        if isinstance(sys.stdout, Stream):
            sys.stdout.write_bytes(text.encode("utf-8", "backslashreplace"))
        else:
            sys.stdout.write(text)


class OutputFile:
    """An output as a text file: UTF-8, unbuffered; an existing file is replaced by the first write only."""

    def __init__(self, output: Output):
        """Open it. A pipe or a device is opened by the first write, which may have to wait for a reader."""
        self._output = output
        self._written = False
        self._created = False
        self._fd = -1
        if not is_stream(output.path):
            self._open()

    def write(self, data: str | bytes) -> None:
        """Write text (as UTF-8) or bytes in full. Raises OutputError."""
        with writing_to(self._output.path):
            self.write_bytes(data.encode("utf-8", "backslashreplace") if isinstance(data, str) else data)

    def write_bytes(self, data: bytes) -> None:
        """Write bytes in full. Raises OSError, or OutputError where the file cannot be opened."""
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
        """Close; a new file into which nothing was written is removed. Raises OutputError."""
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
        with writing_to(self._output.path):  # some file systems report here that something was not written
            os.close(fd)

    def _open(self) -> None:
        path = self._output.path
        with writing_to(path):
            try:
                self._fd = opening.create(path)
                self._created = True
            except FileExistsError:
                self._fd = opening.stream(path) if is_stream(path) else _existing(self._output, write=True)


class DetachedOutput:
    """A text output that may fail, block or be absent: a thread writes it, and nothing waits for that thread."""

    def __init__(self, output: Output):
        """Open it. Raises OutputError where that is known at once."""
        self._path = output.path
        self._file = OutputFile(output)
        self._writer = DetachedWriter(self._put, LINES_LIMIT_BYTES, "canid-output")
        self._lost: str | None = None  # why something was lost, once finished

    def write(self, text: str) -> int:
        """Queue text; never blocks, never raises."""
        self._writer.put(text.encode("utf-8", "backslashreplace"))
        return len(text)

    @property
    def error(self) -> OSError | None:
        """Why nothing more is written; None: no error."""
        return self._writer.error

    def finish(self, timeout: float) -> str:
        """Wait up to `timeout` s for queued text; returns why something was lost, or "". Later calls return at once."""
        if self._lost is None:
            self._lost = self._close(timeout)
        return self._lost

    def _close(self, timeout: float) -> str:
        if self._writer.close(timeout):
            with suppress(OutputError):
                self._file.close()
            return ""
        error = self._writer.error
        why = error.strerror or str(error) if error else f"its reader left {self._writer.lost} pieces unread"
        return f"{self._path}: cannot be written ({why})"

    def _put(self, data: bytes) -> None:
        try:
            self._file.write_bytes(data)
        except OutputError as error:
            raise OSError(0, str(error)) from error


def _name_fits(output: Output) -> None:
    real = os.path.realpath(output.path)
    # the name of the file itself protects its content, not that of a link to it
    linked = os.path.isfile(real) and os.path.getsize(real)
    names = [os.path.basename(path) for path in ((output.path, real) if linked else (output.path,))]
    other = next(filter(None, (foreign_kind(name, output.kind) for name in names)), "")
    is_log = output.kind in (RECORDING, SIMULATED)  # canid.io.logs knows their suffixes
    if other and not is_log:
        raise ConfigError(
            f"{output.option} {output.path}: this option writes {output.kind.name}, but the name is that of {other}; "
            f"use a name that ends with {output.kind.suffixes[0]}"
        )


def _existing(output: Output, *, write: bool) -> int:
    """Open an existing regular file, recognised by its content. Raises OutputError."""
    path = output.path
    with writing_to(path):
        try:
            fd = opening.existing_named(path, write=write)
        except FileNotFoundError as error:
            raise OutputError(f"{path}: is a link to nothing; choose another name") from error
        except OSError as error:
            if error.errno != errno.EMLINK:
                raise
            raise OutputError(
                f"{path}: exists under another name as well (a hard link): it is left as it is; choose another name"
            ) from error
        try:
            # read and seek back: Windows has no pread
            head = os.read(fd, HEAD_BYTES)
            os.lseek(fd, 0, os.SEEK_SET)
            # an empty file, such as after a failure, holds nothing that could be lost
            if head and not (output.kind.recognise and output.kind.recognise(head)):
                raise OutputError(
                    f"{path}: exists and is not {output.kind.name}: it is left as it is; choose another name"
                )
            if not output.replace:
                raise OutputError(f"{path}: exists already; choose another name or use --force")
        except BaseException:
            os.close(fd)
            raise
    return fd


def _creatable(path: str) -> None:
    """Check that a new file can be created. Raises OutputError."""
    if os.path.islink(path):
        raise OutputError(f"{path}: is a link to nothing; choose another name")
    folder = Path(path).parent
    if not os.path.isdir(folder):
        why = "Not a directory" if os.path.exists(folder) else "No such file or directory"
        raise OutputError(f"{path}: cannot be written ({why})")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: cannot be written (Permission denied)")


def is_stream(path: str) -> bool:
    """Whether it is a pipe, a device or a socket: nothing in it can be overwritten."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or stat.S_ISSOCK(mode)


@contextmanager
def writing_to(path: str) -> Iterator[None]:
    """Raise an OSError as the OutputError for a file that the system does not let write."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
