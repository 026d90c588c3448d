"""Addresses of logs and results in storage: the one place that decides which texts are some, and opens them with fsspec.

fsspec opens far more than storage: a scheduler of Dask, whose answers are unpickled, a file of references, which is rendered
as a template, and chains of such (`a::b`). A list of logs, and the listing of a server, may be a stranger's: the schemes are
a closed list, and a text is one address or none.
"""

from __future__ import annotations

import re
from typing import Any

from canid.signals.vehicle.quoting import brief
from canid.values.errors import ConfigError

LOCAL = ("file", "local")
WEB = ("http", "https")
S3 = ("s3", "s3a")
AZURE = ("az", "abfs", "abfss")
# by fsspec's names: storage that gives bytes and lists names; `memory` is that of this process
SCHEMES = (*LOCAL, *WEB, *S3, "gs", "gcs", *AZURE, "oss", "memory")
# a scheme, or several links of which one has a scheme
_FORM = re.compile(r"(?:[A-Za-z][A-Za-z0-9+.-]*::)*([A-Za-z][A-Za-z0-9+.-]*)://", re.ASCII)
# of botocore: its four retries take 9 s where nothing listens, and canid has its own, which are longer
_BOTO = {"retries": {"max_attempts": 1}}


def scheme_of(text: str) -> str:
    """The scheme of an address; "": it is none that canid opens, such as a path.

    Example:
        >>> scheme_of("s3://bucket/a::b.blf"), scheme_of("/logs/a.blf"), scheme_of("a::b.blf")
        ('s3', '', '')
        >>> scheme_of("dask://host/a"), scheme_of("simplecache::s3://bucket/a"), scheme_of("zip://a.blf::s3://b/c.zip")
        ('', '', '')
    """
    scheme = text.partition("://")[0] if _FORM.match(text) else ""
    return scheme if scheme in SCHEMES else ""


def is_address(text: str) -> bool:
    """Whether a text is an address that canid opens; whether a file has that name is for the caller to see first.

    Raises:
        ConfigError: it has the form of an address, and canid opens none of its kind.

    Example:
        >>> is_address("s3://bucket/a"), is_address("http:a.blf"), is_address("a::b.blf")
        (True, False, False)
        >>> is_address("reference::http://host/a")
        Traceback (most recent call last):
        canid.values.errors.ConfigError: reference::http://host/a: addresses in several links (a::b) are not opened
    """
    form = _FORM.match(text)
    if form is None or scheme_of(text):
        return form is not None
    if "::" in form[0]:
        raise ConfigError(f"{brief(text)}: addresses in several links (a::b) are not opened")
    known = ", ".join(SCHEMES)
    raise ConfigError(f"{brief(text)}: {brief(form[1])}:// is none of the addresses that are opened: {known}")


def opened(url: str) -> tuple[Any, str]:
    """The file system of an address, and the path in it.

    Raises:
        ConfigError: it is no address that canid opens.
        ImportError: a package is missing.
        Exception: of each storage, where the address is none of its own.

    Example:
        >>> opened("memory://a/b.blf")[1], opened("file:///a/b::c.blf")[1]
        ('/a/b.blf', '/a/b::c.blf')
    """
    if not is_address(url):
        raise ConfigError(f"{brief(url)}: is no address such as s3://bucket/logs")
    of_scheme = _class_of(url)
    settings = {"config_kwargs": _BOTO} if scheme_of(url) in S3 else {}
    system = of_scheme(**{**of_scheme._get_kwargs_from_urls(url), **settings})
    return system, str(of_scheme._strip_protocol(url))


def of_path(url: str, path: str) -> str | None:
    """The address of a path that the storage of an address has listed: opened again, it leads there.

    An address may name an account, which is no part of a path (`abfs://container@account.dfs.core.windows.net`), and what a
    name holds may mean something in an address: of the ways to write it, that one is taken which the storage itself reads as
    this path of this account.

    Returns:
        None: no address leads to it.

    Example:
        >>> of_path("s3://bucket/**/*.blf", "bucket/x://a::b.blf"), of_path("http://host/", "http://host/a.blf")
        ('s3://bucket/x://a::b.blf', 'http://host/a.blf')
        >>> of_path("s3://bucket/", "bucket/a/") is None
        True
    """
    of_scheme = _class_of(url)
    wanted = of_scheme._get_kwargs_from_urls(url), path.lstrip("/")
    for made in _written(url, path):
        if (
            of_scheme._get_kwargs_from_urls(made),
            str(of_scheme._strip_protocol(made)).lstrip("/"),
        ) == wanted:
            return made
    return None


def folder_name(place: str) -> str:
    """The name of a folder by its path or its address; of an address without a path: of its bucket, container or server.

    Example:
        >>> folder_name("/logs/anna@home/"), folder_name("s3://bucket/anna/"), folder_name("s3://anna")
        ('anna@home', 'anna', 'anna')
        >>> folder_name("abfs://anna@account.dfs.core.windows.net/"), folder_name("https://user:word@host/")
        ('anna', 'host')
    """
    name = place.rstrip("/").rpartition("/")[2]
    if not scheme_of(place) or name != place.partition("://")[2].rstrip("/"):
        return name
    container, at, host = name.rpartition("@")
    return container if at and scheme_of(place) in AZURE else host


def _written(url: str, path: str) -> list[str]:
    """Ways to write the address of a path in the storage of an address.

    >>> _written("abfs://box@zoe.dfs.core.windows.net/*", "box/a.blf")[2]
    'abfs://box@zoe.dfs.core.windows.net/a.blf'
    """
    scheme = scheme_of(url)
    if scheme in WEB:  # the paths of fsspec's web servers are whole addresses
        return [path] if scheme_of(path) in WEB else []
    authority = url.partition("://")[2].partition("/")[0]
    first, slash, rest = path.lstrip("/").partition("/")
    return [
        f"{scheme}://{path}",
        f"{scheme}://{authority}/{path.lstrip('/')}",
        f"{scheme}://{first}@{authority.rpartition('@')[2]}{slash}{rest}",
    ]


def _class_of(url: str) -> Any:
    import fsspec

    # not fsspec's own way from a text to a file system: it takes `::` in a name for a chain
    return fsspec.get_filesystem_class(scheme_of(url))
