"""Files that are there completely or not at all: written under another name in the same folder, renamed at the end."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

from canid.cli.output import outputs
from canid.cli.output.outputs import Output, is_stream, unwritable
from canid.errors import OutputError

# temporary names that are tried: each is random, so one is enough unless another program interferes
_TRIES = 8


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
        outputs.check([output])
        try:
            part = _opened(output)
            self._parts.append(part)
            yield part
            part.file.close()
        except OSError as error:
            raise unwritable(output.path, error) from error

    def commit(self) -> None:
        """Give all files their names. Raises OutputError."""
        outputs.check([part.output for part in self._parts])
        while self._parts:
            part = self._parts[0]
            try:
                _named(part)
            except OSError as error:
                raise unwritable(part.output.path, error) from error
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


def _opened(output: Output) -> Part:
    # a link stays one: what it leads to is replaced
    target = Path(os.path.realpath(output.path))
    # in the folder of a device nothing is renamed
    folder = Path(tempfile.gettempdir()) if is_stream(output.path) else target.parent
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    for _ in range(_TRIES):
        # writers know a format by its suffix; the name may be as long as the system allows
        path = folder / f".canid-{secrets.token_hex(8)}{target.suffix[:10]}"
        with suppress(FileExistsError):
            return Part(output, str(path), os.fdopen(os.open(path, flags, 0o666), "w+b"))
    raise OSError(0, "no temporary name is free")


def _named(part: Part) -> None:
    target = os.path.realpath(part.output.path)
    if is_stream(part.output.path):
        with open(part.path, "rb") as source, open(target, "wb", buffering=0) as sink:
            shutil.copyfileobj(source, sink)
        os.unlink(part.path)
        return
    if os.path.exists(target):
        # recognised by `outputs.check` just before
        os.chmod(part.path, stat.S_IMODE(os.stat(target).st_mode))
        os.replace(part.path, target)
        return
    try:
        os.link(part.path, target)  # never over a file that has just appeared
    except FileExistsError:
        raise OutputError(f"{part.output.path}: exists already; choose another name or use --force") from None
    except OSError:  # no hard links here (FAT, some network file systems)
        os.rename(part.path, target)
        return
    os.unlink(part.path)
