"""Attacks by names: escapes in the names of vehicles, signals, units, messages, nodes, files and folders."""

from __future__ import annotations

import json
import math
import os
import pty
import random
import re
import shutil
import subprocess
import sys
import threading
import unicodedata
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from benchmarks.reliability.attack.overwriting import made
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from canid.values.shipped_files import shipped

PROMISE = "names are data: no control character of a name reaches a terminal or a pipe, JSON stays intact"
COMMANDS = 2  # in a round
TOKEN = "pwn7731"
# what a terminal would act on; each name has one of them before the token
CONTROLS = (
    *(
        "\x1b[2J",
        "\x1b]0;",
        "\x1b[31m",
        "\x1b]8;;http://x\x1b\\",
        "\x1bP1$r",
        "\x1b",
        "\x9b2J",
        "\x90",
        "\x07",
    ),
    *(
        "\x08\x08\x08",
        "\x0e",
        "\x7f",
        "\x00",
        "\r",
        "\n",
        "\x0b",
        "\x0c",
        "\x85",
        "\u2028",
        "\u2029",
        "\u202e",
    ),
    *("\u200b", "\u2066", "\ufeff", "\ue000", "\U000e0041", "\x1b[6n", "\x1b[?1049h"),
)
FORBIDDEN = ("Cc", "Cf", "Cs", "Co", "Zl", "Zp", "Cn")


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Some verbs on a vehicle, a database and a log whose names hold escapes."""
    wrong: list[str] = []
    for k in range(COMMANDS):
        control = rng.choice(CONTROLS)
        here = folder / str(k)
        here.mkdir()
        words, raw = _planted(here, control, rng)
        where = rng.choice(("pipe", "pipe", "terminal"))
        code, out, err = (_on_terminal if where == "terminal" else _on_pipes)(words, here)
        said = f"canid {words[0]}, {control!r}, {where}"
        if "Traceback" in out + err or code not in range(6):
            wrong.append(f"{said}: exit code {code}: {err[-300:]!r}")
        wrong += [
            f"{said}: {text!r}"
            for text in _acted(out, where == "terminal") + _acted(err, where == "terminal")
        ]
        for path in here.glob("*.json"):
            wrong += [f"{said}: {text}" for text in _json(path, raw)]
    yield Outcome(
        "escapes in names of vehicle, role, section, signal, unit, message, node, file, folder; to pipes and a terminal",
        math.nan,
        0,
        "; ".join(wrong),
        tried=COMMANDS,
    )


def _planted(here: Path, control: str, rng: random.Random) -> tuple[list[str], str]:
    """The words of a command on files with such names, and the name as it is."""
    evil = f"{control}{TOKEN}"
    quoted = json.dumps(evil)  # TOML's basic strings take JSON's escapes, but for surrogates
    if len(control) == 1 and ord(control) > 0xFFFF:
        quoted = f'"\\U{ord(control):08x}{TOKEN}"'
    vehicle = (shipped() / "generic.toml").read_text()
    dbc = (shipped() / "generic.dbc").read_text()
    place = rng.randrange(9)
    # a DBC has no escapes: what its grammar takes it holds as it is
    inside = evil.replace("\n", " ").replace("\r", " ").replace("\x00", " ").replace('"', "'")
    if place in (0, 8):
        vehicle = re.sub(r'^name = ".*"', lambda _: f"name = {quoted}", vehicle, count=1, flags=re.M)
    if place == 1:
        vehicle = vehicle.replace("[driver]", f"{quoted} = 1\n[driver]")
    elif place == 2:
        vehicle += f"\n[{quoted}]\nx = 1\n"
    elif place == 3:
        vehicle = vehicle.replace('"ENGINE_DATA.PedalPosition"', quoted)
    elif place == 4:
        dbc = dbc.replace('"km/h"', f'"{inside}"')
    elif place == 5:
        dbc = dbc.replace("PedalPosition", f"Pedal{inside}")
    elif place == 6:
        dbc = dbc.replace("bumper to bumper", inside).replace("RADAR", f"R{inside}")
    elif place == 7:
        vehicle = vehicle.replace(
            '"generic.dbc"', json.dumps(f"no {evil}.dbc") if len(control) < 2 else quoted
        )
    # a file's name: bytes that are no text too
    name = evil.replace("\x00", "\x01").replace("/", "_") if rng.random() < 0.5 else "plain"
    stem = name.encode("utf-8", "surrogatepass") + (b"\xff\xfe" if rng.random() < 0.2 else b"")
    log, car = os.fsdecode(stem + b".blf"), os.fsdecode(stem + b".toml")
    shutil.copy(made() / "simulated.blf", here / log)
    (here / car).write_text(vehicle, encoding="utf-8", newline="")
    (here / "generic.dbc").write_text(dbc, encoding="utf-8", newline="")
    json_name = "out.json"
    commands = (
        ["check", log, "--vehicle", car, "--json", json_name],
        ["check", "--vehicle", car],
        ["identify", log, "--vehicle", car, "--stop", "3", "--json", json_name],
        ["identify", f"no {log}", "--vehicle", car],
        ["diagnose", log, "--vehicle", car, "--stop", "3", "--json", json_name],
        ["replay", log, "--vehicle", car, "--stop", "3", "--json", json_name],
        ["replay", log, "--vehicle", car, "--stop", "3"],
        ["export", log, "--vehicle", car, "-o", os.fsdecode(stem + b"table"), "--stop", "3"],
        ["recover", log, "-o", os.fsdecode(stem + b"copy.blf"), "--json", json_name],
        ["init", "generic.dbc", "--json", json_name],
        ["init", "generic.dbc", "-o", os.fsdecode(stem + b"new.toml")],
        ["record", "-i", "virtual", "-c", f"x{TOKEN}", "-o", log, "--duration", "0.2", "--json", json_name],
        ["live", "-i", "virtual", "-c", name.replace("\x00", "x"), "--vehicle", car, "--duration", "0.5"],
        ["record", "-i", name or "x", "-c", "x", "-o", log, "--duration", "0.2"],
        [name or "x"],
        ["record", f"--{name}"],
        ["simulate", log, "--minutes", "0.02"],
    )
    return list(rng.choice(commands)), evil


def _on_pipes(words: list[str], here: Path) -> tuple[int, str, str]:
    done = subprocess.run(
        [sys.executable, "-m", "canid", *words],
        cwd=here,
        env=_environment(),
        capture_output=True,
        timeout=300,
        check=False,
    )
    return done.returncode, *(part.decode("utf-8", "surrogateescape") for part in (done.stdout, done.stderr))


def _on_terminal(words: list[str], here: Path) -> tuple[int, str, str]:
    master, slave = pty.openpty()
    shown: list[bytes] = []

    def read() -> None:
        with suppress(OSError):
            while data := os.read(master, 65536):
                shown.append(data)

    process = subprocess.Popen(
        [sys.executable, "-m", "canid", *words],
        cwd=here,
        env=_environment() | {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "40"},
        stdin=subprocess.DEVNULL,
        stdout=slave,
        stderr=slave,
        start_new_session=True,
    )
    os.close(slave)
    reading = threading.Thread(target=read, daemon=True)
    reading.start()
    code = process.wait(300.0)
    reading.join(10.0)
    os.close(master)
    return code, b"".join(shown).decode("utf-8", "surrogateescape"), ""


def _environment() -> dict[str, str]:
    clean = {key: value for key, value in os.environ.items() if not key.startswith("CAN_")}
    return clean | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}


def _acted(text: str, terminal: bool) -> list[str]:
    """Where a terminal would act on a name."""
    if not terminal:
        return [text[max(k - 30, 0) : k + 30] for k, c in enumerate(text) if _control(c) and c != "\n"][:2]
    # canid's own colors and cursor movements are sequences before a name too, but end with a letter
    own = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\x1b", text)
    bad = [own[max(k - 30, 0) : k + 30] for k, c in enumerate(own) if _control(c) and c not in "\n\r\x1b"]
    evil = [control for control in CONTROLS if len(control) > 1 and f"{control}{TOKEN}" in text]
    near = [
        m[0] for m in re.finditer(rf".{{0,20}}[\x00-\x09\x0b\x0c\x0e-\x1a\x1c-\x1f\x7f-\x9f]{TOKEN}", text)
    ]
    return (bad + [repr(each) for each in evil if not re.fullmatch(r"\x1b\[[0-9;]*m", each)] + near)[:2]


def _control(character: str) -> bool:
    return unicodedata.category(character) in FORBIDDEN


def _json(path: Path, raw: str) -> list[str]:
    """What is wrong with the JSON: it must parse, and hold names as they are."""
    wrong = []
    text = path.read_text(encoding="utf-8", errors="surrogateescape")
    for line in text.splitlines() if text.startswith("{") else ():
        try:
            value = json.loads(line)
        except ValueError:
            try:
                value = json.loads(text)
            except ValueError as error:
                return [f"its JSON does not parse: {error}"]
        names = [each for each in _strings(value) if TOKEN in each]
        # a sentence for the user may have it escaped; a name alone must be the name
        wrong += [
            f"JSON holds {each!r}"
            for each in names
            if each.endswith(TOKEN) and len(each) < len(TOKEN) + 12 and "\\x" in each and "\\x" not in raw
        ]
    return wrong[:1]


def _strings(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, of in value.items():
            yield str(key)
            yield from _strings(of)
    elif isinstance(value, list):
        for of in value:
            yield from _strings(of)
