"""J1939: messages are found by their parameter group, from one sender; reserved raw numbers are no values."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive.drive_reader import read_signals
from canid.analysis.drive.signal_columns import decode, frames_by_message
from canid.io.logs import open_log, write_log
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle import encoder, read_vehicle
from canid.signals.vehicle.database import load
from canid.signals.vehicle.j1939 import matches
from canid.ui.cli import main
from canid.values.types import Flag, Frame

# SAE J1939-71: EEC2 (PGN 61443) SPN 91, EEC1 (61444) SPN 190, CCVS (65265) SPN 84 and 597, ACC1 (65135)
# SPN 1587; and a proprietary group (PDU2, 65280)
DBC = """VERSION ""
BU_: Engine
BO_ 2364539902 EEC2: 8 Engine
 SG_ AccelPedalPos1 : 8|8@1+ (0.4,0) [0|100] "%" Engine
BO_ 2364540158 EEC1: 8 Engine
 SG_ EngSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" Engine
BO_ 2566844926 CCVS: 8 Engine
 SG_ WheelBasedVehicleSpeed : 8|16@1+ (0.00390625,0) [0|250.996] "km/h" Engine
 SG_ BrakeSwitch : 28|2@1+ (1,0) [0|3] "" Engine
BO_ 2566811646 ACC1: 8 Engine
 SG_ DistanceForwardVehicle : 8|8@1+ (1,0) [0|250] "m" Engine
BO_ 2566848766 RADAR: 8 Engine
 SG_ RelativeSpeed : 0|16@1- (0.01,0) [-100|100] "m/s" Engine
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
BA_DEF_DEF_ "ProtocolType" "";
BA_ "ProtocolType" "J1939";
"""
TOML = """name = "Truck"
dbc = [{file}]
[signals]
pedal = "EEC2.AccelPedalPos1"
engine_speed = {engine}
speed = "CCVS.WheelBasedVehicleSpeed"
brake = "CCVS.BrakeSwitch"
gap = "ACC1.DistanceForwardVehicle"
range_rate = "RADAR.RelativeSpeed"
[driver]
output = "pedal"
"""


def truck(folder: Path, dbc: str = DBC, file: str = '"truck.dbc"', engine: str = '"EEC1.EngSpeed"') -> Path:
    (folder / "truck.dbc").write_text(dbc, encoding="cp1252")
    (folder / "truck.toml").write_text(TOML.format(file=file, engine=engine), encoding="utf-8")
    return folder / "truck.toml"


def frames(n: int = 60) -> list[Frame]:
    """A truck's bus: priorities change, a second ECU sends EEC1 too, and values are missing now and then."""
    out = []
    for k in range(n):
        t = 0.01 * k
        ids = [
            (p << 26) | pgn << 8 | source
            for p, pgn, source in ((3, 61443, 0), (3 + k % 4, 61444, 0), (6, 65265, 0x21))
        ]
        pedal = 0xFE if k == 5 else 0xFF if k == 6 else 50 + k
        rpm = 0xFF00 + k if k == 7 else 8 * (1000 + k)
        speed = 0xFE12 if k == 8 else 256 * k
        eec2 = bytes([0xFF, pedal, *[0xFF] * 6])
        eec1 = bytes([0xFF] * 3) + rpm.to_bytes(2, "little") + bytes([0xFF] * 3)
        ccvs = b"\xff" + speed.to_bytes(2, "little") + bytes([(k % 4) << 4, *[0xFF] * 4])
        out += [
            Frame(t, 0, id_, data, int(Flag.EXTENDED))
            for id_, data in zip(ids, (eec2, eec1, ccvs), strict=True)
        ]
        # the same group from another source, the same id with 11 bits, another group of the same PDU format
        other = bytes([0xFF] * 3) + (8 * 500).to_bytes(2, "little") + bytes([0xFF] * 3)
        out.append(Frame(t + 1e-3, 0, 0x0CF00403, other, int(Flag.EXTENDED)))
        out.append(Frame(t + 2e-3, 0, 0x18F00500, bytes(8), int(Flag.EXTENDED)))
    return out


@pytest.mark.parametrize("suffix", [".asc", ".blf"])
def test_groups_are_found_whatever_priority_and_source(tmp_path: Path, suffix: str) -> None:
    """Each value is the one that was sent; errors and "not available" are not measured; other senders change nothing."""
    log = tmp_path / f"truck{suffix}"
    write_log(log, frames())
    found = read_signals(log, truck(tmp_path))
    k = np.arange(60)
    expected = {
        "pedal": np.where((k == 5) | (k == 6), np.nan, 0.4 * (50 + k)),
        "engine_speed": np.where(k == 7, np.nan, 1000.0 + k),
        "speed": np.where(k == 8, np.nan, k / 3.6),
        "brake": np.where(k % 4 >= 2, np.nan, k % 4),
    }
    for role, values in expected.items():
        np.testing.assert_allclose(found[role].value, values, err_msg=role)


def test_a_role_is_bound_to_one_sender(tmp_path: Path) -> None:
    """`source` takes another ECU's frames; the log's first sender is not used then."""
    log = tmp_path / "truck.blf"
    write_log(log, frames())
    vehicle = truck(tmp_path, engine='{ signal = "EEC1.EngSpeed", source = 0x03 }')
    assert set(read_signals(log, vehicle)["engine_speed"].value) == {500.0}


def test_the_vehicle_file_decides_on_the_protocol(tmp_path: Path) -> None:
    """A DBC that declares nothing is plain CAN (nothing matches), unless the vehicle file says J1939; and back."""
    log = tmp_path / "truck.blf"
    write_log(log, frames(20))
    bare = "\n".join(line for line in DBC.splitlines() if not line.startswith("BA_"))
    assert "pedal" not in read_signals(log, truck(tmp_path, bare))
    as_j1939 = '{ file = "truck.dbc", protocol = "j1939" }'
    assert read_signals(log, truck(tmp_path, bare, as_j1939))["pedal"].value[0] == pytest.approx(20.0)
    assert "pedal" not in read_signals(log, truck(tmp_path, DBC, '{ file = "truck.dbc", protocol = "can" }'))


def test_check_names_both_senders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`canid check` says which source is used, how to choose the other, and counts what was not a value."""
    log = tmp_path / "truck.blf"
    write_log(log, frames())
    main(["check", str(log), "--vehicle", str(truck(tmp_path))])
    text = capsys.readouterr().out
    assert "EEC1 (PGN 61444) comes from source 0x00 and from 0x03; 0x00 is used" in text
    assert "EEC1: frame from source 0x03 ignored: 60 times" in text
    assert "not available" in text


def test_columns_of_a_group(tmp_path: Path) -> None:
    """`matches` finds the frames of a group by any id; `decode` gives NaN where the parameter is not available."""
    log = tmp_path / "truck.blf"
    write_log(log, frames())
    truck(tmp_path)
    with Parser() as parser:
        dbc, _, _ = load(tmp_path / "truck.dbc", None, parser)
    message = dbc.messages["EEC1"]
    mine = {
        key: of
        for key, of in frames_by_message(open_log(log)).items()
        if matches(message, key.id, key.extended)
    }
    assert {key.id & 0xFF for key in mine} == {0x00, 0x03}
    assert len(mine) == 5  # four priorities, and the other source
    column = decode(message, message.signals[0], mine[min(mine, key=lambda key: key.id)])
    assert column is not None
    values = [v for of in mine.values() for v in decode(message, message.signals[0], of).value.tolist()]  # type: ignore[union-attr]
    assert sum(map(math.isnan, values)) == 1
    assert len(values) == 120


def test_what_is_encoded_is_decoded(tmp_path: Path) -> None:
    """Frames of the encoder carry the sender's address, and a missing value as "not available"."""
    vehicle = read_vehicle(truck(tmp_path, engine='{ signal = "EEC1.EngSpeed", source = 0x03 }'))
    sent = encoder(vehicle)(0.0, {"speed": 20.0, "engine_speed": 900.0})
    log = tmp_path / "sent.blf"
    write_log(log, sent)
    found = read_signals(log, vehicle)
    assert 0x0CF00403 in {frame.id for frame in sent}
    assert found["engine_speed"].value == pytest.approx([900.0])
    assert found["speed"].value == pytest.approx([20.0], abs=1e-3)
    assert math.isnan(found["pedal"].value[0])
