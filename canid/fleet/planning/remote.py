"""Logs in storage that fsspec reads: a file, a folder or a pattern as a URL, such as s3://bucket/fleet/**.blf."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING, Any

from canid.fleet.planning import globs
from canid.values.errors import ConfigError, one_line
from canid.vehicle.quoting import brief

if TYPE_CHECKING:
    from canid.fleet.planning.listing import Listed

_HTTP = "Last-Modified"  # as of RFC 9110, sec. 5.6.7
# names under which file systems state when a file was changed
_MODIFIED = ("mtime", "LastModified", "last_modified", "modified", "updated", "created", _HTTP)
_LOCAL = frozenset({"file", "local"})
# of botocore: its four retries take 9 s where nothing listens, and canid has its own, which are longer
_BOTO = {"retries": {"max_attempts": 1}}


def listed(url: str) -> list[Listed]:
    """List the logs of a URL.

    Raises:
        ConfigError: a package is missing, the storage cannot be reached, or it holds no such log.
    """
    from canid.fleet.planning import listing

    scheme = url.partition("://")[0]
    try:
        import fsspec  # noqa: F401
    except ImportError:
        raise ConfigError(f"{brief(url)}: URLs need fsspec: pip install 'canid[fleet]'") from None
    try:
        system, path = opened(url)
        if scheme in _LOCAL:
            return listing.listed([path])
        files = _found(system, path)
    except ImportError as error:
        extra = "s3" if scheme.startswith("s3") else "fleet"
        raise ConfigError(f"{brief(url)}: {one_line(error)}; pip install 'canid[{extra}]'") from None
    except ConfigError:
        raise
    except Exception as error:  # each storage has exceptions of its own
        raise ConfigError(f"{brief(url)}: cannot be listed ({one_line(error)})") from None
    root = globs.parted(path)[0] if globs.is_pattern(path) else path.rstrip("/")
    if root in files:
        root = root.rpartition("/")[0]
    # a web server's listing has names alone
    for name, info in files.items():
        if (
            info.get("size") is None
            and info.get("type", "file") == "file"
            and listing.is_log(name.rpartition("/")[2])
        ):
            files[name] = info | _stated(system, name)
    out = [
        listing.Listed(
            url_of(url, name),
            root_of(url, root),
            int(info.get("size") or 0),
            modified_ns(info),
        )
        for name, info in sorted(files.items())
        if info.get("type", "file") == "file" and (name == path or listing.is_log(name.rpartition("/")[2]))
    ]
    if not out:
        raise ConfigError(f"{brief(url)}: holds no log")
    return out


def opened(url: str) -> tuple[Any, str]:
    """The file system of a URL, and the path in it.

    Raises:
        ImportError: a package is missing.
        Exception: of each storage, where the URL is none of its own.

    Example:
        >>> opened("memory://a/b.blf")[1]
        '/a/b.blf'
    """
    import fsspec

    of_s3 = any(link.startswith(("s3://", "s3a://")) for link in url.split("::"))
    system, path = fsspec.core.url_to_fs(url, **({"s3": {"config_kwargs": _BOTO}} if of_s3 else {}))
    return system, str(path)


def _found(system: Any, path: str) -> dict[str, Any]:
    if globs.is_pattern(path):
        files: dict[str, Any] = system.glob(path, detail=True)
        return files
    if system.isdir(path):
        return dict(system.find(path, detail=True))
    return {path: system.info(path)}


def _stated(system: Any, path: str) -> dict[str, Any]:
    """What the storage states of one file; nothing, where it does not answer: that comes to light when it is fetched."""
    try:
        return dict(system.info(path))
    except Exception:  # each storage has exceptions of its own
        return {}


def url_of(url: str, path: str) -> str:
    """The URL of another path in the storage of a URL.

    Example:
        >>> url_of("s3://bucket/**.blf", "bucket/a.blf"), url_of("zip://*.blf::s3://b/c.zip", "a.blf")
        ('s3://bucket/a.blf', 'zip://a.blf::s3://b/c.zip')
        >>> url_of("simplecache::s3://bucket/x", "bucket/a.blf")
        'simplecache::s3://bucket/a.blf'
    """
    links = url.split("::")
    at = next(k for k, link in enumerate(links) if "://" in link)
    scheme = links[at].partition("://")[0]
    links[at] = path if "://" in path else f"{scheme}://{path}"
    return "::".join(links)


def root_of(url: str, path: str) -> str:
    """The URL of a folder, with which those of all logs in it begin.

    Example:
        >>> root_of("zip://*.blf::s3://b/c.zip", "anna"), root_of("simplecache::s3://b/x", "b")
        ('zip://anna', 'simplecache::s3://b')
    """
    links = url_of(url, path.rstrip("/")).split("::")
    at = next(k for k, link in enumerate(links) if "://" in link)
    return "::".join(links[: at + 1])


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
