"""A log as a local file: as it is, or fetched from storage that fsspec reads to a temporary file."""

from __future__ import annotations

import posixpath
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from canid.errors import one_line
from canid.fleet import listing, remote
from canid.fleet.failed import Failed, failure_of
from canid.fleet.job import Failure

# bytes; twice a day of a full 500 kbit/s bus as .asc (8,000 frames/s of 70 bytes): no log is larger
MAX_BYTES = 100_000_000_000
# bytes of the disk that stay free: a log that fills it would stop everything else on the machine
SPARE_BYTES = 500_000_000
# bytes that are fetched at once; fsspec's own default is 5 MB
BLOCK_BYTES = 4_000_000


class Listed(NamedTuple):
    """Size and time of a log when it was listed."""

    size: int = -1  # bytes; below 0: not known
    modified_ns: int = 0  # ns since 1970; 0: not known


@contextmanager
def fetched(log: str, listed: Listed | None = None) -> Iterator[Path]:
    """Give a local path for a log; what was fetched is deleted at the end.

    Args:
        log: path or URL.
        listed: what is known of a URL's file; that of a local one is for the caller to compare.

    Raises:
        Failed: it cannot be fetched: `missing`, `permission`, `unreadable` or `changed`.

    Example:
        >>> with fetched("replay_logs/following_urban.blf") as path:
        ...     path.name
        'following_urban.blf'
    """
    if not listing.is_url(log):
        yield Path(log)
        return
    scheme = log.partition("://")[0]
    system, path = _file_system(log, scheme)
    if scheme in ("file", "local"):
        yield Path(path)
        return
    with tempfile.TemporaryDirectory(prefix="canid-") as folder:
        target = Path(folder) / f"log{_suffixes(path)}"
        try:
            info = system.info(path)
            _check(info, listed or Listed())
            size = info.get("size")
            known = size if isinstance(size, int) and size >= 0 else None
            _room(known, folder)
            _copy(system, path, target, known)
            _check(system.info(path), Listed(target.stat().st_size if known is not None else -1, _time(info)))
        except Failed:
            raise
        except Exception as error:  # each storage has exceptions of its own
            raise Failed(
                failure_of(error, Failure.UNREADABLE), f"cannot be fetched ({one_line(error)})"
            ) from None
        yield target


def _file_system(log: str, scheme: str) -> tuple[Any, str]:
    try:
        import fsspec

        system, path = fsspec.core.url_to_fs(log)
    except ImportError as error:
        extra = "s3" if scheme.startswith("s3") else "fleet"
        reason = f"{scheme} URLs need a package: {one_line(error)}; pip install 'canid[{extra}]'"
        raise Failed(Failure.UNREADABLE, reason) from None
    except Exception as error:  # each storage has exceptions of its own
        raise Failed(
            failure_of(error, Failure.UNREADABLE), f"cannot be fetched ({one_line(error)})"
        ) from None
    return system, str(path)


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
    if (listed.size >= 0 and isinstance(size, int) and size != listed.size) or (
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
    with system.open(path, "rb", block_size=BLOCK_BYTES) as source, target.open("xb") as sink:
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
