"""Tables as programs write them that are not in the other files: each is read as the drive that it holds, or named."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.column_map import ColumnMap, read_map
from canid.analysis.tables.table import open_table, trace_of
from canid.io.logs.log import open_log
from canid.models.pipeline import pipeline
from canid.values.errors import ConfigError, LogError

N = 900
K = np.arange(N)
T = 0.1 * K
SPEED = 20.0 + 3.0 * np.sin(T / 7.0)
PEDAL = 20.0 + 6.0 * np.sin(T / 5.0)
GAP = 30.0 + 4.0 * np.cos(T / 9.0)
RATE = -4.0 / 9.0 * np.sin(T / 9.0)
ROLES = {"speed": SPEED, "pedal": PEDAL, "gap": GAP, "range_rate": RATE}
START = datetime(2026, 8, 5, 18, 57, 3, tzinfo=UTC)


def _text(
    names: str,
    stamp: Callable[[int], str] = lambda k: f"{0.1 * k:.1f}",
    mark: str = ",",
    factors: tuple[float, ...] = (3.6, 1.0, 1.0, 1.0),
) -> str:
    columns = [x * factor for x, factor in zip(ROLES.values(), factors, strict=True)]
    rows = (mark.join([stamp(k), *(f"{x[k]:.6f}" for x in columns)]) for k in range(N))
    return names + "\n" + "\n".join(rows) + "\n"


def _written(form: str) -> Callable[[int], str]:
    return lambda k: (START + timedelta(milliseconds=100 * k)).strftime(form)


def _check(path: Path) -> None:
    table = open_table(path)
    assert table.damaged == 0
    assert table.log.span[1] - table.log.span[0] == pytest.approx(T[-1], abs=1e-3)
    trace = trace_of(table, pipeline.DT)
    for role, x in ROLES.items():
        values = trace.signals.get(role, trace.output)
        assert np.nanmedian(values) == pytest.approx(np.median(x), rel=0.02, abs=0.1), role


USUAL = "time,speed [km/h],pedal [%],gap [m],range_rate [m/s]"
LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t4\nY_Unit_Label\tkm/h\t%\tm\tm/s\n"
    "X0\t0.0\t0.0\t0.0\t0.0\n***End_of_Header***\t\t\t\t\nX_Value\tSpeed\tPedal\tGap\tRangeRate"
)
HP_TUNERS = (
    "HP Tuners CSV Log File\nVersion: 1.0\n\n[Channel Information]\n0,13,49,7101,7102\n"
    "Offset,Vehicle Speed (SAE),Accelerator Position D (SAE),Gap,Range Rate\ns,km/h,%,m,m/s\n\n[Channel Data]"
)
DIALECTS = {
    "unit behind a slash": _text("Time / s,Speed / km/h,Pedal / %,Gap / m,RangeRate / m/s"),
    "unit in words": _text("time in s,speed in km/h,pedal in %,gap in m,range rate in m/s"),
    "unit behind a comma": _text("time, s;speed, km/h;pedal, %;gap, m;range rate, m/s", mark=";"),
    "wide brackets": _text("time（s）,speed（km/h）,pedal（％）,gap（m）,range_rate（m/s）"),
    "powers": _text("time [s],speed [km·h⁻¹],pedal [%],gap [m],range_rate [m s^-1]"),
    "yards": _text(
        "time [s],speed [mi/h],pedal [-],gap [yd],range_rate [m*s**-1]",
        factors=(1 / 0.44704, 0.01, 1 / 0.9144, 1.0),
    ),
    "Japanese": _text("時間[s],車速[km/h],アクセル開度[%],車間距離[m],相対速度[m/s]"),
    "Chinese": _text("时间(s),车速(km/h),油门踏板开度(%),车间距(m),相对速度(m/s)"),
    "Dutch": _text("tijd (s),snelheid (km/h),gaspedaal (%),afstand (m),relatieve snelheid (m/s)"),
    "PlotJuggler": _text("__time,/can/speed/data [km/h],/can/pedal/data,/radar/gap/data,/radar/range_rate/data"),
    "dSPACE": _text(f"Time [s],{','.join(f'Model Root/{x}' for x in ('Speed [km/h]', 'Pedal', 'Gap', 'RangeRate'))}"),
    "RaceChrono 2": _text(
        "Time (s),Speed (km/h) *can,Accelerator position (%) *obd,Gap (m) *can,Relative speed (m/s) *can"
    ),
    "MoTeC pedal": _text("Time,Ground Speed,Accel Pedal Pos,Gap,Range Rate\ns,km/h,%,m,m/s"),
    "HP Tuners": HP_TUNERS + _text(""),
    "INCA": _text("time\tv\tApp\tgap\tv_rel\ns\tkm/h\t%\tm\tm/s\nf8\tf8\tf8\tf8\tf8", mark="\t"),
    "labelled units": _text("Units,s,km/h,%,m,m/s\nTime,Speed,Pedal,Gap,RangeRate"),
    "LabVIEW": _text(LVM, mark="\t"),
    "pandas index": _text(USUAL.removeprefix("time"), _written("%Y-%m-%d %H:%M:%S.%f")),
    "pandas timedelta": _text(USUAL, lambda k: f"0 days 00:{k // 600:02d}:{k / 10 % 60:09.6f}"),
    "ctime": _text(USUAL, _written("%a %b %d %H:%M:%S.%f %Y")),
    "zone by name": _text(USUAL, _written("%Y-%m-%d %H:%M:%S.%f CEST")),
    "Japanese date": _text(USUAL, _written("%Y年%m月%d日 %H:%M:%S.%f")),
    "ms behind a colon": _text(USUAL, lambda k: f"18:{57 + k // 600}:{k // 10 % 60:02d}:{100 * (k % 10):03d}"),
    "µs since the start": _text(USUAL, lambda k: str(100_000 * k)),
    "µs by the name": _text(USUAL.replace("time", "time_µs"), lambda k: str(100_000 * k)),
    "FILETIME": _text(USUAL, lambda k: str(134_304_298_230_000_000 + 1_000_000 * k)),
    ".NET": _text(USUAL, lambda k: str(639_215_610_230_000_000 + 1_000_000 * k)),
    "24 bits": _text(USUAL.replace("time", "time_ms"), lambda k: str((2**24 - 30_000 + 100 * k) % 2**24)),
    "17 digits": _text(USUAL, lambda k: (START + timedelta(milliseconds=100 * k)).strftime("%Y%m%d%H%M%S%f")[:17]),
    "ordinal date": _text(USUAL, _written("%Y-%jT%H:%M:%S.%f")),
    "hundredths behind a colon": _text(USUAL, lambda k: f"18:{57 + k // 600}:{k // 10 % 60:02d}:{10 * (k % 10):02d}"),
    "24 bits of 10 µs": _text(USUAL.replace("time", "time [10us]"), lambda k: str((2**24 - 3_000_000 + 10_000 * k) % 2**24)),
    "32 bits of 0.1 µs": _text(USUAL.replace("time", "t [100 ns]"), lambda k: str((2**32 - 10**8 + 10**6 * k) % 2**32)),
    "spaces in thousands": _text(USUAL.replace("time", "time [ms]"), lambda k: f"{100 * k:,}".replace(",", " ")),
    "micros": _text(USUAL.replace("time", "micros"), lambda k: str((2**32 - 30_000_000 + 100_000 * k) % 2**32)),
    "dist and dv": _text("t,speed [kmph],pedal,dist,dv"),
    "distance and its difference": _text("time,speed_kmph,pedal,distance [m],speed difference"),
    "units in words": _text("time (seconds),speed (kilometers per hour),pedal,gap (metres),range rate (meters per second)"),
    "Polish": _text("Czas [s],Prędkość [km/h],Pedał gazu [%],Odległość [m],Prędkość względna [m/s]"),
    "Czech": _text("Čas [s],Rychlost [km/h],Plynový pedál [%],Vzdálenost [m],Relativní rychlost [m/s]"),
    "Swedish": _text("Tid [s],Hastighet [km/h],Gaspedal [%],Avstånd [m],Relativ hastighet [m/s]"),
    "Russian": _text("Время (с),Скорость (км/ч),Педаль газа (%),Дистанция (м),Относительная скорость (м/с)"),
    "Korean": _text("시간(s),차속(km/h),가속페달(%),차간거리(m),상대속도(m/s)"),
    "Finnish": _text("aika,ajoneuvon nopeus [km/h],kaasupoljin [%],etäisyys edellä ajavaan [m],suhteellinen nopeus [m/s]"),
    "Hungarian": _text("idő [s],sebesség [km/h],gázpedál [%],követési távolság [m],relatív sebesség [m/s]"),
    "Turkish": _text("zaman (s),araç hızı (km/sa),gaz pedalı (%),öndeki araca mesafe (m),bağıl hız (m/s)"),
    "Romanian": _text("timp [s],viteza [km/h],pedala acceleratie [%],distanta [m],viteza relativa [m/s]"),
    "Greek": _text("χρόνος [s],ταχύτητα [km/h],πεντάλ γκαζιού [%],απόσταση [m],σχετική ταχύτητα [m/s]"),
    "Norwegian": _text("tid [s],hastighet [km/t],gasspedal [%],avstand [m],relativ hastighet [m/s]"),
    "Japanese words": _text("時刻[s],自車速度[km/h],アクセルペダル開度[%],先行車距離[m],相対速度[m/s]"),
    "Korean words": _text("시간[s],차량 속도[km/h],가속페달[%],앞차 거리[m],상대 속도[m/s]"),
    "Chinese words": _text("时间(s),本车速度(km/h),加速踏板开度(%),与前车距离(m),相对速度(m/s)"),
    "units behind commas": _text(
        "Время, с;Скорость, км/ч;Педаль газа, %;Дистанция, м;Относительная скорость, м/с", mark=";"
    ).replace(".", ","),
    "zone behind a blank": _text(USUAL, _written("%Y-%m-%d %H:%M:%S.%f +0200")),
    "Hungarian date": _text(USUAL, _written("%Y. %m. %d. %H:%M:%S.%f")),
    "Japanese clock": _text(USUAL, _written("%Y年%m月%d日 %H時%M分%S.%f秒")),
    "minutes, seconds, ms": _text(USUAL, lambda k: f"{k // 600:02d}:{k // 10 % 60:02d}:{100 * (k % 10):03d}"),
    "serial dates": _text(USUAL.replace("time", "Date"), lambda k: f"{46090.5 + k / 864000:.9f}"),
    "local time": _text(USUAL.replace("time", "local_time"), _written("%Y-%m-%d %H:%M:%S.%f")),
}  # fmt: skip


@pytest.mark.long("many or long tables")
@pytest.mark.parametrize("text", DIALECTS.values(), ids=DIALECTS)
def test_a_dialect_is_the_drive(text: str, tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(text, encoding="utf-8")
    _check(path)


@pytest.mark.parametrize(
    ("of", "encoding"),
    [
        ("Japanese", "shift_jis"),
        ("Chinese", "gb18030"),
        ("Korean", "euc_kr"),
        ("Russian", "cp1251"),
        ("Greek", "cp1253"),
        ("Polish", "cp1250"),
        ("Turkish", "cp1254"),
    ],
)
def test_encodings_of_one_region_are_recognised(of: str, encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(DIALECTS[of], encoding=encoding)
    _check(path)


def test_a_word_that_is_not_known_is_not_left_out(tmp_path: Path) -> None:
    """The highest speed is no speed, and the lead's object is not the own car."""
    path = tmp_path / "drive.csv"
    path.write_text(_text("time,最高speed,pedal,gap,range_rate"), encoding="utf-8")
    with pytest.raises(ConfigError, match="speed is missing"):
        open_table(path)
    path.write_text(_text("time,obj/speed,obj/gap,obj/range_rate,pedal"), encoding="utf-8")
    with pytest.raises(ConfigError, match="missing"):
        open_table(path)


def test_of_equal_headings_each_can_be_named(tmp_path: Path) -> None:
    rows = "".join(
        f"{t:.1f},{2 * v:.4f},{v:.4f},20,{g:.4f},0\n" for t, v, g in zip(T, SPEED, GAP, strict=True)
    )
    path = tmp_path / "drive.csv"
    path.write_text("time,speed,speed,pedal,gap,range_rate\n" + rows, encoding="utf-8")
    with pytest.raises(ConfigError, match='speed = "speed #1"'):
        open_table(path)
    with pytest.raises(ConfigError, match="several columns are called speed"):
        open_table(path, _map(tmp_path, "speed"))
    for heading, factor in (("speed #1", 2.0), ("speed #2", 1.0)):
        trace = trace_of(open_table(path, _map(tmp_path, heading)), pipeline.DT)
        assert np.nanmedian(trace.signals["speed"]) == pytest.approx(factor * np.median(SPEED), abs=0.5)


def _map(folder: Path, speed: str) -> ColumnMap:
    path = folder / "map.toml"
    same = "".join(f'{role} = "{role}"\n' for role in ("time", "pedal", "gap", "range_rate"))
    path.write_text(f'name = "mine"\n[columns]\n{same}speed = "{speed}"\n', encoding="utf-8")
    return read_map(path)


def test_a_table_of_one_value_a_row_is_named(tmp_path: Path) -> None:
    """Car Scanner's and those of data bases of time series."""
    path = tmp_path / "drive.csv"
    path.write_text('"SECONDS";"PID";"VALUE";"UNITS"\n' + '"1.0";"Vehicle speed";"20";"km/h"\n' * 9, "utf-8")
    with pytest.raises(ConfigError, match="make a column of each signal"):
        open_table(path)


@pytest.mark.parametrize(("rest", "used"), [(0.0, True), (0.2, False)])
def test_a_brake_pressure_that_never_is_0_is_no_switch(rest: float, used: bool, tmp_path: Path) -> None:
    """It would be pressed all the time, and the pedal's use with it a fault of the pedal."""
    path = tmp_path / "drive.csv"
    lines = _text(USUAL).splitlines()
    pressure = np.where(np.sin(T / 5.0) < -0.9, 3.0 + np.sin(T), rest)
    rows = [f"{line},{x:.3f}" for line, x in zip(lines[1:], pressure, strict=True)]
    path.write_text("\n".join([f"{lines[0]},brake [bar]", *rows]), encoding="utf-8")
    table = open_table(path)
    assert ("brake" in table.vehicle.roles) == used
    assert any(note.startswith(f"{path}: brake [bar]: not used: 0.2 to ") for note in table.notes) != used


def test_two_times_of_one_name_are_not_chosen_from(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    lines = _text(USUAL).splitlines()
    path.write_text("\n".join([f"time,{lines[0]}", *(f"{k},{x}" for k, x in enumerate(lines[1:]))]), "utf-8")
    with pytest.raises(ConfigError, match="time could be time #1, time #2"):
        open_table(path)


@pytest.mark.parametrize("wrong", ["0", "1e308", "99999999"])
def test_a_time_far_from_all_others_is_damaged(wrong: str, tmp_path: Path) -> None:
    """And the drive is not as long as to it."""
    path = tmp_path / "drive.csv"
    path.write_text(_text(USUAL, lambda k: wrong if k in (300, 500) else f"{100 + 0.1 * k:.1f}"), "utf-8")
    table = open_table(path)
    assert (table.damaged, table.sorted) == (2, "")
    assert table.log.span[1] - table.log.span[0] == pytest.approx(T[-1])


def test_a_row_that_came_late_is_none_of_these(tmp_path: Path) -> None:
    lines = _text(USUAL).splitlines()
    late = [*lines[:100], *lines[101:700], lines[100], *lines[700:]]
    path = tmp_path / "drive.csv"
    path.write_text("\n".join(late), encoding="utf-8")
    table = open_table(path)
    assert table.damaged == 0
    assert "1 of 900 rows were not in the order of time" in table.sorted


def test_a_heading_of_thousands_of_letters_has_no_role(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(_text(USUAL.replace("speed", f"speed {'(' * 5000}")), encoding="utf-8")
    with pytest.raises(ConfigError, match="speed is missing"):
        open_table(path)


def test_a_pedal_of_an_unknown_name_is_mentioned(tmp_path: Path) -> None:
    """It is not left out silently for the slope of the speed."""
    path = tmp_path / "drive.csv"
    path.write_text(_text(USUAL.replace("pedal", "pedal filtered")), encoding="utf-8")
    assert any("pedal filtered" in note and "not used" in note for note in open_table(path).notes)


def test_lines_that_end_with_a_return_alone_are_named(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_bytes(_text(USUAL).replace("\n", "\r").encode())
    with pytest.raises(LogError, match="carriage return"):
        open_table(path)


@pytest.mark.parametrize(
    ("begin", "says"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n", "git lfs pull"),
        (b"<!DOCTYPE html>\n<html><body>404</body></html>\n", "page of a web server"),
        (b"%PDF-1.4\n1 0 obj\n<< /Type /Catalog >>\n", "is a PDF"),
        (b"\xfd7zXZ\x00\x00\x04", "compressed by xz: unpack it"),
        (b"\x28\xb5\x2f\xfd\x24", "compressed by zstd: unpack it"),
        (b"BZh91AY&SY", "compressed by bzip2: unpack it"),
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "is a MATLAB file"),
        (b"\x89HDF\r\n\x1a\n\0\0", "is an HDF5 file"),
        (b"7z\xbc\xaf\x27\x1c\x00\x04", "7-Zip archive: unpack it"),
    ],
)
@pytest.mark.parametrize("suffix", [".csv", ".asc", ".blf", ".parquet"])
def test_what_a_download_left_is_named(begin: bytes, says: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"drive{suffix}"
    path.write_bytes(begin * 40)
    with pytest.raises(LogError, match=says):
        open_table(path) if suffix in (".csv", ".parquet") else open_log(path)


def test_a_zip_archive_is_named(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("drive.csv", _text(USUAL))
    with pytest.raises(LogError, match="ZIP"):
        open_table(path)


def test_a_difference_of_speeds_has_the_sign_of_the_gaps_change(tmp_path: Path) -> None:
    """Under `dv` people write both; without a gap, or where it shows neither, the column is not used."""
    path = tmp_path / "drive.csv"
    path.write_text(_text("time,speed [km/h],pedal,gap,dv", factors=(3.6, 1.0, 1.0, -1.0)))
    _check(path)
    noise = np.random.default_rng(3).standard_normal(N)
    lines = _text("time,speed [km/h],pedal,gap,dv").splitlines()
    path.write_text(
        "\n".join(
            [
                lines[0],
                *(f"{line.rpartition(',')[0]},{x:.3f}" for line, x in zip(lines[1:], noise, strict=True)),
            ]
        )
    )
    with pytest.raises(ConfigError, match="range_rate is missing"):
        open_table(path)


def test_the_way_that_was_driven_is_no_gap(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    rows = [
        f"{t:.1f},{v:.3f},20,{way:.2f},0.1"
        for t, v, way in zip(T, SPEED, np.cumsum(0.1 * SPEED), strict=True)
    ]
    path.write_text("\n".join(["time,speed,pedal,distance,range_rate", *rows]))
    with pytest.raises(ConfigError, match="gap is missing"):
        open_table(path)


def test_ms_of_whole_seconds_under_the_name_of_the_time(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    names = USUAL.replace("time,", "time_s,time_ms,")
    path.write_text(_text(names, lambda k: f"{100 + k // 10},{100 * (k % 10)}"))
    _check(path)


def test_ticks_without_a_unit_are_found_by_the_leads_speed(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    rows = [f"{10_000 * k},{SPEED[k]:.4f},20,{GAP[k]:.4f},{SPEED[k] + RATE[k]:.4f}" for k in range(N)]
    path.write_text("\n".join(["time,speed [m/s],pedal,gap,lead_speed [m/s]", *rows]))
    with pytest.raises(ConfigError, match=r"state the units of time.*10us"):
        open_table(path)


@pytest.mark.parametrize(
    "name", ["Geschwindigkeitsdifferenz", "Differenzgeschwindigkeit", "sebességkülönbség", "delta v"]
)
def test_a_difference_of_speeds_has_the_sign_that_the_gap_shows(name: str, tmp_path: Path) -> None:
    """It may be the lead's speed minus the own one, or the reverse."""
    path = tmp_path / "drive.csv"
    path.write_text(_text(USUAL.replace("range_rate", name), factors=(3.6, 1.0, 1.0, -1.0)), encoding="utf-8")
    _check(path)
    trace = trace_of(open_table(path), pipeline.DT)
    assert np.corrcoef(trace.signals["range_rate"], np.interp(trace.t, T, RATE))[0, 1] > 0.9
