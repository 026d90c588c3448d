"""What an .asc says is taken for what it says, and what cannot be read is never guessed."""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.io.logs.asc import asc_date, asc_fd_base
from canid.values.errors import DAMAGED, ConfigError, DamagedLogError
from canid.values.types import Flag

HEAD = "date Mon Mar 3 10:00:00.000 am 2025\n"
FD_LINE = "{t} CANFD   2 Rx  {id}  Name  1 0 {dlc}  {n} {data}   148531  160   {flags} 0\n"


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "line",
    ["base hax timestamps absolute", "base timestamps absolute", "base", "base hex dec", "base = hex timestamps relativ",
     "base hex timestamps absolute relative", "base: octal"],
)  # fmt: skip
def test_a_base_line_that_cannot_be_read_is_an_error_for_the_file(tmp_path: Path, line: str) -> None:
    path = written(tmp_path / "a.asc", f"{HEAD}{line}\n0.1 1 123 Rx d 1 22\n")
    with pytest.raises(DamagedLogError, match=r"line 2: the base line .* cannot be read: ") as error:
        open_log(path)
    assert error.value.exit_code == DAMAGED
    assert "\n" not in str(error.value)


def test_most_of_the_first_lines_decide_the_base_of_fd_lines(tmp_path: Path) -> None:
    """Where the first says nothing; one that is damaged does not change it."""
    quiet = FD_LINE.format(t="0.1", id="102", dlc="2", n="2", data="20 14", flags="1000")
    says = FD_LINE.format(t="0.2", id="102", dlc="2", n="2", data="0e 20", flags="1000")
    other = FD_LINE.format(t="0.3", id="102", dlc="2", n="2", data="7 200", flags="1000")
    head = f"{HEAD}base dec  timestamps absolute\n"
    log = open_log(written(tmp_path / "a.asc", head + quiet + other + says * 5))
    frames = list(log)
    assert [frame.data for frame in frames] == [b"\x20\x14"] + [b"\x0e\x20"] * 5
    assert log.damaged == 1
    assert log.remarks == (asc_fd_base.HEXADECIMAL,)
    log = open_log(written(tmp_path / "b.asc", head + quiet + other * 5 + says))
    assert [(frame.id, frame.data) for frame in log] == [(102, b"\x14\x0e")] + [(102, b"\x07\xc8")] * 5
    assert log.remarks == (asc_fd_base.DECIMAL,)


@pytest.mark.parametrize(
    ("flags", "marks"),
    [("4096", Flag.FD), ("1000", Flag.FD), ("12288", Flag.FD | Flag.BRS), ("3145728", Flag.NONE), ("300000", Flag.NONE)],
)  # fmt: skip
def test_flags_of_decimal_lines_are_those_that_can_be(tmp_path: Path, flags: str, marks: Flag) -> None:
    brs = "1" if marks & Flag.BRS else "0"
    line = f"0.1 CANFD 1 Rx 102 Name {brs} 0 3 3 7 200 16 0 0 {flags} 0\n"
    log = open_log(written(tmp_path / "a.asc", f"{HEAD}base dec  timestamps absolute\n{line}"))
    (frame,) = log
    assert (frame.data, Flag(frame.flags)) == (b"\x07\xc8\x10", marks)


@pytest.mark.parametrize(
    "text",
    ["Mon Xyz 3 14:03:09 2025", "Wed Oct 15 02:03:09 xx 2025", "3/4/2025 14:03:09", "Wed Oct 15 14:03:10 am 2025",
     "Mon Feb 30 10:00:00 2025", "Mon Mar 3 25:00:00 2025", "Mon Mar 3 10:00 2025", "Mon 10 15 14:03:09 2025", "", "7"],
)  # fmt: skip
def test_a_date_that_may_be_another_is_not_stated(text: str) -> None:
    assert asc_date.local_ns(text, datetime.UTC) is None


def test_a_line_of_any_length_that_holds_no_frame_is_no_damage(tmp_path: Path) -> None:
    """Its time counts where times are relative; a frame's line of that length is damaged."""
    eth = "0.5 ETH 1 Rx 2328:" + "ab" * 9_000
    frame = "0.25 1 123 Rx d 1 22"
    text = "\n".join(
        [f"{HEAD}base hex timestamps relative", frame, eth, frame, "0.25 1 123 Rx d 1 22" + " 00" * 3_000, ""]
    )
    log = open_log(written(tmp_path / "a.asc", text))
    assert [frame.t for frame in log] == [0.0, 0.75]
    assert log.other_kinds == {"header lines": 2, "Ethernet": 1}
    assert log.damaged == 1
    assert log.damage is not None
    assert "more than 8,192 bytes" in log.damage.says


def test_a_joined_log_without_a_date_goes_on_where_the_first_ends(tmp_path: Path) -> None:
    one = "base hex  timestamps absolute\n0.1 1 123 Rx d 0\n5.0 1 123 Rx d 0\n"
    log = open_log(written(tmp_path / "a.asc", HEAD + one + "date not known\n" + one))
    assert [round(frame.t, 6) for frame in log] == [0.0, 4.9, 5.0, 9.9]
    assert log.remarks == (
        "a further log begins at line 5: its times continue at the end of the log before, since not both logs state "
        "their date",
    )


def test_a_log_that_is_joined_in_the_wrong_order_goes_back_and_says_so(tmp_path: Path) -> None:
    one = "base dec  timestamps absolute\n0.1 1 123 Rx d 0\n"
    earlier = HEAD.replace("10:00", "09:00")
    log = open_log(written(tmp_path / "a.asc", HEAD + one + earlier + one))
    assert [round(frame.t, 6) for frame in log] == [0.0, -3600.0]
    assert "which is before the first log's" in log.remarks[0]


@pytest.mark.parametrize(
    ("tail", "base", "id_", "data"),
    [("ID = 3be Data = 7d 0f e7 05", "dec", 0x3BE, "7d0fe705"),
     ("ID = 958 DLC = 4 Data = 125  15  231  5", "hex", 958, "7d0fe705"),
     ("Data = 10 20 ID = 100 Flags = 0x1", "dec", 0x100, "1020"),
     ("ID = 100 Data = 10 20", "dec", 100, "0a14"),
     ("Code = 129 ID = 161758280x DLC = 8", "dec", 161758280, "")],
)  # fmt: skip
def test_fields_of_an_error_frame_have_the_base_that_they_show(
    tmp_path: Path, tail: str, base: str, id_: int, data: str
) -> None:
    text = f"{HEAD}base {base}  timestamps absolute\n0.1 1 100 Rx d 0\n0.2 6  ErrorFrame\t{tail}\n"
    log = open_log(written(tmp_path / "a.asc", text))
    _, frame = log
    assert (frame.id, frame.data.hex()) == (id_, data)
    assert log.damage is None


def test_a_healthy_log_is_shown_without_a_word_of_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from canid.ui.cli import main

    path = written(
        tmp_path / "a.asc", f"{HEAD}base hex  timestamps absolute\n// version 9\n0.1 1 100 Rx d 0\n"
    )
    for verb in ("look", "check"):
        assert main([verb, str(path)]) == 0
        assert capsys.readouterr().err == ""
    path.write_text(path.read_text() + "0.2 1 100 TxRq d 0\n")
    assert main(["look", str(path)]) == 0
    assert "1 transmit requests" in capsys.readouterr().err


@pytest.mark.parametrize("names", [("EngineData", "ABS_1"), ("EngineData", "FE"), ("AB", "Brake_Status")])
def test_a_log_of_symbolic_names_is_refused(tmp_path: Path, names: tuple[str, str]) -> None:
    """In one line with what to do: a name may look like an id, so none of it is read; an id that is damaged is damage."""
    path = tmp_path / "x.asc"
    lines = [f"   {0.01 * k:.6f} 1  {names[k % 2]:15s} Rx   d 2 {k:02X} 00" for k in range(200)]
    path.write_text(
        "\n".join(["date Wed Aug 5 10:00:00 am 2026", "base hex  timestamps absolute", *lines, ""])
    )
    with pytest.raises(
        ConfigError, match=r"line [5-9]: '.*' is a message's name, and no id: log ids instead"
    ):
        list(open_log(path))
    numbers = [line.replace(names[k % 2], f"{0x100 + k:X}") for k, line in enumerate(lines)]
    numbers[3] = numbers[3].replace(" 103 ", " 1Z3 ")
    path.write_text(
        "\n".join(["date Wed Aug 5 10:00:00 am 2026", "base hex  timestamps absolute", *numbers, ""])
    )
    log = open_log(path)
    assert (len(list(log)), log.damaged) == (199, 1)


def test_times_in_hours_minutes_and_seconds(tmp_path: Path) -> None:
    """0h59m59.9s, 1h00m00.0s: as the same times in s; minutes and seconds of 60 are damage."""
    frames = "0h00m00.5s 1 123 Rx d 1 22\n0h59m59.900000s 1 123 Rx d 1 23\n1h00m00,000125s 1 123 Rx d 1 24\n"
    path = written(
        tmp_path / "a.asc", f"{HEAD}base hex timestamps absolute\n{frames}0h60m00.5s 1 123 Rx d 1 22\n"
    )
    log = open_log(path)
    assert [round(frame.t * 1e6) for frame in log] == [0, 3_599_400_000, 3_599_500_125]
    assert log.damaged == 1
