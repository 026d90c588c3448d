"""A log in storage is analysed as a local one, and leaves nothing behind, whatever goes wrong on its way."""

from __future__ import annotations

import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("fsspec", reason="needs fsspec: pip install 'canid[fleet]'")

import fsspec

from canid.analysis.fleet.failed import Failed
from canid.analysis.fleet.job import Failure, Job, Status
from canid.analysis.fleet.one_log.analysis import analyse
from canid.analysis.fleet.planning import fetched, remote
from canid.analysis.fleet.planning.fetched import Listed
from canid.analysis.fleet.running.isolated import Child
from canid.values.errors import ConfigError
from tests.fleet import short_logs
from tests.fleet.fleet_jobs import GENERIC, QUICK, URBAN, job, sparse
from tests.fleet.test_isolated import numbers

CONTENT = short_logs.log(1, 6.0)


@pytest.fixture
def stored() -> Iterator[str]:
    """A log in fsspec's file system in memory, which is a remote one to its users."""
    system = fsspec.filesystem("memory")
    system.pipe_file("/fleet/drive 1.log", CONTENT)
    yield "memory://fleet/drive 1.log"
    system.store.clear()


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary files are."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def unused_port() -> int:
    """A port of this machine on which nobody listens."""
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        return int(bound.getsockname()[1])


def of(url: str, size: int = -1, modified_ns: int = 0) -> Job:
    return Job(url, size, modified_ns, "generic", QUICK)


def test_a_url_gives_the_rows_of_the_file(stored: str, scratch: Path, tmp_path: Path) -> None:
    """The same key and numbers; nothing stays of the copy, and no path of it is in a row."""
    path = tmp_path / "drive.log"
    path.write_bytes(CONTENT)
    local, remote = analyse(job(path), GENERIC), analyse(of(stored, len(CONTENT)), GENERIC)
    assert remote.status is Status.OK, remote.reason
    assert numbers(remote._replace(log="")) == numbers(local._replace(log=""))
    assert str(scratch) not in str(remote)
    assert list(scratch.iterdir()) == []


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_file_url_is_read_in_its_place(scratch: Path) -> None:
    """No copy is made of a local file."""
    with fetched.fetched(f"file://{URBAN}") as path:
        assert path == URBAN
    assert analyse(of(f"file://{URBAN}"), GENERIC).status is Status.OK
    assert list(scratch.iterdir()) == []


def test_failures_of_storage_are_rows(stored: str, scratch: Path) -> None:
    """Missing, changed since it was listed, bad bytes, an unknown scheme: each its word, and one line."""
    system = fsspec.filesystem("memory")
    system.pipe_file("/fleet/bad.asc", b"no log\n" * 9)
    system.pipe_file("/fleet/empty.blf", b"")
    cases = {
        of("memory://fleet/gone.blf"): Failure.MISSING,
        of(stored, len(CONTENT) + 1): Failure.CHANGED,
        of(stored, len(CONTENT), 1): Failure.CHANGED,
        of("memory://fleet/bad.asc"): Failure.NOT_A_LOG,
        of("memory://fleet/empty.blf"): Failure.EMPTY,
        of("nosuchscheme://bucket/a.blf"): Failure.UNREADABLE,
    }
    for one, failure in cases.items():
        outcome = analyse(one, GENERIC)
        assert (outcome.status, outcome.failure) == (Status.FAILED, failure), (one.log, outcome.reason)
        assert outcome.reason
        assert str(scratch) not in outcome.reason
        assert "\n" not in outcome.reason
    assert list(scratch.iterdir()) == []


def test_s3_without_its_package_names_the_extra() -> None:
    """One line with what to install; where it is installed there is nothing to see."""
    try:
        import s3fs  # type: ignore[import-not-found, unused-ignore]  # noqa: F401
    except ImportError:
        outcome = analyse(of("s3://bucket/a.blf"), GENERIC)
        assert (outcome.failure, "canid[s3]" in outcome.reason) == (Failure.NOT_REACHED, True)
    else:
        pytest.skip("s3fs is installed")


def test_what_does_not_fit_is_not_fetched(
    stored: str, scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a log beyond the limit of size, nor one for which the disk has no room, nor one whose size nobody states."""
    with monkeypatch.context() as patch:
        patch.setattr(fetched, "MAX_BYTES", len(CONTENT) - 1)
        assert "the largest" in analyse(of(stored), GENERIC).reason
    system = fsspec.filesystem("memory")
    info = system.info
    with monkeypatch.context() as patch:
        patch.setattr(fetched, "SPARE_BYTES", 10**18)
        assert "has room for 0" in analyse(of(stored), GENERIC).reason
        patch.setattr(type(system), "info", lambda self, path, **settings: {**info(path), "size": None})
        with pytest.raises(Failed, match="more than the 0 bytes"), fetched.fetched(stored, Listed()):
            pass
    assert list(scratch.iterdir()) == []


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_what_was_fetched_goes_with_a_child_that_is_ended(scratch: Path) -> None:
    """A child keeps its copies in a folder of its own, which is deleted where it is killed in the middle of a log."""
    child = Child()
    slow = sparse(scratch.parent / "slow.blf", 20_000_000_000)
    try:
        assert child.analyse(job(URBAN), GENERIC).status is Status.OK
        (folder,) = scratch.iterdir()
        (folder / "copy.blf").write_bytes(b"of a log")
        outcome = child.analyse(job(slow, QUICK._replace(timeout_s=0.3)), GENERIC)
        assert outcome.failure is Failure.TIMEOUT, outcome.reason
        assert list(scratch.iterdir()) == []
    finally:
        child.close()


@pytest.mark.parametrize(
    ("code", "status", "outage"),
    [
        ("SlowDown", 503, True),
        ("InternalError", 500, True),
        ("TooManyRequests", 429, True),
        ("NoSuchKey", 404, False),
        ("AccessDenied", 403, False),
        ("NoSuchBucket", 404, False),
    ],
)
def test_a_storage_that_refuses_for_now_is_waited_for(code: str, status: int, outage: bool) -> None:
    """S3's answers, as botocore raises them and as s3fs translates them; what will not pass is no outage."""
    exceptions = pytest.importorskip("botocore.exceptions")
    translate = pytest.importorskip("s3fs.errors").translate_boto_error
    answer = {"Error": {"Code": code, "Message": "no"}, "ResponseMetadata": {"HTTPStatusCode": status}}
    raised = exceptions.ClientError(answer, "GetObject")
    assert remote.is_outage(raised) == remote.is_outage(translate(raised)) == outage
    assert remote.is_outage(exceptions.EndpointConnectionError(endpoint_url="http://x"))
    assert not remote.is_outage(exceptions.NoCredentialsError())


def test_a_server_that_is_gone_when_it_is_listed_is_said_in_plain_words(unused_port: int) -> None:
    with pytest.raises(ConfigError) as caught:
        remote.listed(f"http://127.0.0.1:{unused_port}/logs/")
    assert "its storage does not answer (Connection refused): check the address" in str(caught.value)
    assert "ssl" not in str(caught.value)
