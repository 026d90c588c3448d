"""A browser, a replay with its page, and a page without a session: each of them once."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from websockets.sync.client import ClientConnection, connect

from canid.io.recording.controls import Controls
from canid.ui.web import address
from canid.ui.web.access import Access
from canid.ui.web.live_page import LivePage
from canid.ui.web.requests import OF_SESSION

ROOT = Path(__file__).parents[2]
# markup, a direction override, and a name as long as a file system takes
HOSTILE = "<img src=x onerror=window.pwned=1><b>\u202efdp." + "x" * 120 + ".blf"
HOSTILE_CAR = "</h1><script>window.pwned=1</script>"
# s of the log: both estimators have given estimates
STOP_S = 45.0


class Replay(NamedTuple):
    """A running `canid replay --web`."""

    url: str
    json: Path

    def lines(self) -> list[dict[str, Any]]:
        """What --json has so far."""
        return [json.loads(line) for line in self.json.read_text(encoding="utf-8").splitlines()]


@pytest.fixture(scope="session")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Replay]:
    """A replay at full speed of a log and a vehicle with hostile names; it stays after its end."""
    folder = tmp_path_factory.mktemp("replay")
    shutil.copy(ROOT / "replay_logs/following_urban.blf", folder / HOSTILE)
    shutil.copy(ROOT / "dbc/generic.dbc", folder)
    text = (ROOT / "dbc/generic.toml").read_text(encoding="utf-8")
    renamed, count = re.subn(r'(?m)^name = ".*"$', f'name = "{HOSTILE_CAR}"', text)
    assert count == 1
    (folder / "car.toml").write_text(renamed, encoding="utf-8")
    words = [str(folder / HOSTILE), "--vehicle", str(folder / "car.toml"), "--stop", str(STOP_S)]
    words += ["--web", "--speed", "max", "--json", str(folder / "out.jsonl")]
    says = folder / "stderr"
    with says.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "canid", "replay", *words],
            stdout=subprocess.DEVNULL,
            stderr=file,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        )
    found = None
    while found is None:
        assert process.poll() is None
        time.sleep(0.05)
        found = re.search(r"http://127\.0\.0\.1:\d+/#token=\S+\n", says.read_text(encoding="utf-8"))
    yield Replay(found[0].strip(), folder / "out.jsonl")
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 0  # after the end of the log it is how the page is closed


class Page(NamedTuple):
    """A page without a session."""

    live: LivePage
    port: int
    token: str
    controls: Controls
    says: list[str]


def opened() -> Page:
    """A page on a free port."""
    sock, where = address.listening(address.parse(""))
    controls, says, token = Controls(), [], secrets.token_urlsafe(16)
    start = {"mode": "live", "title": "test", "vehicle": "generic"}
    live = LivePage(sock, Access(where.host, where.port, token), start, controls, OF_SESSION, says.append)
    return Page(live, where.port, token, controls, says)


def client(page: Page) -> ClientConnection:
    """A websocket of the page's own."""
    here = f"127.0.0.1:{page.port}"
    return connect(f"ws://{here}/live", origin=f"http://{here}", subprotocols=["canid", page.token])  # type: ignore[arg-type, list-item]


@pytest.fixture(scope="session")
def served() -> Iterator[Page]:
    page = opened()
    yield page
    page.live.close()


@pytest.fixture
def fresh() -> Iterator[Page]:
    page = opened()
    yield page
    page.live.close()
