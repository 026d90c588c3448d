"""Only storage is opened by its address: no other protocol, no chain of them, and never what exists as a file."""

from __future__ import annotations

import ast
import json
import os
import re
from collections.abc import Iterator
from contextlib import nullcontext, suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("fsspec", reason="needs fsspec: pip install 'canid[fleet]'")

import fsspec

from canid.analysis.fleet.job import Failure
from canid.analysis.fleet.one_log.analysis import analyse
from canid.analysis.fleet.planning import address, listing
from canid.analysis.fleet.planning.plan import planned
from canid.analysis.fleet.storage import mirror
from canid.values.errors import ConfigError
from tests.fixtures.listening import Listening, listening
from tests.fleet import short_logs
from tests.fleet.fleet_jobs import GENERIC, job
from tests.fleet.short_logs import QUICK, REPO, fleet_here, table

PACKAGES = ("canid", "canid_study")
ONLY = Path("canid/analysis/fleet/planning/address.py")
# what opens addresses: fsspec and what it opens them with
OPENS = ("fsspec", "s3fs", "gcsfs", "adlfs", "ossfs", "aiohttp", "upath", "smart_open")
# of these fsspec does not need a package, or one that is installed
HOSTILE = (
    "dask://127.0.0.1:{port}/a.blf",
    "dask::http://127.0.0.1:{port}/a.blf",
    "reference::http://127.0.0.1:{port}/refs.json",
    "reference://a.blf::http://127.0.0.1:{port}/refs.json",
    "simplecache::http://127.0.0.1:{port}/a.blf",
    "filecache::http://127.0.0.1:{port}/*.blf",
    "blockcache::http://127.0.0.1:{port}/",
    "zip://*.blf::http://127.0.0.1:{port}/logs.zip",
    "tar://a.blf::simplecache::http://127.0.0.1:{port}/logs.tar",
    "dir::http://127.0.0.1:{port}/",
    "jupyter://127.0.0.1:{port}/a.blf",
    "jlab://127.0.0.1:{port}/a.blf",
    "ftp://127.0.0.1:{port}/a.blf",
    "sftp://127.0.0.1:{port}/a.blf",
    "ssh://127.0.0.1:{port}/a.blf",
    "smb://127.0.0.1:{port}/share/a.blf",
    "webhdfs://127.0.0.1:{port}/a.blf",
    "webdav://127.0.0.1:{port}/a.blf",
    "git://127.0.0.1:{port}/a.blf",
    "data:///a.blf,127.0.0.1:{port}",
    "HTTP://127.0.0.1:{port}/a.blf",
    "tcp://127.0.0.1:{port}/a.blf",
)
# files whose names have parts of an address
NAMES = ("a::b.blf", "http:x.blf", "simplecache::b.blf", "s3:c.blf", "zip::file::d.blf", "e::.blf")


@pytest.fixture
def port() -> Iterator[Listening]:
    with listening() as made:
        yield made


@pytest.mark.parametrize("line", HOSTILE)
def test_a_line_of_another_protocol_is_one_failed_log(line: str, port: Listening, tmp_path: Path) -> None:
    """Its row says why, nobody is connected to, and the other lines are planned."""
    hostile = line.format(port=port.port)
    (tmp_path / "good.blf").write_bytes(b"0")
    (tmp_path / "list.txt").write_text(f"{hostile}\ngood.blf\nno.blf\n")
    bad, good, gone = planned([f"@{tmp_path}/list.txt"], vehicle="generic").logs
    assert (bad.log, bad.failure) == (hostile, Failure.UNREADABLE)
    assert "opened" in bad.reason
    assert "\n" not in bad.reason
    assert (good.log, good.failure, gone.failure) == (f"{tmp_path}/good.blf", Failure.NONE, Failure.MISSING)
    outcome = analyse(job(hostile), GENERIC)
    assert (outcome.failure, "opened" in outcome.reason) == (Failure.UNREADABLE, True)
    for words in ((hostile,), (f"{hostile}*",)):
        with pytest.raises(ConfigError) as refused:
            planned(words, vehicle="generic")
        assert len(refused.value.mistakes) == 1
    assert port.connections == []


@pytest.mark.parametrize("line", HOSTILE)
def test_a_folder_of_results_is_not_opened_by_it_either(
    line: str, port: Listening, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`-o`, and the folder that is asked: one line with exit code 2, and no connection."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    hostile = line.format(port=port.port)
    (tmp_path / "a.csv").write_text("t,v\n0,1\n")
    done = fleet_here(tmp_path / "a.csv", "-o", hostile)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    done = fleet_here("query", hostile, "drives")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert not (tmp_path / "cache").exists()
    assert port.connections == []


def test_the_socket_hears_what_is_opened(port: Listening) -> None:
    """An address of storage does connect: the silence of the others is no deafness of the test."""
    with pytest.raises(ConfigError):
        planned([f"http://127.0.0.1:{port.port}/a.blf"], vehicle="generic")
    assert port.connections


@pytest.mark.parametrize("name", NAMES)
def test_what_exists_is_a_file_whatever_its_name_holds(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Named itself, by a pattern, in a list, in a folder, and below one that is named like a scheme."""
    monkeypatch.chdir(tmp_path)
    logs = Path("http:/host")
    logs.mkdir(parents=True)
    (logs / name).write_bytes(b"12")
    full = str(tmp_path / logs / name)
    Path("list.txt").write_text(f"{logs}/{name}\nhttp://host/{name}\n")
    (logs / "list.txt").write_text(f"{name}\n")
    for word in (
        str(logs / name),
        f"http://host/{name}",
        "http:",
        "http://host",
        f"{logs}/*.blf",
        "@list.txt",
    ):
        assert [(one.log, one.size) for one in listing.listed([word])] == [(full, 2)], word
    assert [one.log for one in listing.listed([f"@{logs}/list.txt"])] == [full]
    monkeypatch.chdir(logs)
    assert [one.log for one in planned([name], vehicle="generic").logs] == [full]


def test_a_new_folder_of_results_may_be_named_so() -> None:
    """A name without a scheme is a folder of this machine before it is there."""
    for name in ("a::b", "simplecache::c", "http:d"):
        assert mirror.local(name) == name
        with mirror.working(name) as at:
            assert at.folder == Path(name)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_run_into_a_folder_that_is_named_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`-o a::b` is a folder of this machine, before it is there and afterwards."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("t,v\n0,1\n")
    for name in ("a::b", "simplecache::c"):
        for _ in range(2):
            done = fleet_here("a.csv", "-o", name, "--json", "-")
            assert json.loads(done.stdout)["folder"] == str(tmp_path / name), done.stderr
            assert (tmp_path / name / listing.MARK).is_file()


def test_a_bad_line_needs_no_vehicle_and_no_match(tmp_path: Path) -> None:
    """A line that names nothing, of whatever kind, is a failed row: patterns, folders, storage, bytes that are no text."""
    (tmp_path / "good.csv").write_bytes(b"t,v\n0,1\n")
    (tmp_path / "empty").mkdir()
    lines = (
        b"no*.blf",
        b"empty",
        b"dask://host/a",
        b"http://127.0.0.1:9/a.blf",
        b"memory://none/a.blf",
        b"gone.blf",
        b"s3://",
        b"http://[",
        b"http://host:port/a.blf",
        b"file:///no such folder",
        b"\xff\xfe::http://x",
        b"a\x00b",
        b"x" * 5000,
        b"[",
        b"://",
        b"::",
    )
    (tmp_path / "list.txt").write_bytes(b"\n".join((*lines, b"good.csv")))
    *bad, good = planned([f"@{tmp_path}/list.txt"]).logs
    assert (len(bad), good.failure) == (len(lines), Failure.NONE)
    for one in bad:
        assert one.failure in (Failure.UNREADABLE, Failure.MISSING), one
        assert one.reason
        assert "\n" not in one.reason


SCHEMES = sorted({*fsspec.available_protocols(), *address.SCHEMES, "HTTP", "x", "s3+http", "c"})


@given(
    links=st.lists(st.sampled_from(SCHEMES), min_size=1, max_size=3),
    between=st.sampled_from(["::", "://", "://a::", "::/a::"]),
    end=st.sampled_from(["", "://", "://host/a.blf", "/a", "://h/a::http://h/b"]),
)
def test_a_text_is_one_address_of_the_list_or_none(links: list[str], between: str, end: str) -> None:
    """Whatever is joined: it is opened by the scheme before its first `://`, as one link, or it is refused or a path."""
    text = between.join(links) + end
    first = re.match(r"([a-z0-9]+)://", text)
    allowed = first is not None and first[1] in address.SCHEMES
    assert address.scheme_of(text) == (first[1] if first is not None and allowed else "")
    with suppress(ConfigError) if not allowed else nullcontext():
        assert address.is_address(text) is allowed
    if allowed and first is not None and first[1] in ("memory", "http", "https"):
        system, path = address.opened(text)
        assert type(system) is fsspec.get_filesystem_class(first[1])
        assert path.rstrip("/").endswith(text.partition("://")[2].strip("/"))


def opening(source: str) -> list[str]:
    """Packages that open addresses, as far as a source imports them, in whatever way."""
    found = []
    for node in ast.walk(ast.parse(source)):
        names: list[str] = []
        match node:
            case ast.Import(names=each):
                names = [one.name for one in each]
            case ast.ImportFrom(module=str(module), level=0):
                names = [module]
            case ast.Call(
                func=ast.Name(id="import_module" | "__import__"), args=[ast.Constant(str(name)), *_]
            ):
                names = [name]
            case ast.Call(func=ast.Attribute(attr="import_module"), args=[ast.Constant(str(name)), *_]):
                names = [name]
        found += [name for name in names if name.partition(".")[0] in OPENS]
    return found


def test_one_file_opens_addresses() -> None:
    """No other file of the packages imports fsspec or a package of its storage: read from the source."""
    found = {
        path.relative_to(REPO): names
        for package in PACKAGES
        for path in sorted((REPO / package).rglob("*.py"))
        if any(word in (text := path.read_text("utf-8")) for word in OPENS) and (names := opening(text))
    }
    assert found == {ONLY: ["fsspec"]}
    text = (REPO / ONLY).read_text("utf-8")
    # nor is a text given to what takes it for a chain
    assert re.findall(r"fsspec\.(\w+)", text) == ["get_filesystem_class"]


@pytest.mark.parametrize(
    "source",
    [
        "import fsspec",
        "from fsspec.core import url_to_fs",
        "def f():\n    import s3fs as x",
        "import importlib\nimportlib.import_module('fsspec.core')",
        "__import__('fsspec')",
    ],
)
def test_such_an_import_is_found(source: str) -> None:
    assert opening(source)


@pytest.mark.slow("a run of a fleet in processes of its own")
def test_a_run_over_such_a_list(port: Listening, tmp_path: Path) -> None:
    """Exit code 4: every bad line a row with its reason, every log of this machine analysed."""
    names = [*NAMES, "plain.blf"]
    for number, name in enumerate(names):
        (tmp_path / name.replace(".blf", ".log")).write_bytes(short_logs.log(number))
    lines = [name.replace(".blf", ".log") for name in names]
    hostile = [line.format(port=port.port) for line in HOSTILE]
    (tmp_path / "list.txt").write_text(
        "\n".join(x for pair in zip(hostile, lines, strict=False) for x in pair)
    )
    done = fleet_here(f"@{tmp_path}/list.txt", "-o", tmp_path / "out", *QUICK)
    assert done.returncode == 4, done.stderr
    rows = table(tmp_path / "out", "logs", "log, status, failure, reason")
    assert {os.path.basename(log) for log, status, *_ in rows if status == "ok"} == set(lines)
    bad = [(log, failure, bool(reason)) for log, status, failure, reason in rows if status == "failed"]
    assert sorted(bad) == sorted((line, "unreadable", True) for line in hostile[: len(lines)])
    assert port.connections == []
