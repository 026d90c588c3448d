"""Attacks on files: any option of any verb names any file, by links and other spellings; what was there stays."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, NamedTuple

from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from canid.values.shipped_files import shipped

PROMISE = "no option overwrites a recording, a vehicle, a database or its own input; what is refused leaves nothing behind"
# commands in a round: they share a process, since imports take longer than they do
COMMANDS = 6
_MAKING = threading.Lock()

# Runs commands one after the other in a folder, says what each of them changed, and puts it back.
RUNNER = """
import contextlib, hashlib, io, json, os, sys
from canid.ui.cli import main

def held():
    out = {}
    for folder, _, names in os.walk("."):
        for name in names:
            path = os.path.normpath(os.path.join(folder, name))
            if os.path.islink(path):
                out[path] = ("link", os.readlink(path))
            else:
                with open(path, "rb") as file:
                    out[path] = ("file", file.read())
    return out

results = []
for words in json.load(open(sys.argv[1])):
    before = held()
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            code = main(words)
        except BaseException as error:
            code = f"{type(error).__name__}: {error}"
    after = held()
    # a journal without its log is gone on with: its lines stay
    goes_on = [
        path for path in before
        if path.endswith(".events.jsonl") and path in after and after[path][1].startswith(before[path][1])
    ]
    changed = [path for path in before if after.get(path) != before[path]]
    new = [path for path in after if path not in before]
    results.append([code, said.getvalue()[-600:], [path for path in changed if path not in goes_on], new])
    for path in [*new, *changed]:
        if os.path.lexists(path):
            os.unlink(path)
    for path in changed:
        kind, content = before[path]
        if kind == "link":
            os.symlink(content, path)
        else:
            with open(path, "wb") as file:
                file.write(content)
json.dump(results, open(sys.argv[2], "w"))
"""


@cache
def _made() -> Path:
    """A simulated drive with its truth, in a folder that lasts as long as this process."""
    folder = Path(mkdtemp(prefix="attack_logs"))
    import atexit

    atexit.register(shutil.rmtree, folder, True)
    words = ["simulate", str(folder / "simulated.blf"), "--minutes", "0.15", "--seed", "1"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-m", "canid", *words], check=True, capture_output=True, env=environment)
    return folder


def made() -> Path:
    """The folder of a simulated drive: simulated.blf and simulated.truth.json."""
    with _MAKING:
        return _made()


class Kept(NamedTuple):
    """A file that is worth keeping."""

    name: str
    kind: str  # "" of no option's kind
    content: bytes


def kept(rng: random.Random) -> list[Kept]:
    """One of each kind, under names of their kind and under misleading ones."""
    log = (made() / "simulated.blf").read_bytes()
    truth = (made() / "simulated.truth.json").read_bytes()
    vehicle = (shipped() / "generic.toml").read_bytes()
    dbc = (shipped() / "generic.dbc").read_bytes()
    state = b'{"canid_state": 1,\n"sha256": "' + b"0" * 64 + b'",\n"vehicle": "x"\n}\n'
    page = b"<!DOCTYPE html>\n<html><title>canid diagnosis</title>mine</html>\n"
    journal = b'{"t": 0.0, "utc": 1.0, "what": "bus_lost", "says": "lost"}\n'
    recording = b"LOGG" + rng.randbytes(3000)
    return [
        Kept("mine.blf", "", recording),
        Kept("simulated.blf", "simulated", log),
        Kept("simulated.truth.json", "truth", truth),
        Kept("generic.toml", "vehicle", vehicle),
        Kept("generic.dbc", "", dbc),
        Kept("drive.events.jsonl", "", journal),
        Kept("old.state", "state", state),
        Kept("old.html", "page", page),
        Kept("result.json", "json", b'{"log": "a.blf"}\n'),
        Kept("result.jsonl", "json", b'{"a": 1}\n{"a": 2}\n'),
        Kept("notes.json", "", b"not JSON at all\n"),
        Kept("recording.json", "", recording),
        Kept("vehicle.json", "vehicle", vehicle),
        Kept("dbc.html", "", dbc),
        Kept("log.html", "", recording),
        Kept("state.jsonl", "state", state),
        Kept("journal.json", "", journal),
        Kept("mine.series", "", b"some list\n"),
        Kept("can.conf", "", b"[default]\ninterface = virtual\n"),
        Kept("plain", "", recording),
        Kept("x.asc", "", b"date Mon Jan 1 00:00:00 2024\nbase hex timestamps absolute\n"),
        Kept("x.log", "", b"(1700000000.000000) can0 123#00\n"),
        Kept("t.samples.csv", "", b"t,my own table\n0,1\n"),
        Kept("binary.json", "", b"{" + rng.randbytes(200)),
    ]


class Option(NamedTuple):
    """An option that writes."""

    words: tuple[str, ...]
    kind: str  # what it may replace; "" nothing
    names: tuple[str, ...]  # fresh ones


J = Option(("--json",), "json", ("new.json", "new.jsonl", "new"))
STATE = Option(("--state",), "state", ("new.state", "state2.json"))
LOG_OUT = Option(("-o",), "", ("new.blf", "new.asc", "new.log", "drive.blf"))
VEHICLE_OUT = Option(("--force", "-o"), "vehicle", ("new.toml",))
PAGE_OUT = Option(("--report",), "page", ("new.html",))
SIMULATED_OUT = Option(("--force",), "simulated", ("new.blf", "new.asc", "new.log"))
TABLE_OUT = Option(("--force", "-o"), "table", ("new", "t", "simulated"))
VIRTUAL = ("-i", "virtual", "-c", "attack", "--duration", "0.2")
# verb, what it always needs, inputs, options that write
VERBS: tuple[tuple[str, tuple[str, ...], tuple[str, ...], tuple[Option, ...]], ...] = (
    ("live", (*VIRTUAL, "--vehicle", "VEHICLE"), (), (LOG_OUT._replace(words=("--record",)), STATE, J)),
    ("record", VIRTUAL, (), (LOG_OUT, J)),
    ("record", (*VIRTUAL, "--file-time", "1s"), (), (LOG_OUT, J)),
    ("replay", ("--vehicle", "VEHICLE", "--stop", "2"), ("LOG",), (J, STATE)),
    ("identify", ("--vehicle", "VEHICLE", "--stop", "2"), ("LOG",), (J,)),
    ("diagnose", ("--vehicle", "VEHICLE", "--stop", "2"), ("LOG",), (J, PAGE_OUT)),
    ("check", ("--vehicle", "VEHICLE"), ("LOG",), (J,)),
    ("export", ("--vehicle", "VEHICLE", "--stop", "2"), ("LOG",), (TABLE_OUT, J)),
    ("recover", (), ("LOG",), (LOG_OUT, J)),
    ("simulate", ("--minutes", "0.05"), (), (SIMULATED_OUT, J)),
    ("init", (), ("DBC",), (VEHICLE_OUT, J)),
)


class Command(NamedTuple):
    """A command, and what it may change."""

    words: list[str]
    may: set[str]  # files, by their real names
    twice: bool  # two options that write name one file, or one of them names an input


def drawn(rng: random.Random, folder: Path, files: list[Kept]) -> Command:
    """Draw one."""
    verb, words, inputs, options = rng.choice(VERBS)
    named = {"VEHICLE": "generic.toml", "LOG": "simulated.blf", "DBC": "generic.dbc"}
    read = {named[word] for word in (*words, *inputs) if word in named}
    # the vehicle names its database
    read |= {"generic.dbc"} if "generic.toml" in read else set()
    kinds = {each.name: each.kind for each in files}
    out = [verb, *(named.get(word, word) for word in (*words, *inputs))]
    written: list[str] = []
    may: set[str] = set()
    for option in options:
        if option is not options[0] and rng.random() < 0.4:
            continue
        name = _name(rng, files, option, written, read)
        path = _spelling(rng, folder, name)
        real = os.path.relpath(os.path.realpath(folder / path), os.path.realpath(folder))
        out += [*option.words, path]
        # a table's name is a beginning: NAME.samples.csv
        written.append(f"{real}.samples.csv" if option.kind == "table" else real)
        if option.kind and option.kind == kinds.get(real):
            may.add(real)
        if option.kind == "simulated" and kinds.get(real) == "simulated":
            may.add("simulated.truth.json")
    may -= read
    return Command(out, may, len(set(written)) < len(written) or bool(set(written) & read))


def _name(rng: random.Random, files: list[Kept], option: Option, written: list[str], read: set[str]) -> str:
    kind = rng.random()
    if kind < 0.5:
        return rng.choice(files).name
    if kind < 0.65 and written:
        return rng.choice(written)
    if kind < 0.8 and read:
        return rng.choice(sorted(read))
    return rng.choice(option.names)


def _spelling(rng: random.Random, folder: Path, name: str) -> str:
    """The same file by another name."""
    if name.startswith(".."):
        return name
    kind = rng.randrange(7)
    link = folder / f"link{len(list(folder.iterdir()))}{Path(name).suffix}"
    if kind == 0:
        return f"sub/../{name}"
    if kind == 1:
        return f"./././{name}"
    if kind == 2:
        return str(folder / name)
    if kind == 3 and not link.exists():
        link.symlink_to(name)
        return link.name
    if kind == 4 and (folder / name).is_file() and not link.exists():
        other = folder / f"link{len(list(folder.iterdir()))}.json"
        other.symlink_to(folder / name)
        return other.name
    if kind == 5:
        return f"up/{name}"  # a link to the folder itself
    return name


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Some commands, one after the other."""
    work = folder / "work"
    (work / "sub").mkdir(parents=True)
    files = kept(rng)
    for each in files:
        (work / each.name).write_bytes(each.content)
    (work / "up").symlink_to(".")
    commands = [drawn(rng, work, files) for _ in range(COMMANDS)]
    # a hard link is another name of the same file, that no path shows
    os.link(work / "mine.blf", work / "hard.json")
    os.link(work / "simulated.blf", work / "hard2.json")
    for verb in ("identify", "check"):
        if rng.random() < 0.5:
            name = rng.choice(("hard.json", "hard2.json"))
            commands.append(
                Command([verb, "simulated.blf", "--vehicle", "generic.toml", "--json", name], set(), False)
            )
    wrong = [
        text
        for command, ran in zip(commands, _run(folder, work, commands), strict=True)
        for text in _judge(command, *ran)
    ]
    yield Outcome(
        "random options × random files, links, spellings, in 10 verbs",
        math.nan,
        0,
        "; ".join(wrong),
        tried=len(commands),
    )


def _run(folder: Path, work: Path, commands: list[Command]) -> list[Any]:
    listed, results = folder / "commands.json", folder / "results.json"
    listed.write_text(json.dumps([command.words for command in commands]))
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", RUNNER, str(listed), str(results)],
        cwd=work,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    if not results.exists():
        raise RuntimeError(done.stderr[-500:])
    return list(json.loads(results.read_text()))


def _judge(command: Command, code: object, said: str, changed: list[str], new: list[str]) -> list[str]:
    spelled = " ".join(command.words)
    wrong = [f"`canid {spelled}` changed {path}" for path in changed if path not in command.may]
    if not isinstance(code, int) or code not in range(6) or "Traceback" in said:
        wrong.append(f"`canid {spelled}` ended with {code}: {said}")
    if code == 2 and new:
        wrong.append(f"`canid {spelled}` was refused and left {new}")
    if command.twice and code not in (2, 5):
        wrong.append(f"`canid {spelled}` names a file twice and ended with {code}")
    return wrong
