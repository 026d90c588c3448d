"""The page's secret in a real browser: it reaches no other port, and the page can be reloaded and opened again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any
from urllib.parse import quote

import pytest

from tests.fixtures.foreign_server import ForeignServer
from tests.web.conftest import Page

Error = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install -e '.[dev]'").Error

PATIENCE = 60_000  # ms
ADMITTED = "document.body.dataset.connection === 'open' && document.body.dataset.mode === 'live'"


@pytest.fixture
def context(browser: Any) -> Iterator[Any]:
    made = browser.new_context()
    made.set_default_timeout(PATIENCE)
    yield made
    made.close()


def until(tab: Any, condition: str) -> None:
    """Wait; from outside, because the page's policy keeps playwright from waiting inside."""
    for _ in range(PATIENCE // 50):
        with suppress(Error):  # it is being loaded
            if tab.evaluate(f"Boolean({condition})"):
                return
        tab.wait_for_timeout(50)
    raise AssertionError(condition)


def root(page: Page) -> str:
    return f"http://127.0.0.1:{page.port}/"


@pytest.mark.slow("a session and its page in a browser")
@pytest.mark.parametrize("way", ["another tab", "the same tab", "redirect", "by name", "opened by it"])
def test_no_other_port_gets_the_secret(way: str, context: Any, fresh: Page) -> None:
    """A foreign page on another port of the host, however it is reached, sends home all that it can see: no byte that it
    receives holds the token, plain or encoded, and the owner's page goes on."""
    with ForeignServer(root(fresh)) as foreign:
        owner = context.new_page()
        owner.goto(fresh.live.url)
        until(owner, ADMITTED)
        there = f"http://127.0.0.1:{foreign.port}/"
        tab = owner if way == "the same tab" else context.new_page()
        if way == "redirect":
            there = f"http://localhost:{foreign.port}/redirect"
        elif way == "by name":
            there = f"http://localhost:{foreign.port}/"
        if way == "opened by it":
            owner.evaluate("(there) => { open(there); }", there)
        else:
            tab.goto(there)
        assert foreign.done.wait(PATIENCE / 1000)
        if way == "the same tab":
            tab.go_back()
        until(owner, ADMITTED)
        seen = b"\n".join(foreign.received)
        assert len(foreign.received) > 5
        for form in (fresh.token, quote(fresh.token, safe=""), fresh.token[4:-4]):
            assert form.encode() not in seen
        assert b"canid_" not in seen  # nor a cookie of canid's


@pytest.mark.slow("a session and its page in a browser")
def test_the_page_can_be_reloaded_and_opened_again(context: Any, fresh: Page) -> None:
    """A reload, the link in a second tab, back after another page: admitted; no address, cookie or permanent storage has
    the token; without it nothing of the session is shown, with what to do; the link then admits the same tab."""
    owner = context.new_page()
    owner.goto(fresh.live.url)
    until(owner, ADMITTED)
    assert owner.evaluate("location.href") == root(fresh)
    assert (
        owner.evaluate("document.cookie + JSON.stringify({...localStorage}) + document.title").count(
            fresh.token
        )
        == 0
    )
    assert context.cookies() == []
    owner.reload()
    until(owner, ADMITTED)
    owner.goto("about:blank")
    owner.go_back()
    until(owner, ADMITTED)
    second = context.new_page()
    second.goto(fresh.live.url)
    until(second, ADMITTED)
    stranger = context.new_page()
    for path in ("", "#token=", "#token=a b", "#token=" + "x" * 22, "?token=" + fresh.token):
        stranger.goto("about:blank")
        stranger.goto(root(fresh) + path)
        until(stranger, "document.body.dataset.connection === 'refused'")
        assert "open the address that canid has printed" in stranger.text_content("#banner")
        assert stranger.evaluate("document.body.dataset.mode") == ""
    stranger.goto(root(fresh))
    stranger.goto(fresh.live.url)  # the fragment alone is new
    until(stranger, ADMITTED)


@pytest.mark.slow("a session and its page in a browser")
def test_it_works_without_storage(browser: Any, fresh: Page) -> None:
    """Where the browser keeps nothing the address keeps the token, and a reload is admitted."""
    context = browser.new_context()
    context.add_init_script(
        "Object.defineProperty(window, 'sessionStorage', { get() { throw new Error('off'); } });"
    )
    owner = context.new_page()
    owner.goto(fresh.live.url)
    until(owner, ADMITTED)
    owner.reload()
    until(owner, ADMITTED)
    context.close()
