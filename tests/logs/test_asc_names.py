"""An .asc with names of messages in place of ids is read by the database that a verb is given."""

from __future__ import annotations

import json
import random
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.ui.cli import main

CAR = """name = "N"
dbc = ["m.dbc"]

[signals]
speed = { signal = "FACE.Speed", unit = "km/h" }
pedal = { signal = "GasPedal.Pedal", unit = "%" }
gap = { signal = "Add.Gap", unit = "m" }
range_rate = { signal = "Far.Rate", unit = "m/s" }
"""


@pytest.fixture
def drive(tmp_path: Path, seed: int) -> tuple[Path, Path]:
    """The same frames with ids and with names, of which one reads as an id, on CAN and CAN FD, decimal or not."""
    rng = random.Random(seed)
    ids = dict(zip(("FACE", "GasPedal", "Add"), rng.sample(range(0x7FF), 3), strict=True)) | {
        "Far": 0x18FE0000
    }
    messages = [
        f'BO_ {id_ | (id_ > 0x7FF) << 31} {name}: 8 A\n SG_ {signal} : 0|16@1+ (0.01,0) [0|600] "" A\n'
        for (name, id_), signal in zip(ids.items(), ("Speed", "Pedal", "Gap", "Rate"), strict=True)
    ]
    (tmp_path / "m.dbc").write_text('VERSION ""\nBU_: A\n' + "\n".join(messages))
    (tmp_path / "m.toml").write_text(CAR)
    decimal = rng.random() < 0.5
    head = [f"base {'dec' if decimal else 'hex'}  timestamps absolute", "no internal events logged"]
    texts: dict[bool, list[str]] = {True: [*head], False: [*head]}
    for k in range(800):
        name = rng.choice(list(ids)) if k > 3 else ["GasPedal", "FACE", "Add", "Far"][k]
        data = rng.randbytes(8)
        fd = rng.random() < 0.2
        for named, lines in texts.items():
            id_ = f"{ids[name]:x}" if fd or not decimal else str(ids[name])
            word = name if named else id_ + "x" * (ids[name] > 0x7FF)
            octets = data.hex(" ") if fd or not decimal else " ".join(map(str, data))
            at = f"{k * 0.02:.4f}"
            if fd:
                lines.append(f"   {at} CANFD   1 Rx  {word}  1 0 8  8 {octets}   148531  160   1000 0")
            else:
                lines.append(f"   {at} 1  {word:15s} Rx   d 8 {octets}")
            if k % 50 == 9:
                lines.append(f"   {at} 1  {word:15s} TxRq d 8 {octets}")
        if k % 60 == 11:  # an id that the database does not have, and a name
            texts[True].append(f"   {k * 0.02:.4f} 1  Unheard Rx   d 1 {'7' if decimal else '07'}")
    paths = tmp_path / "names.asc", tmp_path / "ids.asc"
    for path, named in zip(paths, (True, False), strict=True):
        path.write_text("\n".join([*texts[named], ""]))
    return paths


def test_every_verb_reads_names_as_it_does_ids(
    drive: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names, _ = drive
    dbc, car = str(tmp_path / "m.dbc"), str(tmp_path / "m.toml")
    one, other = (canid.read_signals(path, car) for path in drive)
    assert one.keys() == other.keys() >= {"speed", "pedal"}
    for role in one:
        np.testing.assert_array_equal(one[role].value, other[role].value)
        np.testing.assert_array_equal(one[role].t, other[role].t)
    for words in (
        ["decode", "--dbc", dbc],
        ["look", "--signals", "*", "--dbc", dbc],
        ["check", "--vehicle", car],
    ):
        outs = []
        for path in drive:
            main([words[0], str(path), *words[1:]])
            outs.append(capsys.readouterr().out.replace(str(path), "X"))
        assert len(outs[0]) > 100
        assert outs[0].replace("names.asc", "") == outs[1].replace("ids.asc", ""), words
    for words in (
        ["look", str(names)],
        ["check", str(names)],
        ["recover", str(names), "-o", str(tmp_path / "x.blf")],
    ):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert "is a message's name, and no id" in said
        assert "Traceback" not in said


def test_the_page_of_a_symbolic_log(drive: tuple[Path, Path], tmp_path: Path) -> None:
    names, _ = drive
    page, found = tmp_path / "x.html", tmp_path / "x.json"
    words = ["look", str(names), "--dbc", str(tmp_path / "m.dbc")]
    assert main([*words, "--report", str(page)]) == 0
    assert page.stat().st_size > 1000
    assert main([*words, "--json", str(found)]) == 0
    assert json.loads(found.read_text())["frames"] == 800
