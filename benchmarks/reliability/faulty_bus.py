"""A python-can interface that does what a script says: bursts, error frames, bus-off, unplugging, clocks that step.

Registered as `faulty` in the recorder's own process (`BEFORE`). A script is a list of steps:

    ["frames", n, rate]        n numbered frames, `rate` per s; 0: as fast as they are read
    ["error", n]               n error frames
    ["state", "ERROR"]         the controller's state from here on (python-can's BusState)
    ["gone", s]                the interface is away for s; opening fails until then
    ["clock", s]               the clock that stamps the frames steps by s
    ["run", x]                 the clock that stamps the frames runs x times as fast from here on; negative: backwards
    ["number", n]              frames are numbered from n on
    ["duplicate", n]           n frames come twice
    ["swap", n]                n pairs of frames come in the wrong order
    ["pause", s]               nothing comes for s
    ["idle"]                   nothing more comes
"""

from __future__ import annotations

import json
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from canid.io.buses import python_can
from tests.fixtures.traffic import number

BEFORE = "from benchmarks.reliability import faulty_bus; faulty_bus.register()"
NAME = "faulty"


class Script(NamedTuple):
    """A script in a file; the bus counts in another file what it has returned."""

    path: Path

    @property
    def words(self) -> tuple[str, ...]:
        """Arguments of a verb that listens."""
        return ("-i", NAME, "-c", str(self.path))

    def handed_over(self) -> int:
        """Frames that were received so far, as of the latest step that has ended."""
        path = self.path.with_suffix(".done")
        text = path.read_text() if path.exists() else ""
        return int(text.split()[0]) if text.endswith("\n") else 0

    def stamps(self) -> list[tuple[int, float]]:
        """Number and stamp, s, of each frame, in the order in which they came."""
        path = self.path.with_suffix(".stamps")
        return list(struct.iter_unpack("<qd", path.read_bytes())) if path.exists() else []

    def instants(self) -> list[tuple[str, float]]:
        """Each step that has begun, and its wall clock."""
        path = self.path.with_suffix(".instants")
        rows = [line.rsplit(" ", 1) for line in path.read_text().splitlines()] if path.exists() else []
        return [(name, float(at)) for name, at in rows]


def script(folder: Path, steps: list[list[Any]], name: str = "script") -> Script:
    """Write it down."""
    path = folder / f"{name}.json"
    path.write_text(json.dumps(steps))
    return Script(path)


def register() -> None:
    """Make python-can know the interface, in this process."""
    can = python_can.load()
    can.interfaces.BACKENDS[NAME] = (__name__, "FaultyBus")
    # each of these modules has its own name for the same set
    for module in (can, can.interfaces, can.util):
        module.VALID_INTERFACES = frozenset({*module.VALID_INTERFACES, NAME})


class _Node:
    """The device behind a channel: it lives on while its bus is closed and opened."""

    def __init__(self, path: Path):
        self.state = "ACTIVE"
        self.away_until = 0.0  # monotonic clock
        self.items = self._play(path)
        self.held: Any = None

    def _play(self, path: Path) -> Iterator[Any]:
        """What the bus gives; each frame's number and stamp are noted, in the order in which they come."""
        with path.with_suffix(".stamps").open("ab", buffering=0) as stamps:
            for item in self._items(path):
                if getattr(item, "data", None):
                    stamps.write(struct.pack("<qd", int.from_bytes(item.data[:4], "big"), item.timestamp))
                yield item

    def _items(self, path: Path) -> Iterator[Any]:
        can = python_can.load()
        done, clock, speed, since = 0, 0.0, 1.0, time.time()
        instants = path.with_suffix(".instants").open("a")

        def frame(i: int) -> Any:
            stamp = since + (time.time() - since) * speed + clock
            return can.Message(arbitration_id=i % 2048, data=number(i), is_extended_id=False, timestamp=stamp)

        for step, *given in json.loads(path.read_text()):
            instants.write(f"{step} {time.time()}\n")
            instants.flush()
            if step == "frames":
                n, rate = given
                began = time.monotonic()
                for k in range(n):
                    while rate and time.monotonic() < began + k / rate:
                        yield None
                    yield frame(done + k)
                done += n
            elif step == "error":
                for _ in range(given[0]):
                    yield can.Message(
                        is_error_frame=True, timestamp=time.time() + clock, is_extended_id=False
                    )
            elif step == "state":
                self.state = given[0]
            elif step == "gone":
                self.away_until = time.monotonic() + given[0]
                yield can.CanOperationError("the device is unplugged")
            elif step == "clock":
                clock += given[0]
            elif step == "run":
                now = time.time()
                since, speed, clock = now, given[0], since + (now - since) * speed + clock - now
            elif step == "number":
                done = given[0]
            elif step == "duplicate":
                for _ in range(given[0]):
                    one = frame(done)
                    yield one
                    yield one
                    done += 1
            elif step == "swap":
                for _ in range(given[0]):
                    one, two = frame(done), frame(done + 1)
                    yield two
                    yield one
                    done += 2
            elif step == "pause":
                until = time.monotonic() + given[0]
                while time.monotonic() < until:
                    yield None
            path.with_suffix(".done").write_text(f"{done}\n")
        while True:
            yield None


_NODES: dict[str, _Node] = {}


def __getattr__(name: str) -> Any:
    """The class itself, once it is asked for: importing python-can is for the recorder to begin."""
    if name != "FaultyBus":
        raise AttributeError(name)
    can = python_can.load()

    class FaultyBus(can.BusABC):  # type: ignore[misc, name-defined]
        """What python-can opens."""

        def __init__(self, channel: str, **_: Any):
            self._node = _NODES.setdefault(channel, _Node(Path(channel)))
            if time.monotonic() < self._node.away_until:
                raise can.CanInitializationError("no such device")
            self.channel_info = f"faulty {channel}"
            super().__init__(channel)

        @property
        def state(self) -> Any:
            return can.BusState[self._node.state]

        def _recv_internal(self, timeout: float | None) -> tuple[Any, bool]:
            end = time.monotonic() + (timeout or 0.0)
            while True:
                item = next(self._node.items)
                if isinstance(item, Exception):
                    raise item
                if item is not None:
                    return item, False
                if time.monotonic() >= end:
                    return None, False
                time.sleep(0.0005)

        def send(self, msg: Any, timeout: float | None = None) -> None:
            raise NotImplementedError

        def shutdown(self) -> None:
            super().shutdown()

    globals()["FaultyBus"] = FaultyBus
    return FaultyBus
