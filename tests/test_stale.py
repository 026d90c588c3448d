"""`stale`, `valid`, counters and `lead_valid` act for every role."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive import drive_reader
from canid.io.logs import open_log, write_log
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.signals.vehicle.bits import put, raw_of
from canid.signals.vehicle.mapping import SignalMap
from canid.values.types import Frame, LearnGate, Trace
from tests.fixtures.measured_logs import MEASURED, MISSING

ROOT = Path(__file__).parents[1]
URBAN = ROOT / "replay_logs" / "following_urban.blf"
RAV4 = MEASURED / "rav4/rav4_highway.blf"
# s; a stretch of the log with a lead all the time, and a hole in it
BEGIN, END, HOLE, BACK = 33.0, 51.0, 38.03, 45.03
ROLES = tuple(read_vehicle("generic").roles)
SAMPLED = tuple(role for role in ROLES if role != "lead_valid")
STALE = (0.2, 2.6)


def vehicle(folder: Path, role: str, options: str) -> Vehicle:
    """The generic vehicle, with options of one role."""
    lines = (ROOT / "dbc/generic.toml").read_text().splitlines()
    for k, line in enumerate(lines):
        if line.startswith(f"{role} = "):
            signal = line.split('"')[1]
            lines[k] = f'{role} = {{ signal = "{signal}", {options} }}'
    shutil.copy(ROOT / "dbc/generic.dbc", folder)
    (folder / "car.toml").write_text("\n".join(lines))
    return read_vehicle(folder / "car.toml")


@cache
def frames() -> list[Frame]:
    """The stretch of the log; do not change it."""
    return [frame for frame in open_log(URBAN) if BEGIN <= frame.t < END]


def trace_of(folder: Path, car: Vehicle, made: Iterable[Frame]) -> Trace:
    """The samples of a log."""
    path = folder / "x.blf"
    write_log(path, made, 1.7e9)
    return drive_reader.read_drive(path, car, estimating=False).trace


def changed(frame: Frame, how: SignalMap, value: float) -> Frame:
    """A frame with another value of one signal, in the role's unit."""
    raw = round((value - how.offset) / how.factor)
    data = int.from_bytes(frame.data, "little")
    length = len(frame.data)
    mask = put(how.bits._replace(signed=False), (1 << how.bits.length) - 1, length)
    data = data & ~mask | put(how.bits, raw, length)
    return frame._replace(data=data.to_bytes(length, "little"))


def carries(frame: Frame, car: Vehicle, role: str) -> bool:
    how = car.roles[role].how
    return frame.id == car.roles[role].id and all(
        raw_of(where, frame.data) in numbers for where, numbers in how.when
    )


def last_before(made: list[Frame], t: float, keeps: Callable[[Frame], bool]) -> float:
    return max(frame.t for frame in made if frame.t < t and keeps(frame)) - BEGIN


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("stale", STALE)
@pytest.mark.parametrize("role", SAMPLED)
def test_a_message_that_stops_coming(role: str, stale: float, tmp_path: Path) -> None:
    """After `stale` the role is not measured, whatever the role; before, where nothing later came, it is held."""
    car = vehicle(tmp_path, role, f"stale = {stale}")
    whole = frames()
    made = [
        frame._replace(t=frame.t - BEGIN)
        for frame in whole
        if not (HOLE <= frame.t < BACK and carries(frame, car, role))
    ]
    trace = trace_of(tmp_path, car, made)
    last = last_before(whole, HOLE, lambda frame: carries(frame, car, role))
    first = min(f.t for f in whole if f.t >= BACK and carries(f, car, role)) - BEGIN
    t, value = trace.t, trace.signals[role]
    # the smoothing of the lead gives its reports out 1.5 s later, and what is left half a second after the last one
    hole = (t > last + stale + 1e-9) & (t < first)
    assert hole.sum() > 20
    assert np.isnan(value[hole]).all()
    if role not in ("altitude", "grade", "gnss_speed", "lat", "lon", "east", "north") or stale > 0.45:
        # the pages of the satellite message come every 0.3 s: a shorter life is no life
        assert np.isfinite(value[(t > 2.0) & (t < last - 0.4)]).mean() > 0.95
    if stale > 0.6:
        assert np.isfinite(value[(t > last - 0.4) & (t < last + stale - 0.6)]).all()
    if role in ("pedal", "speed", "cruise_active"):
        assert {trace.gate[k] for k in np.flatnonzero(hole)} == {LearnGate.STALE}
    if role in ("gap", "range_rate"):
        assert {trace.gate[k] for k in np.flatnonzero(hole)} <= {LearnGate.STALE, LearnGate.NO_LEAD}
        assert not trace.learn[hole].any()


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("stale", STALE)
@pytest.mark.parametrize("role", ["gap", "range_rate"])
def test_one_of_two_signals_of_the_radar_is_not_measured(role: str, stale: float, tmp_path: Path) -> None:
    """Gap without range rate, or the other way round: the filter carries it on for `stale` s and no longer."""
    car = vehicle(tmp_path, role, f"stale = {stale}, valid = [-70, {70 if role == 'range_rate' else 200}]")
    how = car.roles[role].how
    out = 75.0 if role == "range_rate" else 250.0
    made = []
    for frame in frames():
        if HOLE <= frame.t < BACK and carries(frame, car, role):
            frame = changed(frame, how, out)
        made.append(frame._replace(t=frame.t - BEGIN))
    trace = trace_of(tmp_path, car, made)
    t, value = trace.t, trace.signals[role]
    last = last_before(frames(), HOLE, lambda frame: carries(frame, car, role))
    hole = (t > last + stale + 1e-9) & (t < BACK - BEGIN - 0.1)
    assert np.isnan(value[hole]).all()
    assert np.isfinite(value[(t > 2.0) & (t < last)]).all()
    # carried on by the other one while it may be
    assert np.isfinite(value[(t > last) & (t < last + stale - 0.11)]).all()
    assert not trace.learn[hole].any()
    if role == "range_rate":
        assert np.isfinite(trace.signals["gap"][hole]).all()


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize(
    "role", [role for role in SAMPLED if role not in ("brake", "cruise_active", "clutch")]
)
def test_a_value_out_of_range(role: str, tmp_path: Path) -> None:
    """`valid` says what a role may be; what is outside is not measured (the lead's after its own `stale`)."""
    trace = trace_of(
        tmp_path,
        vehicle(tmp_path, role, "valid = [-1e9, -1e8]"),
        [f._replace(t=f.t - BEGIN) for f in frames()],
    )
    # a range rate that has not come yet may take as long as one that has stopped
    assert np.isnan(trace.signals[role][trace.t > (0.6 if role == "range_rate" else -1.0)]).all()


# every frame, or every tenth: the radar's at 20 and 2 Hz
@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("stale", STALE)
@pytest.mark.parametrize("role", ["pedal", "speed", "gap", "range_rate", "yaw_rate", "lateral_offset"])
def test_a_counter_that_stands_still(role: str, stale: float, every: int, tmp_path: Path) -> None:
    """What a stuck sender repeats is not measured after five frames or `stale`, whichever comes first."""
    car = vehicle(tmp_path, role, f"stale = {stale}")
    message = next(m for m in car.messages if m.name == car.roles[role].message)
    assert message.counter is not None
    counter = SignalMap("", message.counter, 1.0, 0.0, 0.0, 1e9, "number")
    made, k, kept = [], 0, []
    for frame in frames():
        if frame.id == message.id:
            k += 1
            if k % every:
                continue
            number = (k // every) % 8 if not HOLE <= frame.t < BACK else 9
            frame = changed(frame, counter, float(number))
            kept.append(frame.t - BEGIN)
        made.append(frame._replace(t=frame.t - BEGIN))
    trace = trace_of(tmp_path, car, made)
    period = np.median(np.diff(kept))
    t, value = trace.t, trace.signals[role]
    stuck = min(x for x in kept if x >= HOLE - BEGIN)
    # the frame with which the counter stops is new; gap and range rate may be bridged once more, for `stale`
    bridged = stale if role in ("gap", "range_rate") else 0.0
    until = min(stuck + 5 * period, stuck + max(stale, period)) + bridged + period + 1e-6
    hole = (t > until) & (t < BACK - BEGIN)
    assert hole.sum() > 3
    assert np.isnan(value[hole]).all()
    if stale > 2 * period:
        assert np.isfinite(value[(t > 3.0) & (t < stuck - 0.5)]).mean() > 0.95


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("stale", [0.3, 0.9])
@pytest.mark.parametrize("how", ["never", "stops", "stuck"])
def test_lead_valid_that_nobody_says_any_more(how: str, stale: float, tmp_path: Path) -> None:
    """A gap of which it is not known whether it is one is not measured: neither a lead nor none."""
    # in a message of its own, as many radars have it
    text = (ROOT / "dbc/generic.dbc").read_text()
    text = text.replace(
        "BO_ 320 DRIVER_STATE",
        'BO_ 99 STATUS: 2 RADAR\n SG_ Ok : 0|1@1+ (1,0) [0|1] "" X\n'
        ' SG_ OkCounter : 8|4@1+ (1,0) [0|15] "" X\n\nBO_ 320 DRIVER_STATE',
    )
    car = vehicle(tmp_path, "lead_valid", f"stale = {stale}")
    (tmp_path / "generic.dbc").write_text(text)
    toml = (tmp_path / "car.toml").read_text().replace("RADAR_LEAD.LeadValid", "STATUS.Ok")
    (tmp_path / "car.toml").write_text(toml)
    car = read_vehicle(tmp_path / "car.toml")
    made = []
    for frame in frames():
        made.append(frame._replace(t=frame.t - BEGIN))
        if frame.id != car.roles["gap"].id or how == "never":
            continue
        inside = HOLE <= frame.t < BACK
        if not (inside and how == "stops"):
            number = 9 if inside else len(made) % 7
            made.append(Frame(frame.t - BEGIN + 0.001, 0, 99, bytes([1, number])))
    trace = trace_of(tmp_path, car, made)
    t = trace.t
    begin = 0.0 if how == "never" else HOLE - BEGIN
    # a report in between is bridged as one without a gap is, for 0.5 s
    hole = (t > begin + stale + 0.5 + 0.1) & (t < BACK - BEGIN)
    for role in ("gap", "range_rate"):
        assert np.isnan(trace.signals[role][hole]).all()
    assert {trace.gate[k] for k in np.flatnonzero(hole)} == {LearnGate.STALE}
    if how != "never":
        assert np.isfinite(trace.signals["gap"][(t > 2.0) & (t < begin)]).all()


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("stale", [0.2, 1.5])
def test_radar_tracks_that_stop_coming(stale: float, tmp_path: Path) -> None:
    """`stale` of a track's distance or rate acts on the lead that is chosen among them."""
    if not RAV4.exists():
        pytest.skip(MISSING)
    folder = ROOT / "dbc"
    text = (folder / "toyota_rav4_2017.toml").read_text()
    text = text.replace('file = "', f'file = "{folder.resolve()}/')
    assert 'distance = "LONG_DIST"' in text
    text = text.replace('distance = "LONG_DIST"', f'distance = {{ signal = "LONG_DIST", stale = {stale} }}')
    (tmp_path / "car.toml").write_text(text)
    car = read_vehicle(tmp_path / "car.toml")
    ids = {track.id for track in car.lead.tracks or ()}
    made = [f for f in open_log(RAV4) if f.t < 14.0]
    trace = trace_of(tmp_path, car, [f for f in made if not (f.id in ids and 6.0 <= f.t < 10.0)])
    t, gap = trace.t, trace.signals["gap"]
    assert np.isfinite(gap[(t > 2.0) & (t < 5.5)]).mean() > 0.5
    assert np.isnan(gap[(t > 6.0 + stale) & (t < 10.0)]).all()
    if stale > 1.2:
        assert np.isfinite(gap[(t > 5.5) & (t < 6.0 + stale - 0.6)]).any()


def test_options_that_cannot_act_are_refused(tmp_path: Path) -> None:
    """What a track's part cannot have of its own is a mistake, not a word without meaning."""
    from canid.values.errors import ConfigError

    folder = ROOT / "dbc"
    text = (folder / "toyota_rav4_2017.toml").read_text().replace('file = "', f'file = "{folder.resolve()}/')
    for old, new, says in (
        ('valid = "VALID"', 'valid = { signal = "VALID", stale = 0.3 }', "lead.valid.stale: set stale in"),
        (
            'lateral = "LAT_DIST"',
            'lateral = { signal = "LAT_DIST", bus = 1 }',
            "lead.lateral.bus: a track is one",
        ),
        (
            "[signals]",
            '[signals]\nlead_valid = "ACC.X"',
            "signals.lead_valid: is given by lead.tracks already",
        ),
    ):
        assert old in text
        (tmp_path / "car.toml").write_text(text.replace(old, new))
        with pytest.raises(ConfigError, match=says.replace(".", r"\.")):
            read_vehicle(tmp_path / "car.toml")
