"""Logs of public reports, where they are next to the repository: what their README says is what canid reads."""

from __future__ import annotations

import datetime
import re
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.io.logs.log import Log
from canid.values.errors import CanidError, ConfigError
from canid.values.types import Flag, Frame
from tests.fixtures import measured_logs
from tests.fixtures.measured_logs import MISSING

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


@pytest.fixture
def reports(measured: Path) -> Path:
    """The folder of reports; skips where there is none."""
    folder = measured / "reports"
    if not folder.is_dir():
        pytest.skip(MISSING)
    return folder


def opened(path: Path, zone: str = "UTC") -> tuple[Log, list[Frame]]:
    """The log, and its frames."""
    log = open_log(path, time_zone=zone)
    return log, list(log)


def zero(log: Log, own: float) -> str:
    """The time that the log counts from, where its first frame has the time `own`, s."""
    assert log.start_ns is not None
    at = _EPOCH + datetime.timedelta(microseconds=log.start_ns // 1000) - datetime.timedelta(seconds=own)
    return f"{at:%Y-%m-%d %H:%M:%S.%f}"[:-3]


def test_dates_of_all_languages(reports: Path) -> None:
    files = measured_logs.files("reports/03-asc-dates/*.asc")
    assert len(files) > 20
    for path in files:
        log, frames = opened(path)
        first = float(re.findall(rb"(?m)^\s*(\d+\.\d+) +\d", path.read_bytes())[0])
        hour = "00" if path.name.startswith("ampm12") else "14"
        month = "10"
        for name, other in (("de3", "03"), ("de4", "03"), ("fr2", "08")):
            month = other if path.name.startswith(name) else month
        ms = "000" if path.name.startswith("nofrac") else "250"
        assert frames, path.name
        assert zero(log, first) == f"2025-{month}-15 {hour}:03:09.{ms}", path.name


def test_fd_lines_of_decimal_logs(reports: Path) -> None:
    _, frames = opened(reports / "09-asc-dec-canfd" / "digits.asc")
    assert [(frame.id, frame.data.hex()) for frame in frames] == [(0x102, "2000000000140080")] * 2


@pytest.mark.parametrize("name", ["dec", "hex", "fd"])
def test_error_frames_with_data(reports: Path, name: str) -> None:
    log, frames = opened(reports / "10-asc-error-data" / f"{name}.asc")
    assert [bool(frame.flags & Flag.ERROR) for frame in frames] == [False, True]
    assert log.damage is None


def test_error_frames_of_blf(reports: Path) -> None:
    """One data frame, and error frames of the types 2, 73 and 104."""
    _, frames = opened(reports / "13-blf-others" / "errors.blf")
    assert sorted(bool(frame.flags & Flag.ERROR) for frame in frames) == [False, True, True, True]


def test_joined_logs(reports: Path) -> None:
    for name in ("17-joined/two.asc", "17-joined/two.trc"):
        log, frames = opened(reports / name)
        assert (len(frames), round(frames[-1].t, 6), len(log.remarks)) == (20, 300.9, 1), name
    log, frames = opened(reports / "14-blf-appended" / "cat.blf")
    assert (len(frames), log.damage) == (20, None)
    assert any("a further log begins" in remark for remark in log.remarks)


def test_base_lines(reports: Path) -> None:
    folder = reports / "25-asc-base-line"
    for name in ("dec.asc", "dec2.asc", "dec5.asc"):
        log, frames = opened(folder / name)
        assert (frames[0].id, frames[0].data[:2].hex(), log.damage) == (0x122, "160c", None), name
    log, frames = opened(folder / "hex.asc")
    assert (len(frames), log.damage) == (3, None)
    _, frames = opened(folder / "rel.asc")
    assert [frame.t for frame in frames] == [0.0, 0.5, 1.0]
    log, _ = opened(folder / "date1.asc")
    assert zero(log, 0.1) == "2024-03-28 11:08:34.000"


def test_local_time(reports: Path) -> None:
    """The machine in Shanghai: both at 05:00 UTC, where the zone is named; else canid says that it is not known."""
    starts = set()
    for name in ("canoe.asc", "canoe.blf"):
        log, _ = opened(reports / "27-zone" / name, "Asia/Shanghai")
        starts.add(zero(log, 0.1))
    assert starts == {"2025-03-03 05:00:00.000"}


def test_other_dialects(reports: Path) -> None:
    folder = reports / "29-more-dialects"
    for name, at in (("juce_pm", "14:30:07"), ("juce_am", "00:30:07"), ("glued_PM", "14:30:07")):
        path = folder / f"{name}.asc"
        if path.exists():
            log, _ = opened(path)
            assert zero(log, 0.1) == f"2025-03-03 {at}.000"
    log, frames = opened(folder / "esp.trc")
    assert ([frame.id for frame in frames], log.damage) == ([0x123, 0x123, 0x12], None)
    assert [bool(frame.flags & Flag.EXTENDED) for frame in frames] == [False, True, False]
    log, frames = opened(folder / "start0.trc")
    assert log.start_ns is None
    assert frames[1].t == 0.001
    log, frames = opened(folder / "epoch.trc")
    assert (len(frames), log.damage) == (1, None)


@pytest.mark.parametrize("suffix", [".asc", ".blf"])
def test_transmit_requests(reports: Path, suffix: str) -> None:
    log, frames = opened(reports / "34-blf-txrq" / f"txrq{suffix}")
    assert (len(frames), log.other_kinds["transmit requests"]) == (15, 10)


def test_no_log_of_these_formats_is_refused_but_what_is_none(reports: Path) -> None:
    """In each folder of .asc, .trc and .blf something is read, or said to be damaged."""
    for folder in ("03-asc-dates", "04-asc-relative", "13-blf-others", "14-blf-appended", "29-more-dialects"):
        for path in measured_logs.files(f"reports/{folder}/*"):
            if path.suffix not in (".asc", ".trc", ".blf"):
                continue
            try:
                log, frames = opened(path)
            except CanidError as error:
                pytest.fail(f"{path.name}: {error}")
            assert frames or log.damage, path.name


def test_tables_are_no_damaged_logs(reports: Path) -> None:
    """Verbs that need frames say what a table is; every other .csv of the reports is a log, or of an unknown form."""
    tables = measured_logs.files("reports/22-*/*.csv", "reports/23-*/*.csv", "reports/28-*/*.csv")
    assert len(tables) > 15
    for path in tables:
        with pytest.raises(ConfigError, match="is a table of named columns"):
            open_log(path)
