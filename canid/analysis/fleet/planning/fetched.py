"""A log as a local file: as it is, or fetched from storage that fsspec reads to a temporary file."""

from __future__ import annotations

import posixpath
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from canid.analysis.fleet.failed import Failed, failure_of
from canid.analysis.fleet.job import Failure
from canid.analysis.fleet.planning import address, remote
from canid.io.files import opening
from canid.values.errors import ConfigError, one_line

# s before another attempt where the storage itself does not answer; the run waits for a longer outage (`storage_wait`)
PAUSES_S = (1.0, 4.0)

# bytes; twice a day of a full 500 kbit/s bus as .asc (8,000 frames/s of 70 bytes): no log is larger
MAX_BYTES = 100_000_000_000
# bytes of the disk that stay free: a log that fills it would stop everything else on the machine
SPARE_BYTES = 500_000_000
# bytes that are fetched at once; fsspec's own default is 5 MB
BLOCK_BYTES = 4_000_000


class Listed(NamedTuple):
    """Size and time of a log when it was listed."""

    size: int = -1  # bytes; 0 and below: not known
    modified_ns: int = 0  # ns since 1970; 0: not known


@contextmanager
def fetched(log: str, listed: Listed | None = None) -> Iterator[Path]:
    """Give a local path for a log; what was fetched is deleted at the end.

    Args:
        log: path or URL.
        listed: what is known of a URL's file; that of a local one is for the caller to compare.

    Raises:
        Failed: it cannot be fetched: `missing`, `permission`, `unreadable`, `changed`, or `not_reached`: the storage
            did not answer.

    Example:
        >>> with fetched("replay_logs/following_urban.blf") as path:
        ...     path.name
        'following_urban.blf'
    """
    if not is_stored(log):
        yield Path(_file_system(log)[1] if address.is_address(log) else log)
        return
    with tempfile.TemporaryDirectory(prefix="canid-") as folder:
        yield fetch(log, listed or Listed(), Path(folder))


def is_stored(log: str) -> bool:
    """Whether a log has to be fetched: it is no local file.

    Raises:
        Failed: it has the form of an address, and canid opens none of its kind.

    Example:
        >>> is_stored("s3://bucket/a.blf"), is_stored("file:///a.blf"), is_stored("a.blf")
        (True, False, False)
    """
    try:
        return address.is_address(log) and address.scheme_of(log) not in address.LOCAL
    except ConfigError as error:
        raise Failed(Failure.UNREADABLE, one_line(error)) from None


def fetch(log: str, listed: Listed, folder: Path) -> Path:
    """Fetch a log of a storage.

    Args:
        log: URL.
        listed: what is known of it.
        folder: where the copy is made.

    Raises:
        Failed: it cannot be fetched; see `fetched`.
    """
    system, path = _file_system(log)
    target = folder / f"log{_suffixes(path)}"
    for pause in (*PAUSES_S, None):
        try:
            _fetch(system, path, target, listed)
            break
        except Failed:
            raise
        except Exception as error:  # each storage has exceptions of its own
            out = remote.is_outage(error)
            if out and pause is not None:
                # what a storage keeps in memory of its folders may be of before
                system.invalidate_cache()
                target.unlink(missing_ok=True)
                time.sleep(pause)
                continue
            if out:
                raise Failed(
                    Failure.NOT_REACHED, f"its storage does not answer ({one_line(error)})"
                ) from None
            failure = failure_of(error, Failure.UNREADABLE)
            raise Failed(failure, f"cannot be fetched ({one_line(error)})") from None
    return target


def seen(log: str) -> bool:
    """Whether this machine can open a log: what a worker then misses lacks there, not the log.

    Example:
        >>> seen("replay_logs/following_urban.blf"), seen("/no such file.blf")
        (True, False)
    """
    try:
        if address.is_address(log):
            system, path = _file_system(log)
            system.info(path)
        else:
            with open(log, "rb"):
                pass
    except Exception:  # each storage has exceptions of its own
        return False
    return True


def answers(log: str) -> bool:
    """Whether the storage of a URL answers, be it that there is no such file.

    Example:
        >>> answers("memory://no such file"), answers("http://127.0.0.1:9/a.blf")
        (True, False)
    """
    try:
        system, path = _file_system(log)
        system.invalidate_cache()
        system.info(path)
    except Exception as error:  # each storage has exceptions of its own
        return not remote.is_outage(error)
    return True


def _fetch(system: Any, path: str, target: Path, listed: Listed) -> None:
    info = system.info(path)
    _check(info, listed)
    size = info.get("size")
    known = size if isinstance(size, int) and size >= 0 else None
    _room(known, str(target.parent))
    _copy(system, path, target, known)
    _check(system.info(path), Listed(target.stat().st_size if known is not None else -1, _time(info)))


def _file_system(log: str) -> tuple[Any, str]:
    scheme = address.scheme_of(log)
    try:
        system, path = address.opened(log)
    except ImportError as error:
        extra = "s3" if scheme in address.S3 else "fleet"
        reason = f"{scheme} URLs need a package: {one_line(error)}; pip install 'canid[{extra}]'"
        raise Failed(Failure.NOT_REACHED, reason) from None
    except Exception as error:  # each storage has exceptions of its own
        raise Failed(
            failure_of(error, Failure.UNREADABLE), f"cannot be fetched ({one_line(error)})"
        ) from None
    return system, path


def _suffixes(path: str) -> str:
    """The suffixes by which a format is known, without what follows the name in a URL.

    >>> _suffixes("https://host/a.b/drive.2.asc.gz?version=3"), _suffixes("bucket/drive")
    ('.asc.gz', '')
    """
    name = posixpath.basename(urlsplit(path).path)
    suffixes = Path(name).suffixes
    return "".join(suffixes[-2:] if suffixes[-1:] == [".gz"] else suffixes[-1:])


def _time(info: Mapping[str, Any]) -> int:
    return remote.modified_ns(info)


def _check(info: Mapping[str, Any], listed: Listed) -> None:
    """Raise where size or time are not those that were listed, as far as both are known."""
    size, modified = info.get("size"), _time(info)
    if (listed.size > 0 and isinstance(size, int) and size != listed.size) or (
        listed.modified_ns and modified and modified != listed.modified_ns
    ):
        raise Failed(Failure.CHANGED, "changed since it was listed; run again when nothing writes to it")


def _room(size: int | None, folder: str) -> int:
    """How many bytes may be fetched to a folder. Raises where `size` is more."""
    free = shutil.disk_usage(folder).free - SPARE_BYTES
    if size is not None and size > MAX_BYTES:
        raise Failed(Failure.UNREADABLE, f"has {size:,} bytes; the largest that is fetched has {MAX_BYTES:,}")
    if size is not None and size > free:
        says = f"has {size:,} bytes; {folder} has room for {max(free, 0):,}: set TMPDIR to a larger disk"
        raise Failed(Failure.UNREADABLE, says)
    return min(free, MAX_BYTES)


def _copy(system: Any, path: str, target: Path, size: int | None) -> None:
    """Copy a file, no more bytes than it has, or than there is room for."""
    room = size if size is not None else _room(None, str(target.parent))
    done = 0
    with system.open(path, "rb", block_size=BLOCK_BYTES) as source, opening.create_file(target) as sink:
        while block := source.read(BLOCK_BYTES):
            done += len(block)
            if done > room:
                if size is not None:
                    raise Failed(
                        Failure.CHANGED, "grew while it was fetched; run again when nothing writes to it"
                    )
                raise Failed(
                    Failure.UNREADABLE, f"has more than the {max(room, 0):,} bytes that there is room for"
                )
            sink.write(block)
    if size is not None and done < size:
        raise Failed(Failure.CHANGED, "shrank while it was fetched; run again when nothing writes to it")
