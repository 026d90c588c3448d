"""End to end on three buses: nothing is lost, and live says what replay says."""

from __future__ import annotations

import json
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.session.session import SessionSettings, World, session
from canid.io.buses.bus_opener import open_bus, open_buses
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.values.text import json_values
from canid.values.types import Estimate, Flag, Frame

LOG = Path(__file__).parents[2] / "replay_logs/following_urban.blf"
# s: both estimators are "ok" by then, and the slow machine needs no more than four minutes for all of it
PART = 60.0


def sent() -> list[Frame]:
    """The part that is played."""
    return [frame for frame in open_log(LOG) if frame.t <= PART]


def content(frames: list[Frame]) -> list[tuple[int, bytes, int]]:
    """What a frame is, without its time; who sent it is not part of it."""
    return [(frame.id, frame.data, frame.flags & ~Flag.TX) for frame in frames]


def rows(text: str) -> list[dict[str, Any]]:
    """Lines of JSON, without the name of their schema."""
    return [{k: v for k, v in json.loads(line).items() if k != "schema"} for line in text.splitlines()]


def on_virtual(tmp_path: Path, recording: Path, **_: Any) -> tuple[list[dict[str, Any]], int]:
    """One process: a thread sends as fast as the bus takes it, the frames keep the log's times."""
    config = {"interface": "virtual", "channel": str(tmp_path)}
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, iter(sent()), math.inf))
    lines, drops = [], -1
    sender.start()
    ended = lambda: not sender.is_alive()  # noqa: E731
    # a minute is played in seconds: the estimators are behind when the last frame has come, and may finish
    for item in session(buses, SessionSettings("generic", recording, finish=120.0), stopped=ended):
        if isinstance(item, World):
            assert item.estimator is not None
            drops = item.recorder.drops_bus + item.recorder.drops_estimator + item.estimator.dropped
        elif isinstance(item.item, Estimate):
            lines.append(json.loads(json_values.line(json_values.plain(item.item))))
    sender.join()
    return lines, drops


def children_wait(parent: int) -> bool:
    """Whether, after 50 ms, no child process runs or is ready to run: whoever has no processor yet is ready."""
    time.sleep(0.05)
    states = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has ended
            state, its_parent = status.read_text().rpartition(")")[2].split()[:2]
            states += [state] if int(its_parent) == parent else []
    return "S" in states and "R" not in states


def between_processes(
    bus: tuple[str, ...],
    number: int,
    tmp_path: Path,
    recording: Path,
    listening: Callable[..., Any],
    canid: Callable[..., Any],
    until: Callable[..., None],
) -> tuple[list[dict[str, Any]], int]:
    """Two processes: `replay --onto` in the log's own time, and `live` until a signal."""
    reported = tmp_path / "live.jsonl"
    live = listening("live", *bus, "--vehicle", "generic", "--record", recording, "--json", reported)
    sender = canid("replay", LOG, "--onto", *bus, "--speed", 1, "--stop", PART)
    assert sender.end() == 0, sender.says()
    # the estimators may be behind the bus on a slow machine; 2.5 s: they report every half second, of samples that are
    # up to 1.9 s old
    until(lambda: reported.read_text().endswith("\n") and rows(reported.read_text())[-1]["t"] > PART - 2.5)
    # and what came after the frames of those samples may still be on its way to them
    until(lambda: all(children_wait(live.process.pid) for _ in range(20)))
    assert live.end(number) == 128 + number, live.says()
    assert " 0 dropped" in live.printed(), live.printed()
    assert "not estimated" not in live.printed(), live.says()
    return rows(reported.read_text()), 0


def on_udp_multicast(**tools: Any) -> tuple[list[dict[str, Any]], int]:
    """Hop limit 0, in a namespace that has loopback alone: no packet leaves the machine."""
    bus = ("-i", "udp_multicast", "-c", "233.252.0.1", "--bus-kwargs", "hop_limit=0")
    return between_processes(bus, signal.SIGINT, **tools)


def on_vcan(candump: Callable[[str], Any], **tools: Any) -> tuple[list[dict[str, Any]], int]:
    """Kernel SocketCAN, with another program's client as well."""
    witness = candump("vcan0")
    result = between_processes(("-i", "socketcan", "-c", "vcan0", "--fd"), signal.SIGTERM, **tools)
    witness.end(signal.SIGTERM)
    seen = witness.printed().splitlines()
    # nothing but what was played: live has sent nothing
    assert [line.split()[2] for line in seen] == [f"{f.id:03X}#{f.data.hex().upper()}" for f in sent()]
    return result


BUSES = [
    on_virtual,
    pytest.param(on_udp_multicast, marks=pytest.mark.netns),
    pytest.param(on_vcan, marks=pytest.mark.vcan),
]


@pytest.mark.slow("sessions on a bus in real time")
@pytest.mark.timeout(900)
@pytest.mark.parametrize("play", BUSES)
def test_live_loses_nothing_and_says_what_replay_says(
    play: Callable[..., tuple[list[dict[str, Any]], int]],
    tmp_path: Path,
    listening: Callable[..., Any],
    canid: Callable[..., Any],
    until: Callable[..., None],
    request: pytest.FixtureRequest,
) -> None:
    """A log played onto a bus is recorded whole, and live estimates are those of replaying the recording."""
    recording = tmp_path / "live.blf"
    tools: dict[str, Any] = {"listening": listening, "canid": canid, "until": until}
    if play is on_vcan:
        tools["candump"] = request.getfixturevalue("candump")
    live, drops = play(tmp_path=tmp_path, recording=recording, **tools)

    assert drops == 0
    log = open_log(recording)
    assert content(list(log)) == content(sent())
    assert log.damage is None

    again = canid("replay", recording, "--vehicle", "generic", "--json", "-")
    original = canid("replay", LOG, "--vehicle", "generic", "--stop", PART, "--json", "-")
    assert again.end() == 0, again.says()
    assert original.end() == 0, original.says()

    replayed = rows(again.printed())
    assert len(live) == len(replayed) > PART  # two estimators, each every half second, once it has begun
    for one, other in zip(live, replayed, strict=True):
        same(one, other)
    assert agreements(live, rows(original.printed())) > PART / 2


def same(one: Any, other: Any, where: str = "") -> None:
    """Equal, numbers to 1e-9 relative or absolute."""
    if isinstance(one, float) and isinstance(other, float):
        assert math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-9), f"{where}: {one} {other}"
    elif isinstance(one, dict) and isinstance(other, dict):
        assert one.keys() == other.keys()
        for key in one:
            same(one[key], other[key], f"{where}/{key}")
    else:
        assert one == other, where


def agreements(ours: list[dict[str, Any]], theirs: list[dict[str, Any]]) -> int:
    """Count the intervals of the same estimator at nearly the same time that overlap; none may be apart.

    The frames' times differ by the scheduling of two processes, a few ms, far below what the intervals allow. A busy
    machine may stop the sender for so long that the lead is lost: estimates are then made at other times, half a second
    apart as before.
    """
    found = 0
    # other lines are findings on the signals: a sender that was stopped makes the speed late
    estimates, others = ([row for row in each if "estimator" in row] for each in (ours, theirs))
    for row in estimates:
        near = [o for o in others if o["estimator"] == row["estimator"] and abs(o["t"] - row["t"]) < 0.3]
        other = min(near, key=lambda o: abs(o["t"] - row["t"]), default=None)
        if other is None or not row["status"] == other["status"] == "ok":
            continue
        for where, one, two in intervals(row, other):
            assert one["low"] <= two["high"], (where, one, two)
            assert two["low"] <= one["high"], (where, one, two)
            found += 1
    return found


def intervals(row: dict[str, Any], other: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """The intervals that both rows have."""
    for name, channel in row["channels"].items():
        for parameter in ("K", "tau", "dead_time", "tau_plus_dead_time"):
            one, two = channel[parameter], other["channels"][name][parameter]
            if one["value"] is not None and two["value"] is not None:
                yield f"{row['t']} {row['estimator']} {name} {parameter}", one, two


@pytest.mark.slow("sessions on a bus in real time")
@pytest.mark.netns
def test_what_udp_multicast_drops_is_counted() -> None:
    """Received and counted make up what was sent, also where they were not read in time."""
    config = {"interface": "udp_multicast", "channel": "239.74.163.3", "hop_limit": 0}
    bus = open_bus(config)
    try:
        sent = onto(config, (Frame(0.0, 0, k % 2048, bytes(8)) for k in range(120_000)), speed=math.inf)
        received = 0
        while bus.recv(0.5) is not None:
            received += 1
        assert received > 0
        assert received + bus.drops == sent
    finally:
        bus.shutdown()


@pytest.mark.netns
def test_a_group_is_a_bus_of_its_own() -> None:
    """Two udp_multicast channels on one machine: none receives what was sent to the other."""
    configs = [{"interface": "udp_multicast", "channel": f"239.74.163.{n}", "hop_limit": 0} for n in (11, 12)]
    buses = [open_bus(config) for config in configs]
    try:
        for n, config in enumerate(configs):
            onto(config, [Frame(0.0, 0, 0x100 + n, bytes([n]))], speed=math.inf)
        for n, bus in enumerate(buses):
            received = []
            while (got := bus.recv(0.5)) is not None:
                received.append(got.data)
            assert received == [bytes([n])]
    finally:
        for bus in buses:
            bus.shutdown()
