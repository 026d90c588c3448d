"""Attacks by configuration: vehicle files, databases and saved states that are bombs."""

from __future__ import annotations

import json
import math
import random
import threading
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.reliability.attack.overwriting import made
from benchmarks.reliability.outcome import Outcome
from canid.models.saving.checksum import Refused, seal, unseal
from canid.values.shipped_files import shipped
from tests.fixtures.measured_process import canid
from tests.fixtures.vehicle_files import (
    DBC_HEAD,
    DBC_SIGNAL,
    MAX_CPU_S,
    MAX_MEMORY_BYTES,
    TOML,
    write_vehicle,
)

PROMISE = (
    "a hostile vehicle file, database or state: one line and exit 2, or an event; 5 s and 300 MB at most"
)
_SAVING = threading.Lock()
SECTIONS = {
    "lead": ("in_path", "gap_noise", "range_rate_noise", "rate_sign", "tracks"),
    "driver": ("headway_desired", "output", "task"),
    "armax": ("na", "nb", "nc", "nk", "start", "forgetting"),
    "fopdt": ("window", "refit", "tau_max", "dead_time_max"),
    "x": ("y",),
}


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One bomb of a vehicle file or database, and one absurd state now and then."""
    kind, toml, dbc = _drawn(rng)
    path = write_vehicle(folder, toml, dbc)
    verb = (
        rng.choice(("check", "check", "init", "identify"))
        if dbc is not None
        else rng.choice(("check", "live"))
    )
    words: list[Any] = {
        "check": ["check", "--vehicle", path],
        "init": ["init", folder / "car.dbc", "-o", folder / "new.toml"],
        "identify": ["identify", made() / "simulated.blf", "--vehicle", path, "--stop", "2"],
        "live": ["live", "-i", "virtual", "-c", "x", "--duration", "0.3", "--vehicle", path],
    }[verb]
    ran = canid(*words, folder=folder)
    wrong = []
    # some of what is drawn is merely strange, and read
    if ran.code not in (0, 1, 2) or "Traceback" in ran.err:
        wrong.append(f"exit code {ran.code}: {ran.err[-300:]}")
    # a line per mistake; which mode the bus has been set to is none
    lines = [line for line in ran.err.splitlines() if "listen-only" not in line]
    if ran.code == 2 and (len(lines) > 6 or max(map(len, lines), default=0) > 700):
        wrong.append(f"{len(lines)} lines, {len(ran.err)} characters: {ran.err[:200]}")
    if ran.cpu > MAX_CPU_S or ran.memory > MAX_MEMORY_BYTES:
        wrong.append(f"{ran.cpu:.1f} s of processor time, {ran.memory / 1e6:.0f} MB")
    about = f" ({verb}, {kind})" if wrong else ""
    yield Outcome(
        "TOML and DBC: nesting, huge numbers, sizes, ranges, random values",
        ran.cpu,
        0,
        "; ".join(wrong) + about,
        measure="processor time at most",
    )
    if rng.random() < 0.5:
        yield from _state(folder, rng)


def _drawn(rng: random.Random) -> tuple[str, bytes, bytes | None]:
    """A kind, a vehicle file and a database; None: the generic one."""
    n = round(10 ** rng.uniform(2.0, 5.3))
    opening, closing = rng.choice((("[", "]"), ("{a=", "}"), ("[{a=", "}]")))
    digits = rng.choice("123456789") * rng.randrange(300, 9000)
    section = rng.choice(list(SECTIONS))
    key = rng.choice(SECTIONS[section])
    value = rng.choice(
        ("inf", "-inf", "nan", "1e308", "-1e-308", "0", "-1", digits, "true", "[]", "{}", '""', "1979-05-27")
    )
    tomls = {
        f"{n} nested {opening}": f"a = {opening * n}{closing * n}",
        f"a dotted key of {n} parts": ".".join("a" * n) + " = 1",
        f"{n} keys": "".join(f"k{k}=1\n" for k in range(n)),
        f"{n} roles": TOML + "".join(f'role{k} = "A.B"\n' for k in range(n)),
        f"{len(digits)} digits": TOML.replace('"Car"', digits),
        f"{section}.{key} = {value[:20]}": TOML + f"[{section}]\n{key} = {value}\n",
        f"accel.scale = {value[:20]}": TOML
        + f'accel = {{ signal = "EGO_SPEED.LongAccel", scale = {value} }}',
        f"{n} databases": TOML.replace('"car.dbc"', ",".join(['"car.dbc"'] * n)),
        f"tracks up to {n}": TOML + f'[lead]\ntracks = "T_{{0..{n * n}}}"\ndistance = "D"\nrate = "R"\n',
        "random bytes": rng.randbytes(n),
        "random text": "".join(chr(rng.randrange(32, 0x3000)) for _ in range(min(n, 20000))),
        f"bits of the generic one, {n}": _flipped((shipped() / "generic.toml").read_bytes(), rng),
    }
    head, one = DBC_HEAD, DBC_SIGNAL
    signals = "".join(
        f"BO_ {2**31 + k} M{k}: 8 X\n"
        + "".join(f' SG_ S{s} : {8 * s}|8@1+ (1,0) [0|0] "" X\n' for s in range(8))
        for k in range(n // 2)
    )
    dbcs = {
        f"{8 * (n // 2)} signals": head + signals,
        f"a signal of {n}00000 bits": head + "BO_ 1 M: 8 X\n" + one.replace("0|8", f"0|{n}00000"),
        f"a message of {n}0000 bytes": head + f"BO_ 1 M: {n}0000 X\n" + one,
        f"a factor of {len(digits)} digits": head + "BO_ 1 M: 8 X\n" + one.replace("(1,0)", f"({digits},0)"),
        f"{n} senders": head
        + "BO_ 1 M: 8 X\n"
        + one
        + "BO_TX_BU_ 1 : "
        + ",".join(f"N{k}" for k in range(n))
        + ";\n",
        f"{n} pages": head
        + 'BO_ 1 M: 8 X\n SG_ MX M : 0|16@1+ (1,0) [0|0] "" X\n'
        + "".join(f' SG_ S{k} m{k} : 16|8@1+ (1,0) [0|0] "" X\n' for k in range(n)),
        f"a range of {n}0000 pages": head
        + 'BO_ 1 M: 8 X\n SG_ S0 M : 0|32@1+ (1,0) [0|0] "" X\n SG_ S1 m0 : 32|8@1+ (1,0) [0|0] "" X\n\n'
        + f"SG_MUL_VAL_ 1 S1 S0 0-{n}0000;\n",
        f"{n} messages of one name": head + ("BO_ 1 M: 8 X\n" + one) * n,
        f"{n} words": head + rng.choice(("a ", ";", '"', "( ", "SG_ ")) * n * 3,
        "random bytes": rng.randbytes(n * 5),
        f"bits of the generic one, {n}": _flipped((shipped() / "generic.dbc").read_bytes(), rng),
    }
    if rng.random() < 0.5:
        kind = rng.choice(list(tomls))
        text = tomls[kind]
        return kind, text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"), None
    kind = rng.choice(list(dbcs))
    text = dbcs[kind]
    return kind, TOML.encode(), text if isinstance(text, bytes) else text.encode()


def _flipped(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.randrange(1, 6)):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


@cache
def _saved() -> tuple[bytes, float]:
    """A sound state of the simulated drive, and the s of processor time that a replay takes which goes on from it."""
    with TemporaryDirectory() as name:
        path, log = Path(name) / "own.state", made() / "simulated.blf"
        words = ("replay", log, "--vehicle", "generic", "--state", path)
        canid(*words, folder=Path(name))
        saved = path.read_bytes()
        return saved, canid(*words, folder=Path(name)).cpu


def _state(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """A state that canid has saved, changed in one place and sealed again; then a replay that goes on from it."""
    path = folder / "own.state"
    log = made() / "simulated.blf"
    with _SAVING:
        saved, usual = _saved()
    plain = unseal(saved)
    if isinstance(plain, Refused):
        raise RuntimeError(f"canid's own state: {plain.says}")
    what = _spoiled(plain, rng)
    try:
        path.write_bytes(seal(plain))
    except ValueError:  # JSON has no such number
        return
    ran = canid(
        "replay", log, "--vehicle", "generic", "--state", path, "--json", folder / "o.json", folder=folder
    )
    wrong = []
    if ran.code not in (0, 2) or "Traceback" in ran.err:
        wrong.append(f"exit code {ran.code}: {ran.err[-300:]}")
    if ran.cpu > MAX_CPU_S + usual or ran.memory > MAX_MEMORY_BYTES:
        wrong.append(
            f"{ran.cpu:.1f} s of processor time ({usual:.1f} s with a sound one), {ran.memory / 1e6:.0f} MB"
        )
    for line in (folder / "o.json").read_text().splitlines() if (folder / "o.json").exists() else ():
        if not _finite(json.loads(line)):
            wrong.append(f"an estimate that is no number: {line[:200]}")
            break
    about = f" ({what})" if wrong else ""
    yield Outcome(
        "a correctly sealed state with absurd content",
        max(ran.cpu - usual, 0.0),
        0,
        "; ".join(wrong) + about,
        measure="processor time beyond that of a sound state at most",
    )


def _spoiled(plain: Any, rng: random.Random) -> str:
    """Change one thing of a tree in place; returns what."""
    absurd = (0, -1, 1e300, -1e300, 1e-300, "nan", "inf", "-inf", 10**30, None, "", [], {}, True, [[[]]])
    for _ in range(200):
        at, name = plain, []
        while isinstance(at, dict | list) and at:
            key = rng.choice(list(at)) if isinstance(at, dict) else rng.randrange(len(at))
            name.append(str(key))
            below = at[key]
            if not isinstance(below, dict | list) or not below or rng.random() < 0.15:
                value = rng.choice(absurd)
                at[key] = value
                return f"{'.'.join(name)} = {value!r}"
            at = below
    return "nothing"


def _finite(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, dict):
        return all(map(_finite, value.values()))
    return all(map(_finite, value)) if isinstance(value, list) else True
