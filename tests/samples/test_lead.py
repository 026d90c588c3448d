"""The lead is in the path, nearest and continuous; a change of target is an event, never a jump in range rate."""

from __future__ import annotations

import numpy as np

from canid.signals.samples import lead
from canid.signals.samples.lead import Settings
from canid.values.types import Event, Reading, TrackReading

TRACKS = Settings(from_tracks=True)


def run(
    readings: list[Reading | TrackReading], settings: Settings
) -> tuple[dict[str, list[tuple[float, float]]], list[Event]]:
    state, roles, events = lead.init(), {}, []
    for reading in readings:
        state, out = lead.step(state, reading, settings)
        for item in out:
            if isinstance(item, Event):
                events.append(item)
            else:
                roles.setdefault(item.role, []).append((item.t, item.value))
    return roles, events


def scene(
    duration: float, *objects: dict, yaw_rate: float = 0.0, speed: float = 20.0
) -> list[Reading | TrackReading]:
    """A radar at 20 Hz; an object has track, from, to, gap, rate, lateral, and may have new or valid."""
    out: list[Reading | TrackReading] = []
    for k in range(int(duration * 20)):
        t = k * 0.05
        out += [Reading(t, "speed", speed), Reading(t, "yaw_rate", yaw_rate)]
        for o in objects:
            if o.get("from", 0.0) <= t < o.get("to", 1e9):
                gap = o["gap"] + o["rate"] * t
                out.append(
                    TrackReading(
                        t + 0.001,
                        o["track"],
                        gap,
                        o["rate"],
                        o["lateral"],
                        o.get("valid", True),
                        o.get("new", False),
                    )
                )
    return out


def test_the_nearest_in_the_path_is_followed() -> None:
    roles, events = run(
        scene(
            5.0,
            {"track": 3, "gap": 20.0, "rate": 0.0, "lateral": 3.5},  # next lane, nearer
            {"track": 5, "gap": 40.0, "rate": -1.0, "lateral": 0.4},
            {"track": 9, "gap": 80.0, "rate": 1.0, "lateral": 0.0},
        ),
        TRACKS,
    )
    t, gap = np.array(roles["gap"])[50:].T
    assert np.allclose(gap, 40.0 - t, atol=0.1)
    assert not events


def test_a_track_that_is_not_valid_is_nothing() -> None:
    roles, _ = run(scene(3.0, {"track": 1, "gap": 30.0, "rate": 0.0, "lateral": 0.0, "valid": False}), TRACKS)
    assert all(value != value for _, value in roles["gap"])
    assert {value for _, value in roles["lead_valid"]} == {0.0}


def test_a_flicker_is_not_followed() -> None:
    """An object in the path for a tenth of a second is a reflection."""
    roles, events = run(
        scene(
            6.0,
            {"track": 5, "gap": 40.0, "rate": 0.0, "lateral": 0.0},
            {"track": 2, "gap": 12.0, "rate": 0.0, "lateral": 0.0, "from": 3.0, "to": 3.12},
        ),
        TRACKS,
    )
    assert not events
    assert min(value for _, value in roles["gap"] if value == value) > 39.0


def test_a_cut_in_is_an_event_and_no_jump_in_range_rate() -> None:
    roles, events = run(
        scene(
            10.0,
            {"track": 5, "gap": 60.0, "rate": 0.5, "lateral": 0.0},
            {"track": 2, "gap": 25.0, "rate": -1.0, "lateral": 0.0, "from": 5.0},
        ),
        TRACKS,
    )
    assert [e.what for e in events] == ["target_change"]
    assert 5.0 < events[0].t < 5.5
    rates = [value for _, value in roles["range_rate"]]
    assert np.nanmax(rates) < 0.7
    assert np.nanmin(rates) > -1.2
    serials = [value for _, value in roles["target"]]
    assert sorted(set(serials)) == [1.0, 2.0]


def test_the_same_vehicle_under_another_track_number_goes_on() -> None:
    """Radars renumber: the filter finds that it is the same object, and nothing happens."""
    roles, events = run(
        scene(
            8.0,
            {"track": 5, "gap": 40.0, "rate": -0.5, "lateral": 0.2, "to": 4.0},
            {"track": 11, "gap": 40.0, "rate": -0.5, "lateral": 0.2, "from": 3.8, "new": False},
        ),
        TRACKS,
    )
    assert not [e for e in events if e.what == "target_change"]
    t, gap = np.array(roles["gap"]).T
    known = np.isfinite(gap)
    assert np.allclose(gap[known], 40.0 - 0.5 * t[known], atol=0.2)


def test_the_path_bends_with_the_road() -> None:
    """On a left bend of 400 m radius the lead at 50 m is 3.1 m to the left, and the car at lateral 0 is not ours."""
    speed, radius = 20.0, 400.0
    roles, _ = run(
        scene(
            8.0,
            {"track": 1, "gap": 50.0, "rate": 0.0, "lateral": 50.0**2 / (2 * radius)},
            {"track": 2, "gap": 45.0, "rate": 0.0, "lateral": -0.5},
            yaw_rate=speed / radius,
            speed=speed,
        ),
        TRACKS,
    )
    assert abs(roles["gap"][-1][1] - 50.0) < 0.2


def test_the_roadside_is_not_a_lead_but_a_braking_lead_is() -> None:
    roles, _ = run(scene(3.0, {"track": 1, "gap": 90.0, "rate": -20.0, "lateral": 0.0}), TRACKS)
    assert all(value != value for _, value in roles["gap"])


def test_signals_pass_with_no_target_as_nothing() -> None:
    """Gap and range rate of one frame belong together; "no target" ends the history after the bridge."""
    readings: list[Reading | TrackReading] = []
    for k in range(200):
        t = k * 0.05
        seen = not 4.0 <= t < 7.0
        readings += [
            Reading(t, "gap", 30.0 + t if seen else float("nan")),
            Reading(t, "range_rate", 1.0 if seen else float("nan")),
            Reading(t + 0.01, "pedal", 10.0),
        ]
    roles, events = run(readings, Settings())
    assert len(roles["pedal"]) == 200
    assert [e.what for e in events] == ["lead_lost", "target_change"]
    t, gap = np.array(roles["gap"]).T
    known = np.isfinite(gap)
    assert np.allclose(gap[known], 30.0 + t[known], atol=0.05)
    assert not np.any(known & (t > 4.0) & (t < 6.99))
    assert np.all(np.diff(t) > 0)


def test_lead_valid_false_means_no_lead() -> None:
    readings: list[Reading | TrackReading] = []
    for k in range(100):
        t = k * 0.05
        readings += [
            Reading(t, "gap", 30.0),
            Reading(t, "range_rate", 0.0),
            Reading(t, "lead_valid", float(t < 2.0)),
        ]
    roles, _ = run(readings, Settings())
    assert all(value != value for t, value in roles["gap"] if t > 2.05)
    assert roles["lead_valid"][-1][1] == 0.0


def test_nothing_is_known_between_the_reports_of_two_vehicles() -> None:
    """One leaves the path, another is followed 0.3 s later, or cuts in: no line of the gap joins the two."""
    for until in (5.0, 5.25):
        first = {"track": 3, "gap": 40.0, "rate": 0.0, "lateral": 0.0, "to": until}
        second = {"track": 7, "gap": 25.0, "rate": 0.0, "lateral": 0.0, "from": 5.0}
        roles, _ = run(scene(10.0, first, second), TRACKS)
        t, gap = np.array(roles["gap"]).T
        assert (np.diff(t) >= 0.0).all()
        far, near = np.abs(gap - 40.0) < 1.0, np.abs(gap - 25.0) < 1.0
        between = gap[(t > t[far].max()) & (t < t[near].min())]
        assert between.size, until
        assert np.isnan(between).all()
        assert roles["gap_reported"]
