"""Public sets by their maps: traffic in both directions, centres, pairs, and episodes that are stacked by an id."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive.drive_parameters import identify, whole_drive
from canid.analysis.tables.column_map import read_map
from canid.analysis.tables.episodes import PAUSE_S
from canid.analysis.tables.table import Selection, Table, open_table, trace_of
from canid.models.pipeline import pipeline
from canid.values.errors import ConfigError, LogError
from canid.values.types import Trace
from tests.fixtures.measured_logs import MEASURED, needs_measured
from tests.tables import platoon
from tests.tables.platoon import Platoon

# samples at the begin and end of a drive or an episode that the slopes and the smoothing of the lead do not reach
EDGE = 25


@pytest.fixture(scope="module")
def drive() -> Platoon:
    return platoon.platoon(21, minutes=1.0)


def _opened(path: Path, vehicle: str | None = None, columns: str | None = None) -> Table:
    return open_table(path, None if columns is None else read_map(columns), Selection((), vehicle))


def _follows(trace: Trace, of: Platoon, k: int, start: float = 0.0, part: slice = slice(None)) -> None:
    """Gap, range rate and speed of vehicle k of a drive, of which the trace has a part from `start` on."""
    t, since = of.t[part], of.t[part][0]
    inside = (trace.t > start + 1.0) & (trace.t < start + t[-1] - since - 2.5)
    assert inside.sum() > 50
    truth = {
        "speed": of.speed[part, k],
        "gap": of.gap(k)[part],
        "range_rate": of.speed[part, k - 1] - of.speed[part, k],
    }
    for role, x in truth.items():
        expected = np.interp(trace.t[inside] - start + since, t, x)
        np.testing.assert_allclose(trace.signals[role][inside], expected, atol=0.05, err_msg=role)


@pytest.mark.parametrize("plain", [False, True])
def test_sumo(tmp_path: Path, drive: Platoon, plain: bool) -> None:
    """Recognised by its header; -1 is no gap, and the leader without one is not listed as following."""
    path = platoon.sumo(tmp_path / "fcd.csv", drive, plain)
    with pytest.raises(ConfigError, match=r"car\.1 \(60 s behind a lead\), car\.2 \(60 s\), car\.0 \(0 s\)"):
        open_table(path)
    table = _opened(path, "car.1")
    assert "read as SUMO (--columns sumo)" in table.notes[0]
    _follows(trace_of(table, pipeline.DT), drive, 1)
    with pytest.raises(ConfigError, match="has none ahead in any of its 600 rows"):
        _opened(path, "car.0")


@pytest.mark.long("many or long tables")
@pytest.mark.parametrize("packed", [False, True])
def test_sumo_in_xml(tmp_path: Path, drive: Platoon, packed: bool) -> None:
    """As written by SUMO, plain or gzipped: ids with entities and letters of other languages, persons, a comment."""
    path = platoon.sumo_xml(tmp_path / "fcd.xml", drive)
    if packed:
        path = path.with_suffix(".xml.gz")
        path.write_bytes(gzip.compress((tmp_path / "fcd.xml").read_bytes()))
    with pytest.raises(ConfigError, match=r"holds 3 vehicles: .* Bus <1> nach Köln \(60 s behind a lead\)"):
        open_table(path)
    table = _opened(path, "Bus <1> nach Köln")
    assert "read as SUMO (--columns sumo)" in table.notes[0]
    assert table.damaged == 0
    trace = trace_of(table, pipeline.DT)
    _follows(trace, drive, 1)
    same = trace_of(_opened(platoon.sumo(tmp_path / "fcd.csv", drive), "car.1"), pipeline.DT)
    np.testing.assert_array_equal(trace.output, same.output)


@pytest.mark.parametrize("cut", [1, 2, 3])
def test_a_damaged_line_of_xml_costs_no_other(tmp_path: Path, drive: Platoon, seed: int, cut: int) -> None:
    """Lines that are cut at a drawn place are counted; the rows of a step whose time is damaged have none."""
    lines = platoon.sumo_xml(tmp_path / "x.xml", drive).read_text(encoding="utf-8").split("\n")
    rng = np.random.default_rng(seed + cut)
    vehicles = [k for k, text in enumerate(lines[20:], 20) if "<vehicle" in text]
    chosen = rng.choice(vehicles, 5, replace=False).tolist()
    for k in chosen:
        lines[k] = lines[k][: int(rng.integers(20, len(lines[k]) - 1))]
    (tmp_path / "x.xml").write_text("\n".join(lines), encoding="utf-8")
    table = _opened(tmp_path / "x.xml", "Bus <1> nach Köln")
    assert table.damaged == 5
    assert table.log.count.read == drive.speed.size - 5


def test_sumo_without_leaders_says_how_to_write_them(tmp_path: Path, drive: Platoon) -> None:
    """As fcd-output is by default, in either form; and XML that is none of it."""
    path = platoon.sumo_xml(tmp_path / "fcd.xml", drive, leader=False)
    with pytest.raises(ConfigError, match=r"--fcd-output\.max-leader-distance"):
        open_table(path)
    path.write_text("<routes>\n</routes>\n", encoding="utf-8")
    with pytest.raises(LogError, match="of XML only SUMO's --fcd-output is read"):
        open_table(path)


@pytest.mark.long("many or long tables")
@pytest.mark.parametrize("heading", [0.0, 128.0, 217.0, 330.0])
def test_exid_in_any_direction(tmp_path: Path, heading: float) -> None:
    """The gap is that of the centres, whatever way the motorway runs: no column is trusted whose meaning no page states."""
    of = platoon.platoon(25, minutes=0.5, rate=25.0)
    path = platoon.exid(tmp_path / "03_tracks.csv", of, heading)
    with pytest.raises(
        ConfigError, match=r"holds 3 vehicles: .* 21 \(30 s behind a lead\), 22 \(30 s\), 20 \(0 s\)"
    ):
        open_table(path)
    for vehicle, k in ((21, 1), (22, 2)):
        table = _opened(path, str(vehicle))
        assert any("read as exiD" in note for note in table.notes)
        trace = trace_of(table, pipeline.DT)
        _follows(trace, of, k)
        inside = slice(EDGE, -EDGE)
        np.testing.assert_allclose(
            trace.output[inside], np.interp(trace.t[inside], of.t, of.accel[:, k]), atol=0.1
        )
    assert any("2 episodes" in note or "1 of 3 vehicles" in note for note in _opened(path, "all").notes)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("recordingId,trackId,initialFrame,finalFrame,numFrames,class\n3,20,0,9,10,car\n", "XX_tracks.csv"),
        ("recordingId,locationId,frameRate,duration\n3,0,25.0,1200\n", "XX_tracks.csv"),
        (
            "recordingId,trackId,frame,xCenter,yCenter,lonVelocity\n3,20,0,1.0,2.0,20.0\n",
            "name no vehicle ahead",
        ),
    ],
)
def test_files_of_a_set_without_a_vehicle_ahead_are_named(tmp_path: Path, text: str, says: str) -> None:
    """Descriptions of recordings, and sets of crossings."""
    path = tmp_path / "x.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=says):
        open_table(path)


@pytest.mark.parametrize("lanes", [(1, 2), (3, 3)])
@pytest.mark.parametrize("head", [True, False])
def test_citysim_in_both_directions(tmp_path: Path, lanes: tuple[int, int], head: bool) -> None:
    """The lead is the vehicle ahead in the direction of travel, also where both directions have the same lane."""
    of = platoon.platoon(22, minutes=0.5, rate=30.0)
    path = platoon.citysim(tmp_path / "x.csv", of, lanes, head)
    for vehicle, k in ((2, 1), (12, 1), (13, 2)):
        table = _opened(path, str(vehicle))
        assert "read as CitySim" in table.notes[0]
        _follows(trace_of(table, pipeline.DT), of, k)
    # who leads its direction has none ahead
    with pytest.raises(ConfigError, match="has none ahead in any of its 900 rows"):
        _opened(path, "11")


def test_speeds_that_are_negative_with_the_direction_are_turned(tmp_path: Path, drive: Platoon) -> None:
    """A table of positions, speeds and accelerations along x, of which two vehicles drive towards lower ones."""
    path = tmp_path / "x.csv"
    lines = ["time,vehicle_id,lane,position,speed,accel,length"]
    for i, t in enumerate(drive.t):
        for k in range(3):
            x = -drive.position[i, k]
            lines.append(
                f"{t:.1f},{k},1,{x:.5f},{-drive.speed[i, k]:.5f},{-drive.accel[i, k]:.5f},{platoon.LENGTH}"
            )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    table = _opened(path, "1")
    assert any("position, speed, accel: turned in 600 of 600 rows" in note for note in table.notes)
    trace = trace_of(table, pipeline.DT)
    _follows(trace, drive, 1)
    inside = slice(EDGE, -EDGE)
    np.testing.assert_allclose(
        trace.output[inside], np.interp(trace.t[inside], drive.t, drive.accel[:, 1]), atol=0.02
    )


def test_positions_that_begin_anew_on_the_next_lane_have_a_direction(tmp_path: Path, drive: Platoon) -> None:
    """As along SUMO's lanes of 300 m: the way is that of the steps, not from the first row to the last."""
    path = tmp_path / "x.csv"
    lines = ["time,vehicle_id,lane,position,speed,length"]
    for i, t in enumerate(drive.t):
        for k in range(2):
            x = drive.position[i, k] + 40.0
            lines.append(f"{t:.1f},{k},{x // 300:.0f},{x % 300:.5f},{drive.speed[i, k]:.5f},{platoon.LENGTH}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    table = _opened(path, "1")
    assert not any("turned" in note for note in table.notes)
    trace = trace_of(table, pipeline.DT)
    gap = trace.signals["gap"][np.isfinite(trace.signals["gap"])]
    assert gap.size > 100
    assert (gap > 0.0).all()


@pytest.mark.parametrize("name", ["lyft", "ultra_av", "ultra_av, ms", "follownet"])
def test_episodes_follow_each_other_with_nothing_across_the_joint(
    tmp_path: Path, drive: Platoon, name: str
) -> None:
    """Three episodes of 20 s: their own starts, three segments, and the values of each in its place."""
    title = name.split(",")[0]
    path = tmp_path / "x.csv"
    if title == "follownet":
        parts = [platoon.follownet(tmp_path / f"{k}.csv", _part(drive, k), k) for k in range(3)]
        texts = [part.read_text(encoding="utf-8").splitlines() for part in parts]
        path.write_text("\n".join([*texts[0], *texts[1][1:], *texts[2][1:]]) + "\n", encoding="utf-8")
    elif title == "lyft":
        platoon.lyft(path, drive)
    else:
        platoon.ultra_av(path, drive, unit=1e-3 if "ms" in name else 1.0)
    table = _opened(path, columns=title if title == "follownet" else None)
    assert any("3 episodes by " in note and "of 19.9 to 19.9 s" in note for note in table.notes)
    trace = trace_of(table, pipeline.DT)
    begins = [k * np.ceil(19.9 + PAUSE_S) for k in range(3)]
    for k, begin in enumerate(begins):
        _follows(trace, drive, 1, begin, slice(200 * k, 200 * (k + 1)))
    segments = [
        {*trace.segment[trace.learn & (trace.t >= begin) & (trace.t < begin + 20.0)]} for begin in begins
    ]
    assert [len(one) for one in segments] == [1, 1, 1]
    assert len(set.union(*segments)) == 3
    paused = (trace.t > 21.0) & (trace.t < begins[1] - 0.05)
    assert not trace.learn[paused].any()
    # one of them by its id
    one = trace_of(_opened(path, "1", title), pipeline.DT)
    assert one.t[-1] < 21.0


def _part(of: Platoon, k: int) -> Platoon:
    rows = slice(200 * k, 200 * (k + 1))
    return Platoon(*(x[rows] for x in of))


def test_waymo_pairs(tmp_path: Path, drive: Platoon) -> None:
    """Rows of both vehicles: each pair of each segment is an episode, with the leader's values at the same times."""
    path = platoon.waymo(tmp_path / "x.csv", drive)
    table = open_table(path)
    assert any("6 episodes by segment_id and follower_id and leader_id" in note for note in table.notes)
    trace = trace_of(table, pipeline.DT)
    begins = [k * np.ceil(19.9 + PAUSE_S) for k in range(6)]
    for k, begin in enumerate(begins):
        _follows(trace, drive, 1 + k % 2, begin, slice(200 * (k // 2), 200 * (k // 2 + 1)))
    alone = trace_of(_opened(path, "2"), pipeline.DT)
    _follows(alone, drive, 2, 0.0, slice(0, 200))


def test_all_vehicles_of_a_set_are_episodes_on_request(tmp_path: Path, drive: Platoon) -> None:
    """`--vehicle-id all`: those that follow, each with its own lead; one that never follows is left out."""
    path = platoon.ngsim(tmp_path / "x.csv", drive)
    with pytest.raises(ConfigError, match="each an episode of its own, with --vehicle-id all"):
        open_table(path)
    table = _opened(path, "all")
    assert any("1 of 3 vehicles have no lead in any row" in note for note in table.notes)
    trace = trace_of(table, pipeline.DT)
    begin = np.ceil(59.9 + PAUSE_S)
    _follows(trace, drive, 1)
    _follows(trace, drive, 2, begin)


def test_times_that_go_on_are_one_drive(tmp_path: Path) -> None:
    """A column of ids in one drive is no reason to cut it, where no map says that it is."""
    path = tmp_path / "x.csv"
    rows = [f"{0.1 * k:.1f},{k // 100},20,30,0.1,{0.01 * (k % 7)}" for k in range(300)]
    path.write_text("time,event_id,speed,gap,range_rate,accel\n" + "\n".join(rows) + "\n", encoding="utf-8")
    table = open_table(path)
    assert not any("episodes" in note for note in table.notes)
    assert table.log.span == (0.0, pytest.approx(29.9))
    anew = [f"{0.1 * (k % 100):.1f},{k // 100},20,30,0.1,{0.01 * (k % 7)}" for k in range(300)]
    path.write_text("time,event_id,speed,gap,range_rate,accel\n" + "\n".join(anew) + "\n", encoding="utf-8")
    assert any("3 episodes by event_id" in note for note in open_table(path).notes)


@pytest.mark.parametrize("title", ["case_id", "trial"])
def test_a_number_that_several_drivers_have_is_no_episode(tmp_path: Path, title: str, seed: int) -> None:
    """Trials 1 to 3 of each of two drivers: the rows of both would alternate within one episode."""
    rng = np.random.default_rng(seed)
    path = tmp_path / "x.csv"
    rows = [
        f"{k // 600},{k // 200 % 3},{0.1 * (k % 200):.1f},20,{30 + rng.normal():.3f},0.1,0.2"
        for k in range(1200)
    ]
    head = f"driver,{title},time,speed [km/h],gap,range_rate,accel\n"
    path.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=f"one {title}: holds several drives: .* --where"):
        open_table(path)
    path.write_text(head + "\n".join(rows[:600]) + "\n", encoding="utf-8")
    assert any(f"3 episodes by {title}" in note for note in open_table(path).notes)


@pytest.mark.parametrize("name", ["waymo", "follownet"])
def test_episodes_are_used_from_their_first_row_to_their_last(
    tmp_path: Path, drive: Platoon, name: str
) -> None:
    """But where the slope of a speed, which stands in for the acceleration, has no rows; and the drive's last 1.6 s."""
    path = tmp_path / "x.csv"
    if name == "waymo":
        platoon.waymo(path, drive)
    else:
        rows = [
            line
            for k in range(3)
            for line in platoon.follownet(tmp_path / "one.csv", _part(drive, k), k).read_text().splitlines()
        ]
        path.write_text(
            "\n".join([rows[0], *(row for row in rows if row[0] != "e")]) + "\n", encoding="utf-8"
        )
    trace = trace_of(_opened(path, columns=name), pipeline.DT)
    lasts = trace.t[np.flatnonzero(np.diff(trace.segment))]
    assert lasts.size == (5 if name == "waymo" else 2)
    for segment in range(lasts.size):
        learnt = trace.learn[trace.segment == segment]
        # times that round to just before the first row or behind the last one; eleven rows of a slope
        assert learnt.size >= 198
        assert learnt.sum() >= (198 if name == "waymo" else 188)
        assert learnt[6:-6].all()


@pytest.mark.slow("an estimate of eight minutes")
def test_one_estimate_over_many_episodes_is_that_of_the_driver(tmp_path: Path) -> None:
    """24 episodes of 20 s: the gain is within its interval, as narrow as that of the drive they were cut from.

    The widths are those of the estimators: `identify` widens them by what this very drive does not exclude of causes.
    """
    of = platoon.platoon(31, minutes=8.0, vehicles=2)
    widths = []
    for episodes in (24, 1):
        trace = trace_of(open_table(platoon.ultra_av(tmp_path / "x.csv", of, episodes)), pipeline.DT)
        gain = identify(trace, select_orders=False, sliding=False).channels["range_rate"].K
        assert gain.low < platoon.K2 < gain.high, episodes
        gain = whole_drive(trace).channels["range_rate"].K
        widths.append(gain.high - gain.low)
    assert widths[0] < 1.3 * widths[1]


@pytest.mark.long("many or long tables")
@needs_measured
def test_measured_sets() -> None:
    """SUMO's ego behind its lead at 40 m, but where it has none; CitySim's vehicle 12 behind 11, not 13."""
    folder = MEASURED / "reports" / "53-others"
    trace = trace_of(_opened(folder / "fcd.csv", "ego"), pipeline.DT)
    gap = trace.signals["gap"]
    assert 30.0 < np.nanmin(gap) < np.nanmax(gap) < 50.0
    assert 0.04 < np.isnan(gap).mean() < 0.06
    trace = trace_of(_opened(folder / "city.csv", "12"), pipeline.DT)
    gap, rate = trace.signals["gap"][EDGE:-EDGE], trace.signals["range_rate"][EDGE:-EDGE]
    assert 30.0 < gap.min() < gap.max() < 50.0
    # the gap is the integral of the rate: of the same vehicle
    np.testing.assert_allclose(np.diff(gap).sum(), rate.sum() * pipeline.DT, atol=0.5)
