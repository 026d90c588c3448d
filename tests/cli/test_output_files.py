"""No option of any verb overwrites a recording, a vehicle, a database, its own input, or another option's file."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.io.logs import open_log, write_log
from canid.io.logs.formats import read_suffixes
from canid.ui.cli.output import output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.values.errors import CHECK_FAILED, DONE, NO_BUS, NOT_WRITTEN, USAGE, ConfigError, OutputError
from canid.values.shipped_files import shipped

ROOT = Path(__file__).parents[2]
PART = ("--vehicle", "generic", "--stop", 3)
VIRTUAL = ("-i", "virtual", "-c", "outputs", "--duration", 0.2)
# (name of a verb's option that writes -> the words around it); {} is the file
WRITERS: dict[str, tuple[object, ...]] = {
    "identify --json": ("identify", "LOG", *PART, "--json"),
    "identify --report": ("identify", "LOG", *PART, "--report"),
    "check --report": ("check", "LOG", "--vehicle", "generic", "--report"),
    "replay --report": ("replay", "LOG", *PART, "--report"),
    "identify --plot": ("identify", "LOG", *PART, "--plot"),
    "diagnose --json": ("diagnose", "LOG", *PART, "--json"),
    "diagnose --report": ("diagnose", "LOG", *PART, "--report"),
    "replay --json": ("replay", "LOG", *PART, "--json"),
    "replay --state": ("replay", "LOG", *PART, "--state"),
    "look --json": ("look", "LOG", "--dbc", "DBC", "--json"),
    "check --json": ("check", "LOG", "--vehicle", "generic", "--json"),
    "recover --json": ("recover", "LOG", "-o", "COPY", "--json"),
    "recover -o": ("recover", "LOG", "-o"),
    "export --json": ("export", "LOG", *PART, "-o", "TABLE", "--json"),
    "simulate": ("simulate", "--minutes", 0.1, "--force"),
    "simulate --json": ("simulate", "NEW", "--minutes", 0.1, "--json"),
    "compare --json": ("compare", "LOG", "--vehicle", "generic", "--stop", 3, "--json"),
    "compare --report": ("compare", "LOG", "--vehicle", "generic", "--stop", 3, "--report"),
    "fleet --json": ("fleet", "LOG", "--vehicle", "generic", "-o", "RESULTS", "--json"),
    "init -o": ("init", "DBC", "--force", "-o"),
    "init --json": ("init", "DBC", "--json"),
    "record --json": ("record", *VIRTUAL, "-o", "NEW", "--json"),
    "live --json": ("live", *VIRTUAL, "--vehicle", "generic", "--json"),
    "live --state": ("live", *VIRTUAL, "--vehicle", "generic", "--state"),
}


@pytest.fixture
def victims(log: Path, tmp_path: Path) -> dict[str, Path]:
    """Valuable files, one of each kind, under names of their kind and under names without one."""
    folder = tmp_path / "kept"
    folder.mkdir()
    # not of the instant at which simulated drives begin
    write_log(tmp_path / "recorded.blf", (f for f in open_log(log) if f.t < 5.0), 1.7e9)
    recorded = (tmp_path / "recorded.blf").read_bytes()
    kept = {
        "recording.blf": recorded,
        "vehicle.toml": (shipped() / "generic.toml").read_bytes(),
        "car.dbc": (shipped() / "generic.dbc").read_bytes(),
        "drive.events.jsonl": b'{"t": 0.0, "utc": 1.0, "what": "bus_lost", "says": "lost"}\n',
        "drive.truth.json": (log.with_name("drive.truth.json")).read_bytes(),
        "state.json": b'{"canid_state": 1,\n"sha256": "' + b"0" * 64 + b'",\n"vehicle": "x"\n}\n',
        "notes.txt": b"my notes of the drive\n",
        "can.conf": b"[default]\ninterface = virtual\n",
        "plain": recorded,
        "plain.json": recorded,
        "toml.json": (shipped() / "generic.toml").read_bytes(),
        "dbc.html": (shipped() / "generic.dbc").read_bytes(),
    }
    for name, content in kept.items():
        (folder / name).write_bytes(content)
    (folder / "link.json").symlink_to(folder / "recording.blf")
    (folder / "truth link.json").symlink_to(folder / "drive.truth.json")
    os.link(folder / "recording.blf", folder / "hard.json")
    (folder / "hanging.json").symlink_to(folder / "nothing")
    return {path.name: path for path in folder.iterdir()}


def content(folder: Path) -> dict[str, bytes | str]:
    return {
        path.name: os.readlink(path) if path.is_symlink() else path.read_bytes()
        for path in sorted(folder.iterdir())
    }


def worded(words: tuple[object, ...], log: Path, tmp_path: Path) -> list[object]:
    """The words of a command, with its files in place."""
    names: dict[object, object] = {
        "LOG": log,
        "DBC": shipped() / "generic.dbc",
        "COPY": tmp_path / "copy.blf",
        "NEW": tmp_path / "new.blf",
        "TABLE": tmp_path / "table",
        "RESULTS": tmp_path / "results",
    }
    return [names.get(word, word) for word in words]


# what an option may replace, of what lies there: its own kind; through a link to nothing a state is created
OWN = {
    "live --state": {"state.json", "hanging.json"},
    "replay --state": {"state.json", "hanging.json"},
    "init -o": {"vehicle.toml", "toml.json"},
}


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("writer", WRITERS)
def test_no_option_writes_over_a_file_of_another_kind(
    canid: Callable[..., Any], log: Path, tmp_path: Path, victims: dict[str, Path], writer: str
) -> None:
    """Each writing option of each verb against each kind of file, by links too: all stay as they were, byte by byte."""
    folder = tmp_path / "kept"
    before = content(folder)
    for name, victim in victims.items():
        if name in OWN.get(writer, ()):
            continue
        for path in tmp_path.iterdir():
            if path.is_file():
                path.unlink()
        ran = canid(*worded(WRITERS[writer], log, tmp_path), victim)
        assert content(folder) == before, (writer, name, ran.err)
        # a foreign state file is reported and left as it is; all else is an error
        assert ran.code in (USAGE, NOT_WRITTEN) or writer.endswith("--state"), (writer, name, ran.err)
        assert "Traceback" not in ran.err


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("link", ["same", "symbolic", "hard"])
def test_no_verb_writes_into_its_own_input(
    canid: Callable[..., Any], log: Path, tmp_path: Path, writer: str, link: str
) -> None:
    """The log or database that a verb reads, named as its output as well: refused with exit 2 or 5, untouched."""
    mine, database = tmp_path / "mine.blf", tmp_path / "mine.dbc"
    shutil.copy(log, mine)
    shutil.copy(shipped() / "generic.dbc", database)
    words = [{"LOG": mine, "DBC": database}.get(str(w), w) for w in WRITERS[writer]]
    if mine not in words and database not in words:
        pytest.skip("it reads no file")
    read = mine if mine in words else database
    output = read if link == "same" else tmp_path / "other.json"
    if link == "symbolic":
        output.symlink_to(read)
    elif link == "hard":
        os.link(read, output)
    before = read.read_bytes()
    ran = canid(*worded(tuple(words), log, tmp_path), output)
    assert ran.code in (USAGE, NOT_WRITTEN), ran.err
    assert read.read_bytes() == before
    if link != "hard" or writer not in ("recover -o", "simulate"):
        assert ran.code == USAGE or "--report" in writer or "exists" in ran.err


PAIRS = (
    ("live", *VIRTUAL, "--vehicle", "generic", "--record", "a.blf", "--state", "a.blf"),
    ("live", *VIRTUAL, "--vehicle", "generic", "--record", "a.blf", "--json", "a.blf"),
    ("live", *VIRTUAL, "--vehicle", "generic", "--json", "a.json", "--state", "a.json"),
    ("live", *VIRTUAL, "--vehicle", "generic", "--json", "a.json", "--state", "x/../a.json"),
    ("record", *VIRTUAL, "-o", "a.asc", "--json", "a.asc"),
    ("record", *VIRTUAL, "-o", "a.asc", "--json", "a.events.jsonl"),
    ("record", *VIRTUAL, "-o", "a.asc", "--file-time", "1s", "--json", "a.series"),
    ("replay", "LOG", *PART, "--json", "a.json", "--state", "a.json"),
    ("recover", "LOG", "-o", "a.blf", "--json", "a.blf"),
    ("diagnose", "LOG", *PART, "--json", "a.html", "--report", "a.html"),
    ("simulate", "a.blf", "--minutes", 0.1, "--json", "a.truth.json"),
    ("simulate", "a.blf", "--minutes", 0.1, "--json", "a.blf"),
    ("init", "DBC", "-o", "a.toml", "--json", "a.toml"),
    ("export", "LOG", *PART, "-o", "a", "--json", "a.samples.csv"),
    ("identify", "--vehicle", "generic", "--json", "LOG", "LOG"),
)


@pytest.mark.parametrize("words", PAIRS, ids=lambda words: " ".join(map(str, words)))
def test_two_options_that_name_one_file_are_refused_before_anything_is_opened(
    canid: Callable[..., Any],
    log: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[object, ...],
) -> None:
    """Exit 2, one line, and no file is there that was not there before."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x").mkdir()
    before, mine = log.read_bytes(), sorted(tmp_path.rglob("*"))
    ran = canid(*worded(words, log, tmp_path))
    assert ran.code == USAGE, ran.err
    assert "Traceback" not in ran.err
    assert sorted(tmp_path.rglob("*")) == mine
    assert log.read_bytes() == before


@pytest.mark.slow("whole commands, one after the other")
def test_earlier_results_are_replaced_and_only_by_a_result(
    canid: Callable[..., Any], log: Path, tmp_path: Path
) -> None:
    """--json of every verb replaces what --json has written; a command that fails leaves the earlier file whole."""
    for words in (
        ("identify", log, *PART),
        ("replay", log, "--vehicle", "generic", "--stop", 30),
        ("check", log, "--vehicle", "generic"),
        ("look", log),
        ("init", shipped() / "generic.dbc"),
        ("record", *VIRTUAL, "-o", tmp_path / "r.blf"),
    ):
        path = tmp_path / f"{words[0]}.json"
        assert canid(*words, "--json", path).code in (DONE, CHECK_FAILED, NO_BUS)  # record: a silent bus
        first = path.read_bytes()
        assert first
        assert canid("identify", tmp_path / "none.blf", *PART, "--json", path).code == USAGE
        assert path.read_bytes() == first
        path.write_bytes(first + first)  # longer than what comes: nothing of it is left behind
        assert canid(*words, "--json", path).code in (DONE, CHECK_FAILED, NO_BUS)  # record: a silent bus
        assert len(path.read_bytes()) < 1.5 * len(first)
        for line in path.read_text().splitlines():
            json.loads(line)


def test_pipes_and_devices_are_outputs(canid: Callable[..., Any], log: Path) -> None:
    """/dev/null as --json of two options at once belongs to neither."""
    words = ("replay", log, *PART, "--json", "/dev/null")
    assert canid(*words).code == DONE
    with pytest.raises(OutputError, match="not a regular file"):
        outputs.check([Output("--json", str(Path(__file__).parent), output_kinds.JSON)])


def test_every_suffix_of_a_log_is_foreign_to_every_result() -> None:
    """A log's name is never taken for a result, in any format that canid reads."""
    for suffix in read_suffixes():
        for kind in (output_kinds.JSON, output_kinds.PAGE, output_kinds.VEHICLE_FILE, output_kinds.STATE):
            with pytest.raises(ConfigError, match="the name is that of a log"):
                outputs.check([Output("--json", f"x{suffix}", kind)])


AUDIT = """
import json, os, sys
inputs = set(sys.argv[1].split(os.pathsep))
def hook(event, args):
    if event == "open" and isinstance(args[0], str) and os.path.realpath(args[0]) in inputs:
        mode, flags = args[1], args[2]
        if (isinstance(mode, str) and set(mode) & set("wax+")) or flags & (os.O_WRONLY | os.O_RDWR | os.O_TRUNC):
            os.write(2, f"WRITES {args}".encode())
            os._exit(99)
sys.addaudithook(hook)
from canid.ui.cli import main
for line in sys.stdin:
    print("code", main(json.loads(line)), flush=True)
"""


@pytest.mark.slow("whole commands, one after the other")
def test_inputs_are_never_opened_for_writing(log: Path, tmp_path: Path) -> None:
    """An audit hook of the interpreter sees every opening of a file: none of an input with a mode that writes."""
    mine = {name: tmp_path / name for name in ("mine.blf", "mine.toml", "generic.dbc")}
    shutil.copy(log, mine["mine.blf"])
    shutil.copy(shipped() / "generic.toml", mine["mine.toml"])
    shutil.copy(shipped() / "generic.dbc", mine["generic.dbc"])
    part = ("--vehicle", mine["mine.toml"], "--stop", 2)
    commands = (
        ("identify", mine["mine.blf"], *part, "--json", "i.json"),
        ("replay", mine["mine.blf"], *part, "--json", "r.json", "--state", "s.json"),
        ("diagnose", mine["mine.blf"], *part, "--report"),
        ("check", mine["mine.blf"], "--vehicle", mine["mine.toml"]),
        ("recover", mine["mine.blf"]),
        ("export", mine["mine.blf"], *part),
        ("init", mine["generic.dbc"], "-o", "new.toml"),
        ("identify", mine["mine.blf"], *part, "--json", mine["mine.blf"]),
        ("identify", mine["mine.blf"], *part, "--json", mine["mine.toml"]),
    )
    done = subprocess.run(
        [sys.executable, "-c", AUDIT, os.pathsep.join(map(str, mine.values()))],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        input="".join(json.dumps([str(word) for word in words]) + "\n" for words in commands),
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert "WRITES" not in done.stderr
    assert done.returncode == 0, done.stderr
    assert len(re.findall(r"^code \d+$", done.stdout, re.MULTILINE)) == len(commands)
