"""A fleet's folder in storage that fsspec writes, such as s3://bucket/results: a local copy that is uploaded part by part.

The run works in the local copy, which has the lock and the journal: what a kill leaves is there, and the same command on the
same machine loses nothing. Each part is uploaded when it is complete. In storage it counts as it does locally, once it has
its `outcomes.parquet`, which is uploaded last: nothing is renamed. Another machine fetches the parts and goes on from there.
Two machines at once are not locked out by a storage without locks: the second one to upload a part of a number that is taken
is stopped.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from canid.analysis.fleet.planning import address, remote
from canid.analysis.fleet.planning.listing import MARK, is_url
from canid.analysis.fleet.storage import generations, journal, lock, parts
from canid.analysis.fleet.storage.columns import SUMMARIES, TABLES
from canid.analysis.fleet.storage.lock import LockError
from canid.io.files import opening
from canid.values.errors import CanidError, ConfigError, OutputError, one_line

_LAST_OF_PART = f"{journal.LAST}.parquet"
# uploaded in this order; the generation that they name says which belong together (generations.py)
_TABLES = tuple(f"{name}.parquet" for name in (*TABLES, *SUMMARIES, "logs"))
_ROOT = (MARK, *_TABLES)
_PART = re.compile(r"parts/([0-9]{6,9}(?:-[0-9]{6,9})?)/\w+\.parquet")
# what was the same on both sides the last time: name -> what the storage stated, and size and time of the local file
_SYNCED = "synced.json"


class Working(NamedTuple):
    """A folder to work in."""

    folder: Path
    push: Callable[[], None]  # upload what is new; does nothing of a folder that is local. Raises OutputError


@contextmanager
def working(folder: str) -> Iterator[Working]:
    """The local folder to work in, with what the storage has; at the end what is new is uploaded.

    Args:
        folder: a path, which is taken as it is, or a URL.

    Raises:
        ConfigError: the storage cannot be reached, or a package is missing.
        OutputError: it holds other things, or cannot be written.

    Example:
        >>> with working("out") as at:
        ...     at.folder.name
        'out'
    """
    if not is_url(folder):
        yield Working(Path(folder), lambda: None)
        return
    mirror = _Mirror(folder)
    with mirror.held():
        mirror.pull()
        try:
            yield Working(mirror.folder, mirror.push)
        finally:
            if os.path.exists(mirror.folder / MARK):
                mirror.push()


def local(folder: str) -> str:
    """A folder to read from: of a URL the local copy, with what the storage has. Raises as `working`.

    Example:
        >>> local("out")
        'out'
    """
    if not is_url(folder):
        return folder
    mirror = _Mirror(folder)
    # a run that works in the copy has tables at least as new
    with suppress(LockError), mirror.held():
        mirror.pull(tables_alone=True)
    return str(mirror.folder)


def copy_of(url: str) -> Path:
    """Where the local copy is: in the user's cache (XDG_CACHE_HOME), under the name of the URL's last folder.

    Example:
        >>> copy_of("s3://bucket/results/").name
        'results'
    """
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    plain = url.rstrip("/")
    return (
        caches
        / "canid"
        / "fleet"
        / hashlib.sha256(plain.encode()).hexdigest()[:16]
        / plain.rpartition("/")[2]
    )


class _Mirror:
    """The two sides of one folder."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self.folder = copy_of(url)
        try:
            self._system, self._path = address.opened(self.url)
        except Exception as error:  # each storage has exceptions of its own
            raise ConfigError(f"{url}: {one_line(error)}; pip install 'canid[fleet,s3]'") from None

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the lock of the local copy. Raises LockError where another process of this machine works in it."""
        with self._saying("cannot be read"):
            self.folder.mkdir(parents=True, exist_ok=True)
        with lock.held(self.folder):
            yield

    def pull(self, *, tables_alone: bool = False) -> None:
        """Fetch the parts that are not here, and the tables that another machine has written."""
        with self._saying("cannot be read"):
            there = self._there()
            if there and MARK not in there:
                raise OutputError(
                    f"{self.url}: holds other things than results of canid fleet; name an empty or a new folder with -o"
                )
            known = self._known()
            # first by what the copy is known as a fleet's folder
            self._fetch([MARK], there, known)
            for name in () if tables_alone else _complete(there):
                if not self._is_here(name):
                    self._fetch_part(name, there)
                known[f"parts/{name}"] = there[f"parts/{name}/{_LAST_OF_PART}"]
            self._fetch_tables(there, known)
            self._note(known)

    def push(self) -> None:
        """Upload what is new here, and delete there what is in a merged part, or is no longer true."""
        with self._saying(
            f"cannot be written; what is missing there is in {self.folder}, and the same command uploads it"
        ):
            known, here = self._known(), self._parts()
            tables = [name for name in _ROOT if os.path.isfile(self.folder / name)]
            for part in here:
                name = f"parts/{part.name}"
                if name not in known:
                    self._send_part(part)
                    known[name] = self._state(f"{name}/{_LAST_OF_PART}")
                    self._note(known)
            for name in tables:
                now = _local(self.folder / name)
                if name not in known or list(known[name][1:]) != now:
                    self._system.put_file(str(self.folder / name), self._at(name))
                    known[name] = [self._state(name), *now]
            for name in sorted(set(known) - {f"parts/{part.name}" for part in here}.union(tables)):
                # the part stops counting with the first one
                for file in sorted(self._below(name), key=lambda file: file != f"{name}/{_LAST_OF_PART}"):
                    self._system.rm_file(self._at(file))
                del known[name]
            self._note(known)

    def _is_here(self, name: str) -> bool:
        """Is a part here, or one that it was merged into?"""
        return any(parts.covers(part, Path(name)) for part in self._parts())

    def _parts(self) -> list[Path]:
        return parts.parts(self.folder) if os.path.isdir(self.folder / "parts") else []

    def _fetch(self, names: Sequence[str], there: Mapping[str, str], known: dict[str, Any]) -> None:
        """Fetch files that are others than the last time."""
        for name in names:
            if name in there and _stated(known.get(name)) != there[name]:
                with opening.private_folder(self.folder / "tables") as made:
                    self._system.get_file(self._at(name), str(made / name))
                    os.replace(made / name, self.folder / name)
                known[name] = [there[name], *_local(self.folder / name)]

    def _fetch_tables(self, there: Mapping[str, str], known: dict[str, Any]) -> None:
        """Fetch the tables that are others than the last time, once they are those of one run."""
        generations.published(self.folder)
        names = [name for name in _TABLES if name in there and _stated(known.get(name)) != there[name]]
        if not names:
            return
        with opening.private_folder(self.folder / "tables") as made:
            for name in names:
                self._system.get_file(self._at(name), str(made / name))
            # else another machine uploads its tables just now; those that are here are whole
            if generations.are_whole(self.folder, made) or not generations.is_folder(self.folder):
                generations.written(self.folder, made, lambda: None)
                known |= {name: [there[name], *_local(self.folder / name)] for name in names}

    def _fetch_part(self, name: str, there: Mapping[str, str]) -> None:
        (self.folder / "parts").mkdir(exist_ok=True)
        # under a name that a run deletes where a kill left it
        made = opening.temporary_name(self.folder / "parts" / name)
        made.mkdir()
        try:
            for file in (file for file in there if file.startswith(f"parts/{name}/")):
                self._system.get_file(self._at(file), str(made / file.rpartition("/")[2]))
            made.rename(self.folder / "parts" / name)
        finally:
            shutil.rmtree(made, ignore_errors=True)

    def _send_part(self, part: Path) -> None:
        try:
            held = self._system.cat_file(self._at(f"parts/{part.name}/{_LAST_OF_PART}"))
        except FileNotFoundError:
            held = None
        if held is not None and held != (part / _LAST_OF_PART).read_bytes():
            raise LockError(
                f"{self.url}: another run has written part {part.name} since this one began; end one of them. Delete "
                f"{self.folder}, and the same command goes on from what the storage has"
            )
        files = sorted(part.glob("*.parquet"), key=lambda file: file.name == _LAST_OF_PART)
        for file in files:
            self._system.put_file(str(file), self._at(f"parts/{part.name}/{file.name}"))

    def _there(self, folder: str = "") -> dict[str, str]:
        """What the storage has, in a folder or in all: name below the URL -> what is another one where the content is."""
        self._system.invalidate_cache()
        try:
            listed: dict[str, Any] = self._system.find(self._at(folder).rstrip("/"), detail=True)
        except FileNotFoundError:
            return {}
        start = self._at("")
        return {name.removeprefix(start): _token(info) for name, info in listed.items()}

    def _below(self, name: str) -> list[str]:
        """Files of a part, or the table itself, that the storage has."""
        if name not in _ROOT:
            return sorted(self._there(name))
        self._system.invalidate_cache()
        return [name] if self._system.exists(self._at(name)) else []

    def _state(self, name: str) -> str:
        self._system.invalidate_cache()
        return _token(self._system.info(self._at(name)))

    def _at(self, name: str) -> str:
        return f"{self._path.rstrip('/')}/{name}"

    def _known(self) -> dict[str, Any]:
        """What was the same on both sides; nothing where the copy was deleted."""
        try:
            noted = json.loads((self.folder.parent / _SYNCED).read_text("utf-8"))
        except (OSError, ValueError):
            return {}
        return noted if isinstance(noted, dict) and os.path.isfile(self.folder / MARK) else {}

    def _note(self, known: Mapping[str, Any]) -> None:
        with opening.replacement(self.folder.parent / _SYNCED) as file:
            file.write(json.dumps(known).encode())

    @contextmanager
    def _saying(self, what: str) -> Iterator[None]:
        try:
            yield
        except CanidError:
            raise
        except ImportError as error:
            raise ConfigError(f"{self.url}: {one_line(error)}; pip install 'canid[fleet,s3]'") from None
        except Exception as error:  # each storage has exceptions of its own
            raise OutputError(f"{self.url}: {what} ({one_line(error)})") from None


def _complete(there: Mapping[str, str]) -> list[str]:
    """Parts in storage that have their last file.

    >>> _complete({"parts/000001/outcomes.parquet": "", "parts/000002/drives.parquet": "", "logs.parquet": ""})
    ['000001']
    """
    named = {match[1] for name in there if (match := _PART.fullmatch(name))}
    return sorted(name for name in named if f"parts/{name}/{_LAST_OF_PART}" in there)


def _token(info: Mapping[str, Any]) -> str:
    return str(info.get("ETag") or f"{info.get('size')} {remote.modified_ns(info)}")


def _stated(known: Any) -> str | None:
    return known[0] if isinstance(known, list) else None


def _local(path: Path) -> list[int]:
    status = path.stat()
    return [status.st_size, status.st_mtime_ns]
