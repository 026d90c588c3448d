"""Trigger conditions: what is accepted, the sentences of what is not, and their truth for every frame."""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest

from canid.signals.triggers import trigger
from canid.signals.triggers.conditions import MAX_LENGTH, parse
from canid.signals.triggers.evaluation import Run, Watch, evaluator
from canid.signals.triggers.resolution import Names, resolve
from canid.signals.triggers.trigger import Trigger, checked
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.values.errors import ConfigError
from canid.values.frame_columns import columns_of
from canid.values.types import Event, Frame, MonitorReport

CANID = Path(__file__).parents[2] / "canid"


def names(*texts: str) -> Names:
    return resolve(checked(Trigger(texts)), read_vehicle("generic"))


WRONG = {
    "": "column 1: a signal is missing",
    "brake >": "column 8: a number is missing",
    "brake > x": 'column 9: a number is missing before "x"',
    "brke > 0": 'column 1: no role "brke" (did you mean "brake"?)',
    "speed > 3 and brakepressed": '(did you mean "DRIVER_STATE.BrakePressed"?)',
    "EGO_SPEED.Speed > 3": '(did you mean "VehicleSpeed"?)',
    "EGO.Speed > 3": 'no message "EGO" in generic.dbc',
    "speed > 3 parsecs": '"parsecs" cannot be converted: speed is in m/s; write one of m/s, km/h',
    "brake > 1 km/h": '"km/h" cannot be converted: brake has no unit; leave it out',
    "speed": '"speed" is a number, not yes or no; compare it: speed > 0',
    "1 < speed": "column 1: the signal comes first",
    "speed > 1 < 3": 'column 11: "<" is not expected here; join comparisons by and',
    "speed = 3": 'column 7: "=" is no comparison; write ==',
    "(brake": 'column 7: ")" is missing',
    "brake)": 'column 6: ")" is not expected here',
    "brake adn clutch": 'column 7: "adn" is not expected here (did you mean "and"?)',
    "brake and": "column 10: a signal is missing",
    "not": "column 4: a signal is missing",
    "event": "column 6: the name of an event is missing",
    "event target_chang": 'no event "target_chang" (did you mean "target_change"?)',
    "mark and brake": "mark is the recorder's",
    "speed > 1e999": "column 9: 1e999 is too large",
    "speed > nan": "column 9: a number is missing",
    "speed > 0x10": 'column 10: "x10" cannot be converted',
    "__import__('os').system('id')": "column 11",
    "speed > 3; brake": 'column 10: ";" is not part of a condition',
    "speed.__class__ > 3": 'no message "speed"',
    "\x1b[31mbrake": "\\x1b",
    "(" * 400: "more than 20 brackets",
    "not " * 100 + "brake": "more than 20 brackets",
    "x" * (MAX_LENGTH + 1): "501 characters; 500 is the most",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_a_wrong_condition_is_one_printable_sentence(text: str) -> None:
    """Each names what is wrong, where it is, and what there is instead."""
    with pytest.raises(ConfigError) as error:
        names(text)
    said = str(error.value)
    assert WRONG[text] in said
    assert said.isprintable()
    assert len(said) < 600


def test_random_texts_are_conditions_or_config_errors(seed: int) -> None:
    """Nothing else can happen, whatever the text."""
    rng = random.Random(seed)
    words = [
        "brake",
        "speed",
        "and",
        "or",
        "not",
        "(",
        ")",
        ">",
        "<=",
        "==",
        "3",
        "km/h",
        ".",
        "\0",
        "é",
        "%",
        "=",
        "1e3",
    ]
    accepted = 0
    for _ in range(3000):
        text = rng.choice((" ", "")).join(rng.choice(words) for _ in range(rng.randint(0, 9)))
        try:
            parse(text)
            accepted += 1
        except ConfigError:
            pass
    assert accepted > 20


def test_options_that_cannot_be_meant_end_with_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before a bus is opened or a file is made: a line, and what to do."""
    out = str(tmp_path / "x.blf")
    cases = {
        ("record", "-o", out, "--trigger", "brake > 0"): "needs --vehicle",
        ("record", "-o", out, "--trigger", "brke", "--vehicle", "generic"): "did you mean",
        ("record", "-o", out, "--trigger", "misfit", "--vehicle", "generic"): "canid live",
        ("record", "-o", out, "--pre", "3"): "belongs to a trigger",
        ("record", "-o", out, "--trigger", "mark", "--pre", "61"): "from 0 to 60 s",
        ("record", "-o", out, "--trigger", "mark", "--post", "1e9"): "--post",
        ("live", "--vehicle", "generic", "--trigger", "brake"): "add --record",
        ("record", "-o", out, "--publish", "udp://239.1.1.1:5"): "multicast",
        ("record", "-o", out, "--publish", "udp://255.255.255.255:5"): "broadcast",
        ("record", "-o", out, "--publish", "http://127.0.0.1:5"): "udp://HOST:PORT",
        ("record", "-o", out, "--publish", "udp://127.0.0.1"): "udp://HOST:PORT",
        ("record", "-o", out, "--publish", "udp://127.0.0.1:99999"): "udp://127.0.0.1:9870",
        ("record", "-o", out, "--publish", "udp://127.0.0.1:5/x?allow=1"): "nothing but host and port",
    }
    for words, expected in cases.items():
        assert main([*words, "-i", "virtual", "-c", "none"]) == 2
        assert expected in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_events_of_conditions_exist() -> None:
    """Every name that a condition may hold is reported somewhere in canid."""
    source = "".join(path.read_text() for path in CANID.rglob("*.py") if "triggers" not in path.parts)
    known = {*trigger.RECORDER_EVENTS, *trigger.PIPELINE_EVENTS}
    assert [name for name in known if not re.search(rf'"{name}"', source)] == []


# --- truth ---


def state_frames(seconds: float, pressed: set[int]) -> list[Frame]:
    """The brake's state at 50 Hz and the speed at 100 Hz, 0.36 km/h more with each frame; `pressed`: which states."""
    states = [Frame(0.02 * k, 0, 0x140, bytes([k in pressed, 0])) for k in range(round(50 * seconds))]
    speeds = [
        Frame(0.01 * k + 0.001, 0, 0x120, (36 * k).to_bytes(2, "big") + bytes(4))
        for k in range(round(100 * seconds))
    ]
    return sorted(states + speeds)


def truth(
    found: Names, frames: list[Frame], cuts: list[int], outputs: list[tuple[int, object]]
) -> list[bool]:
    """Row by row, with the chunks cut as given."""
    init, step = evaluator(found)
    state, true = init(), [False] * len(frames)
    for start, stop in zip([0, *cuts], [*cuts, len(frames)], strict=True):
        if start < stop:
            own = [(row - start, item) for row, item in outputs if start <= row < stop]
            state, runs = step(state, columns_of(frames[start:stop]), own)
            for run in runs:
                true[start + run.start : start + run.stop] = [True] * (run.stop - run.start)
    return true


def test_a_pulse_of_one_frame_is_true_until_the_next_and_no_longer() -> None:
    """The state of one frame holds until the next one of its message: exactly these rows, whatever else comes."""
    frames = state_frames(2.0, {7, 30})
    found = names("brake > 0")
    states = [k for k, frame in enumerate(frames) if frame.id == 0x140]
    expected = [states[7] <= k < states[8] or states[30] <= k < states[31] for k in range(len(frames))]
    assert truth(found, frames, [], []) == expected


def test_the_truth_does_not_depend_on_the_chunks(seed: int) -> None:
    """However the frames are cut, the same rows are true; of signals, units, events and the monitor."""
    rng = random.Random(seed)
    frames = state_frames(3.0, set(range(40, 60)))
    fits = [MonitorReport(0.0, ok, 0.0, "", "", {}) for ok in (True, False, True)]
    outputs: list[tuple[int, object]] = [
        (100, fits[0]), (150, fits[1]), (170, Event(1.0, "target_change", "")), (200, fits[2]),
    ]  # fmt: skip
    for text in (
        "brake and not speed > 36 km/h",
        "speed >= 5 and speed < 20 m/s or misfit",
        "event target_change or EGO_SPEED.VehicleSpeed > 100",
        "not (brake or misfit)",
    ):
        found = names(text)
        whole = truth(found, frames, [], outputs)
        assert 0 < sum(whole) < len(whole)
        for _ in range(5):
            cuts = sorted(rng.randrange(len(frames)) for _ in range(rng.choice((1, 7, 100))))
            assert truth(found, frames, cuts, outputs) == whole


def test_what_is_not_measured_triggers_nothing() -> None:
    """Before the first reading, after the last one, and with an invalid value a comparison is neither true nor false."""
    quiet = [Frame(0.1 * k, 0, 0x7, b"") for k in range(40)]
    one = [Frame(0.55, 0, 0x140, bytes([1, 0]))]
    for text in ("brake", "not brake", "speed > 3 or not speed > 3"):
        assert sum(truth(names(text), quiet, [], [])) == 0
    # a yes/no signal is valid for a second
    true = truth(names("brake"), sorted(quiet + one), [], [])
    assert np.flatnonzero(true).tolist() == list(range(6, 17))


def test_the_condition_that_is_true_is_named() -> None:
    """Of several conditions the run names the one that began it."""
    init, step = evaluator(names("clutch", "brake > 0"))
    assert step(init(), columns_of(state_frames(0.2, {3})), ())[1] == [Run(9, 12, "brake > 0")]


def test_a_signal_that_never_comes_is_named() -> None:
    """Of a message that is not on the bus, and of a role that is made of others: a sentence each."""
    watching = Watch(names("CHASSIS_DATA.YawRate > 1 and headway < 2"))
    _, never = watching.step(columns_of(state_frames(0.5, set())), ())
    assert never[0].startswith("CHASSIS_DATA.YawRate: message CHASSIS_DATA (0x150) never seen")
    assert never[1] == "headway, which a trigger needs, has had no value so far"


def test_a_condition_on_a_role_that_is_made_reads_all_its_messages(tmp_path: Path) -> None:
    """A speed of wheels in two messages: both are decoded."""
    (tmp_path / "car.dbc").write_text(
        'VERSION ""\nBU_: X\n'
        + "".join(
            f'BO_ {id_} {name}: 8 X\n SG_ A : 0|16@1+ (0.01,0) [0|100] "{unit}" X\n'
            for id_, name, unit in (
                (1, "PEDAL", "%"),
                (2, "FRONT", "km/h"),
                (3, "REAR", "km/h"),
                (4, "RADAR", "m"),
            )
        )
    )
    (tmp_path / "car.toml").write_text(
        'dbc = ["car.dbc"]\n[signals]\npedal = "PEDAL.A"\nspeed = { mean_of = ["FRONT.A", "REAR.A"] }\n'
        'gap = "RADAR.A"\nrange_rate = { derivative_of = "gap" }\n'
    )
    found = resolve(checked(Trigger(("speed > 70 km/h",))), read_vehicle(tmp_path / "car.toml"))
    assert [message.name for message in found.vehicle.messages] == ["FRONT", "REAR"]
