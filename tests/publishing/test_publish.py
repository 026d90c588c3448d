"""--publish: the datagrams that a real socket receives, against --json; and that nothing can delay who publishes."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import canid
from canid.io.publishing import datagrams, udp_address, udp_publisher
from canid.io.publishing.udp_publisher import UdpPublisher
from canid.ui.cli import main
from canid.values.errors import ConfigError
from canid.values.types import BlockStatus, Event, Identifiable, LearnGate, Sample, Status

ROOT = Path(__file__).parents[2]
LOG = ROOT / "replay_logs" / "following_urban.blf"
STOP_S = 40.0


@contextmanager
def receiver() -> Iterator[tuple[str, list[bytes]]]:
    """A socket on loopback and what it got."""
    got: list[bytes] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(0.5)
        ended = threading.Event()

        def read() -> None:
            while True:
                try:
                    got.append(sock.recv(65536))
                except TimeoutError:
                    if ended.is_set():
                        return

        thread = threading.Thread(target=read)
        thread.start()
        try:
            yield f"udp://127.0.0.1:{sock.getsockname()[1]}", got
        finally:
            ended.set()
            thread.join()


@pytest.mark.slow("sessions in real time")
def test_a_replay_publishes_the_numbers_of_its_json(tmp_path: Path) -> None:
    """Every estimate and report of --json, and every sample of the pipeline, with equal numbers; each fits a frame."""
    out = tmp_path / "x.json"
    with receiver() as (url, got):
        words = ["--vehicle", "generic", "--stop", str(STOP_S), "--json", str(out), "--publish", url]
        # 200 times as fast: a loopback socket's buffer holds some hundred datagrams
        assert main(["replay", str(LOG), *words, "--speed", "20"]) == 0
    messages = [json.loads(data) for data in got]
    assert max(map(len, got)) <= datagrams.MAX_BYTES
    assert all(isinstance(m["timestamp"], float) and m["t"] <= STOP_S for m in messages)
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    for name in ("fopdt", "armax"):
        expected = [line for line in lines if line.get("estimator") == name]
        sent = [(m["t"], m["estimate"][name]) for m in messages if name in m.get("estimate", {})]
        assert len(sent) >= len(expected) > 50
        for line in expected:
            parts: dict[str, Any] = {}
            for t, part in sent:
                if round(t, 6) == line["t"]:
                    merge(parts, part)
            assert parts["status"] == line["status"]
            for channel, values in line["channels"].items():
                for parameter in ("K", "tau", "dead_time"):
                    known = {key: x for key, x in values[parameter].items() if x is not None}
                    assert parts[channel].get(parameter, {}) == known
    samples = {m["t"]: m for m in messages if "sample" in m}
    assert len(samples) > 9 * STOP_S
    trace = canid.read_trace(LOG, "generic")
    for k in np.flatnonzero(trace.t < STOP_S - 5.0).tolist():
        message = samples[float(trace.t[k])]
        assert message["sample"].get("output", None) == finite(trace.output[k])
        assert message["signals"].get("speed", None) == finite(trace.signals["speed"][k])
        assert message["sample"]["learn"] == int(trace.learn[k])


def merge(into: dict[str, Any], part: dict[str, Any]) -> None:
    for key, value in part.items():
        if isinstance(value, dict):
            merge(into.setdefault(key, {}), value)
        else:
            into[key] = value


def finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def sample(t: float = 1.0, **signals: float) -> Sample:
    return Sample(t, 12.0, (0.5, -1.0), LearnGate.OPEN, True, 0, signals)


def test_what_is_too_long_is_sent_in_parts() -> None:
    """Of 300 signals each comes once, in datagrams that fit an Ethernet frame, all with their time."""
    values = {f"signal_{k}": k + 0.125 for k in range(300)} | {"unknown": float("nan")}
    sent = datagrams.datagrams(1e9, 1.0, datagrams.values_of(sample(**values)))
    parts = [json.loads(data) for data in sent]
    assert len(parts) > 3
    assert max(map(len, sent)) <= datagrams.MAX_BYTES
    assert {part["timestamp"] for part in parts} == {1e9}
    found = [pair for part in parts for pair in part.get("signals", {}).items()]
    assert sorted(found) == sorted((name, x) for name, x in values.items() if name != "unknown")


def test_names_and_texts_are_data() -> None:
    """Control characters, surrogates and endless texts of events: valid UTF-8 and JSON, in one datagram."""
    text = "\x1b[2J\udcff" + "é" * 5000
    (data,) = datagrams.datagrams(1e9, 1.0, datagrams.values_of(Event(1.0, "mark", text)))
    assert len(data) <= datagrams.MAX_BYTES
    assert b"\x1b" not in data
    assert json.loads(data)["event"]["mark"] == 1


def test_a_name_server_that_does_not_answer_costs_only_the_datagrams(monkeypatch: pytest.MonkeyPatch) -> None:
    """Items that wait are bounded and counted; putting and closing return although the thread hangs."""
    hang = threading.Event()

    def hangs(*_: object) -> Any:
        hang.wait(60.0)
        raise OSError(None, "never")

    monkeypatch.setattr(udp_address, "resolve", hangs)
    said: list[str] = []
    publisher = UdpPublisher(udp_address.parse("udp://nowhere.invalid:9"), said.append, 0)
    for k in range(udp_publisher.MAX_WAITING_ITEMS + 10):
        publisher.put(sample(float(k)))
    publisher.close()
    assert publisher.dropped == 10
    assert said == ["--publish udp://nowhere.invalid:9: 10,010 items were not sent"]
    hang.set()


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "127.255.255.255"])
def test_a_host_that_refuses_ends_nothing(host: str) -> None:
    """A closed port answers by ICMP, the broadcast address of loopback is not permitted: each is reported once at most."""
    said: list[str] = []
    publisher = UdpPublisher(udp_address.parse(f"udp://{host}:9"), said.append, 0)
    for k in range(200):
        publisher.put(sample(float(k)))
        publisher.status({"frames": k, "start_ns": None, "buses": [{"load": None}]})
        time.sleep(0.0001)
    publisher.close()
    assert publisher.dropped == 0
    assert len([line for line in said if "was not sent" in line]) <= 1


def test_a_name_of_a_group_is_refused_once_it_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """A host name that stands for a multicast address: a sentence, and nothing is sent."""
    found = [(socket.AF_INET, socket.SOCK_DGRAM, 17, "", ("239.1.1.1", 9))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
    said: list[str] = []
    publisher = UdpPublisher(udp_address.parse("udp://group.invalid:9"), said.append, 0)
    publisher.put(sample())
    publisher.close()
    assert "239.1.1.1 is a multicast address" in said[0]
    assert publisher.sent == 0


def test_codes_are_those_of_the_documentation() -> None:
    """docs/publish.md lists every code with its number."""
    text = (ROOT / "docs" / "publish.md").read_text()
    for names in (
        [member.value for member in Status],
        [member.value for member in Identifiable],
        [member.value for member in BlockStatus],
        [member.name.lower() for member in LearnGate],
    ):
        assert ", ".join(f"{k} `{name}`" for k, name in enumerate(names)) in text


def test_what_cannot_be_encoded_costs_itself_alone() -> None:
    """A time that is no number is reported, what follows is sent; a name that cannot be one ends nothing."""
    says: list[str] = []
    with receiver() as (url, got):
        published = UdpPublisher(udp_address.parse(url), says.append, 0)
        published.put(Event(float("nan"), "mark", "lost"))
        published.put(Event(2.0, "mark", "kept"))
        published._thread.join(0.01)
        published.close()
    impossible = UdpPublisher(udp_address.parse("udp://" + "a" * 64 + ":9"), says.append, 0)
    impossible._thread.join(30)
    assert [json.loads(data)["event"]["says"] for data in got] == ["kept"]
    assert len(says) == 2
    assert "was not sent" in says[0]
    assert "nothing is published" in says[1]
    with pytest.raises(ConfigError, match="multicast"):
        udp_address.parse("udp://[::ffff:224.0.0.1]:9")
