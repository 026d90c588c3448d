"""What a late client is given is bounded, and so is what a client that takes nothing can cost."""

from __future__ import annotations

import asyncio
import json
from itertools import pairwise
from typing import Any

import pytest

from canid.ui.web import hub
from canid.ui.web.history import History


def sample(t: float) -> dict[str, Any]:
    signals = {"speed": 20.123456789, "gap": 31.987654321, "headway": 1.23456789, "range_rate": -0.123456789}
    inputs = {"headway_error": -0.123456789, "range_rate": -0.123456789}
    return {
        "kind": "sample", "t": t, "output": 12.3456789, "inputs": inputs, "gate": "", "learn": True, "segment": 0,
        "signals": signals,
    }  # fmt: skip


@pytest.mark.slow("a session and its page in a browser")
def test_eight_hours_are_bounded() -> None:
    """The snapshot of a day's driving is small, reaches from the first sample to the last, and has the last two minutes
    whole; between them the gaps are even."""
    history, sizes = History(), []
    for k in range(8 * 36000):
        history.take(sample(k / 10))
        if k in (2 * 36000, 8 * 36000 - 1):
            sizes.append(len(json.dumps(history.snapshot())))
    t = [row["t"] for row in history.snapshot()["samples"]]
    assert max(sizes) < 1_000_000
    assert sizes[1] < 1.5 * sizes[0]
    assert (t[0], t[-1]) == (0.0, 8 * 3600 - 0.1)
    assert t[-1200:] == [k / 10 for k in range(8 * 36000 - 1200, 8 * 36000)]
    gaps = [b - a for a, b in pairwise(t[:-1199])]
    assert max(gaps) < 3 * min(gaps[1:-1])


class Mute:
    """A websocket whose client takes nothing."""

    def __init__(self) -> None:
        self.aborted = False
        self.sent = 0
        self.scope = {"canid.abort": self.abort}

    def abort(self) -> None:
        self.aborted = True

    async def accept(self, subprotocol: str) -> None:
        """Take it."""

    async def send_text(self, _: str) -> None:
        self.sent += 1
        await asyncio.Event().wait()

    async def receive(self) -> None:
        await asyncio.Event().wait()


def test_a_client_that_takes_nothing_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """One message is handed to its connection, never a second one; then the connection is ended."""
    monkeypatch.setattr(hub, "STALLED_S", 0.2)
    mute = Mute()

    async def run() -> None:
        of = hub.Hub(("mark",), lambda request: None)
        serving = asyncio.create_task(of.serve(mute))  # type: ignore[arg-type]
        for k in range(2000):
            of.take([json.dumps(sample(k / 10)).encode()])
            if k % 100 == 0:
                await asyncio.sleep(0)
        await asyncio.wait_for(serving, 30)

    asyncio.run(run())
    assert mute.aborted
    assert mute.sent == 1
