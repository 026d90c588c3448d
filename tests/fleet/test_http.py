"""Logs of a web server, Python's own: listed, fetched, and waited for where it does not answer."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

pytest.importorskip("fsspec", reason="needs fsspec: pip install 'canid[fleet]'")
pytest.importorskip("aiohttp", reason="needs aiohttp: pip install 'canid[fleet]'")

import fsspec

from canid.analysis.fleet.failed import Failed
from canid.analysis.fleet.job import Failure
from canid.analysis.fleet.planning import fetched, remote
from canid.analysis.fleet.planning.fetched import Listed
from tests.fleet import short_logs


class Handler(SimpleHTTPRequestHandler):
    """A server that leaves the next so many requests without an answer, and counts those for a log's size and time."""

    dropped = 0
    delay_s = 0.0  # of an answer to HEAD
    heads, open_heads, most_heads = 0, 0, 0
    lock = threading.Lock()

    def do_HEAD(self) -> None:
        with Handler.lock:
            Handler.heads += 1
            Handler.open_heads += 1
            Handler.most_heads = max(Handler.most_heads, Handler.open_heads)
        threading.Event().wait(Handler.delay_s)
        with Handler.lock:
            Handler.open_heads -= 1
        super().do_HEAD()

    def handle_one_request(self) -> None:
        if Handler.dropped > 0:
            Handler.dropped -= 1
            self.close_connection = True
            return
        super().handle_one_request()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    """URL of a folder with logs, one of them in a folder of its own."""
    root = tmp_path / "served"
    (root / "anna").mkdir(parents=True)
    for k, name in enumerate(("a.log", "b 2.log", "anna/c.log")):
        (root / name).write_bytes(short_logs.log(k, 6.0))
    (root / "notes.txt").write_text("no log", encoding="utf-8")
    http = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(root)))
    threading.Thread(target=http.serve_forever, daemon=True).start()
    Handler.dropped = 0
    yield f"http://127.0.0.1:{http.server_port}/"
    http.shutdown()
    http.server_close()
    fsspec.filesystem("http").invalidate_cache()


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """No waiting; the pauses that were asked for."""
    pauses: list[float] = []
    monkeypatch.setattr(fetched.time, "sleep", pauses.append)
    return pauses


def test_a_folder_is_listed_and_each_log_fetched(server: str, tmp_path: Path) -> None:
    found = remote.listed(server)
    assert len(found) == 3
    for one in found:
        assert one.size > 0 and one.modified_ns > 0  # noqa: PT018
        with fetched.fetched(one.log, Listed(one.size, one.modified_ns)) as path:
            assert path.stat().st_size == one.size
            assert path.read_bytes() in {p.read_bytes() for p in (tmp_path / "served").rglob("*.log")}
    assert [one.log for one in remote.listed(f"{server}*.log")] == [
        one.log for one in found if "anna" not in one.log
    ]


def test_sizes_and_times_are_asked_for_once_each_and_side_by_side(
    server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An index page has names alone: a server that answers late costs each log its latency over so many at once."""
    for k in range(40):
        (tmp_path / "served" / f"d{k:02d}.log").write_bytes(b"0" * (k + 1))
    monkeypatch.setattr(Handler, "delay_s", 0.05)
    for name in ("heads", "most_heads"):
        monkeypatch.setattr(Handler, name, 0)
    found = remote.listed(server)
    sizes = {one.log.rpartition("/")[2]: one.size for one in found}
    assert [sizes[f"d{k:02d}.log"] for k in range(40)] == list(range(1, 41))
    assert (len(found), Handler.heads) == (43, 43)
    assert 4 <= Handler.most_heads <= remote.MAX_REQUESTS


def test_a_log_that_grew_since_it_was_listed_is_changed(server: str, tmp_path: Path) -> None:
    one = next(one for one in remote.listed(server) if one.log.endswith("a.log"))
    with (tmp_path / "served" / "a.log").open("ab") as file:
        file.write(b"(1.0) can0 123#00\n")
    with pytest.raises(Failed) as failed, fetched.fetched(one.log, Listed(one.size, one.modified_ns)):
        pass
    assert failed.value.failure is Failure.CHANGED


def test_an_outage_is_waited_for(server: str, hurried: list[float]) -> None:
    Handler.dropped = 5
    with fetched.fetched(f"{server}a.log") as path:
        assert path.stat().st_size > 0
    assert hurried
    Handler.dropped = 10**6
    hurried.clear()
    with (
        pytest.raises(Failed, match="does not answer") as failed,
        fetched.fetched(f"{server}a.log"),
    ):
        pass
    assert (failed.value.failure, hurried) == (Failure.NOT_REACHED, list(fetched.PAUSES_S))


def test_what_the_server_has_not_is_missing_at_once(server: str, hurried: list[float]) -> None:
    with pytest.raises(Failed) as failed, fetched.fetched(f"{server}none.log"):
        pass
    assert (failed.value.failure, hurried) == (Failure.MISSING, [])
