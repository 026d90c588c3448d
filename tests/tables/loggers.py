"""A drive as the programs of loggers export it: preambles, units, blank lines, repeated headers, decimal commas."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tests.tables.platoon import Platoon


class Columns(NamedTuple):
    """A follower's columns."""

    t: np.ndarray  # (n,) s
    speed: np.ndarray  # (n,) m/s
    pedal: np.ndarray  # (n,) %
    gap: np.ndarray  # (n,) m
    rate: np.ndarray  # (n,) m/s


def columns(of: Platoon) -> Columns:
    """The second vehicle's; its pedal follows its acceleration."""
    rate = of.speed[:, 0] - of.speed[:, 1]
    return Columns(of.t, of.speed[:, 1], 20.0 + 10.0 * of.accel[:, 1], of.gap(1), rate)


def _rows(of: Columns, stamp: Callable[[float], str], speed: float, quoted: bool = False) -> list[str]:
    lines = []
    for t, v, pedal, gap, rate in zip(*of, strict=True):
        cells = [stamp(t), f"{v * speed:.5f}", f"{pedal:.4f}", f"{gap:.5f}", f"{rate:.5f}"]
        lines.append(",".join(f'"{cell}"' for cell in cells) if quoted else ",".join(cells))
    return lines


def aim(of: Columns) -> str:
    """AiM RaceStudio 3: all in quotes, blank lines before the names and before the rows."""
    head = '"Format","AIM CSV File"\n"Venue","Test"\n"Time","10:00 AM"\n"Sample Rate","10"\n"Duration","30"\n'
    head += '"Beacon Markers","10","20"\n"Segment Times","0:10.0","0:10.0"\n\n'
    head += '"Time","GPS Speed","Pedal","Gap","RangeRate"\n"s","km/h","%","m","m/s"\n\n'
    return head + "\n".join(_rows(of, lambda t: f"{t:.3f}", 3.6, quoted=True)) + "\n"


def aim_comma(of: Columns) -> str:
    """The same under a decimal comma, of three decimals that might group thousands."""
    rows = (
        [f'"{x:.3f}"'.replace(".", ",") for x in (t, v * 3.6, pedal, gap, rate)]
        for t, v, pedal, gap, rate in zip(*of, strict=True)
    )
    head = '"Format","AIM CSV File"\n"Sample Rate","10"\n\n"Time","Speed","Pedal","Gap","RangeRate"\n'
    return head + '"s","km/h","%","m","m/s"\n\n' + "\n".join(map(",".join, rows)) + "\n"


def motec(of: Columns) -> str:
    """MoTeC i2: lines of other widths, several blank ones, two more before the rows."""
    head = '"Format","MoTeC CSV File",,,"Workbook",""\n"Log Date","05/05/2025",,,"Origin Time","0.000","s"\n'
    head += '"Sample Rate","10.000","Hz",,"End Time","30","s"\n"Beacon Markers",""\n\n\n\n\n'
    head += '"Time","Ground Speed","Throttle Pedal","Gap","RangeRate"\n"s","km/h","%","m","m/s"\n\n\n'
    return head + "\n".join(_rows(of, lambda t: f"{t:.3f}", 3.6, quoted=True)) + "\n"


def racecapture(of: Columns) -> str:
    """RaceCapture: name, unit, range and rate in each heading, which is written again at each start; no fix at first."""
    head = '"Interval"|"ms"|0|0|1,"Utc"|"ms"|0|0|1,"Speed"|"MPH"|0.0|150.0|10,"Pedal"|"%"|0.0|100.0|10,'
    head += '"Gap"|"m"|0.0|250.0|10,"RangeRate"|"m/s"|-50.0|50.0|10\n'
    rows = _rows(of, lambda t: f"{402 + 1000 * t:.0f},0", 1 / 0.44704)
    half = len(rows) // 2
    return head + "\n".join(rows[:half]) + "\n" + head + "\n".join(rows[half:]) + "\n"


def racechrono(of: Columns) -> str:
    """RaceChrono 3: units and sources below the names, of which some are equal; the elapsed time begins anew."""
    head = "This file is created using RaceChrono Pro v10.1.3 ( http://racechrono.com/ ).\nFormat,3\n"
    head += 'Session title,"Test"\nCreated,04/08/2026,13:14\nNote,\n\n'
    head += "timestamp,fragment_id,elapsed_time,speed,speed,accelerator_pos,gap,range_rate\n"
    head += "unix time,,s,m/s,m/s,%,m,m/s\n,,,100: gps,calc,300: canbus,300: canbus,300: canbus\n"
    rows = []
    for k, (t, v, pedal, gap, rate) in enumerate(zip(*of, strict=True)):
        elapsed = t if 2 * k < len(of.t) else t - 0.5 * of.t[-1]
        rows.append(
            f"{1785849363.0 + t:.3f},0,{elapsed:.3f},{v:.5f},{v + 1:.5f},{pedal:.4f},{gap:.5f},{rate:.5f}"
        )
    return head + "\n".join(rows) + "\n"


def tunerstudio(of: Columns) -> str:
    """TunerStudio's .msl: two lines of text, tabs, units that are not all known, marks between the rows."""
    head = '"MS2Extra comms330NP: 2.20"\n"Capture Date: Wed Aug 05 18:57:56 BST 2026"\n'
    head += "Time\tVSS1\tSpeed\tPedal\tgap\trange_rate\tBatt V\tAFR\ns\tms-1\tkm/h\t%\tm\tm/s\tv\tAFR\n"
    rows = [
        f"{t:.3f}\t{v:.1f}\t{v * 3.6:.5f}\t{pedal:.4f}\t{gap:.5f}\t{rate:.5f}\t13.8\t14.7"
        for t, v, pedal, gap, rate in zip(*of, strict=True)
    ]
    rows.insert(50, "MARK 000 - Manual - Wed Aug 05 18:58:01 BST 2026")
    return head + "\n".join(rows) + "\n"


def labview(of: Columns) -> str:
    """LabVIEW's .lvm: two headers, decimal commas, units above the names, a column of comments that is empty."""
    head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tOne\nDate\t2026/08/05\n"
    head += "Time\t10:00:00,1234567\n***End_of_Header***\t\n\t\nChannels\t4\t\t\t\t\n"
    head += "Date\t2026/08/05\t2026/08/05\t2026/08/05\t2026/08/05\t\nY_Unit_Label\tkm/h\t%\tm\tm/s\t\n"
    head += "X_Dimension\tTime\tTime\tTime\tTime\t\nDelta_X\t0,1\t0,1\t0,1\t0,1\t\n***End_of_Header***\t\t\t\t\t\n"
    head += "X_Value\tSpeed\tPedal\tgap\trange_rate\tComment\n"
    rows = [
        f"{t:.3f}\t{v * 3.6:.5f}\t{pedal:.4f}\t{gap:.5f}\t{rate:.5f}\t".replace(".", ",")
        for t, v, pedal, gap, rate in zip(*of, strict=True)
    ]
    return head + "\n".join(rows) + "\n"


def torque(of: Columns) -> str:
    """Torque Pro's: units in a second pair of brackets, the header again between the rows, "-" for nothing."""
    head = "Device Time, Longitude, Latitude,GPS Speed (Meters/second), G(x),Accelerator PedalPosition D(%),"
    head += "Speed (OBD)(km/h),gap(m),range_rate(m/s)\n"
    rows = []
    for k, (t, v, pedal, gap, rate) in enumerate(zip(*of, strict=True)):
        shown = "-" if k == 30 else f"{pedal:.4f}"
        stamp = np.datetime64("2026-08-05T18:57:56.000") + np.timedelta64(round(1000 * t), "ms")
        rows.append(f"{stamp},-82.15,41.42,{v:.3f},-0.16,{shown},{v * 3.6:.5f},{gap:.5f},{rate:.5f}")
    half = len(rows) // 2
    return head + "\n".join(rows[:half]) + "\n" + head + "\n".join(rows[half:]) + "\n"


EXPORTS: dict[str, tuple[str, Callable[[Columns], str]]] = {
    "AiM RaceStudio": (".csv", aim),
    "AiM, decimal commas": (".csv", aim_comma),
    "MoTeC i2": (".csv", motec),
    "RaceCapture": (".csv", racecapture),
    "RaceChrono": (".csv", racechrono),
    "TunerStudio": (".msl", tunerstudio),
    "LabVIEW": (".lvm", labview),
    "Torque Pro": (".csv", torque),
}
