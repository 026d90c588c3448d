"""How far a new user gets without an edit: `canid init --yes`, `check` and `identify` on a drive of known truth.

    python -m benchmarks own_car [--dbc FOLDER] [--only NAME ...] [--keep FOLDER] [--fits] [--seed N]

Every vehicle DBC of the folder of which pedal and speed are known (tables of `benchmarks/init`) carries five simulated
minutes; the lead is its own, or that of a radar on a second bus, in turn. A car ends as right (K of range rate may be
quoted and its interval touches the true one within 5 %), wrong (it may be quoted, and does not), or open; open is also a
K whose pedal is marked as of unconfirmed scale, where the limits of the scale hold the true one. `--seed` draws other
drives, raw scales and radars.
"""

from __future__ import annotations

import argparse
import fnmatch
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import cantools
import numpy as np

import canid
from benchmarks.init.__main__ import DEFAULT, HALVES
from benchmarks.init.__main__ import HERE as TRUTHS
from benchmarks.own_car import frames, radars
from benchmarks.own_car.drive import RANGE_RATE_K, STEP_S, Array, Drive, drive
from canid.mathematics.identification.identifiability import quotable

SECONDS = 300.0
# share by which K may miss: quantisation, tyres
TOLERANCE = 0.05
# steps of a pedal that is measured; share of its bits that raw numbers fill
FEWEST_STEPS, RAW_SHARE = 50, 0.98
# m/s: what a speed signal must hold
FASTEST = 40.0
# messages of a DBC that say nothing
IDLE_MESSAGES = 15
_SPEEDS = {"km/h": 3.6, "kph": 3.6, "kmh": 3.6, "mph": 2.23694, "m/s": 1.0}
_WHEEL = re.compile(
    r"(whl|wheel).*(spd|speed)|(spd|speed).*(whl|wheel)|wheel_?(fl|fr|rl|rr|lf|rf|lr)", re.IGNORECASE
)


class Outcome(NamedTuple):
    """One car."""

    brand: str
    file: str
    radar: str
    result: str  # right, wrong, open
    says: str


def columns_of(
    signals: Any, roles: Mapping[str, list[str]], message: str, t: Array, of: Drive
) -> dict[str, Array]:
    """The physical values of a message's signals at its times, by the roles that they are."""
    at = np.minimum((t / STEP_S).astype(int), len(of.t) - 1)
    late = np.maximum(at - round(of.latency / STEP_S), 0)
    out: dict[str, Array] = {}
    for signal in signals:
        name = f"{message}.{signal.name}"
        role = next(
            (r for r, patterns in roles.items() if any(fnmatch.fnmatchcase(name, p) for p in patterns)), ""
        )
        unit = (signal.unit or "").lower().replace(" ", "")
        if role == "pedal":
            top = signal.maximum if signal.maximum else 0.0
            if top < FEWEST_STEPS * float(signal.scale):
                # a range that nobody measured: the raw numbers of the sensor fill its bits, but for a few
                top = float(signal.scale) * round(RAW_SHARE * ((1 << signal.length) - 1))
            out[signal.name] = of.pedal[at] * (
                (100.0 if "%" in unit or "perc" in unit or 90 < top <= 127 else top) / 100.0
            )
        elif role == "speed" or (not role and _WHEEL.search(name) and signal.length >= 10):
            # of a signal without a unit: km/h, unless its bits hold no such speed
            held = float(signal.scale) * (1 << signal.length) + float(signal.offset)
            silent = 2.23694 if "meil" in unit else 3.6 if held > 3.6 * FASTEST else 1.0
            factor = next((f for u, f in _SPEEDS.items() if u in unit), silent)
            if "meterpersec" in unit:
                factor = 1.0
            out[signal.name] = of.speed[at] * factor
        elif role == "gap":
            out[signal.name] = of.gap[late]
        elif role == "range_rate":
            out[signal.name] = of.range_rate[late] * (3.6 if "k" in unit else 1.0)
        elif not role and unit in ("rpm", "1/min", "u/min"):
            out[signal.name] = of.rpm[at]
        elif role == "brake":
            out[signal.name] = of.brake[at]
    return out


def _with_flag(found: re.Match[str]) -> str:
    """The id of a message; one of 29 bits has the flag of those, which some files leave out."""
    id_ = int(found[1])
    return f"BO_ {id_ | (1 << 31) if 0x7FF < id_ < 1 << 29 else id_}"


def encode(path: Path, truth: Mapping[str, Any], radar: str, folder: Path, seed: int) -> list[str]:
    """Write the log of a drive in this DBC; returns the DBC files of the car.

    Raises:
        ValueError: the DBC has no pedal or speed that can be encoded.
    """
    rng = np.random.default_rng(seed)
    of = drive(SECONDS, seed)
    text = path.read_text(encoding="cp1252", errors="replace")
    # of the frames only messages and signals say something, and some files have malformed comments and tables
    plain = "".join(
        line + "\n" for line in text.splitlines() if re.match(r"\s*(VERSION|BU_|BO_|SG_)\b", line)
    )
    plain = re.sub(r"^BO_ (\d+)", _with_flag, plain, flags=re.MULTILINE)
    database = cantools.database.load_string(plain, "dbc", strict=False)
    roles = {role: truth.get(role, []) for role in ("pedal", "speed", "brake")}
    if not radar:
        roles |= {role: truth[role] for role in ("gap", "range_rate")}
    found: set[str] = set()
    made, rest, taken = [], [], set()
    for message in database.messages:
        if (
            message.length == 0
            or message.length > 64
            or message.is_multiplexed()
            or message.frame_id in taken
        ):
            continue
        taken.add(message.frame_id)
        t = frames.times(SECONDS, 0.05 if any("gap" in r for r in roles) and not radar else 0.04, rng)
        values = columns_of(message.signals, roles, message.name, t, of)
        if not values:
            rest.append(message)
            continue
        for role, patterns in roles.items():
            named = (f"{message.name}.{name}" for name in values)
            if any(fnmatch.fnmatchcase(name, pattern) for name in named for pattern in patterns):
                found.add(role)
        data = frames.pack(message.signals, values, message.length, len(t))
        made.append(frames.Stream(0, message.frame_id, message.is_extended_frame, t, data))
    if not {"pedal", "speed"} <= found:
        raise ValueError(f"only {', '.join(sorted(found)) or 'nothing'} can be encoded")
    some = rng.permutation(len(rest))[:IDLE_MESSAGES].tolist()
    made += [frames.idle(rest[k], 0, SECONDS, rng) for k in some]
    names = [path.name]
    (folder / path.name).write_bytes(path.read_bytes())
    if radar:
        family = radars.FAMILIES[radar]()
        (folder / "radar.dbc").write_text(family.dbc)
        made += radars.streams(family, of, 1, seed)
        names.append("radar.dbc")
    frames.write(folder / "drive.log", made, rng)
    return names


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """One command of canid."""
    return subprocess.run(
        [sys.executable, "-m", "canid", *words], cwd=folder, capture_output=True, text=True, check=False
    )


def judge(folder: Path, names: list[str], identifying: bool) -> tuple[str, str]:
    """What init, check and identify come to."""
    proposed = run(folder, "init", *names, "--log", "drive.log", "--yes", "-o", "car.toml", "--force")
    checked = run(folder, "check", "drive.log", "--vehicle", "car.toml")
    if checked.returncode not in (0, 1):
        return "open", "; ".join(
            line for line in proposed.stderr.splitlines() if "open" in line or "fill" in line
        )
    wrong = [line.strip() for line in checked.stdout.splitlines() if "✗" in line]
    refused = f"; check: {' '.join(wrong)[:160]}" if checked.returncode else ""
    if not identifying:
        return ("open", refused[2:]) if refused else ("fits", "")
    trace = canid.read_trace(folder / "drive.log", folder / "car.toml")
    found = canid.identify(trace, select_orders=False, sliding=False)
    channel = found.channels.get("range_rate")
    if channel is None or not quotable(channel, "K"):
        return "open", f"nothing may be quoted{refused}"
    value, low, high = channel.K
    says = f"K {value:.2f} [{low:.2f}, {high:.2f}]{refused}"
    right = low <= RANGE_RATE_K * (1 + TOLERANCE) and high >= RANGE_RATE_K * (1 - TOLERANCE)
    scale = found.output_scale
    if right or scale is None or scale.confirmed:
        return ("right" if right else "wrong"), says
    least, most = low * 100.0 / scale.high, high * 100.0 / scale.low
    held = least <= RANGE_RATE_K * (1 + TOLERANCE) and most >= RANGE_RATE_K * (1 - TOLERANCE)
    return ("open" if held else "wrong"), f"{says}; scale not confirmed: {least:.1f} to {most:.1f}"


def outcomes(
    dbc: Path, only: list[str], keep: Path | None, identifying: bool = True, seed: int = 0
) -> Iterator[Outcome]:
    """Every car of the folder."""
    families = list(radars.FAMILIES)
    turn = seed
    for half in HALVES.values():
        for file, truth in tomllib.loads((TRUTHS / half).read_text(encoding="utf-8")).items():
            if not (dbc / file).is_file() or not truth.get("pedal") or not truth.get("speed"):
                continue
            own = bool(truth.get("gap") and truth.get("range_rate"))
            radar = "" if own else families[turn % len(families)]
            turn += not own
            if only and not any(part in file for part in only):
                continue
            with tempfile.TemporaryDirectory() as made:
                folder = Path(made) if keep is None else keep / Path(file).stem
                folder.mkdir(parents=True, exist_ok=True)
                try:
                    names = encode(dbc / file, truth, radar, folder, sum(file.encode()) + 10_000 * seed)
                except (ValueError, cantools.Error) as error:
                    yield Outcome(truth["brand"], file, radar, "left out", str(error))
                    continue
                yield Outcome(truth["brand"], file, radar or "own", *judge(folder, names, identifying))


def main() -> None:
    """Print a line for each car, and the shares."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks own_car", description=__doc__)
    parser.add_argument("--dbc", type=Path, default=DEFAULT, metavar="FOLDER")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write logs and vehicle files here")
    parser.add_argument("--fits", action="store_true", help="init and check alone: a minute instead of ten")
    parser.add_argument("--seed", type=int, default=0, help="other drives, and each car with another radar")
    args = parser.parse_args()
    all_ = []
    for one in outcomes(args.dbc, args.only, args.keep, not args.fits, args.seed):
        print(f"{one.brand:9} {one.file:36} {one.radar:11} {one.result:8} {one.says}", flush=True)
        all_.append(one)
    cars = [one for one in all_ if one.result != "left out"]
    for result in ("right", "wrong", "open", "fits"):
        n = sum(one.result == result for one in cars)
        print(f"{result}: {n} of {len(cars)} ({100 * n / max(len(cars), 1):.0f} %)")


if __name__ == "__main__":
    main()
