"""Reads captures of SocketCAN, .pcap and .pcapng, as columns or as a stream of frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from canid.io.logs.damage import DamagedSpans
from canid.io.logs.frame_lines import Times
from canid.io.logs.pcap.capture_packets import Lost, Packets, is_capture, packets
from canid.io.logs.pcap.socketcan_frames import NO_NAME, SLL2, Source, frames, sources
from canid.io.logs.reader_state import ReadState
from canid.values.bus_names import MAX_BUSES, bus_numbers, with_more
from canid.values.errors import ConfigError, DamagedLogError, LogError
from canid.values.frame_columns import WantedIds, join, keep_memory
from canid.values.types import Columns, Damage

_GZIP = b"\x1f\x8b"


def read_pcap(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where it is no capture, ConfigError where it has no CAN frame.

    `wanted`: frames with other ids may be left out.
    """
    keep_memory()
    _check(path)
    buses = _buses(path, state)
    damaged = DamagedSpans()
    times = Times(state)
    with open(path, "rb") as file:
        for item in packets(file, state.size):
            if isinstance(item, Lost):
                damaged.add(*item)
                continue
            state.done = item.begin
            state.unpacked = state.size + item.begin
            ns, chunk, others, wrong = frames(item, buses)
            for span in wrong:
                damaged.add(*span)
            state.other_kinds.update(others)
            state.frames += len(ns)
            yield from times.step(ns, chunk, wanted)
    if times.waiting:
        yield join(times.waiting)
    _close(path, state, damaged)


def _check(path: Path) -> None:
    """Raise LogError where a file is no capture."""
    with open(path, "rb") as file:
        begin = file.read(4)
    if begin.startswith(_GZIP):
        raise LogError(f"{path} is compressed: unpack it with gunzip first")
    if not is_capture(begin):
        raise LogError(f"{path} is no capture: it begins neither as .pcap nor as .pcapng does")


def _buses(path: Path, state: ReadState) -> dict[Source, int]:
    """The bus of each interface. They are looked for in the whole file, where it may have several."""
    present: set[Source] = set()
    with open(path, "rb") as file:
        for item in packets(file, state.size):
            if isinstance(item, Packets):
                state.unpacked = item.begin
                if item.single and item.interfaces[0].link != SLL2:
                    return {NO_NAME: 0}
                present |= sources(item)
            if len(present) > MAX_BUSES:
                break
    numbers = bus_numbers(sorted(name for name, _ in present if name)[:MAX_BUSES])
    state.buses.update(numbers)
    buses = {(name, 0): number for name, number in numbers.items()}
    # names by number, then those that have a number alone
    rest = {
        f"#{source[1]}": source
        for source in sorted(present - buses.keys(), key=lambda source: abs(source[1]))
    }
    more = with_more(numbers, [*rest][: MAX_BUSES - len(numbers)])
    return buses | {source: more[text] for text, source in rest.items() if text in more}


def _close(path: Path, state: ReadState, damaged: DamagedSpans) -> None:
    """Sum up. Raises an error where there was no frame."""
    state.done = state.size
    state.damaged = damaged.count
    if not state.frames:
        kinds = ", ".join(f"{n:,} {kind}" for kind, n in state.other_kinds.items())
        if damaged:
            says = damaged.sentence("packets", 0, -1)
            raise DamagedLogError(f"{path} holds no frame that can be read ({says})")
        if kinds:
            raise ConfigError(
                f"{path}: is a capture without CAN frames ({kinds}); capture an interface of SocketCAN, such as can0"
            )
    if damaged:
        says = damaged.sentence("packets", state.frames, -1)
        state.damage = Damage(says, state.frames, -1, damaged.spans)
