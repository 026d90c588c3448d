"""`canid.Listener` behind python-can's Notifier: replay's numbers, and nothing that reaches the bus's thread."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest

import canid
from canid.analysis.session import listener as module
from canid.analysis.session.listener import Listener
from canid.io.buses.messages import message_of
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.values.errors import CanidError, ConfigError
from canid.values.text import json_values
from canid.values.types import Estimate, Event

LOG = Path(__file__).parents[2] / "replay_logs/following_urban.blf"
# s: both estimators are "ok" by then
PART = 40.0
START = 1.6e9


def messages(stop: float = PART) -> list[can.Message]:
    """The log's first frames as a Notifier delivers them: stamped with an epoch float, which resolves a µs."""
    frames = [frame._replace(t=round(frame.t, 6)) for frame in open_log(LOG) if frame.t <= stop]
    return [message_of(frame, START) for frame in frames]


def line(estimate: Estimate) -> str:
    return json_values.line(json_values.plain(estimate))


@pytest.mark.slow("sessions on a bus in real time")
def test_a_notifier_on_a_virtual_bus_gives_the_numbers_of_replay(tmp_path: Path) -> None:
    """Frames of the virtual bus, through a Notifier into a Listener and can.Logger: every number of replay is the same."""
    path, channel = tmp_path / "logged.log", str(tmp_path)  # candump: epoch times in µs
    estimates: list[Estimate] = []
    bus = can.Bus(channel=channel, interface="virtual", preserve_timestamps=True)
    sender = can.Bus(channel=channel, interface="virtual", preserve_timestamps=True)
    given = Listener("generic", estimates.append, finish=60.0)
    notifier = can.Notifier(bus, [given, can.Logger(path)])
    try:
        sent = messages()
        for message in sent:
            sender.send(message)
        deadline = time.monotonic() + 60.0
        while given.counts().received < len(sent) and time.monotonic() < deadline:
            time.sleep(0.02)
    finally:
        notifier.stop()
        bus.shutdown()
        sender.shutdown()
    counts = given.counts()
    assert counts.received == counts.estimated == len(sent)
    assert (counts.bad, counts.dropped, counts.callback_errors) == (0, 0, 0)
    replayed = list(canid.replay(path, "generic"))
    assert sum(e.status.value == "ok" for e in replayed) > PART / 2
    assert counts.estimates == len(replayed)
    assert list(map(line, estimates)) == list(map(line, replayed))


@pytest.mark.slow("sessions on a bus in real time")
@pytest.mark.netns
def test_a_queue_on_the_notifiers_own_loop_gets_estimates_from_udp() -> None:
    """With Notifier(loop=...) all of it runs on one event loop, and nothing of the listener blocks it."""
    config = {"interface": "udp_multicast", "channel": "239.74.163.21", "hop_limit": 0}

    async def run() -> tuple[Estimate, float]:
        queue: asyncio.Queue[Estimate] = asyncio.Queue()
        loop = asyncio.get_running_loop()
        with can.Bus(**config) as bus, Listener("generic", queue=queue) as listener:
            notifier = can.Notifier(bus, [listener], loop=loop)
            frames = [frame for frame in open_log(LOG) if frame.t <= 8.0]
            sender = threading.Thread(target=onto, args=(config, iter(frames), 4.0))
            sender.start()
            longest, before = 0.0, time.monotonic()
            while queue.empty() and before < time.monotonic() + 60.0:
                await asyncio.sleep(0.01)
                longest, before = max(longest, time.monotonic() - before), time.monotonic()
            first = await queue.get()
            notifier.stop()
            sender.join()
            return first, longest

    first, longest = asyncio.run(run())
    assert first.estimator in ("fopdt", "armax")
    # s: not the second that the estimator process takes to start
    assert longest < 1.0


def broken_messages() -> list[Any]:
    """What back ends are known to deliver, and worse."""
    rows: list[Any] = [None, "frame", object(), can.Message(arbitration_id=-5, check=False)]
    rows += [can.Message(timestamp=float("nan")), can.Message(timestamp=1e300), can.Message(timestamp=-5.0)]
    long = can.Message(is_fd=True)
    long.data, long.dlc = bytearray(200), 200
    contradictory = can.Message(bitrate_switch=True)  # without FD
    return [*rows, long, contradictory]


@pytest.mark.slow("sessions on a bus in real time")
def test_nothing_is_raised_into_the_bus_thread(caplog: pytest.LogCaptureFixture) -> None:
    """Bad messages, a callback and an on_error that raise: counted, reported once each, and estimates go on."""
    said: list[str] = []

    def report(error: Exception) -> None:
        said.append(str(error))
        raise RuntimeError("on_error fails as well")

    def callback(_: Estimate) -> None:
        raise KeyError("of the\nuser")

    listener = Listener("generic", callback, on_error=report, finish=60.0)
    mixed = broken_messages()
    special = [
        can.Message(timestamp=START, is_error_frame=True, arbitration_id=4),
        can.Message(timestamp=START, is_remote_frame=True, dlc=8),
        can.Message(timestamp=START, is_fd=True, bitrate_switch=True, data=bytes(64)),
        *messages(6.0),
    ]
    with caplog.at_level(logging.WARNING, "canid.listener"):
        for message in [*mixed, *special, *mixed]:
            listener.on_message_received(message)
        with pytest.raises(NotImplementedError):  # python-can's word for "not handled here"
            listener.on_error(can.CanOperationError("bus off"))
        listener.stop()
    counts = listener.counts()
    assert counts.bad == 2 * len(mixed)
    assert counts.received == len(special) + counts.bad
    assert counts.estimated == len(special)
    assert counts.estimates == counts.callback_errors > 4
    assert sorted(text.split(": ")[1] for text in said) == ["a message", "the bus", "the callback"]
    assert all("\n" not in text for text in said)
    assert len(caplog.records) == 3  # on_error itself failed three times, and that is logged


@pytest.mark.slow("sessions on a bus in real time")
def test_a_slow_reader_and_a_closed_loop_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A full asyncio queue, a loop that was closed and a full queue of messages drop, count, and say so once."""
    said: list[str] = []
    loop = asyncio.new_event_loop()
    queue: asyncio.Queue[Estimate] = asyncio.Queue(maxsize=3)
    listener = Listener(
        "generic", queue=queue, loop=loop, on_error=lambda e: said.append(str(e)), finish=60.0
    )
    for message in messages(6.0):
        listener(message)
    deadline = time.monotonic() + 60.0
    while listener.counts().estimates < 8 and time.monotonic() < deadline:
        loop.run_until_complete(asyncio.sleep(0.05))
    loop.close()
    for message in messages(9.0)[len(messages(6.0)) :]:
        listener(message)
    listener.stop()
    assert queue.qsize() == 3
    assert listener.counts().estimates_dropped == listener.counts().estimates - 3 > 5
    assert [text.split(": ")[1] for text in said] == ["the asyncio queue", "the event loop"]

    monkeypatch.setattr(module, "MAX_WAITING_MESSAGES", 10)
    full = Listener("generic")
    monkeypatch.setattr(full._stopping, "wait", lambda *_: time.sleep(0.01) or full._stopping.is_set())
    first = messages(3.0)
    for message in first:
        full(message)
    full.stop()
    counts = full.counts()
    assert counts.received == len(first) == counts.dropped + counts.estimated
    assert counts.dropped > 0


@pytest.mark.slow("sessions on a bus in real time")
def test_stop_is_idempotent_from_anywhere_and_keeps_the_state(tmp_path: Path) -> None:
    """stop() twice, within the callback and after the end; what was learnt is in the state file and is gone on from."""
    state, events = tmp_path / "driver.json", []
    holder: list[Listener] = []
    stopped = threading.Event()

    def callback(_: Estimate) -> None:
        holder[0].stop()
        stopped.set()

    with Listener("generic", callback, state=state, finish=60.0) as listener:
        holder.append(listener)
        for message in messages(20.0):
            listener(message)
        assert stopped.wait(60.0)
        listener.stop()
    listener.stop()
    assert b"canid_state" in state.read_bytes()[:100]
    listener(messages(0.1)[0])  # a late message is counted
    assert listener.counts().dropped == 1
    with Listener("generic", on_other=events.append, state=state, finish=60.0) as again:
        for message in messages(2.0):
            again(message)
    assert "state_restored" in {event.what for event in events if isinstance(event, Event)}


def test_wrong_calls_are_refused_at_once(tmp_path: Path) -> None:
    """A missing vehicle, two ways of delivery, a coroutine, a queue without a loop: before anything is started."""

    async def coroutine(_: Estimate) -> None: ...

    before = threading.active_count()
    calls: list[tuple[type[Exception], Callable[[], object], str]] = [
        (ConfigError, lambda: Listener("no such vehicle"), "no such vehicle"),
        (ValueError, lambda: Listener("generic", print, queue=asyncio.Queue()), "not both"),
        (ValueError, lambda: Listener("generic", coroutine), "coroutine"),
        (TypeError, lambda: Listener("generic", 3), "a function of one estimate"),  # type: ignore[arg-type]
        (ValueError, lambda: Listener("generic", queue=asyncio.Queue()), "loop="),
        (CanidError, lambda: Listener("generic", state=tmp_path), str(tmp_path)),
    ]
    for kind, call, says in calls:
        with pytest.raises(kind, match=says):
            call()
    assert threading.active_count() == before


def test_two_clocks_are_one_session() -> None:
    """A driver that counts from its own zero and one that stamps with the epoch: both at the time of their arrival."""
    stamps = module.MessageStamps(["can0", "can1"])
    now = 1_700_000_000 * 10**9
    frames = [
        stamps.frame(can.Message(timestamp=1.7e9, channel="can1"), now),
        stamps.frame(can.Message(timestamp=12.5, channel="can0"), now + 10**8),
        stamps.frame(can.Message(timestamp=13.0, channel="can0"), now + 10**9),
        stamps.frame(can.Message(timestamp=0.0, channel="can2"), now + 2 * 10**9),
        # its driver has found the time of day meanwhile
        stamps.frame(can.Message(timestamp=1.7e9 + 3.0, channel="can0"), now + 3 * 10**9),
    ]
    assert [(round(f.t, 6), f.bus) for f in frames] == [(0.0, 1), (0.1, 0), (0.6, 0), (2.0, 2), (3.0, 0)]
