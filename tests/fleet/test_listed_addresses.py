"""An address that a listing gives leads to the file that was listed: in the same account, and by the same name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

pytest.importorskip("fsspec", reason="needs fsspec: pip install 'canid[fleet]'")

import fsspec
from fsspec import AbstractFileSystem
from fsspec.implementations.memory import MemoryFileSystem
from fsspec.registry import _registry

from canid.analysis.fleet.job import Failure
from canid.analysis.fleet.planning import address, listing
from canid.analysis.fleet.planning.fetched import fetched
from canid.analysis.fleet.planning.plan import planned

HOST = "dfs.core.windows.net"
# of each kind of storage: addresses of one folder, and the paths that its file system has of files in it
FORMS = {
    "s3://drives/fleet": "drives/fleet",
    "s3a://drives/fleet/": "drives/fleet",
    "gs://drives/fleet": "drives/fleet",
    "gcs://drives/fleet": "drives/fleet",
    "az://drives/fleet": "drives/fleet",
    "abfs://drives/fleet": "drives/fleet",
    f"az://drives@one.{HOST}/fleet": "drives/fleet",
    f"abfs://drives@one.{HOST}/fleet/": "drives/fleet",
    f"abfss://drives@one.{HOST}": "drives",
    f"abfss://one.{HOST}/drives/fleet": "drives/fleet",
    "oss://drives/fleet": "/drives/fleet",
    "memory://drives/fleet": "/drives/fleet",
    "http://host:80/fleet/": "http://host:80/fleet",
    "https://user@host/fleet/": "https://user@host/fleet",
    "file:///drives/fleet": "/drives/fleet",
    "local:///drives/fleet": "/drives/fleet",
}
# characters that an address or a library gives a meaning to
NAMES = st.text(alphabet="ab/.@:?#%*[] \t\n&=+;~é", min_size=1, max_size=12)


def installed(scheme: str) -> type[AbstractFileSystem] | None:
    """The file system of a scheme; None: its package is not here."""
    try:
        found: type[AbstractFileSystem] = fsspec.get_filesystem_class(scheme)
    except (ImportError, ValueError):  # ValueError: a scheme that only its package makes known
        return None
    return found


def test_every_scheme_has_a_form() -> None:
    """Every scheme that is opened is held against its listing below."""
    assert set(address.SCHEMES) == {form.partition("://")[0] for form in FORMS}


@pytest.mark.parametrize(
    "form",
    [
        pytest.param(
            form,
            marks=pytest.mark.skipif(
                installed(form.partition("://")[0]) is None, reason=f"the package of {form} is not installed"
            ),
        )
        for form in FORMS
    ],
)
@given(name=NAMES)
@example("a::b.blf")
@example("a?versionid=2")
@example("a#3")
@example("a\tb.blf")
@example("x://y@z.blf")
def test_an_address_leads_back_or_there_is_none(form: str, name: str) -> None:
    """Of drawn names: by the library's own functions it gives the settings of the folder's address, and the file's path."""
    of_scheme = installed(form.partition("://")[0])
    assert of_scheme is not None
    path = f"{FORMS[form]}/{name}"
    made = address.of_path(form, path)
    if made is None:
        assert set(name) & set("/.?#:\t\n "), name
        return
    assert address.is_address(made)
    assert of_scheme._get_kwargs_from_urls(made) == of_scheme._get_kwargs_from_urls(form)
    assert str(of_scheme._strip_protocol(made)).lstrip("/") == path.lstrip("/")


class Accounts(MemoryFileSystem):
    """Storage in memory whose addresses name the account as Azure's do: abfs://container@account.host/path."""

    protocol = ("abfs", "az", "abfss")
    accounts: dict[str, tuple[dict[str, Any], list[str]]] = {}  # noqa: RUF012

    def __init__(self, account_name: str = "default", **more: Any) -> None:
        super().__init__(**more)
        self.store, self.pseudo_dirs = self.accounts.setdefault(account_name, ({}, [""]))

    @staticmethod
    def _get_kwargs_from_urls(path: str) -> dict[str, str]:
        host = path.partition("://")[2].partition("/")[0].rpartition("@")[2]
        return {"account_name": host.partition(".")[0]} if host.endswith(HOST) else {}

    @classmethod
    def _strip_protocol(cls, path: Any) -> Any:
        if isinstance(path, list):
            return [cls._strip_protocol(each) for each in path]
        scheme, found, rest = str(path).partition("://")
        # as urllib.parse.urlsplit, by which the real one parts an address
        authority, slash, below = (rest.replace("\t", "") if found else scheme).partition("/")
        container, at, host = authority.rpartition("@")
        if not at:
            container = "" if host.endswith(HOST) else host
        path = f"{container}{slash}{below}".strip("/")
        return f"/{path}" if path else ""


@pytest.fixture
def accounts() -> Iterator[None]:
    """Two accounts with files of the same names, and other bytes."""
    before = {scheme: _registry.get(scheme) for scheme in Accounts.protocol}
    for scheme in Accounts.protocol:
        fsspec.register_implementation(scheme, Accounts, clobber=True)
    for account in ("one", "two"):
        system = Accounts(account_name=account)
        for name in ("anna/a.csv", "ben/b.csv"):
            system.pipe_file(f"drives/fleet/{name}", f"t,v\n0,{account} {name}\n".encode())
    yield
    Accounts.accounts.clear()
    Accounts.clear_instance_cache()
    for scheme, found in before.items():
        _registry.pop(scheme, None)
        if found is not None:
            fsspec.register_implementation(scheme, found, clobber=True)


@pytest.mark.usefixtures("accounts")
@pytest.mark.parametrize(
    "form",
    [
        "abfs://drives@{}.dfs.core.windows.net/fleet",
        "abfss://drives@{}.dfs.core.windows.net/fleet/",
        "az://drives@{}.dfs.core.windows.net/fleet/**/*.csv",
        "abfs://{}.dfs.core.windows.net/drives/fleet",
        "abfs://drives@{}.dfs.core.windows.net",
        "abfs://{}.dfs.core.windows.net/",
    ],
)
def test_a_listed_log_is_fetched_from_its_own_account(form: str) -> None:
    """A folder, a pattern, a container and a whole account: each log has its bytes, its driver, and no other account's."""
    for account in ("one", "two"):
        for log in listing.listed([form.format(account)]):
            assert f"{account}.{HOST}" in log.log
            name = "/".join(log.relative.split("/")[-2:])
            with fetched(log.log) as path:
                assert path.read_text() == f"t,v\n0,{account} {name}\n"
            assert log.log.endswith(log.relative)
    alone = listing.listed([f"abfs://drives@one.{HOST}/fleet/anna/a.csv"])
    assert [(one.log, one.relative) for one in alone] == [
        (f"abfs://drives@one.{HOST}/fleet/anna/a.csv", "a.csv")
    ]


@pytest.mark.usefixtures("accounts")
def test_drivers_are_those_of_the_folders() -> None:
    """Two accounts at once: each log once, with the driver of its folder."""
    logs = planned([f"abfs://drives@{account}.{HOST}/fleet" for account in ("one", "two")]).logs
    assert sorted((log.driver, log.log) for log in logs) == [
        ("anna", f"abfs://drives@one.{HOST}/fleet/anna/a.csv"),
        ("anna", f"abfs://drives@two.{HOST}/fleet/anna/a.csv"),
        ("ben", f"abfs://drives@one.{HOST}/fleet/ben/b.csv"),
        ("ben", f"abfs://drives@two.{HOST}/fleet/ben/b.csv"),
    ]


@pytest.mark.usefixtures("accounts")
@pytest.mark.parametrize(
    "forms",
    [
        ("abfs://anna@one.{}", "abfs://ben@one.{}/"),
        ("az://anna@one.{}/*.csv", "abfss://ben@one.{}"),
        ("abfs://one.{}/anna", "abfs://ben@one.{}"),
        ("abfs://drives@two.{}/fleet/anna", "abfs://drives@one.{}/fleet/ben/"),
    ],
)
def test_logs_that_lie_directly_in_named_containers(forms: tuple[str, ...]) -> None:
    """Each container or folder has the name of its driver; the account is no part of it."""
    for driver in ("anna", "ben"):
        Accounts(account_name="one").pipe_file(f"{driver}/a.csv", b"t,v\n0,1\n")
    logs = planned([form.format(HOST) for form in forms]).logs
    assert sorted(log.driver for log in logs) == ["anna", "ben"]


@pytest.mark.usefixtures("accounts")
def test_a_file_that_no_address_leads_to_is_one_failed_log() -> None:
    """Its row says what to do, and the other files of the folder are planned."""
    Accounts(account_name="one").pipe_file("drives/odd/a\tb.csv", b"t,v\n0,1\n")
    Accounts(account_name="one").pipe_file("drives/odd/b.csv", b"t,v\n0,1\n")
    bad, good = planned([f"abfs://drives@one.{HOST}/odd"]).logs
    assert (bad.failure, "rename it" in bad.reason, "\n" in bad.reason) == (Failure.UNREADABLE, True, False)
    assert (good.log, good.failure) == (f"abfs://drives@one.{HOST}/odd/b.csv", Failure.NONE)
