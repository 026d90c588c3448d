"""Attacks by formulas: .mf4 files whose conversions are texts that act where something evaluates them."""

from __future__ import annotations

import math
import os
import random
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.outcome import Outcome
from canid.values.shipped_files import shipped
from tests.fixtures.measured_process import canid
from tests.formats_oracle.mf4_conversions import (
    MEMBERS,
    SIGNALS,
    Conversion,
    bus_log,
    formula,
    measurement,
    write,
)

PROMISE = "no text of a log is evaluated: a formula is named, and what it would give is counted as not read"
FILES = 4  # in a round, each read by one verb
_PLACES = ("t", "DataBytes", *(name for name, *_ in MEMBERS))
# members that no frame needs: their formulas cost nothing
_UNUSED = {"CRC"}
_NAMED = "has a formula as its conversion; canid does not evaluate it"


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Logs and measurements with formulas at drawn places, read by drawn verbs."""
    wrong: list[str] = []
    for k in range(FILES):
        marker = folder / f"marker{k}"
        path = folder / f"x{k}.mf4"
        wrong += _of_log(path, marker, rng) if rng.random() < 0.6 else _of_measurement(path, marker, rng)
        # next to the file, and where canid is run
        if made := [name for name in (*os.listdir(folder), *os.listdir()) if name.startswith("marker")]:
            wrong.append(f"{path.name}: {', '.join(made)} was made")
    yield Outcome(
        "formulas of ids, times, members and signals, within tables: .mf4",
        math.nan,
        0,
        "; ".join(wrong),
        tried=FILES,
    )


def _of_log(path: Path, marker: Path, rng: random.Random) -> list[str]:
    """Bus logging with formulas on some channels, and harmless conversions on others."""
    places = rng.sample(_PLACES, rng.randint(1, 3))
    conversions = {place: formula(_text(marker, rng)) for place in places}
    for other in rng.sample([name for name in _PLACES if name not in places], 2):
        conversions[other] = Conversion(1, (0.0, 1.0))
    structure = rng.choice(("CAN_DataFrame", "CAN_DataFrame", "CAN_RemoteFrame"))
    write(path, bus_log(conversions, rng.randint(1, 400), structure))
    words: list[object] = {
        "look": ["look", path],
        "check": ["check", path],
        "identify": ["identify", path, "--vehicle", shipped() / "generic.toml"],
        "export": [
            "export",
            path,
            "--dbc",
            shipped() / "generic.dbc",
            "-o",
            path.with_suffix(".csv"),
            "--force",
        ],
    }[rng.choice(("look", "check", "identify", "export"))]
    ran = canid(*words, folder=path.parent)
    lost = bool(set(places) - _UNUSED) if structure == "CAN_DataFrame" else bool({"t", "ID"} & {*places})
    wrong = []
    if "Traceback" in ran.err or ran.code not in (0, 1, 2, 4):
        wrong.append(f"exit code {ran.code}: {ran.err[-300:]}")
    if lost and (ran.code != 4 or _NAMED not in ran.err + ran.out):
        wrong.append(f"exit code {ran.code}, and the formula is not named: {ran.err[-300:]}")
    return [f"{words[0]} of {structure} with formulas at {', '.join(places)}: {text}" for text in wrong]


def _of_measurement(path: Path, marker: Path, rng: random.Random) -> list[str]:
    """Signals with formulas, also within tables of texts."""
    n = rng.randint(20, 200)
    columns = {
        "t": [0.1 * k for k in range(n)],
        **{name: [20.0 + k % 7 for k in range(n)] for name in SIGNALS},
    }
    places = rng.sample(("t", *SIGNALS), rng.randint(1, 2))
    conversions = {}
    for place in places:
        evil = formula(_text(marker, rng))
        within = place != "t" and rng.random() < 0.4
        conversions[place] = Conversion(rng.choice((7, 8)), (1.0, 2.0), ("low", evil)) if within else evil
        if conversions[place].kind == 7:
            conversions[place] = Conversion(7, (1.0,), ("low", evil))
    write(path, measurement(columns, conversions))
    verb = rng.choice(("identify", "check"))
    ran = canid(verb, path, folder=path.parent)
    # the acceleration can be made of the speed
    codes = (0, 1, 2) if places == ["accel"] else (2,)
    if "Traceback" in ran.err or ran.code not in codes or _NAMED not in ran.err + ran.out:
        says = f"exit code {ran.code}: {ran.err[-300:]}"
        return [f"{verb} of signals with formulas at {', '.join(places)}: {says}"]
    return []


def _text(marker: Path, rng: random.Random) -> str:
    """A formula that makes a file where it is evaluated: for numexpr, for sympy, and one that is only wrong."""
    name = f"'{marker}'" if rng.random() < 0.7 else f"'{marker.name}'"
    return rng.choice(
        (
            f"(*(open({name}, 'w') for i in (1,)),)",
            f"X1 + 0 * (*(open({name}, 'w') for i in (1,)),)",
            f"open({name}, 'w')",
            f"__import__('os').open({name}, 65)",
            f"exec(\"open({name}, 'w')\")",
            "X1 ** X1 ** X1 ** 9",
            "(" * rng.randint(50, 5000) + "X1",
            f"X1 * {'9' * rng.randint(1, 3000)}",
            "".join(chr(rng.randrange(32, 0x2000)) for _ in range(rng.randint(1, 300))),
            "",
        )
    )
