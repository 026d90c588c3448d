"""Decimal lines of an .asc as arrays: the same as one by one, whatever stands in them."""

from __future__ import annotations

import random

import numpy as np

from canid.io.logs.asc import asc_decimal_words
from canid.io.logs.asc.asc_line import parse
from canid.io.logs.text_lines import Block, Line
from canid.values import timestamps
from canid.values.types import Flag

_OCTETS = b"0123456789 .,xRTdx=\t\x00\x0b\xa0af-_+LID"


def drawn_line(rng: random.Random) -> bytes:
    """A line of a frame, or something like it."""
    data = rng.randbytes(rng.randrange(9))
    extended = rng.random() < 0.3
    number = rng.randrange(1 << 29 if extended else 0x800)
    width = rng.choice((1, 3))
    cells = " ".join(f"{octet:>{width}}" for octet in data)
    tail = rng.choice(("", "", f"  Length = 240015 BitCount = 124 ID = {number}{'x' * extended}"))
    text = f"{rng.randrange(10**4)}.{rng.randrange(10**6):06} {rng.randrange(1, 5)}  {number}{'x' * extended:<9} "
    text += f"{rng.choice(('Rx', 'Tx'))}   d {len(data)} {cells}{tail}"
    octets = bytearray(text.encode())
    for _ in range(rng.choice((0, 0, 1, 2))):
        octets[rng.randrange(len(octets))] = rng.choice(_OCTETS)
    return bytes(octets)


def test_lines_are_those_of_the_definition(seed: int) -> None:
    """What is found is what `asc_line` parses; of lines without damage all is found."""
    rng = random.Random(seed)
    lines = [drawn_line(rng) for _ in range(3_000)]
    data = b"".join(line + b"\n" for line in lines)
    ends = np.cumsum([len(line) + 1 for line in lines])
    found = asc_decimal_words.read(Block(data, ends, 1))
    assert found.found.mean() > 0.5
    for k in np.flatnonzero(found.found).tolist():
        words = lines[k].decode("latin-1").split()
        parsed = parse(words, 10, Line("", 1, True))
        assert parsed is not None, lines[k]
        length = int(found.length[k])
        got = (
            int(found.ns[k]), int(found.bus[k]), int(found.id[k]), found.data[k, :length].tobytes(), int(found.flags[k]),
        )  # fmt: skip
        said = (timestamps.from_text(words[0]), parsed.bus, parsed.id, parsed.data, parsed.flags)
        assert got == said, lines[k]


def test_a_usual_line_is_found() -> None:
    line = b"   1.000000 5  258             Tx   d 8  32   0   0   0   0  20   0 128"
    line += b"  Length = 225972 BitCount = 117 ID = 258\r\n"
    found = asc_decimal_words.read(Block(line * 3, np.arange(1, 4) * len(line), 1))
    assert found.found.all()
    assert found.flags.tolist() == [int(Flag.TX)] * 3
    assert found.data[0].tolist() == [32, 0, 0, 0, 0, 20, 0, 128]
