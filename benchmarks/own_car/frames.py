"""Frames of a drive in the messages of a DBC: packed by column, with counters, idle values and messages that say nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.own_car.drive import Array

Bytes = npt.NDArray[np.uint8]
# share of frames that are lost
LOST = 0.001


class Stream(NamedTuple):
    """One message over a drive."""

    bus: int
    id: int
    extended: bool
    t: Array  # (n,) s
    data: Bytes  # (n, length)


def pack(signals: Sequence[Any], values: Mapping[str, Array], length: int, n: int) -> Bytes:
    """Pack columns into frames.

    Args:
        signals: cantools' signals of the message.
        values: name -> (n,) physical values; the other signals are 0.
        length: bytes.
        n: frames.
    """
    bits = np.zeros((n, 8 * length), np.uint8)
    for signal in signals:
        if signal.name not in values:
            continue
        scale, offset = float(signal.scale), float(signal.offset)
        raw = np.round((values[signal.name] - offset) / scale).astype(np.int64)
        size = signal.length
        low, high = (-(1 << (size - 1)), (1 << (size - 1)) - 1) if signal.is_signed else (0, (1 << size) - 1)
        raw = np.clip(raw, low, high)
        for k in range(size):
            bit = ((raw >> k) & 1).astype(np.uint8)
            bits[:, place(signal, k)] = bit
    return np.packbits(bits.reshape(n, length, 8)[:, :, ::-1], axis=2)[:, :, 0]


def place(signal: Any, k: int) -> int:
    """Where bit k (0: the least) of a signal is, counted from the least bit of byte 0."""
    if signal.byte_order == "little_endian":
        return int(signal.start) + k
    # Motorola: the start is the highest bit; downwards in a byte, then to the highest of the next
    position = 8 * (signal.start // 8) + 7 - signal.start % 8 + signal.length - 1 - k
    return int(8 * (position // 8) + 7 - position % 8)


def times(seconds: float, period: float, rng: np.random.Generator) -> Array:
    """When a message is sent: every period with 2 % of jitter."""
    n = int(seconds / period) - 1
    return (np.arange(n) + rng.uniform(0, 0.9) + rng.uniform(0, 0.02, n)) * period


def idle(message: Any, bus: int, seconds: float, rng: np.random.Generator) -> Stream:
    """A message that says nothing: constant bytes, of which the last counts in some."""
    t = times(seconds, 0.1, rng)
    data = np.tile(rng.integers(0, 256, message.length, dtype=np.uint8) & 0x5A, (len(t), 1))
    if message.length > 2 and rng.random() < 0.5:
        data[:, -1] = np.arange(len(t)) & 0x0F
    return Stream(bus, message.frame_id, message.is_extended_frame, t, data)


def write(path: Any, streams: Sequence[Stream], rng: np.random.Generator) -> None:
    """Write a candump log, without the frames that are lost."""
    lines: list[tuple[float, str]] = []
    for bus, id_, extended, t, data in streams:
        kept = rng.random(len(t)) >= LOST
        name = f"can{bus} {id_:08X}#" if extended else f"can{bus} {id_:03X}#"
        fd = data.shape[1] > 8
        if fd:
            name += "#1"
        text = data.tobytes().hex().upper()
        size = 2 * data.shape[1]
        lines += [
            (at, f"{name}{text[k * size : (k + 1) * size]}")
            for k, (at, keep) in enumerate(zip(t.tolist(), kept.tolist(), strict=True))
            if keep
        ]
    lines.sort()
    with open(path, "w", encoding="ascii") as file:
        file.writelines(f"({1_750_000_000 + at:.6f}) {rest}\n" for at, rest in lines)
