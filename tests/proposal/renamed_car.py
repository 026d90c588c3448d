"""A simulated drive on the bus of a car of any maker: the signals' names are the maker's, decoys are among them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

import canid

STEP = 5  # rows of the simulation (0.01 s) for each frame


class Field(NamedTuple):
    """A signal of 16 bits, or a switch of 8."""

    name: str
    unit: str
    scale: float
    low: float
    high: float
    value: str  # an expression of the drive's columns
    bits: int = 16


class Maker(NamedTuple):
    """Right signals by role, and the messages."""

    right: dict[str, str]
    messages: dict[str, list[Field]]


MAKERS = {
    "german": Maker(
        {
            "pedal": "Motor_20.MO_Fahrpedalrohwert_01",
            "speed": "ESP_21.ESP_v_Signal",
            "gap": "ACC_15.ACC_Abstand_Zielobjekt_Dist",
            "brake": "ESP_05.ESP_Fahrer_bremst",
            "accel": "ESP_02.ESP_Laengsbeschl",
        },
        {
            "Motor_20": [Field("MO_Fahrpedalrohwert_01", "Unit_PerCent", 0.01, 0, 100, "pedal")],
            "Motor_21": [Field("MO_Sollpedal_virtuell", "Unit_PerCent", 0.01, 0, 100, "pedal * 0.9 + 4")],
            "ESP_21": [Field("ESP_v_Signal", "Unit_KiloMeterPerHour", 0.01, 0, 655, "speed * 3.6")],
            "Kombi_01": [Field("KBI_angez_Geschw", "Unit_KiloMeterPerHour", 0.01, 0, 325, "speed * 3.6 * 1.03")],
            "TSK_07": [Field("TSK_Wunschgeschw", "Unit_KiloMeterPerHour", 0.01, 0, 325, "speed * 0 + 130")],
            "ESP_05": [Field("ESP_Fahrer_bremst", "", 1, 0, 1, "brake", 8)],
            "ESP_02": [Field("ESP_Laengsbeschl", "Unit_MeterPerSeconSquar", 0.001, -16, 16, "accel")],
            "ACC_15": [Field("ACC_Abstand_Zielobjekt_Dist", "Unit_Meter", 0.01, 0, 300, "gap")],
            "Parkhilfe_01": [Field("PH_Abstand_Objekt_hinten", "cm", 1, 0, 65535, "gap * 0 + 150")],
        },
    ),
    # range rate of the wrong sign, a speed without unit next to wheels, a pedal of 255 steps
    "american": Maker(
        {
            "pedal": "EngineData.AccelPdlPos",
            "speed": "BrakeData.VehSpd",
            "gap": "RadarTarget.TrgtObjDist",
            "range_rate": "RadarTarget.TrgtObjRelSpd",
            "brake": "BrakeData.DrvrBrkAppl",
        },
        {
            "EngineData": [
                Field("AccelPdlPos", "", 1, 0, 255, "pedal * 2.55"),
                Field("ThrottlePos", "%", 0.1, 0, 100, "30 + 0.2 * pedal"),
            ],
            "BrakeData": [
                Field("VehSpd", "", 0.01, 0, 655, "speed * 3.6"),
                Field("DrvrBrkAppl", "", 1, 0, 1, "brake", 8),
            ],
            "WheelData": [
                Field("WhlSpdFL", "km/h", 0.01, 0, 655, "speed * 3.6 * 1.002"),
                Field("WhlSpdFR", "km/h", 0.01, 0, 655, "speed * 3.6 * 0.998"),
                Field("WhlSpdRL", "km/h", 0.01, 0, 655, "speed * 3.6"),
            ],
            "ClusterData": [Field("VehSpdDisp", "km/h", 1, 0, 255, "speed * 3.6 * 1.03 + 1")],
            "VehData2": [Field("VehSpdAlt", "km/h", 0.2, 0, 655, "speed * 3.6 * 1.03")],
            "CruiseButtons": [
                Field("SPEED_UP", "", 1, 0, 1, "brake * 0", 8),
                Field("VehSpdSetTrgt", "km/h", 0.1, 0, 255, "speed * 0 + 90"),
            ],
            "RadarTarget": [
                Field("TrgtObjDist", "m", 0.01, 0, 300, "gap"),
                Field("TrgtObjRelSpd", "m/s", 0.01, -100, 100, "-range_rate"),
            ],
            "ParkAid": [
                Field("RearObjDist", "cm", 1, 0, 65535, "gap * 0 + 120"),
                Field("FrontObjRange", "cm", 1, 0, 65535, "gap * 0 + 80"),
            ],
        },
    ),
}  # fmt: skip
DECOYS = {
    "MO_Sollpedal_virtuell", "KBI_angez_Geschw", "TSK_Wunschgeschw", "PH_Abstand_Objekt_hinten", "VehSpdDisp", "VehSpdAlt",
    "SPEED_UP", "VehSpdSetTrgt", "RearObjDist", "FrontObjRange", "ThrottlePos",
}  # fmt: skip


def write(folder: Path, maker: Maker, seed: int, bus: str = "can0") -> tuple[Path, Path]:
    """Write the DBC and a log of a simulated drive; returns both paths."""
    drive = canid.simulate(1.2, seed=seed)
    columns = {name: values[::STEP] for name, values in drive.columns.items()}
    t = columns["t"]
    dbc, payloads = ['VERSION ""', "NS_ :", "BS_:", "BU_: X"], {}
    for index, (message, fields) in enumerate(maker.messages.items()):
        identifier, start, data = 0x100 + 8 * index, 0, np.zeros((len(t), 8), np.uint8)
        dbc.append(f"BO_ {identifier} {message}: 8 X")
        for of in fields:
            physical = eval(of.value, {}, columns)
            raw = np.clip(np.round(physical / of.scale), -(2 ** (of.bits - 1)), 2**of.bits - 1).astype(
                np.int64
            )
            sign = "-" if of.low < 0 else "+"
            dbc.append(
                f" SG_ {of.name} : {start}|{of.bits if of.bits > 8 else 1}@1{sign} ({of.scale:g},0) "
                f'[{of.low:g}|{of.high:g}] "{of.unit}" X'
            )
            for byte in range(of.bits // 8):
                data[:, start // 8 + byte] = (raw >> (8 * byte)) & 0xFF
            start += of.bits
        payloads[identifier] = data
    (folder / "car.dbc").write_text("\n".join(dbc) + "\n")
    with (folder / "drive.log").open("w") as log:
        for row, time in enumerate(t):
            for identifier, data in payloads.items():
                log.write(f"({1e9 + time:.6f}) {bus} {identifier:03X}#{data[row].tobytes().hex().upper()}\n")
    return folder / "car.dbc", folder / "drive.log"
