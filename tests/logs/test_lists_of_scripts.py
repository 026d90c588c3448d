"""Lists of frames as scripts print them: columns that no header names, ids with Linux's flag, bytes as Python shows them."""

from __future__ import annotations

import base64
import random
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.io.logs.log import Log
from canid.values.errors import ConfigError
from canid.values.types import Flag
from tests.logs.test_frame_tables import Sent, drawn

Row = Callable[[Sent, int], list[str]]


def _read(path: Path, head: str, row: Row, frames: list[Sent]) -> Log:
    rows = [",".join(row(frame, k)) for k, frame in enumerate(frames)]
    path.write_text("\n".join([head, *rows] if head else rows) + "\n")
    return open_log(path)


def _same(log: Log, frames: list[Sent], *, buses: bool = False, ways: bool = False) -> None:
    found = list(log)
    assert (len(found), log.damaged) == (len(frames), 0)
    for frame, sent in zip(found, frames, strict=True):
        assert round(frame.t * 1e6) == sent.us - frames[0].us
        assert (frame.id, frame.data) == (sent.id, sent.data)
        assert bool(Flag.EXTENDED & frame.flags) == sent.extended
        assert frame.bus == (sent.bus if buses else 0)
        assert bool(Flag.TX & frame.flags) == (ways and sent.tx)


def _id(sent: Sent) -> str:
    return f"{sent.id:08X}" if sent.extended else f"{sent.id:03X}"


def _hex(sent: Sent, mark: str = "") -> str:
    return mark.join(f"{octet:02X}" for octet in sent.data)


def _time(sent: Sent) -> str:
    return f"{sent.us / 1e6:.6f}"


WITHOUT_A_HEADER: dict[str, Row] = {
    "a channel": lambda x, _: [_time(x), str(x.bus), _id(x), str(len(x.data)), _hex(x, ",")],
    "joined bytes": lambda x, _: [_time(x), "0x" + _id(x), str(len(x.data)), _hex(x)],
    "a digit of 29 bits": lambda x, _: [
        _time(x),
        "0x" + _id(x),
        str(int(x.extended)),
        str(len(x.data)),
        _hex(x, " "),
    ],
    "numbered rows": lambda x, k: [str(k), _time(x), "0x" + _id(x), str(len(x.data)), _hex(x, ",")],
}


@pytest.mark.parametrize("row", WITHOUT_A_HEADER.values(), ids=WITHOUT_A_HEADER)
def test_a_list_without_a_header(row: Row, tmp_path: Path) -> None:
    frames = [x for x in drawn(random.Random(4), buses=2) if x.data]
    _same(_read(tmp_path / "x.csv", "", row, frames), frames, buses=row is WITHOUT_A_HEADER["a channel"])


def test_decimal_numbers_without_a_header_are_no_damage(tmp_path: Path) -> None:
    """What they are is not known; with a header they are read."""
    frames = [x for x in drawn(random.Random(4)) if x.data]

    def row(x: Sent, _: int) -> list[str]:
        return [_time(x), str(x.id), str(len(x.data)), *map(str, x.data)]

    with pytest.raises(ConfigError, match="no line names the columns"):
        _read(tmp_path / "x.csv", "", row, frames)
    _same(_read(tmp_path / "x.csv", "Time (s),ID (dec),DLC,Data (dec)", row, frames), frames)


WITH_A_HEADER: dict[str, tuple[str, Row]] = {
    "Linux's flag of 29 bits": (
        "time (s),can_id,dlc,data",
        lambda x, _: [_time(x), f"0x{x.id | x.extended << 31:08X}", str(len(x.data)), _hex(x, " ")],
    ),
    "bytes of Python": (
        "time (s),id (hex),data",
        lambda x, _: [_time(x), _id(x), '"' + repr(x.data).replace('"', '""') + '"'],
    ),
    "counts in µs": ("micros,id (hex),dlc,data", lambda x, _: [str(x.us), _id(x), str(len(x.data)), _hex(x)]),
    "0x and padding": (
        "Time (s),ID,DLC,b0,b1,b2,b3,b4,b5,b6,b7",
        lambda x, _: [_time(x), f"0x{x.id:X}", str(len(x.data)), *(f"0x{o:X}" for o in x.data.ljust(8, b"\0"))],
    ),
    "three digits of flags": (  # as python-can's rows without a header have them
        "time (s),id,ext,fdf,brs,dlc,data",
        lambda x, _: [_time(x), f"0x{x.id:X}", str(int(x.extended)), "0", "0", str(len(x.data)), _hex(x, " ")],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("head", "row"), WITH_A_HEADER.values(), ids=WITH_A_HEADER)
def test_a_list_with_a_header(head: str, row: Row, tmp_path: Path) -> None:
    frames = [x for x in drawn(random.Random(5)) if x.data]
    _same(_read(tmp_path / "x.csv", head, row, frames), frames)


def test_directions_and_channels_under_other_words(tmp_path: Path) -> None:
    frames = drawn(random.Random(6), buses=2)

    def row(x: Sent, _: int) -> list[str]:
        return [
            _time(x),
            str(x.bus + 1),
            "0x" + _id(x),
            str(len(x.data)),
            _hex(x, " "),
            "Tx" if x.tx else "Rx",
        ]

    for head in (
        "Zeit [s],Kanal,Kennung,Länge,Daten,Richtung",
        "Temps (s),Canal,Identifiant,DLC,Données,Type",
    ):
        _same(_read(tmp_path / "x.csv", head, row, frames), frames, buses=True, ways=True)


def test_columns_that_may_say_the_bus_are_named_where_they_are_not_read(tmp_path: Path) -> None:
    frames = drawn(random.Random(6), buses=2)
    log = _read(
        tmp_path / "x.csv", "Time (s),Wire,ID (hex),Data", lambda x, _: [_time(x), str(x.bus), _id(x), _hex(x)], frames
    )  # fmt: skip
    assert any("'Wire'" in remark for remark in log.remarks)


def test_python_cans_list_with_numbered_rows(tmp_path: Path) -> None:
    """As pandas writes it; a number before a row of a list without them is damage."""
    frames = drawn(random.Random(7))
    head = "timestamp,arbitration_id,extended,remote,error,dlc,data"

    def row(x: Sent, k: int) -> list[str]:
        packed = base64.b64encode(x.data).decode()
        return [str(k), _time(x), f"0x{x.id:x}", str(int(x.extended)), "0", "0", str(len(x.data)), packed]

    _same(_read(tmp_path / "x.csv", f",{head}", row, frames), frames)
    log = _read(tmp_path / "x.csv", head, lambda x, k: row(x, k)[k != 9 :], frames)
    assert (len(list(log)), log.damaged) == (len(frames) - 1, 1)


@pytest.mark.parametrize("prefix", ["INFO:root:", "2026-03-09 14:30:07,250 INFO "])
def test_printed_frames_behind_what_a_logging_library_writes(prefix: str, tmp_path: Path) -> None:
    frames = [x for x in drawn(random.Random(8)) if x.data]
    path = tmp_path / "x.log"
    path.write_text(
        "".join(
            f"{prefix}Timestamp: {_time(x)}    ID: {_id(x).lower()}    {'X' if x.extended else 'S'} Rx"
            f"    DL: {len(x.data)}    {_hex(x, ' ').lower()}\n"
            for x in frames
        )
    )
    _same(open_log(path), frames)


START = datetime(2026, 3, 14, 14, 22, 33, tzinfo=UTC)


def _stamp(form: str) -> Callable[[Sent], str]:
    return lambda x: (START + timedelta(microseconds=x.us)).strftime(form)


@pytest.mark.parametrize(
    ("head", "form"),
    [
        ("Date/Time", "%m/%d/%Y %H:%M:%S.%f"),
        ("Timestamp", "%m/%d/%Y %I:%M:%S.%f %p"),
        ("Time", "%d/%m/%Y %H:%M:%S.%f"),
        ("Date,Time", "%m/%d/%Y,%I:%M:%S.%f %p"),
    ],
)
def test_dates_whose_month_may_be_first(head: str, form: str, tmp_path: Path) -> None:
    frames = [x for x in drawn(random.Random(4)) if x.data]

    def row(x: Sent, _: int) -> list[str]:
        return [_stamp(form)(x), "0x" + _id(x), str(len(x.data)), _hex(x, " ")]

    log = _read(tmp_path / "x.csv", f"{head},ID,DLC,Data", row, frames)
    _same(log, frames)
    assert (log.start_ns or 0) // 10**9 == int(START.timestamp()) + frames[0].us // 10**6


def test_dates_of_which_none_shows_the_month_are_refused(tmp_path: Path) -> None:
    frames = [x for x in drawn(random.Random(4)) if x.data]

    def row(x: Sent, _: int) -> list[str]:
        return [f"03/04/2026 10:00:{x.us / 1e6:09.6f}", "0x" + _id(x), str(len(x.data)), _hex(x, " ")]

    with pytest.raises(ConfigError, match="day or month may be first"):
        _read(tmp_path / "x.csv", "Time,ID,DLC,Data", row, frames)


def test_bytes_of_a_fixed_array(tmp_path: Path) -> None:
    """ROS messages have eight bytes, whatever the length is; one that has bytes behind its length is damaged."""
    frames = [x for x in drawn(random.Random(4)) if x.data]

    def row(x: Sent, _: int) -> list[str]:
        octets = ",".join(map(str, x.data.ljust(8, b"\0")))
        return [_time(x), "0x" + _id(x), str(len(x.data)), f'"[{octets}]"']

    log = _read(tmp_path / "x.csv", "time [s],id,dlc,data", row, frames)
    _same(log, frames)
    text = (tmp_path / "x.csv").read_text().splitlines()
    k = next(k for k, x in enumerate(frames) if len(x.data) < 8) + 1
    text[k] = text[k].removesuffix('0]"') + '9]"'
    (tmp_path / "x.csv").write_text("\n".join(text) + "\n")
    log = open_log(tmp_path / "x.csv")
    assert (len(list(log)), log.damaged) == (len(frames) - 1, 1)


PYTHON_CAN = "timestamp,arbitration_id,extended,remote,error,dlc,data"


@pytest.mark.parametrize("more", ["", "channel,is_rx"])
@pytest.mark.parametrize("hexadecimal", [False, True])
def test_python_can_with_more_columns_or_hexadecimal_bytes(
    more: str, hexadecimal: bool, tmp_path: Path
) -> None:
    frames = [x for x in drawn(random.Random(4)) if x.data]

    def row(x: Sent, _: int) -> list[str]:
        packed = x.data.hex() if hexadecimal else base64.b64encode(x.data).decode()
        return [
            _time(x),
            hex(x.id),
            str(int(x.extended)),
            "0",
            "0",
            str(len(x.data)),
            packed,
            *["can0", "True"][: 2 * bool(more)],
        ]

    log = _read(tmp_path / "x.csv", PYTHON_CAN + ("," + more if more else ""), row, frames)
    _same(log, frames)
    assert [*log.remarks] == ([f"its columns {more} are not read"] if more else [])


PLACES = [
    "arbitration_id,timestamp,data,dlc,extended,remote,error",
    "timestamp,channel,arbitration_id,extended,remote,error,dlc,data",
    "timestamp,arbitration_id,dlc,data",
    PYTHON_CAN,
]


@pytest.mark.parametrize("names", PLACES)
@pytest.mark.parametrize("mark", [",", ";", "\t", '","'])
def test_python_can_in_other_columns(names: str, mark: str, tmp_path: Path, seed: int) -> None:
    """Columns that pandas or a spreadsheet has put elsewhere, parted by another mark, quoted, with a decimal comma."""
    frames = [x for x in drawn(random.Random(seed)) if x.data]
    quote = '"' if mark == '","' else ""
    lines = [quote + mark.join(names.split(",")) + quote]
    for x in frames:
        cells = {
            "timestamp": _time(x).replace(".", "," if mark == ";" else "."),
            "arbitration_id": hex(x.id),
            "channel": "can0",
        }
        cells |= {
            "extended": str(int(x.extended)),
            "dlc": str(len(x.data)),
            "data": base64.b64encode(x.data).decode(),
        }
        lines.append(quote + mark.join(cells.get(name, "0") for name in names.split(",")) + quote)
    path = tmp_path / "x.csv"
    path.write_text("\n".join(lines) + "\n")
    if "extended" not in names:
        frames = [x._replace(extended=x.id > 0x7FF) for x in frames]
    _same(open_log(path), frames)
    if names != PYTHON_CAN or mark != ",":
        path.write_text(
            "\n".join([*lines, lines[-1].replace(hex(frames[-1].id), hex(frames[-1].id) + "z")]) + "\n"
        )
        log = open_log(path)
        assert (len(list(log)), log.damaged) == (len(frames), 1)


def test_times_in_several_columns_are_refused(tmp_path: Path) -> None:
    """The microseconds alone would begin anew each second."""
    frames = drawn(random.Random(4))

    def row(x: Sent, _: int) -> list[str]:
        seconds, micros = divmod(x.us, 1_000_000)
        return [str(seconds // 60 % 60), str(seconds % 60), str(micros), hex(x.id), str(len(x.data)), _hex(x)]

    with pytest.raises(ConfigError, match="in several columns, 'minute' to 'usec': write them as one"):
        _read(tmp_path / "x.csv", "minute,second,usec,id,dlc,data", row, frames)
