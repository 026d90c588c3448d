"""Every kind of bad input: one clear line, the right exit code, no traceback; intact data are used."""

from __future__ import annotations

import json
import random
import re
import shlex
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.session.session import SessionSettings, World, session
from canid.io.buses.bus_opener import open_buses
from canid.io.buses.send import onto
from canid.io.logs import open_log, write_log
from canid.values.errors import CHECK_FAILED, DAMAGED, DONE, NO_BUS, NOT_WRITTEN, USAGE
from canid.values.shipped_files import shipped
from canid.values.types import Frame

Canid = Callable[..., Any]
READERS = ("replay", "identify", "check", "export")


def vehicle(folder: Path, *changes: tuple[str, str]) -> Path:
    """The generic vehicle file with changes, its DBC next to it."""
    text = (shipped() / "generic.toml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    shutil.copy(shipped() / "generic.dbc", folder)
    path = folder / "car.toml"
    path.write_text(text)
    return path


# --- logs that cannot be read -----------------------------------------------------------------------------


@pytest.mark.parametrize("verb", READERS)
def test_a_missing_log(canid: Canid, verb: str) -> None:
    """A missing log is named; exit 2."""
    ran = canid(verb, "nowhere.blf", "--vehicle", "generic")
    assert ran.code == USAGE
    assert "nowhere.blf" in ran.line


@pytest.mark.parametrize("verb", READERS)
@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("empty.blf", b"", "is empty"),
        ("empty.asc", b"", "is empty"),
        ("zeros.blf", bytes(4096), "not a BLF log"),
        ("zeros.asc", bytes(4096), "zeros.asc"),
        ("zeros.log", bytes(4096), "zeros.log"),
        ("zeros.trc", bytes(4096), "zeros.trc"),
        ("text.blf", b"hello\n" * 100, "not a BLF log"),
    ],
)
def test_a_log_without_anything_in_it(
    canid: Canid, verb: str, name: str, content: bytes, says: str, tmp_path: Path
) -> None:
    """Empty, zero-filled or foreign content: exit 2 (nothing of it is used), the file is named, no result is left behind."""
    bad = tmp_path / name
    bad.write_bytes(content)
    result = tmp_path / "result.json"
    ran = canid(verb, bad, "--vehicle", "generic", "--json", result)
    assert ran.code == USAGE
    assert says in ran.line
    assert not result.exists()


def test_a_folder_instead_of_a_log(canid: Canid, tmp_path: Path) -> None:
    """A folder in place of a log is named as such."""
    ran = canid("replay", tmp_path, "--vehicle", "generic")
    assert ran.code == USAGE
    assert "is a folder" in ran.line


def test_an_unknown_suffix(canid: Canid, log: Path, tmp_path: Path) -> None:
    """The known suffixes are listed; exit 2."""
    other = shutil.copy(log, tmp_path / "drive.xyz")
    ran = canid("replay", other, "--vehicle", "generic")
    assert ran.code == USAGE
    assert ".xyz" in ran.line
    assert ".blf" in ran.line


# --- logs that can be read in part ------------------------------------------------------------------------


def truncated(content: bytes) -> bytes:
    return content[: len(content) * 3 // 4]


def flipped(content: bytes) -> bytes:
    """Bits of the last quarter: a drive of 45 s has few containers, the first must stay whole."""
    pick, bad = random.Random(3), bytearray(content)
    for _ in range(4):
        bad[pick.randrange(len(bad) * 3 // 4, len(bad))] ^= 1 << pick.randrange(8)
    return bytes(bad)


def zeroed(content: bytes) -> bytes:
    return content[: len(content) * 3 // 4] + bytes(len(content) // 4)


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("damage", [truncated, flipped, zeroed])
def test_a_damaged_blf_is_read_as_far_as_it_is_whole(
    canid: Canid, log: Path, tmp_path: Path, damage: Callable[[bytes], bytes]
) -> None:
    """Every verb uses the intact part, reports "read N of M" with the true M, and exits with 4."""
    bad = tmp_path / "bad.blf"
    bad.write_bytes(damage(log.read_bytes()))
    whole = sum(1 for _ in open_log(log))
    result = tmp_path / "result.json"
    ran = canid("replay", bad, "--vehicle", "generic", "--json", result)
    assert ran.code == DAMAGED
    said = re.search(r"read (\d+) of (\d+) objects", ran.err)
    assert said, ran.err
    assert 0 < int(said[1]) < int(said[2]) == whole
    lines = [json.loads(line) for line in result.read_text().splitlines()]
    assert lines[-1]["t"] > 10.0
    for verb in ("identify", "check", "export"):
        ran = canid(verb, bad, "--vehicle", "generic", "--json", tmp_path / f"{verb}.json")
        assert ran.code == DAMAGED
        assert said[0] in ran.err
        assert "Traceback" not in ran.err
        assert json.loads((tmp_path / f"{verb}.json").read_text())


@pytest.mark.slow("whole commands, one after the other")
def test_an_asc_of_another_locale(canid: Canid, log: Path, tmp_path: Path) -> None:
    """German month and day names in the date line change nothing but the start."""
    asc = tmp_path / "drive.asc"
    write_log(asc, open_log(log), 1533224087.0)
    english = canid("replay", asc, "--vehicle", "generic", "--json", "-")
    text = asc.read_text().splitlines(keepends=True)
    assert text[0].startswith("date ")
    asc.write_text("".join(["date Do Mär 1 15:41:27.000 2018\n", *text[1:]]), encoding="utf-8")
    german = canid("replay", asc, "--vehicle", "generic", "--json", "-")
    assert (german.code, german.out) == (DONE, english.out)
    assert len(german.out.splitlines()) > 100


@pytest.mark.slow("whole commands, one after the other")
def test_time_that_goes_backwards(canid: Canid, tmp_path: Path, log: Path) -> None:
    """Frames with an earlier time are left out and reported with count and largest step; exit 4, the rest is estimated."""
    frames = list(open_log(log))
    # candump writes times as they are: ten frames of the middle claim to be 3 s older
    middle = len(frames) // 2
    for k in range(middle, middle + 10):
        frames[k] = frames[k]._replace(t=frames[k].t - 3.0)
    bad = tmp_path / "back.log"
    with bad.open("w") as file:
        for frame in frames:
            file.write(f"({1e9 + frame.t:.6f}) can0 {frame.id:03X}#{frame.data.hex().upper()}\n")
    ran = canid("replay", bad, "--vehicle", "generic", "--json", tmp_path / "result.jsonl")
    assert ran.code == DAMAGED
    assert re.search(r"10 frames go back in time \(by up to 3", ran.err), ran.err
    assert json.loads((tmp_path / "result.jsonl").read_text().splitlines()[-1])["t"] > 40.0
    assert canid("identify", bad, "--vehicle", "generic").code == DAMAGED
    assert canid("check", bad, "--vehicle", "generic").code == CHECK_FAILED


# --- logs and vehicles that do not fit --------------------------------------------------------------------


@pytest.mark.parametrize("verb", ["replay", "identify", "export"])
def test_a_log_without_any_mapped_id(canid: Canid, tmp_path: Path, verb: str) -> None:
    """The log of another vehicle: reported with the command that lists its ids; exit 2."""
    other = tmp_path / "other.blf"
    write_log(other, [Frame(0.01 * k, 0, 0x7A0, bytes(8)) for k in range(500)])
    ran = canid(verb, other, "--vehicle", "generic")
    assert ran.code == USAGE
    assert "its 500 frames hold no value" in ran.line
    assert "canid check" in ran.line
    assert "0x7A0" in canid("check", other).out


@pytest.mark.parametrize("verb", ["replay", "identify", "export"])
def test_a_part_without_frames(canid: Canid, log: Path, tmp_path: Path, verb: str) -> None:
    """--start behind the end is a mistake of the call, not an empty result; exit 2."""
    output = ("-o", tmp_path / "out") if verb == "export" else ()
    ran = canid(verb, log, "--vehicle", "generic", "--start", 1000, *output)
    assert ran.code == USAGE
    assert "no frames between 1000 and" in ran.line


def test_a_signal_that_never_comes(canid: Canid, log: Path, tmp_path: Path) -> None:
    """It is named with its message and its id in hex, by replay (exit 0) and check (exit 1)."""
    part = tmp_path / "part.blf"
    write_log(part, [frame for frame in open_log(log) if frame.id != 0x170 and frame.t < 5.0])
    ran = canid("replay", part, "--vehicle", "generic")
    assert ran.code == DONE
    assert re.search(r"altitude: message GNSS_DATA \(0x170\) never seen", ran.err), ran.err
    ran = canid("check", part, "--vehicle", "generic")
    assert ran.code == CHECK_FAILED
    assert "GNSS_DATA (0x170) never seen" in ran.out


def test_two_channels_with_one_id(canid: Canid, log: Path, tmp_path: Path) -> None:
    """The bus that was chosen is reported with the remedy; `check` fails; the other bus changes no number."""
    frames = [frame for frame in open_log(log) if frame.t < 20.0]
    twice = [each for f in frames for each in (f, f._replace(bus=1, data=bytes(8)))]
    double = tmp_path / "double.blf"
    write_log(double, twice)
    ran = canid("replay", double, "--vehicle", "generic", "--json", tmp_path / "double.jsonl")
    assert ran.code == DONE
    assert re.search(r"0x[0-9A-F]+.*bus 1", ran.err), ran.err
    canid("replay", log, "--stop", 19.9999, "--vehicle", "generic", "--json", tmp_path / "one.jsonl")
    assert (tmp_path / "double.jsonl").read_text() == (tmp_path / "one.jsonl").read_text()
    ran = canid("check", double, "--vehicle", "generic")
    assert ran.code == CHECK_FAILED
    assert "✗" in ran.out


def test_frames_shorter_than_the_dbc_says(canid: Canid, log: Path, tmp_path: Path) -> None:
    """Short frames are counted by message; signals in the bytes that came are used, the others are not measured."""
    short = tmp_path / "short.blf"
    write_log(short, [f._replace(data=f.data[:1]) if f.id == 0x170 else f for f in open_log(log) if f.t < 5])
    ran = canid("replay", short, "--vehicle", "generic")
    assert ran.code == DONE
    assert re.search(r"altitude: frame too short: \d+ times", ran.err), ran.err


# --- vehicle files ----------------------------------------------------------------------------------------


def test_all_mistakes_of_a_vehicle_file_at_once(canid: Canid, log: Path, tmp_path: Path) -> None:
    """An unknown role, signal and output: all reported together, each with its key and a suggestion; exit 2."""
    bad = vehicle(
        tmp_path,
        ("pedal = ", "pedale = "),
        ("EGO_SPEED.VehicleSpeed", "EGO_SPEED.VehicelSpeed"),
        ('task = "car_following"', 'task = "car_folowing"'),
    )
    ran = canid("replay", log, "--vehicle", bad)
    assert ran.code == USAGE
    assert "Traceback" not in ran.err
    for key, guess in (("pedale", "pedal"), ("speed", "VehicleSpeed"), ("task", "car_following")):
        assert re.search(rf"{key}\b.*did you mean \W?{guess}|{key}\b.*{guess}", ran.err), (key, ran.err)
    assert canid("check", "--vehicle", bad).code == USAGE


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--vehicle", "nobody"), "nobody"),
        (("--vehicle", "genric"), "generic"),
    ],
)
def test_a_vehicle_that_is_not_there(canid: Canid, log: Path, words: tuple[str, str], says: str) -> None:
    """The built-in vehicles are listed."""
    ran = canid("replay", log, *words)
    assert ran.code == USAGE
    assert says in ran.line
    assert "generic_lane" in ran.line


def test_a_dbc_that_is_none(canid: Canid, log: Path, tmp_path: Path) -> None:
    """A wrong DBC is named with the place of the error, given directly or in a vehicle file; exit 2."""
    car = vehicle(tmp_path)
    (tmp_path / "generic.dbc").write_text("this is a letter\nnot a DBC\n")
    ran = canid("init", tmp_path / "generic.dbc")
    assert ran.code == USAGE
    assert re.search(
        r"generic.dbc cannot be parsed as a DBC: line 1, 'this is a letter': no .*DBC$", ran.line.strip()
    )
    ran = canid("replay", log, "--vehicle", car)
    assert ran.code == USAGE
    assert "generic.dbc cannot be parsed as a DBC" in ran.err
    assert "Traceback" not in ran.err
    for other, says in ((tmp_path, "is a folder"), (tmp_path / "none.dbc", "does not exist")):
        ran = canid("init", other)
        assert ran.code == USAGE
        assert says in ran.line


# --- usage ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("repaly",), '"replay"'),
        (("sing",), "--help"),
        (("replay", "LOG", "--spede", "3"), "--speed"),
        (("check", "LOG", "--dbc", "car.dbc"), "canid init FILE.dbc"),
        (("init", "--log", "LOG", "--dbc", "car.dbc"), "without an option"),
        (("recover", "LOG", "--dbc", "car.dbc"), "--help"),
        (("replay", "LOG", "--speed", "fast"), '"fast" is not a speed'),
        (("replay", "LOG", "--speed", "0"), '"0" is not a speed'),
        (("replay", "LOG", "--speed", "nan"), '"nan" is not a speed'),
        (("replay", "LOG", "--start", "-1"), "--start"),
        (("replay", "LOG"), "--vehicle"),
        (("replay",), "LOG"),
        (("identify", "LOG"), "--vehicle"),
        (("simulate", "x.blf", "--minutes", "0"), '"0" is not a time in minutes'),
        (("simulate", "x.blf", "--noise", "pink"), "'pink'"),
        (("simulate", "x.mp3"), ".mp3"),
        (("export", "LOG", "--vehicle", "generic", "--dt", "0"), "--dt"),
        (("live", "-i", "sockedcan", "-c", "can0", "--vehicle", "generic"), '"socketcan"'),
        (("record", "-i", "nonsense", "-c", "x"), '"nonsense"'),
        (("replay", "LOG", "--onto", "-i", "nonsense", "-c", "x"), '"nonsense"'),
        (("replay", "LOG", "--onto", "-i", "socketcan", "-c", "can0"), "--arm can0"),
        (("replay", "LOG", "--onto", "-i", "pcan", "-c", "PCAN_USBBUS1"), "physical"),
    ],
)
def test_a_wrong_call(
    canid: Canid,
    log: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    says: str,
) -> None:
    """One line with the correct usage; exit 2; no file is left behind."""
    monkeypatch.chdir(tmp_path)
    ran = canid(*(log if word == "LOG" else word for word in words))
    assert ran.code == USAGE
    assert says in ran.line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "words",
    [
        ("live", "-i", "socketcan", "-c", "can77", "--vehicle", "generic"),
        ("record", "-i", "socketcan", "-c", "can77", "-o", "x.blf"),
        ("check", "-i", "socketcan", "-c", "can77", "--vehicle", "generic"),
        ("record", "-i", "vector", "-c", "0"),
        ("record",),
    ],
)
def test_no_such_bus(
    canid: Canid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    """One line that names the bus and what to try; exit 3; no file."""
    monkeypatch.chdir(tmp_path)
    ran = canid(*words)
    assert ran.code == NO_BUS
    assert ";" in ran.line
    assert '"None"' not in ran.line
    assert list(tmp_path.iterdir()) == []


# --- outputs ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("below", ["drive.blf/x", "missing/x"])
def test_an_output_that_cannot_be_written(canid: Canid, log: Path, tmp_path: Path, below: str) -> None:
    """An output below a file or in a missing folder: one line that names it; exit 5."""
    path = log.parent / below if below.startswith("drive") else tmp_path / below
    part = ("--vehicle", "generic", "--stop", 2)
    for words in (
        ("replay", log, *part, "--json", f"{path}.json"),
        ("identify", log, *part, "--json", f"{path}.json"),
        ("export", log, *part, "-o", path),
        ("export", log, *part, "-o", path, "--to", "parquet"),
        ("init", shipped() / "generic.dbc", "-o", f"{path}.toml"),
        ("simulate", f"{path}.blf", "--minutes", 0.1),
    ):
        ran = canid(*words)
        assert ran.code == NOT_WRITTEN, words
        assert path.name in ran.line
        assert len(ran.line) < 250


@pytest.mark.slow("whole commands, one after the other")
def test_a_full_disk(canid: Canid, log: Path, shell: Callable[[str], Any]) -> None:
    """A file or standard output that is full: exit 5 with a message, no traceback. A closed pipe: a normal end."""
    part = ("--vehicle", "generic", "--stop", 2)
    ran = canid("replay", log, *part, "--json", "/dev/full")
    assert ran.code == NOT_WRITTEN
    assert "/dev/full: cannot be written (No space left on device)" in ran.line
    ran = shell(f"canid replay {shlex.quote(str(log))} --vehicle generic --stop 2 >/dev/full")
    assert ran.code == NOT_WRITTEN
    assert "standard output: No space left on device" in ran.line
    ran = shell(f"canid check {shlex.quote(str(log))} | head -1; exit ${{PIPESTATUS[0]}}")
    assert (ran.code, ran.err) == (DONE, "")


def test_nothing_that_exists_is_overwritten(canid: Canid, log: Path, tmp_path: Path) -> None:
    """Files that exist are refused with exit 5; --force replaces those of the kind that is written, and no others."""
    dbc = shipped() / "generic.dbc"
    part = ("--vehicle", "generic", "--stop", 3)
    assert canid("simulate", tmp_path / "an_earlier.blf", "--minutes", 0.1).code == DONE
    simulated = (tmp_path / "an_earlier.blf").read_bytes()
    for words, kept, content in (
        (("export", log, *part, "-o", "table"), "table.estimates.csv", b"t,estimator,can_tell\n"),
        (("init", dbc, "-o", "car.toml"), "car.toml", b'name = "mine"\ndbc = "mine.dbc"\n'),
        (("simulate", "a.blf", "--minutes", 0.1, "--seed", 2), "a.blf", simulated),
        (("simulate", "b.blf", "--minutes", 0.1), "b.truth.json", b'{"channels": {}}'),
    ):
        path = tmp_path / kept
        path.write_bytes(b"mine")
        foreign = [
            tmp_path / str(w) if re.search(r"^(table|\w+\.(json|toml|blf))$", str(w)) else w for w in words
        ]
        for words_or_more in (foreign, [*foreign, "--force"]):
            assert canid(*words_or_more).code == NOT_WRITTEN, words
            assert path.read_bytes() == b"mine"
        path.write_bytes(content)
        full = [
            tmp_path / str(w) if re.search(r"^(table|\w+\.(json|toml|blf))$", str(w)) else w for w in words
        ]
        ran = canid(*full)
        assert ran.code == NOT_WRITTEN, words
        assert kept in ran.err
        assert "--force" in ran.err
        assert path.read_bytes() == content
        assert canid(*full, "--force").code == DONE, words
        assert path.read_bytes() != content


# --- live -------------------------------------------------------------------------------------------------


@pytest.mark.slow("whole commands, one after the other")
def test_live_goes_on_recording_while_a_signal_is_missing(log: Path, tmp_path: Path) -> None:
    """A mapped signal that never comes on the bus is named with its id; every frame is recorded all the same."""
    frames = [frame for frame in open_log(log) if frame.id != 0x170 and frame.t < 10.0]
    config = {"interface": "virtual", "channel": str(tmp_path)}
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, frames, 1e9))
    sender.start()
    ended = lambda: not sender.is_alive()  # noqa: E731
    # ten seconds are played at once: the estimators may finish
    *_, last = session(buses, SessionSettings("generic", tmp_path / "live.blf", finish=60.0), stopped=ended)
    assert isinstance(last, World)
    assert any("GNSS_DATA (0x170) never seen" in sentence for sentence in last.missing), last.missing
    recorded = open_log(tmp_path / "live.blf")
    assert [(f.id, f.data) for f in recorded] == [(f.id, f.data) for f in frames]
    assert recorded.damage is None
