"""The last value of each signal: that of its last frame, however the frames are cut and whenever rows are asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.analysis.contents import last_values, single_frame
from canid.analysis.contents.binding import DbcFile
from canid.analysis.contents.decoded_frames import Decoder, decoded_signals
from canid.analysis.contents.last_values import LastValues
from canid.analysis.contents.log_survey import Wanted
from canid.analysis.contents.signal_tables import SignalTables
from canid.analysis.drive.signal_columns import MessageFrames, decode
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.vehicle_file import with_databases
from canid.values.frame_columns import columns_of
from canid.values.types import Flag, Frame
from tests.test_signal_columns import TEXT, read


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[DbcFile]:
    path = tmp_path_factory.mktemp("dbc") / "kinds.dbc"
    path.write_text(TEXT)
    return [DbcFile(path.name, None, list(read(path).messages.values()))]


def drawn(rng: np.random.Generator, files: list[DbcFile], n: int) -> list[Frame]:
    """Frames of all messages on two buses at uneven rates, some too short, pages among them, and of no message."""
    messages = list(files[0].messages)
    times = np.cumsum(rng.exponential(0.01, n)).round(9)
    often = rng.dirichlet(np.full(len(messages), 0.5))
    out = [Frame(0.0, bus, messages[0].id, bytes(8)) for bus in (0, 1)]
    for t in times.tolist():
        message = messages[rng.choice(len(messages), p=often)]
        size = message.length if rng.random() < 0.9 else int(rng.integers(0, message.length))
        flags = (Flag.EXTENDED if message.extended else 0) | (Flag.FD if message.length > 8 else 0)
        id_ = message.id if rng.random() < 0.95 else 0x7E0
        out.append(
            Frame(t, int(rng.integers(2)), id_, rng.bytes(min(size, 8) if size < 64 else 64), int(flags))
        )
    return out


@pytest.mark.parametrize("waiting", [100_000, 50])
def test_rows_are_those_of_the_last_frames_frame_by_frame(
    files: list[DbcFile], seed: int, waiting: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Value and age of each signal, of a page too that came long ago; the rate of its message's last frames."""
    monkeypatch.setattr(last_values, "MAX_WAITING_FRAMES", waiting)
    rng = np.random.default_rng(seed)
    frames = drawn(rng, files, 600)
    decoder = Decoder(files, Wanted())
    value: dict[tuple[int, str], tuple[float, str]] = {}
    times: dict[tuple[int, str], list[float]] = {}
    for frame in decoder.decoded([columns_of(frames)]):
        times.setdefault((frame.bus, frame.message), []).append(frame.t)
        for signal in frame.signals:
            value[frame.bus, f"{frame.message}.{signal.name}"] = frame.t, signal.text
    assert len(value) > 15
    values = LastValues(Decoder(files, Wanted()))
    values.take([columns_of(frames[:2])])  # so that both see the same buses first
    values.rows(0.0)
    left = frames[2:]
    while left:
        n = int(rng.integers(1, 80))
        values.take([columns_of(left[:n])])
        left = left[n:]
        if rng.random() < 0.4:
            values.rows(frames[-1].t)
    now = frames[-1].t + 1.5
    rows = values.rows(now)
    assert {(row.bus, row.name): row.text for row in rows} == {key: text for key, (_, text) in value.items()}
    assert len(rows) == len(value)
    for row in rows:
        assert row.age == pytest.approx(now - value[row.bus, row.name][0])
        last = times[row.bus, row.name.split(".")[0]][-32:]
        rate = (len(last) - 1) / (last[-1] - last[0]) if len(last) > 1 else math.nan
        assert row.rate == pytest.approx(rate, nan_ok=True)
    assert [row.bus for row in rows] == sorted(row.bus for row in rows)


def drawn_message(rng: np.random.Generator) -> Message:
    """Signals of all kinds anywhere in a frame, with value tables of raw numbers that come; J1939 now and then."""
    signals = []
    for k in range(8):
        floating = rng.random() < 0.2
        motorola, length = (
            rng.random() < 0.5,
            int(rng.choice([16, 32, 64]) if floating else rng.integers(1, 54)),
        )
        choices = {int(raw): f"text {raw}" for raw in (0, 1, 255, 2**length - 1, rng.integers(0, 9))}
        scale, offset = float(rng.choice([1.0, 0.1, -0.25, 1e-9])), float(rng.choice([0.0, -40.0, 0.3]))
        one = (
            f"S{k}",
            int(rng.integers(0, 64)),
            length,
            motorola,
            bool(rng.random() < 0.4),
            floating,
            scale,
            offset,
        )
        signals.append(Signal(*one, None, None, "m", choices, False, None, (), int(rng.integers(0, 2))))
    return Message("M", 1, True, 8, 0.1, tuple(signals), str(rng.choice(["", "j1939"])))


def test_a_single_frame_has_the_values_of_the_columns(seed: int) -> None:
    """To the last bit, and the same words, of frames that are too short or say that there is no measurement too."""
    rng = np.random.default_rng(seed)
    texts: list[str] = []
    for _ in range(150):
        message = drawn_message(rng)
        octets = rng.choice([0x00, 0x01, 0xFF, 0xFE, 0xFB, int(rng.integers(256))], 8).astype(np.uint8)
        length = 8 if rng.random() < 0.8 else int(rng.integers(0, 9))
        octets[length:] = 0
        frame = MessageFrames(np.zeros(1), np.array([length], np.uint8), octets[np.newaxis])
        columns = ((signal, decode(message, signal, frame)) for signal in message.signals)
        expected = [decoded_signals(signal, column)[0] for signal, column in columns if column is not None]
        found = single_frame.places(message)
        assert found is not None
        shown = single_frame.read(found, octets[:length].tobytes())
        assert [(one.name, one.text) for one in shown] == [(one.name, one.text) for one in expected]
        for one, other in zip(shown, expected, strict=True):
            assert one.value == other.value or (math.isnan(one.value) and math.isnan(other.value))
        texts += [one.text for one in shown]
    assert any(text.startswith("text") for text in texts)
    assert "–" in texts


def test_a_file_that_fits_another_bus_better_leaves_no_row_on_the_first(files: list[DbcFile]) -> None:
    """One id of the file comes on bus 1 before bus 0, which has them all, says anything."""
    values = LastValues(Decoder(files, Wanted()))
    values.take([columns_of([Frame(0.0, 1, 101, bytes(8))])])
    assert {row.bus for row in values.rows(0.0)} == {1}
    values.take([columns_of([Frame(0.1, 0, id_, bytes(64), int(Flag.FD)) for id_ in (100, 101, 102, 103)])])
    rows = values.rows(0.1)
    assert {row.bus for row in rows} == {0}
    assert {row.name.split(".")[0] for row in rows} == {"PLAIN", "FLOATS", "PAGES", "LONG"}


def test_a_signal_in_no_frame_yet_has_no_row(files: list[DbcFile]) -> None:
    values = LastValues(Decoder(files, Wanted()))
    assert values.rows(1.0) == []
    values.take([columns_of([Frame(0.0, 0, 102, bytes(8))])])
    assert {row.name for row in values.rows(0.0)} == {"PAGES.page", "PAGES.first", "PAGES.always"}


def test_what_fails_ends_the_tables_alone() -> None:
    """Frames that cannot be: no exception for the process that estimates, but a table that says why it is empty."""
    tables = SignalTables(*with_databases("generic"), {})
    good = columns_of([Frame(0.0, 0, 0x110, bytes(8)), Frame(0.1, 0, 0x110, bytes(8))])
    tables.take(good)
    assert tables.table().rows
    tables.take(good._replace(data=good.data[:1]))
    table = tables.table()
    assert table.rows == []
    assert table.failure
    tables.take(good)
    assert tables.table().failure == table.failure
