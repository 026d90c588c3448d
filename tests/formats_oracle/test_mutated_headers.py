"""Whatever the first lines of a log of any program say, it is read, or refused in a sentence."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.values.bus_names import MAX_BUSES
from canid.values.errors import CanidError
from tests.formats_oracle.generators import GENERATORS

MUTANTS = 60
# what a cell becomes; +27:59 is an offset of more than a day
CELLS = (b"", b"x", b"id", b"time", b"T", b"9" * 40, b'"', b"\xff", b"+27:59")


def mutated(content: bytes, rng: random.Random) -> bytes:
    """A few cells, lines or bytes at the beginning are lost or other ones."""
    lines = content.split(b"\n")
    for _ in range(rng.randint(1, 4)):
        what, k = rng.random(), rng.randrange(min(6, len(lines)))
        cells = lines[k].split(b",")
        if what < 0.4 and len(cells) > 1:
            j = rng.randrange(len(cells))
            cells[j : j + 1] = [] if rng.random() < 0.5 else [rng.choice(CELLS)]
            lines[k] = b",".join(cells)
        elif what < 0.6 and len(lines) > 1:
            del lines[k]
        else:
            octets = bytearray(b"\n".join(lines))
            if octets:
                octets[rng.randrange(min(400, len(octets)))] = rng.randrange(256)
            lines = bytes(octets).split(b"\n")
    return b"\n".join(lines)


@pytest.mark.parametrize("name", [name for name in GENERATORS if name != "blf"])
def test_first_lines_of_any_kind(name: str, tmp_path: Path, seed: int) -> None:
    """Columns, words and bytes that are lost or wrong raise nothing but canid's own errors."""
    for k in range(MUTANTS):
        rng = random.Random(f"{seed} {k}")
        written = GENERATORS[name](rng)
        path = tmp_path / f"drawn{written.suffix}"
        path.write_bytes(mutated(written.content, rng))
        with contextlib.suppress(CanidError):
            list(open_log(path))


@pytest.mark.slow("whole logs")
def test_more_networks_than_there_are_buses(tmp_path: Path) -> None:
    """70,000 networks in a list: as many as there are numbers are buses, lines of others are damaged."""
    path = tmp_path / "x.csv"
    header = "Line,Abs Time(Sec),Rel Time (Sec),Tx,Er,Description,ArbID,Remote,Xtd,Network,Node,B1,B2\n"
    lines = [f"{k},{0.001 * k:.6f},0.001,F,F,x,123,F,F,net{k}x,,11,22\n" for k in range(70_000)]
    path.write_text(header + "".join(lines))
    log = open_log(path)
    assert sum(len(chunk.t) for chunk in log.columns()) == MAX_BUSES
    assert log.damaged == 70_000 - MAX_BUSES
