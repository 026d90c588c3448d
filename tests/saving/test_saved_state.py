"""A saved state is restored to the last bit, and used for the same vehicle and configuration only."""

from __future__ import annotations

import base64
import random
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid import __version__
from canid.models.pipeline import pipeline
from canid.models.saving import saved_state
from canid.models.saving.checksum import Refused, ours, seal, unseal
from canid.models.saving.saved_state import MAX_AGE_S, Restored, resume, saver
from canid.signals.vehicle import read_vehicle
from canid.values.shipped_files import shipped
from canid.values.types import Estimate, Interval, Status
from tests.exact import exact

NOW = 1.8e9  # s since 1970


def saved(driven, t: float) -> bytes:
    known = pipeline.known(driven.states[driven.at(t)])
    assert known is not None
    return saver(driven.vehicle, driven.running).save(known, NOW)


@pytest.mark.slow("states of whole drives, written and read")
def test_saved_at_any_time_it_continues_with_the_same_numbers_to_the_last_bit(driven) -> None:
    """Before, while and after each estimator starts, and later: the outputs continue as without saving."""
    saving = saver(driven.vehicle, driven.running)
    rng = random.Random(7)
    times = [3.0, 19.9, 21.0, *(rng.uniform(1.0, 114.0) for _ in range(9))]
    for t in times:
        k = driven.at(t)
        state = driven.states[k]
        known = pipeline.known(state)
        assert known is not None
        bytes_ = saving.save(known, NOW)
        found = saving.restore(bytes_, NOW)
        assert isinstance(found, Restored)
        # the same bytes again: nothing was lost on the way
        assert saving.save(found.known, NOW) == bytes_
        assert exact(found.known) == exact(known)
        state = state._replace(**found.known._asdict())
        for i in range(k + 1, driven.at(t + 5.0)):
            state, out = driven.running.step(state, driven.chunks[i])
            assert exact([item for _, item in out]) == exact(driven.outputs[i])


def test_nothing_is_saved_before_there_is_anything_new(driven) -> None:
    """A session without a sample leaves the file alone: what it restored does not grow younger by it."""
    assert pipeline.known(driven.running.init()) is None
    found = saver(driven.vehicle, driven.running).restore(saved(driven, 60.0), NOW)
    assert isinstance(found, Restored)
    assert pipeline.known(driven.running.resume(driven.running.init(), found.known)) is None


@pytest.fixture(scope="module")
def whole(driven) -> bytes:
    return saved(driven, 60.0)


@pytest.fixture(scope="module")
def restore(driven) -> Callable[[bytes], Restored | Refused]:
    saving = saver(driven.vehicle, driven.running)
    return lambda data: saving.restore(data, NOW)


@pytest.mark.long("many states")
@settings(max_examples=100, deadline=None, derandomize=True)
@given(data=st.data())
def test_one_flipped_byte_anywhere_is_refused(data, whole, restore) -> None:
    """The checksum covers every byte, and its own bytes are checked."""
    at = data.draw(st.integers(0, 800) | st.integers(0, len(whole) - 1))
    other = data.draw(st.integers(1, 255))
    found = restore(whole[:at] + bytes([whole[at] ^ other]) + whole[at + 1 :])
    assert isinstance(found, Refused)
    assert found.says.startswith(("the saved state ", "the state file "))
    assert "\n" not in found.says


@settings(max_examples=150, deadline=None, derandomize=True)
@given(data=st.data())
def test_a_truncated_or_longer_file_is_refused_and_still_known_as_ours(data, whole, restore) -> None:
    length = data.draw(st.integers(0, 800) | st.integers(0, len(whole) - 1))
    more = data.draw(st.binary(min_size=1, max_size=20))
    for broken in (whole[:length], whole + more, whole + whole):
        assert isinstance(restore(broken), Refused)
        assert ours(broken)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(data=st.binary(max_size=300))
def test_any_other_bytes_are_refused(data, restore) -> None:
    assert isinstance(restore(data), Refused)


@pytest.mark.slow("states of whole drives, written and read")
def test_what_is_refused_is_not_used_at_all(driven, whole) -> None:
    """The pipeline begins exactly as it does without any file."""
    saving = saver(driven.vehicle, driven.running)
    flipped = whole.replace(b'"known"', b'"knowN"', 1)
    assert flipped != whole
    state, event = resume(driven.running, saving, flipped, NOW)
    assert exact(state) == exact(driven.running.init())
    assert event.what == "state_refused"
    assert event.says == "the saved state is damaged: its checksum does not fit; the estimators start fresh"


@pytest.mark.slow("states of whole drives, written and read")
def test_a_correct_checksum_does_not_excuse_wrong_types(driven, whole, restore) -> None:
    """In a file that was edited and given a correct checksum every type is checked, and the place named."""
    fields = unseal(whole)
    assert isinstance(fields, dict)
    assert isinstance(restore(seal(fields)), Restored)
    plain = msgspec.msgpack.decode(base64.b64decode(fields["known"]))
    plain[1][0][0][2] = "soon"  # known.estimators[0].closed.emitted
    fields["known"] = base64.b64encode(msgspec.msgpack.encode(plain)).decode()
    found = restore(seal(fields))
    assert isinstance(found, Refused)
    assert found.says == "the saved state is damaged: Expected `float`, got `str` - at `$[1][0][0][2]`"
    for broken in (
        {},
        {"known": 1},
        {**fields, "known": []},
        {**fields, "known": "ä"},
        {**fields, "known": "@"},
        {**fields, "saved_utc": None},
        {"canid": {}},
    ):
        assert isinstance(restore(seal(broken)), Refused)


def test_a_newer_format_is_named(whole, restore) -> None:
    found = restore(whole.replace(b'"canid_state": 1', b'"canid_state": 2', 1))
    assert found.says == "the saved state has format 2, of a newer canid; this one reads 1"


def test_another_canid_is_named(driven, whole, monkeypatch) -> None:
    monkeypatch.setattr(saved_state, "__version__", "99.0")
    found = saver(driven.vehicle, driven.running).restore(whole, NOW)
    assert found.says == f"the saved state was saved by canid {__version__}; this is 99.0"


@pytest.mark.parametrize(
    ("hours", "taken"), [(0.0, True), (11.9, True), (12.1, False), (-11.9, True), (-13, False)]
)
def test_a_state_of_another_day_is_refused(driven, whole, hours, taken) -> None:
    """12 h either way: a clock that was wrong then or is wrong now gives no age."""
    found = saver(driven.vehicle, driven.running).restore(whole, NOW + 3600.0 * hours)
    assert isinstance(found, Restored) is taken
    assert MAX_AGE_S == 12 * 3600.0
    if not taken:
        assert f"{abs(hours):.1f} h" in found.says


# (what is changed in which file, what the sentence names)
CHANGES = {
    "vehicle": (
        "generic.toml",
        'name = "Generic car-following vehicle"',
        'name = "Another"',
        'vehicle "Generic',
    ),
    "driver": ("generic.toml", "headway_desired = 2.0", "headway_desired = 1.7", "[driver]"),
    "armax": ("generic.toml", "[driver]", "[armax]\nforgetting = 0.997\n\n[driver]", "[armax]"),
    "fopdt": ("generic.toml", "[driver]", "[fopdt]\nwindow = 50.0\n\n[driver]", "[fopdt]"),
    "lead": ("generic.toml", "[driver]", "[lead]\ngap_noise = 0.3\n\n[driver]", "[lead]"),
}


def changed(folder: Path, file: str, old: str, new: str) -> Path:
    """A copy of the generic vehicle with one change."""
    for name in ("generic.toml", "generic.dbc"):
        text = (shipped() / name).read_text(encoding="utf-8")
        if name == file:
            assert old in text, (file, old)
            text = text.replace(old, new, 1)
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "generic.toml"


@pytest.mark.slow("states of whole drives, written and read")
@pytest.mark.parametrize("change", CHANGES)
def test_another_vehicle_or_configuration_is_refused_and_named(driven, whole, tmp_path, change) -> None:
    *how, named = CHANGES[change]
    vehicle = read_vehicle(changed(tmp_path, *how))
    found = saver(vehicle, pipeline.build(vehicle)).restore(whole, NOW)
    assert isinstance(found, Refused)
    assert named in found.says


def test_a_dbc_that_scales_otherwise_is_another_configuration(driven, whole, tmp_path) -> None:
    """The same names, another number: what was learnt in the old unit must not go on in the new one."""
    signal = next(line for line in (shipped() / "generic.dbc").read_text().splitlines() if " SG_ " in line)
    factor = signal[signal.index("(") : signal.index(")") + 1]
    low, offset = factor[1:-1].split(",")
    other = signal.replace(factor, f"({float(low) * 2:g},{offset})")
    vehicle = read_vehicle(changed(tmp_path, "generic.dbc", signal, other))
    found = saver(vehicle, pipeline.build(vehicle)).restore(whole, NOW)
    assert isinstance(found, Refused)
    assert "[signals] or their DBC changed" in found.says


def test_words_in_the_files_change_nothing(driven, whole, tmp_path) -> None:
    """A comment, another folder, another order: the numbers mean the same."""
    path = changed(tmp_path, "generic.toml", "[driver]", "# a remark\n[driver]")
    vehicle = read_vehicle(path)
    assert isinstance(saver(vehicle, pipeline.build(vehicle)).restore(whole, NOW), Restored)


def test_another_grid_is_refused(driven, whole) -> None:
    running = pipeline.build(driven.vehicle, dt=0.05)
    found = saver(driven.vehicle, running, 0.05).restore(whole, NOW)
    assert isinstance(found, Refused)
    assert "the grid's step" in found.says


def test_estimators_whose_state_is_built_otherwise_refuse_the_old_one(driven, whole) -> None:
    """Nobody has to remember to count a version up: another field is another state."""

    class More(NamedTuple):
        t: float
        more: int

    first = driven.running.init()
    running = driven.running._replace(
        init=lambda: first._replace(estimators=(More(0.0, 1), *first.estimators[1:]))
    )
    found = saver(driven.vehicle, running).restore(whole, NOW)
    assert isinstance(found, Refused)
    assert "the estimators' state changed" in found.says


def ok(outputs: list[pipeline.Output]) -> dict[str, Estimate]:
    return {x.estimator: x for x in outputs if isinstance(x, Estimate) and x.status is Status.OK}


# s; the age of the newest sample, and half a second
AT_ONCE = 2.5


@pytest.mark.slow("states of whole drives, written and read")
def test_after_a_restart_it_continues_at_once(driven) -> None:
    """A new session whose time begins at 0, as after a restart in the car: the same estimators report at once.

    Whatever the pause was: each estimator that was ok when it was saved is ok within 2.5 s of the first frame, unless
    the uninterrupted drive is not; and for 15 s its K is inside the uninterrupted interval.
    """
    saving = saver(driven.vehicle, driven.running)
    spoke = 0
    for t, pause in ((47.3, 0.0), (61.0, 1.0), (75.6, 60.0), (90.2, 3600.0), (101.9, 36000.0)):
        k = driven.at(t)
        state, event = resume(driven.running, saving, saved(driven, t), NOW + pause)
        assert event.what == "state_restored"
        begin = float(driven.chunks[k].t[0])
        before = set(ok([x for out in driven.outputs[driven.at(t - 0.6) : k] for x in out]))
        first: dict[str, float] = {}
        uninterrupted: dict[str, Estimate] = {}
        expected: set[str] = set()
        for i in range(k, driven.at(t + 15.0)):
            t_since = (driven.chunks[i].t - begin).round(9)
            since = float(t_since[-1])
            state, out = driven.running.step(state, driven.chunks[i]._replace(t=t_since))
            uninterrupted |= ok(driven.outputs[i])
            expected |= set(uninterrupted) if since <= AT_ONCE else set()
            for name, e in ok([item for _, item in out]).items():
                first.setdefault(name, since)
                assert 0.0 <= e.t <= since
                K = uninterrupted[name].channels["range_rate"].K if name in uninterrupted else Interval()
                # NaN: this K is not identifiable in the uninterrupted drive just now
                if K.value == K.value:
                    assert K.low <= e.channels["range_rate"].K.value <= K.high
        assert {name for name, since in first.items() if since <= AT_ONCE} >= expected & before
        spoke += len(expected & before)
    assert spoke >= 5


@pytest.mark.slow("states of whole drives, written and read")
def test_many_restarts_add_up(driven) -> None:
    """Restarted every 12 s from the beginning, the drive still becomes ok, and its time runs on."""
    saving = saver(driven.vehicle, driven.running)
    data, found = None, {}
    for start in range(0, 96, 12):
        state = driven.running.init() if data is None else resume(driven.running, saving, data, NOW)[0]
        begin = float(driven.chunks[driven.at(start)].t[0])
        for i in range(driven.at(start), driven.at(start + 12.0)):
            chunk = driven.chunks[i]
            state, out = driven.running.step(state, chunk._replace(t=(chunk.t - begin).round(9)))
            found |= ok([item for _, item in out])
        known = pipeline.known(state)
        assert known is not None
        data = saving.save(known, NOW)
    assert "fopdt" in found
    assert 80.0 < known.time.t + known.time.ahead < 96.0
    assert known.time.segments == 7
