"""Whole numbers of 64 bits: every digit where text is written, and said where a double is."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from canid.io.logs import write_log
from canid.ui.cli import main
from canid.values.types import Frame

DBC = """VERSION ""
BS_:
BU_: X
BO_ 256 SERIAL: 8 X
 SG_ Number : 0|64@1+ (1,0) [0|0] "" X
BO_ 257 BALANCE: 8 X
 SG_ Signed : 0|60@1- (3,-7) [0|0] "" X
 SG_ Few : 60|4@1+ (1,0) [0|0] "" X
BO_ 258 STATE: 8 X
 SG_ Key : 0|64@1+ (1,0) [0|0] "" X
VAL_ 258 Key 9007199254740993 "one" 9007199254740992 "other" ;
"""
NUMBERS = [0, 1, 2**53 + 1, 2**60 + 1, 2**63 + 3, 2**64 - 1]
SIGNED = [0, -1, 2**59 - 1, -(2**59), 2**53 + 1, -(2**53) - 1]
KEYS = [2**53, 2**53 + 1, 7, 2**53, 2**53 + 1, 7]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "car.dbc").write_text(DBC)
    frames = []
    for k, (number, signed, key) in enumerate(zip(NUMBERS, SIGNED, KEYS, strict=True)):
        words = (number, (signed & ((1 << 60) - 1)) | 5 << 60, key)
        frames += [Frame(0.1 * k, 0, 256 + at, word.to_bytes(8, "little")) for at, word in enumerate(words)]
    write_log(tmp_path / "drive.blf", frames, 1.7e9)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def column(path: Path, name: str) -> list[str]:
    with path.open(newline="") as file:
        return [row[name] for row in csv.DictReader(file)]


def test_a_table_of_text_has_every_digit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also behind scale and offset; and the value table holds for one of two neighbours."""
    words = ["export", "drive.blf", "--dbc", "car.dbc", "--signals", "--to", "csv", "-o", "table"]
    assert main(words) == 0
    assert "53 bits" not in capsys.readouterr().err
    assert column(folder / "table.signals.SERIAL.csv", "Number") == [str(number) for number in NUMBERS]
    assert column(folder / "table.signals.BALANCE.csv", "Signed") == [
        str(3 * number - 7) for number in SIGNED
    ]
    assert set(column(folder / "table.signals.BALANCE.csv", "Few")) == {"5.0"}
    texts = {2**53: "other", 2**53 + 1: "one", 7: ""}
    assert column(folder / "table.signals.STATE.csv", "Key text") == [texts[key] for key in KEYS]


@pytest.mark.parametrize("words", [["--to", "mat"], ["--to", "csv", "--raster", "0.1"]])
def test_what_holds_doubles_says_so(
    folder: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "drive.blf", "--dbc", "car.dbc", "--signals", *words, "-o", "table"]) == 0
    said = capsys.readouterr().err
    assert "SERIAL.Number" in said
    assert "more than 53 bits" in said
    assert "BALANCE.Few" not in said


def test_decode_shows_every_digit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On the terminal, as CSV and as JSON."""
    assert main(["decode", "drive.blf", "--dbc", "car.dbc"]) == 0
    assert f"Number {2**60 + 1}" in capsys.readouterr().out
    assert main(["decode", "drive.blf", "--dbc", "car.dbc", "--csv"]) == 0
    assert f",Signed,{3 * SIGNED[4] - 7}," in capsys.readouterr().out
    assert main(["decode", "drive.blf", "--dbc", "car.dbc", "--json", "-"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    values = [one["value"] for line in lines for one in line["signals"] if one["name"] == "Number"]
    assert values == NUMBERS
