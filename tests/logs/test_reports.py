"""Logs of public reports next to the repository: candump, lists, other programs, early frames, buses, .mf4, UTF-16.

Those of .asc, .trc and .blf are in tests/formats_oracle/test_reported_logs.py. Some folders lost their .log files; what
these hold is written here from the README.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.ui.cli import main
from canid.values.errors import ConfigError
from canid.values.types import Flag
from tests.fixtures.measured_logs import MISSING, files

SPEED = 'VERSION ""\nBU_: A\nBO_ 256 S: 1 A\n SG_ Speed : 0|8@1+ (1,0) [0|0] "" A\n'


@pytest.fixture
def reports(measured: Path) -> Path:
    """The folder of reports; skips where there is none."""
    if not (measured / "reports").is_dir():
        pytest.skip(MISSING)
    return measured / "reports"


def test_relative_times(reports: Path) -> None:
    frames = list(open_log(reports / "04-asc-relative" / "a.asc"))
    assert (len(frames), round(frames[-1].t - frames[0].t, 6)) == (6, 0.5)


@pytest.mark.parametrize(("name", "frames"), [("a.csv", 5), ("crcrlf.csv", 2), ("appended.csv", 2)])
def test_python_can_csv(reports: Path, name: str, frames: int) -> None:
    log = open_log(reports / "08-pythoncan-csv" / name)
    assert (len(list(log)), log.damage) == (frames, None)


def test_other_programs_files_are_read_or_refused_in_one_line(reports: Path) -> None:
    """Never damaged; the same for every verb."""
    refused = {}
    paths = [path for path in files("reports/24-foreign/*") if path.name != "README"]
    assert len(paths) > 5
    for path in paths:
        try:
            log = open_log(path)
        except ConfigError as error:
            refused[path.name] = "save it there" in str(error)
            continue
        assert list(log), path.name
        assert log.damage is None, path.name
    assert all(refused.values()), refused


def test_what_is_refused_is_refused_by_every_verb(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, dbc = str(reports / "24-foreign" / "plain.csv"), tmp_path / "s.dbc"
    dbc.write_text(SPEED)
    verbs = (
        ["look", path], ["check", path], ["recover", path, "-o", str(tmp_path / "x.blf")],
        ["export", path, "--dbc", str(dbc)], ["init", str(dbc), "--log", path],
        ["replay", "--onto", path, "-i", "virtual", "-c", "foreign"], ["identify", path, "--vehicle", "generic"],
        ["diagnose", path, "--vehicle", "generic"], ["replay", path, "--vehicle", "generic"],
        ["compare", path, "--vehicle", "generic"],
    )  # fmt: skip
    for words in verbs:
        assert main(words) == 2, words
        assert "lists CAN frames in a form that canid does not know" in capsys.readouterr().err, words


@pytest.mark.parametrize("name", ["a.asc", "a.csv", "a.trc"])
def test_utf_16(reports: Path, name: str) -> None:
    log = open_log(reports / "26-utf16" / name)
    assert list(log)
    assert log.damage is None


def test_candumps_screen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """06: with times it is read; without them it is said that `candump -L` is needed."""
    path = tmp_path / "view.log"
    path.write_text(
        "  can0  123   [8]  01 02 03 04 05 06 07 08\n  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n"
    )
    for words in (["look", str(path)], ["check", str(path)], ["recover", str(path)]):
        assert main(words) == 2
        assert "candump -L" in capsys.readouterr().err
    for stamp in ("(1436509052.249713)", "(2025-03-03 10:00:00.123456)"):
        path.write_text(f" {stamp}  can0  123   [8]  01 02 03 04 05 06 07 08\n")
        assert [frame.id for frame in open_log(path)] == [0x123]


def test_candump_dialects(tmp_path: Path) -> None:
    """05: R and T, remote, error, 29-bit ids below 0x800, CAN FD, empty, points."""
    path = tmp_path / "r.log"
    frames = (
        "123#11 R",
        "123#22 T",
        "123#R",
        "20000004#0000000000000000",
        "00000123#11",
        "12345678##1AABB",
        "123##0",
        "123#",
        "123#11.22",
    )
    path.write_text("".join(f"({1.7e9 + k:.6f}) can0 {frame}\n" for k, frame in enumerate(frames)))
    log = open_log(path)
    found = list(log)
    assert (len(found), log.damage) == (9, None)
    assert found[4].flags == Flag.EXTENDED
    assert found[5].flags == Flag.EXTENDED | Flag.FD | Flag.BRS


def test_sent_frames_without_a_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """31: 100 frames and 10 that were sent, with the time 0: all are shown, within the ten seconds of the log."""
    path = tmp_path / "zero.csv"
    lines = ["timestamp,arbitration_id,extended,remote,error,dlc,data"]
    for k in range(100):
        lines += ["0.0,0x101,0,0,0,1,AQ=="] * (k % 10 == 0) + [f"{1.7e9 + k / 10:.6f},0x100,0,0,0,1,AQ=="]
    path.write_text("\n".join(lines) + "\n")
    assert main(["look", str(path)]) == 0
    assert "9.9 s, 110 frames, 2 ids" in capsys.readouterr().out


def test_the_same_car_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """32: whichever interface speaks first, speed.dbc@0 is the speed of can0."""
    (tmp_path / "speed.dbc").write_text(SPEED)
    drive = [f"({1.7e9 + k / 10:.6f}) can0 100#{k:02X}" for k in range(50)]
    other = [f"({1.7e9 + k / 10:.6f}) can1 100#C8" for k in range(50)]
    for first, second in ((drive, other), (other, drive)):
        path = tmp_path / "drive.log"
        path.write_text("".join(f"{a}\n{b}\n" for a, b in zip(first, second, strict=True)))
        assert (
            main(["look", str(path), "--dbc", f"{tmp_path / 'speed.dbc'}@0", "--signals", "Speed", "--all"])
            == 0
        )
        row = next(line for line in capsys.readouterr().out.splitlines() if "S.Speed" in line)
        assert row.split()[1:3] == ["0", "49"], row


MF4 = {
    "plain.mf4": (50, 0), "noide.mf4": (50, 0), "err_scalar.mf4": (50, 3), "err_bytes.mf4": (50, 3), "two.mf4": (100, 0),
    "empty_group.mf4": (50, 0), "cut20000.mf4": (347, 0),
}  # fmt: skip


@pytest.mark.slow("each .mf4 is read in a child that imports asammdf")
@pytest.mark.parametrize("name", MF4)
def test_mf4(reports: Path, name: str) -> None:
    pytest.importorskip("asammdf", reason="asammdf is not installed: pip install canid[mf4]")
    log = open_log(reports / "16-mf4" / name)
    frames = list(log)
    errors = sum(bool(frame.flags & Flag.ERROR) for frame in frames)
    assert (len(frames) - errors, errors or log.other_kinds.get("error frames", 0)) == MF4[name]
    assert (log.damage is not None) == name.startswith("cut")
    if name == "noide.mf4":
        assert sum(not frame.flags & Flag.EXTENDED for frame in frames) == 25
