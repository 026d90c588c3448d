"""Files that are there completely or not at all: written under another name in the same folder, renamed at the end.

Every page, JSON object and table goes this way; what a reader may follow as it grows is opened with `growing`.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

from canid.io.files import opening
from canid.ui.cli.output import outputs
from canid.ui.cli.output.outputs import Output, StandardOutput, TextOutput, is_stream, writing_to
from canid.values.errors import OutputError


class Part(NamedTuple):
    """A file that is being written."""

    output: Output
    path: str  # under which it is written
    file: BinaryIO


class CompleteFiles:
    """All files of a command: they get their names together, when the last one is written."""

    def __init__(self) -> None:
        """None yet."""
        self._parts: list[Part] = []

    @contextmanager
    def writing(self, output: Output) -> Iterator[Part]:
        """Open a file under a temporary name; an OSError within becomes an OutputError that names `output`.

        Raises:
            OutputError: it cannot be written, or a file that must not be replaced is there.
        """
        part = self.begin(output)
        with writing_to(output.path):
            yield part
            part.file.close()

    def begin(self, output: Output) -> Part:
        """Open a file under a temporary name. Raises OutputError."""
        outputs.check([output])
        with writing_to(output.path):
            self._parts.append(_opened(output))
        return self._parts[-1]

    def commit(self) -> None:
        """Give all files their names. Raises OutputError."""
        outputs.check([part.output for part in self._parts])
        while self._parts:
            part = self._parts[0]
            with writing_to(part.output.path):
                part.file.close()
                _named(part)
            self._parts.pop(0)

    def discard(self) -> None:
        """Remove what has no name of its own yet."""
        for part in self._parts:
            with suppress(OSError):
                part.file.close()
            with suppress(OSError):
                os.unlink(part.path)


@contextmanager
def complete_files() -> Iterator[CompleteFiles]:
    """Files of a command: all of them are there if the body ends, none of them if it is left by an exception."""
    files = CompleteFiles()
    try:
        yield files
        files.commit()
    finally:
        files.discard()


class Document:
    """A text or page that is being written."""

    def __init__(self, part: Part) -> None:
        """Nothing is written yet."""
        self.begun = False
        self._part = part

    def write(self, data: str | bytes) -> None:
        """Write text (as UTF-8) or bytes. Raises OutputError."""
        self.begun = True
        with writing_to(self._part.output.path):
            self._part.file.write(data.encode("utf-8", "backslashreplace") if isinstance(data, str) else data)


@contextmanager
def opened(output: Output | None, *, growing: bool = False) -> Iterator[TextOutput | None]:
    """Open an output for a text that is there as a whole if the body ends, and not at all if it is left by an exception.

    None gives None. What exists is replaced at the end, and only where something was written; a pipe or a device is
    written at once, and so is every output that is `growing`, whose reader wants each line as soon as it is known.

    Raises:
        OutputError: it cannot be written, or a file that must not be replaced is there.
    """
    if output is None or output.stdout:
        yield StandardOutput() if output else None
        return
    with outputs.opened_file(output) if growing else opened_file(output) as file:
        yield file


def write(output: Output | None, make: Callable[[], str]) -> None:
    """Write the text that a function makes, where there is an output for it. Raises OutputError as `opened` does."""
    with opened(output) as file:
        if file is not None:
            file.write(make())


@contextmanager
def opened_file(output: Output) -> Iterator[TextOutput]:
    """Open an output that is a file, as `opened` does."""
    if is_stream(output.path):
        with outputs.opened_file(output) as file:
            yield file
        return
    files = CompleteFiles()
    try:
        document = Document(files.begin(output))
        yield document
        if document.begun:
            files.commit()
    finally:
        files.discard()


def _opened(output: Output) -> Part:
    # a link stays one: what it leads to is replaced
    target = Path(os.path.realpath(output.path))
    # in the folder of a device nothing is renamed; of a file in a folder that is not ours it is the content that is replaced
    renamed = not is_stream(output.path) and os.access(target.parent, os.W_OK)
    folder = target.parent if renamed else Path(tempfile.gettempdir())
    # writers know a format by its suffix
    fd, path = opening.create_temporary(folder / "canid", target.suffix[:10])
    return Part(output, str(path), os.fdopen(fd, "w+b"))


def _named(part: Part) -> None:
    target = os.path.realpath(part.output.path)
    if os.path.exists(target):
        # recognised by `outputs.check` just before
        try:
            if is_stream(target):
                raise OSError(errno.EXDEV, os.strerror(errno.EXDEV))
            os.chmod(part.path, stat.S_IMODE(os.stat(target).st_mode))
            os.replace(part.path, target)
        except OSError as error:
            # another file system (a device's, a file that is mounted by itself): the content
            if error.errno not in (errno.EXDEV, errno.EBUSY):
                raise
            fd = opening.stream(target) if is_stream(target) else opening.existing_named(target)
            with open(part.path, "rb") as source, os.fdopen(fd, "wb", buffering=0) as sink:
                if not is_stream(target):
                    sink.truncate(0)
                shutil.copyfileobj(source, sink)
            os.unlink(part.path)
        return
    try:
        os.link(part.path, target)  # never over a file that has just appeared
    except FileExistsError:
        raise OutputError(f"{part.output.path}: exists already; choose another name or use --force") from None
    except OSError:  # no hard links here (FAT, some network file systems)
        os.rename(part.path, target)
        return
    os.unlink(part.path)
