"""Attacks on the live page: connections that say nothing, frames without a pause, and foreign pages in Chromium."""

from __future__ import annotations

import math
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from tests.fixtures.browser import FLAGS
from tests.fixtures.crowd import FRAMES, crowd, drawn, thrown_out
from tests.fixtures.foreign_server import ForeignServer

PROMISE = "the live page's secret reaches no other port; connections without it keep nobody out"
# s; bounds what hangs, no more
PATIENCE_S = 60.0
FILES = ("/", "/page.js", "/store.js", "/plotly.min.js")
ADMITTED = "document.body.dataset.connection === 'open' && document.body.dataset.mode === 'record'"


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One recording with its page, against all three."""
    says = folder / "says"
    with says.open("w") as file:
        process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "canid",
                "record",
                "-i",
                "virtual",
                "-c",
                str(folder),
                "-o",
                "drive.log",
                "--web",
            ],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=file,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        )
    try:
        url = _address(says)
        port, token = int(url.split(":")[2].partition("/")[0]), url.partition("token=")[2]
        yield Outcome("silent and slow connections without the token", math.nan, 0, _crowd(port, token, rng))
        yield Outcome("websocket frames without a pause", math.nan, 0, _flood(port, token, rng))
        chromium = shutil.which("chromium")
        if chromium is None or find_spec("playwright") is None:
            yield Outcome("foreign page: not tried, chromium or playwright is missing", math.nan, 0)
        else:
            group = "foreign page on another port of the host, in Chromium"
            yield Outcome(group, math.nan, 0, _foreign(chromium, url, token, rng))
        if process.poll() is not None:
            yield Outcome(
                "websocket frames without a pause", math.nan, 0, f"canid has ended: {says.read_text()[-300:]}"
            )
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE_S)


def _address(says: Path) -> str:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        found = re.search(r"live page: (http\S+)\n", says.read_text())
        if found:
            return found[1]
        time.sleep(0.02)
    raise AssertionError(says.read_text())


def _client(port: int, token: str) -> ClientConnection:
    here = f"127.0.0.1:{port}"
    return connect(f"ws://{here}/live", origin=f"http://{here}", subprotocols=["canid", token])  # type: ignore[arg-type, list-item]


def _crowd(port: int, token: str, rng: random.Random) -> str:
    path, beginnings = rng.choice(FILES), drawn(rng)
    try:
        with crowd(port, beginnings):
            with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as sock:
                sock.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
                answer = b"".join(iter(lambda: sock.recv(65536), b""))
            with _client(port, token) as own:
                own.recv(PATIENCE_S)
    except (OSError, ConnectionClosed) as error:
        return f"{len(beginnings)} connections, {path}: {error!r}"
    status = answer.partition(b"\r\n")[0].decode("latin-1")
    return "" if status == "HTTP/1.1 200 OK" else f"{len(beginnings)} connections: {path} gives {status}"


def _flood(port: int, token: str, rng: random.Random) -> str:
    kind, at_once = rng.choice(list(FRAMES)), rng.randrange(50, 5000)
    first, many = FRAMES[kind]
    with _client(port, token) as own, _client(port, token) as flooding:
        if not thrown_out(flooding.socket, first, many * at_once, PATIENCE_S):
            return f"{kind}, {at_once} at once, for {PATIENCE_S:g} s and not thrown out"
        for _ in range(3):
            own.recv(PATIENCE_S)
    return ""


def _foreign(chromium: str, url: str, token: str, rng: random.Random) -> str:
    from playwright.sync_api import sync_playwright

    root = url.partition("#")[0]
    with sync_playwright() as play, ForeignServer(root) as foreign:
        browser = play.chromium.launch(executable_path=chromium, args=FLAGS)
        context = browser.new_context()
        owner = context.new_page()

        def admitted() -> bool:
            end = time.monotonic() + PATIENCE_S
            while not owner.evaluate(ADMITTED):
                if time.monotonic() > end:
                    return False
                owner.wait_for_timeout(30)
            return True

        owner.goto(url)
        if not admitted():
            return "the owner is not admitted"
        host = rng.choice(("127.0.0.1", "localhost"))
        there = f"http://{host}:{foreign.port}/{rng.choice(('', 'redirect'))}"
        way = rng.choice(("same tab", "another tab", "opened by the page"))
        if way == "opened by the page":
            owner.evaluate("(there) => { open(there); }", there)
        else:
            (owner if way == "same tab" else context.new_page()).goto(there)
        finished = foreign.done.wait(PATIENCE_S)
        if way == "same tab":
            owner.go_back()
        else:
            owner.reload()
        back = admitted()
        browser.close()
        seen = b"".join(foreign.received)
    if not finished:
        return f"{way}, {there}: the foreign page has not reported all"
    if any(form.encode() in seen for form in (token, quote(token, safe=""))):
        return f"{way}, {there}: the foreign server has the token"
    return "" if back else f"{way}, {there}: the owner is not admitted again"
