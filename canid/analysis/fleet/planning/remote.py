"""Logs in storage that fsspec reads: a file, a folder or a pattern as a URL, such as s3://bucket/fleet/**/*.blf."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING, Any

from canid.analysis.fleet.planning import address, globs
from canid.signals.vehicle.quoting import brief
from canid.values.errors import ConfigError, one_line

if TYPE_CHECKING:
    from canid.analysis.fleet.planning.listing import Listed

# that a web server is asked at once, below the 100 connections of aiohttp; each would wait for the answer before it
MAX_REQUESTS = 16
# that are waiting for their turn: what an interrupted run still asks for, and what is held of a million logs
MAX_PENDING = 256
_HTTP = "Last-Modified"  # as of RFC 9110, sec. 5.6.7
# names under which file systems state when a file was changed
_MODIFIED = ("mtime", "LastModified", "last_modified", "modified", "updated", "created", _HTTP)


def listed(url: str) -> list[Listed]:
    """List the logs of a URL.

    Raises:
        ConfigError: a package is missing, the storage cannot be reached, or it holds no such log.
    """
    from canid.analysis.fleet.planning import listing

    scheme = address.scheme_of(url)
    try:
        system, path = address.opened(url)
        if scheme in address.LOCAL:
            return listing.listed([path])
        files = _found(system, path)
    except ImportError as error:
        extra = "s3" if scheme in address.S3 else "fleet"
        raise ConfigError(f"{brief(url)}: {one_line(error)}; pip install 'canid[{extra}]'") from None
    except ConfigError:
        raise
    except Exception as error:  # each storage has exceptions of its own
        if is_outage(error):
            raise ConfigError(
                f"{brief(url)}: its storage does not answer ({_words(error)}): check the address, or run the same command "
                "again when it does"
            ) from None
        raise ConfigError(f"{brief(url)}: cannot be listed ({one_line(error)})") from None
    root = globs.parted(path)[0] if globs.is_pattern(path) else path.rstrip("/")
    if root in files:
        root = root.rpartition("/")[0]
    logs = {
        name: info
        for name, info in sorted(files.items())
        if info.get("type", "file") == "file" and (name == path or listing.is_log(name.rpartition("/")[2]))
    }
    out = [
        _of_file(url, root.rstrip("/"), name, info) for name, info in (logs | _stated(system, logs)).items()
    ]
    if not out:
        raise ConfigError(f"{brief(url)}: holds no log")
    return out


# of aiohttp and botocore, which are optional: no connection, or one that ended; and what a server says of itself
_OUTAGES = frozenset(
    {
        "ClientConnectionError",
        "ClientPayloadError",
        "HTTPClientError",
        "EndpointConnectionError",
        "ConnectTimeoutError",
        "ProxyConnectionError",
        "IncompleteReadError",
    }
)
_STATUS = frozenset({429, 500, 502, 503, 504})


def is_outage(error: BaseException) -> bool:
    """Whether the storage did not answer, as far as the error or its causes say; fsspec calls that a missing file.

    A storage that refuses for now ("SlowDown") answers as little as one that is gone.

    Example:
        >>> is_outage(ConnectionResetError()), is_outage(FileNotFoundError()), is_outage(TimeoutError())
        (True, False, True)
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, ConnectionError | TimeoutError):
            return True
        names = {each.__name__ for each in type(cause).__mro__}
        if names & _OUTAGES or _status(cause) in _STATUS:
            return True
        cause = cause.__cause__ or cause.__context__
    return False


def _status(error: BaseException) -> int:
    """Status of the answer (RFC 9110, sec. 15), under the names that aiohttp, gcsfs, azure and botocore give it; 0: none."""
    response = getattr(error, "response", None)
    if isinstance(response, Mapping):
        given = response.get("ResponseMetadata", {}).get("HTTPStatusCode", 0)
    else:
        # the first that there is: aiohttp warns of its further name
        there = dir(error)
        name = next((name for name in ("status", "status_code", "code") if name in there), "")
        given = getattr(error, name, 0)
    return given if isinstance(given, int) else 0


def _words(error: BaseException) -> str:
    """What the system says of a connection, where its number is known: libraries add how they tried it."""
    number = error.errno if isinstance(error, OSError) else None
    return os.strerror(number) if number is not None and number > 0 else one_line(error)


def _found(system: Any, path: str) -> dict[str, Any]:
    if globs.is_pattern(path):
        files: dict[str, Any] = system.glob(path, detail=True)
        return files
    if system.isdir(path):
        return dict(system.find(path, detail=True))
    return {path: system.info(path)}


def _stated(system: Any, logs: Mapping[str, Any]) -> dict[str, Any]:
    """What a storage states of each log of which its listing has no size, by one request each.

    A web server's listing has names alone, or sizes and times that are rounded to units and minutes: by them a log that has
    changed would pass for the one that was analysed.
    """

    def stated(name: str) -> dict[str, Any]:
        try:
            return {**logs[name], **system.info(name)}
        except (
            Exception
        ):  # each storage has exceptions of its own; that it does not answer comes to light at the fetch
            return dict(logs[name])

    names = [name for name, info in logs.items() if info.get("size") is None]
    out: dict[str, Any] = {}
    with ThreadPoolExecutor(MAX_REQUESTS) as pool:
        for first in range(0, len(names), MAX_PENDING):
            some = names[first : first + MAX_PENDING]
            out |= zip(some, pool.map(stated, some), strict=True)
    return out


def _of_file(url: str, root: str, path: str, info: Mapping[str, Any]) -> Listed:
    """A file that the storage of a URL has listed below a root."""
    from canid.analysis.fleet.planning import listing

    log = address.of_path(url, path)
    if log is None:
        name = f"{address.scheme_of(url)}://{path}"
        return listing.Listed(
            name, url, listing.MISSING, 0, "no address leads to a file of this name: rename it"
        )
    above = log.removesuffix(listing.below(path, root) if root else path.lstrip("/"))
    return listing.Listed(log, above, int(info.get("size") or 0), modified_ns(info))


def modified_ns(info: Mapping[str, Any]) -> int:
    """When a file was changed, ns since 1970; 0: its storage does not say.

    Example:
        >>> modified_ns({"mtime": 1.5}), modified_ns({"name": "a"})
        (1500000000, 0)
    """
    for name in _MODIFIED:
        value = info.get(name)
        if isinstance(value, str):
            try:
                value = parsedate_to_datetime(value) if name == _HTTP else datetime.fromisoformat(value)
            except ValueError:
                continue
        if isinstance(value, datetime):
            return int(value.timestamp() * 1e9)
        if isinstance(value, int | float) and value > 0:
            return int(value * 1e9)
    return 0
