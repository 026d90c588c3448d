"""Every line or object of a log is a frame, known to be none, or damaged: there is no fourth class."""

from __future__ import annotations

import gzip
import random
import struct
import zlib
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.io.logs import open_log, write_log
from canid.io.logs.blf.blf_layout import parse_file_header
from canid.io.logs.blf.blf_writer import BlfWriter
from canid.io.logs.log import Log
from canid.values.errors import LogError
from canid.values.frame_columns import frames_of
from canid.values.types import Event, Flag, Frame
from tests.damaged_logs.bases import _stored_blf, drive
from tests.logs import samples
from tests.logs.samples import write_with_python_can

START = 1_600_000_000.0
# one frame of each kind
FRAMES = [*samples.FRAMES[:6], samples.FRAMES[8]]

# One line of each kind that Vector's specifications of the format have, and lines as CANoe writes them.
EVENTS = """\
date Die Dez 21 11:29:01 2004
base hex  timestamps absolute
internal events logged
// version 7.0.0
//0.000000 previous log file: logfile.asc
Begin Triggerblock Mon Mar 7 01:21:51 pm 2005
   0.0000 Start der Messung
   0.0000 CANFD   Start of measurement
   0.0006 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0
   1.0100 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.0%
   2.0000 log direct start (0ms)
   2.7000 log trigger event (this trigger was in post trigger time of last block)
   1.300000 1  7FF             TxRq d 1 0c
   1.400000 1  OverloadFrame
   3.297743 1  J1939TP FEE3p        6    0  0   -   Rx   d 23 A0 0F A6 60
  59.171614 CANXL   2 Rx   XLFF   984438   4656      432  msgCanXlTest1 e0 0  1fe  511 1 1f96 00
  42.017364 Li 14              Rx     8 2a 79 00 00 00 80 c0 ff  checksum = 07   header time =  40
  17.000000 Li SchedModChng    prior scheduler mode = 2, next scheduler mode = 3
  36.000000 M1 Register: 1 23 4567
   0.012845 M1 Tx 0100 0400 04 00 7F 00 01 00 00 00 00 00 00 00 00 00 00 00 00 00 1250
   0.039150 Fr RMSG 0 0 1 1 1 7 Rx 0 3 5 32 96 x 4 0 0 0 0
   0.002404 ETH 1 STAT Link:Link_up LinkSpeed:100Mbit/s
   9.026000 COM2 Tx 10400 6 82 61 11 10 86 8A
   0.100000    EnvVECU_SpeedSlider := 40
   1.000000 SV: 1 0 0 ::Path::Name = 5
  14.105284 L2 GWI::GWI_01::GWI_FrontWindowsLeft = Up
   1.0000 DiagRequest[Engine] 10 81
   1.593770 Comment: 105 testComment
   1.5 100 0 0 1 GMGroup: a GMMarker: b GMDescription: c
   2.0 GPS-Device: 1 La:48.82 Lo:9.09 Alt:325 Sp:29.6 Co:87.1
   2.5009 1  64              Tx   d 8 00 01 02 03 04 05 06 07  Length = 240015 BitCount = 124 ID = 100
   2.5010 1  200             Tx   r
   2.6000 1  ErrorFrame	ECC: 10100010
   2.7000 2 ErrorFrame Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 0 DLC = 0 Position = 5 Length = 11300
   2.8000 CANFD 1  101             Tx   1 0 d 9 12 F1 F1 F1 F1 F1 F1 F1 F1 00 00 00 00  Length = 209000 BitCount = 128 ID = 257
   3.0050 CANFD   2 Rx        300  Name_12  1 0 8  8 01 02 03 04 05 06 07 08   102203  133   303000 e0006659 46500250 4b140250 20011736 2001040d
End TriggerBlock
"""  # noqa: E501

TRC = {
    "1.0": "     1)      1841      0001  8  00 00 00 00 00 00 00 00\n     2)      1843  FFFFFFFF  4  00 00 00 04 -- -- -- -- BUSLIGHT\n     3)  1844  0100  3  RTR\n",  # noqa: E501
    "1.1": ";$FILEVERSION=1.1\n;$STARTTIME=37704.5364870833\n     1)  1059.9  Rx  0300  7  00 00 00 00 04 00 00\n     2)  1283.2  Warng  FFFFFFFF  4  00 00 00 04  BUSLIGHT\n     3)  1298.9  Error  0008  4  00 19 08 08\n     4)  1323.0  Rx  0400  2  RTR\n",  # noqa: E501
    "1.3": ";$FILEVERSION=1.3\n;$STARTTIME=40704.5364870833\n     1)  1059.900 1  Rx  0300 -  7  00 00 00 00 04 00 00\n     2)  1283.231 1  Warng FFFFFFFF -  4    00 00 00 08 BUSHEAVY\n     3)  1298.945 2  Rx  00000400 -  0\n",  # noqa: E501
    "2.0": ";$FILEVERSION=2.0\n;$STARTTIME=43008.920986169\n;$COLUMNS=N,O,T,I,d,l,D\n      1   1059.900 DT     0300 Rx 7  00 00 00 00 04 00 00\n      2   1283.231 ST          Rx    00 00 00 08\n      3   1298.945 FB     0400 Tx 12 00 00 00 00 04 00 00 00 00 00 00 00\n      4   1300.000 RR     0500 Rx 3\n",  # noqa: E501
    "2.1": ";$FILEVERSION=2.1\n;$STARTTIME=43008.920986169\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n      1   1059.900 DT 1      0300 Rx -  7    00 00 00 00 04 00 00\n      2   1283.231 ST 1         - Rx -  4    00 00 00 08\n      3   1298.945 FB 2      0400 Tx -  9    00 00 00 00 04 00 00 00 00 00 00 00\n      4   1300.000 RR 1      0500 Rx -  3\n      5   1400.000 EV    A text\n",  # noqa: E501
}


def read(path: Path, data: bytes) -> tuple[list[Frame], Log] | None:
    """Frames and log; None where nothing at all can be read, which is said by an error."""
    path.write_bytes(data)
    try:
        log = open_log(path)
        return [frame for chunk in log.columns() for frame in frames_of(chunk)], log
    except LogError:
        return None


def lines(data: bytes) -> int:
    return sum(1 for line in data.split(b"\n") if line.decode("latin-1").strip())


def accounted(log: Log) -> int:
    return log.frames_read + log.events_read + log.others + log.damaged


def text_log(folder: Path, name: str) -> tuple[bytes, str]:
    """A log in one of the text formats, and its suffix."""
    suffix = f".{name.partition(' ')[0]}"
    path = folder / f"made{suffix}"
    if name in ("asc", "log"):
        write_log(path, FRAMES, START)
    elif name == "asc events":
        path.write_text(EVENTS)
    elif name == "asc columns":
        # many lines of one shape: the fast path
        write_log(path, [Frame(k * 0.001, 0, 0x123, bytes([k] * 4)) for k in range(12)], START)
    elif name == "asc dec":
        head = "base dec  timestamps relative\n"
        tail = "  Length = 240015 BitCount = 124 ID = 291\n"
        path.write_text(
            head + "".join(f"   0.001000 1  291             Rx   d 2 {k} 7{tail}" for k in range(12))
        )
    elif suffix == ".csv":
        write_with_python_can(path, (frame._replace(bus=0) for frame in FRAMES), START)
    else:
        path.write_text(TRC[name.partition(" ")[2]])
    return path.read_bytes().replace(b"\r\n", b"\n"), suffix


TEXTS = ["asc", "asc events", "asc columns", "asc dec", "log", "csv", *(f"trc {version}" for version in TRC)]


@pytest.mark.parametrize("name", TEXTS)
def test_all_lines_of_an_undamaged_log_are_accounted_for(name: str, tmp_path: Path) -> None:
    """Every line is a frame or of a known kind; nothing is damaged, one by one and in columns."""
    data, suffix = text_log(tmp_path, name)
    found = read(tmp_path / f"x{suffix}", data)
    assert found is not None
    frames, log = found
    assert (log.damage, log.damaged) == (None, 0)
    assert accounted(log) == lines(data)
    assert log.frames_read == len(frames) > 0
    assert sum(log.other_kinds.values()) == log.others
    kinds = log.other_kinds
    assert list(log) == frames
    assert (log.frames_read, log.other_kinds) == (len(frames), kinds)


def test_frames_not_asked_for_are_counted_too(tmp_path: Path) -> None:
    """The count is the file's, whichever ids are wanted."""
    for suffix in (".asc", ".blf"):
        path = tmp_path / f"x{suffix}"
        write_log(path, FRAMES, START)
        log = open_log(path)
        list(log.columns(ids=[0x7]))
        assert log.frames_read == len(FRAMES)


@pytest.mark.parametrize("word", ["Sx", "Rz", "rX ", "RR", "Txx", "Rx\x7f"])
def test_a_damaged_direction_is_reported(word: str, tmp_path: Path) -> None:
    """One bit in the direction of an .asc line: the line is damaged, not of no interest."""
    data, _ = text_log(tmp_path, "asc")
    found = read(tmp_path / "x.asc", data.replace(b"Rx   d 0", f"{word}   d 0".encode(), 1))
    assert found is not None
    frames, log = found
    if word.strip().lower() == "rx":
        assert len(frames) == len(FRAMES)
        return
    assert len(frames) == len(FRAMES) - 1
    assert log.damage is not None
    assert (log.damaged, log.damage.read, log.damage.total) == (1, len(FRAMES) - 1, len(FRAMES))


@pytest.mark.slow("many logs, written and read")
@pytest.mark.timeout(300)  # a guard against hangs on a busy machine; some seconds are usual
@pytest.mark.parametrize("name", TEXTS)
def test_one_flipped_bit_loses_no_frame_in_silence(name: str, tmp_path: Path) -> None:
    """Each bit of every third byte flipped: a lost frame is reported, each line counted."""
    data, suffix = text_log(tmp_path, name)
    path = tmp_path / f"x{suffix}"
    whole = read(path, data)
    assert whole is not None
    for at in range(0, len(data), 7 if name == "asc events" else 3):
        for bit in range(8):
            mutant = data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :]
            found = read(path, mutant)
            if found is None:
                continue
            frames, log = found
            assert accounted(log) == lines(mutant), (at, bit)
            assert len(frames) >= len(whole[0]) or log.damage is not None, (
                at,
                bit,
                mutant[at - 40 : at + 40],
            )


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_any_mutation_of_any_text_log_is_accounted_for(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Bytes replaced, inserted, removed, lines twice or gone: frames + events + others + damaged = lines."""
    folder = tmp_path_factory.mktemp("drawn")
    text, suffix = text_log(folder, data.draw(st.sampled_from(TEXTS)))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text)))
        end = min(len(text), at + data.draw(st.sampled_from([0, 1, 1, 2, 30])))
        text = text[:at] + data.draw(st.binary(max_size=8)) + text[end:]
    zipped = data.draw(st.booleans())
    path = folder / (f"x{suffix}.gz" if zipped else f"x{suffix}")
    found = read(path, gzip.compress(text, 1) if zipped else text)
    if found is not None:
        frames, log = found
        assert accounted(log) == lines(text)
        assert log.frames_read == len(frames)
        assert (log.damage is None) == (log.damaged == 0)


@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_one_byte_of_one_frame_line(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    """One byte of a frame's line replaced by any other: the frame is there with another value, or it is reported."""
    folder = tmp_path_factory.mktemp("drawn")
    text, suffix = text_log(folder, data.draw(st.sampled_from(TEXTS)))
    whole = read(folder / f"w{suffix}", text)
    assert whole is not None
    at = data.draw(st.integers(0, len(text) - 1))
    mutant = text[:at] + bytes([data.draw(st.integers(0, 255))]) + text[at + 1 :]
    found = read(folder / f"x{suffix}", mutant)
    if found is not None:
        assert len(found[0]) >= len(whole[0]) or found[1].damage is not None


# --- .blf ------------------------------------------------------------------------------------------


def own(path: Path, frames: list[Frame], each: int = 20) -> bytes:
    with closing(BlfWriter(path, 1_600_000_000_123_456_789)) as writer:
        for k, frame in enumerate(frames):
            if k % each == 3:
                writer.note(Event(frame.t, "remark", f"event {k}"))
            writer.append(frame)
            if k % each == each - 1:
                writer.checkpoint(sync=False)
    return path.read_bytes()


def stored(frames: list[Frame], each: int = 10) -> bytes:
    """The same without compression: no checksum protects it."""
    return _stored_blf("x", frames, each, whole=True).data


def test_events_and_frames_of_a_recording_are_counted(tmp_path: Path) -> None:
    """Frames and the recorder's events apart; nothing else is in it."""
    found = read(tmp_path / "x.blf", own(tmp_path / "w.blf", FRAMES * 10))
    assert found is not None
    log = found[1]
    assert (log.frames_read, log.events_read, log.others, log.damaged) == (70, 4, 0, 0)


def test_objects_of_other_types_are_counted_by_kind(tmp_path: Path) -> None:
    """LIN, text and unknown types between frames: how many of each."""
    path = tmp_path / "x.blf"
    write_log(path, FRAMES[:3], START)

    def item(kind: int) -> bytes:
        return struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 40, kind, 2, 0, 0, 0) + bytes(8)

    row = item(11) + item(16) + item(65) + item(900)
    packed = zlib.compress(row)
    size = 32 + len(packed)
    box = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, size, 10, 2, len(row)) + packed
    path.write_bytes(path.read_bytes() + box)
    log = open_log(path)
    assert len(list(log)) == 3
    assert log.other_kinds == {"LIN": 2, "texts and remarks": 1, "of unknown types": 1}
    assert log.damage is None


@pytest.mark.slow("many logs, written and read")
@pytest.mark.parametrize("kind", ["own", "stored"])
def test_one_flipped_bit_of_a_blf_loses_no_frame_in_silence(kind: str, tmp_path: Path) -> None:
    """Each bit of every container's and object's header, and of all bytes of the first container, flipped."""
    frames = drive(random.Random(5), 20, (0, Flag.EXTENDED, Flag.FD, Flag.TX), 2)
    data = own(tmp_path / "w.blf", frames) if kind == "own" else stored(frames)
    path = tmp_path / "x.blf"
    assert read(path, data)[1].damage is None  # type: ignore[index]
    ats, at = set(range(4)), data.find(b"LOBJ")
    second = data.find(b"LOBJ", at + 4)
    ats |= set(range(at, min(second, at + 400)))
    while at >= 0:
        ats |= set(range(at, min(at + 16, len(data))))
        at = data.find(b"LOBJ", at + 4)
    for at in sorted(ats):
        for bit in range(8):
            found = read(path, data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :])
            if found is not None:
                got, log = found
                assert len(got) >= len(frames) or log.damage is not None, (at, bit, log.other_kinds)


@pytest.mark.parametrize(
    ("what", "offset", "form", "value"),
    [
        ("a stated size of 0", 8, "<L", 0),
        ("a stated size one too large", 8, "<L", 1),
        ("another stated size when uncompressed", 24, "<L", 7),
        ("another size of the header", 4, "<H", 24),
        ("another version of the header", 6, "<H", 3),
    ],
)
def test_a_container_that_contradicts_itself_is_reported(
    what: str, offset: int, form: str, value: int, tmp_path: Path
) -> None:
    """Its data are whole and all read; that its header is damaged is stated with its bytes."""
    data = bytearray(own(tmp_path / "w.blf", FRAMES * 10))
    at = data.index(b"LOBJ")
    value = struct.unpack_from(form, data, at + offset)[0] + 1 if value == 1 else value
    struct.pack_into(form, data, at + offset, value)
    found = read(tmp_path / "x.blf", bytes(data))
    assert found is not None
    frames, log = found
    assert len(frames) == 70, what
    if what == "a stated size one too large" and log.damage is None:
        # the byte behind it is padding, which some writers count
        assert data[at + value - 1] == 0
        return
    assert log.damage is not None, what
    assert log.damage.spans[0][0] == at


def test_a_header_that_miscounts_is_reported(tmp_path: Path) -> None:
    """A header that fits the file in every byte, but counts other objects than are in it."""
    data = bytearray(own(tmp_path / "w.blf", FRAMES * 10))
    assert parse_file_header(bytes(data)).objects == 70
    for count in (69, 71, 0):
        struct.pack_into("<L", data, 32, count)
        found = read(tmp_path / "x.blf", bytes(data))
        assert found is not None
        assert len(found[0]) == 70
        assert found[1].damage is not None
        assert f"{count} objects" in found[1].damage.says or "1 more" in found[1].damage.says


def test_a_killed_recording_states_what_it_stated_before(tmp_path: Path) -> None:
    """A header of an earlier checkpoint and whole containers behind it: a kill, and no damage."""
    path = tmp_path / "w.blf"
    writer = BlfWriter(path, 1_600_000_000_000_000_000)
    for frame in FRAMES * 3:
        writer.append(frame)
    writer.checkpoint(sync=False)
    head = path.read_bytes()[:144]
    for frame in FRAMES * 3:
        writer.append(frame)
    writer.close()
    found = read(tmp_path / "x.blf", head + path.read_bytes()[144:])
    assert found is not None
    assert (len(found[0]), found[1].damage) == (42, None)


@pytest.mark.parametrize("tail", [b"\0" * 12, b"xyz", b"\0\0\0junk"])
def test_bytes_behind_the_last_container_are_reported(tail: bytes, tmp_path: Path) -> None:
    """Up to three zeros are padding; more, or anything else, is damage."""
    data = own(tmp_path / "w.blf", FRAMES)
    found = read(tmp_path / "x.blf", data + tail)
    assert found is not None
    assert len(found[0]) == len(FRAMES)
    assert found[1].damage is not None


def test_a_stored_container_of_zeros_is_reported(tmp_path: Path) -> None:
    """Its bytes never reached the disk: its frames are lost, and that is stated."""
    frames = drive(random.Random(6), 30, (0,), 1)
    data = bytearray(stored(frames))
    at = data.index(b"LOBJ", data.index(b"LOBJ") + 500)
    size = struct.unpack_from("<L", data, data.index(b"LOBJ") + 8)[0]
    begin = data.index(b"LOBJ") + 32
    data[begin : begin + size - 32] = bytes(size - 32)
    assert at > 0
    found = read(tmp_path / "x.blf", bytes(data))
    assert found is not None
    assert 0 < len(found[0]) < 30
    assert found[1].damage is not None
