"""`--state`: a restart goes on from what was learnt; a state that does not fit is reported, and has no other effect."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.drive import drive_reader
from canid.analysis.session import estimator_process
from canid.analysis.session.estimator_process import Estimating
from canid.analysis.session.session import Result, SessionSettings, World, session
from canid.io.buses.bus_opener import open_buses
from canid.io.buses.send import onto
from canid.io.files import state_file
from canid.io.logs import open_log
from canid.models.pipeline import pipeline
from canid.models.saving.checksum import seal, unseal
from canid.models.saving.saved_state import Restored, saver
from canid.signals.vehicle import read_vehicle
from canid.ui.cli.health_lines import health_lines
from canid.ui.cli.live_session import exit_code
from canid.values.errors import DONE, NO_BUS, NOT_WRITTEN, USAGE, OutputError
from canid.values.frame_columns import chunks, columns_of
from canid.values.types import Estimate, Event, Frame, Status
from canid.values.window import Window
from tests.pipeline_outputs import outputs as outputs_of

REPO = Path(__file__).parents[2]
LOG = REPO / "replay_logs" / "following_urban.blf"


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def ok(items: Iterable[Any]) -> set[str]:
    """Estimators with status `ok` among these items."""
    return {x.estimator for x in items if isinstance(x, Estimate) and x.status is Status.OK}


@pytest.fixture(scope="module")
def learnt(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """State after a minute of driving, saved with the present time."""
    vehicle = read_vehicle("generic")
    running = pipeline.build(vehicle)
    state = running.init()
    for chunk in chunks(Window(0.0, 60.0).frames(open_log(LOG))):
        state, _ = running.step(state, chunk)
    known = pipeline.known(state)
    assert known is not None
    return saver(vehicle, running).save(known, time.time())


# --- replay ---


@pytest.mark.slow("whole commands, one after the other")
def test_replay_in_two_halves_goes_on(canid, tmp_path) -> None:
    """The second half has status `ok` within a second of data; a fresh start takes twenty."""
    state, out = tmp_path / "driver.json", tmp_path / "out.jsonl"
    ran = canid("replay", LOG, "--vehicle", "generic", "--stop", 45, "--state", state, "--json", out)
    assert ran.code == DONE
    when_saved = {e["estimator"] for e in lines(out) if e["t"] > 42.5 and e["status"] == "ok"}
    assert "fopdt" in when_saved
    assert json.loads(state.read_text())["vehicle"] == "Generic car-following vehicle"
    ran = canid(
        "replay", LOG, "--vehicle", "generic", "--start", 45, "--stop", 50, "--state", state, "--json", out
    )
    assert ran.code == DONE
    assert "continue from the state saved 0 s ago" in ran.err
    first = [e for e in lines(out) if e["t"] <= 46.0]
    assert {e["estimator"] for e in first if e["status"] == "ok"} >= when_saved
    # the newest samples are up to 1.9 s old
    assert 48.0 < json.loads(state.read_text())["session_time"] <= 50.0
    ran = canid("replay", LOG, "--vehicle", "generic", "--start", 45, "--stop", 50, "--json", out)
    assert not [e for e in lines(out) if e["status"] == "ok"]


@pytest.mark.slow("whole commands, one after the other")
def test_python_replay_goes_on_too(tmp_path, learnt) -> None:
    """A replay that its reader closes early saves its state as well."""
    path = tmp_path / "driver.json"
    estimates = drive_reader.replay(LOG, "generic", state=path)
    while next(estimates).t < 3.0:
        pass
    estimates.close()  # type: ignore[attr-defined]
    assert 2.0 < json.loads(path.read_text())["session_time"] < 4.0


def broken(learnt: bytes) -> dict[str, tuple[bytes, str]]:
    fields = unseal(learnt)
    assert isinstance(fields, dict)
    return {
        "damaged": (learnt[:5000] + b"#" + learnt[5001:], "is damaged: its checksum does not fit"),
        "empty": (b"", "is empty"),
        "truncated": (learnt[:-100], "is damaged"),
        "newer": (learnt.replace(b": 1,", b": 3,", 1), "format 3, of a newer canid"),
        "another vehicle": (seal({**fields, "vehicle": "Truck"}), 'is of the vehicle "Truck"'),
        "old": (seal({**fields, "saved_utc": 1.0e9}), "h ago, more than 12 h"),
        "another configuration": (
            seal({**fields, "configuration": {**fields["configuration"], "driver": "0"}}),
            "[driver] changed",
        ),
    }


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize(
    "how", ["damaged", "empty", "truncated", "newer", "another vehicle", "old", "another configuration"]
)
def test_a_refused_state_is_told_in_one_sentence_and_replaced(canid, tmp_path, learnt, how) -> None:
    """Exit code 0; the estimates are those of a fresh start, to the last digit."""
    data, sentence = broken(learnt)[how]
    state, fresh, out = (tmp_path / name for name in ("driver.json", "fresh.jsonl", "out.jsonl"))
    state.write_bytes(data)
    part = ("replay", LOG, "--vehicle", "generic", "--stop", 4, "--json")
    canid(*part, fresh)
    ran = canid(*part, out, "--state", state)
    assert ran.code == DONE
    lines_on_state = [line for line in ran.err.splitlines() if "state" in line]
    assert len(lines_on_state) == 1
    assert sentence in lines_on_state[0]
    assert lines_on_state[0].endswith("the estimators start fresh")
    assert out.read_text() == fresh.read_text()
    assert isinstance(unseal(state.read_bytes()), dict)


def test_somebody_elses_file_is_never_written_over(canid, tmp_path) -> None:
    """A vehicle file or a log that is named by mistake is refused by its name; any other file stays what it is."""
    other = tmp_path / "car.toml"
    other.write_text("name = 'My car'\n")
    ran = canid("replay", LOG, "--vehicle", "generic", "--stop", 3, "--state", other)
    assert ran.code == USAGE
    assert "the name is that of a configuration" in ran.line
    assert other.read_text() == "name = 'My car'\n"
    other = other.rename(tmp_path / "car.json")
    ran = canid("replay", LOG, "--vehicle", "generic", "--stop", 3, "--state", other)
    assert ran.code == DONE
    assert "was not written by canid: it is left as it is" in ran.err
    assert other.read_text() == "name = 'My car'\n"


@pytest.mark.parametrize(
    "verb",
    [("replay", LOG), ("live", "-i", "virtual", "-c", "state", "--duration", "20")],
    ids=lambda v: v[0],
)
def test_what_can_never_be_read_or_written_ends_it_before_it_begins(canid, tmp_path, verb) -> None:
    """A folder as state file is a usage error (2), a missing folder a write error (5); one line each."""
    ran = canid(*verb, "--vehicle", "generic", "--state", tmp_path, "--json", tmp_path / "out.jsonl")
    assert ran.code == USAGE
    assert ran.err.splitlines()[-1].startswith(f"canid: {tmp_path} is no file")
    ran = canid(*verb, "--vehicle", "generic", "--state", tmp_path / "none" / "driver.json")
    assert ran.code == NOT_WRITTEN
    assert "driver.json: the state cannot be written (No such file or directory)" in ran.err
    assert not list(tmp_path.iterdir())


def test_sending_a_log_has_no_state(canid, tmp_path) -> None:
    ran = canid("replay", LOG, "--onto", "-i", "virtual", "-c", "x", "--state", tmp_path / "driver.json")
    assert ran.code == USAGE
    assert "--state" in ran.line


# --- live ---


@pytest.mark.slow("whole commands, one after the other")
def test_live_says_what_it_refuses_and_ends_well(canid, tmp_path, learnt) -> None:
    """With JSON on standard output the message goes to standard error; exit 3, since nobody sends."""
    state = tmp_path / "driver.json"
    state.write_bytes(learnt[:-1])
    ran = canid(
        "live", "-i", "virtual", "-c", "refuse", "--vehicle", "generic", "--duration", 4, "--state", state, "--json", "-"
    )  # fmt: skip
    assert ran.code == NO_BUS
    assert "the saved state is damaged: its checksum does not fit; the estimators start fresh" in ran.err
    # nothing was learnt: the old file is left for inspection
    assert state.read_bytes() == learnt[:-1]


OFTEN = """
import sys
from canid.analysis.session import estimator_process
from canid.models.saving import saved_state
saved_state.SAVE_INTERVAL_S = 0.0
sys.exit(estimator_process.main())
"""


@pytest.mark.slow("whole commands, one after the other")
def test_live_goes_on_and_saves(tmp_path, learnt) -> None:
    """A session on a bus: the restoring reported, `ok` at once, newer states saved before and at the end."""
    path = tmp_path / "driver.json"
    path.write_bytes(learnt)
    part = [f._replace(t=f.t - 60.0) for f in Window(60.0, 64.5).frames(open_log(LOG))]
    config = {"interface": "virtual", "channel": str(tmp_path)}
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, part, 1.0))
    sender.start()
    deadline = time.monotonic() + 600.0

    def saved_meanwhile() -> bool:
        assert time.monotonic() < deadline
        return not sender.is_alive() and path.read_bytes() != learnt

    child = [sys.executable, "-c", OFTEN, "generic"]
    items = list(
        session(buses, SessionSettings("generic", state=path, command=child), stopped=saved_meanwhile)
    )
    results = [item.item for item in items if isinstance(item, Result)]
    events = [x for x in results if isinstance(x, Event)]
    assert [event.what for event in events] == ["state_restored"], events
    # in 4.5 s a fresh start can say nothing
    assert "fopdt" in ok(results)
    last = items[-1]
    assert isinstance(last, World)
    assert last.unsaved == ""
    vehicle = read_vehicle("generic")
    found = saver(vehicle, pipeline.build(vehicle)).restore(path.read_bytes(), time.time())
    assert isinstance(found, Restored)
    # the minute that was there, and what was driven now
    assert found.known.time.t > 1.0
    assert found.known.time.t + found.known.time.ahead > 60.0


# The estimator's own child, which hands its state over after every message and fails once.
FAILS_ONCE = """
import os, sys, time
from canid.analysis.session import estimator_process
from canid.models.pipeline import pipeline
from canid.models.saving import saved_state
saved_state.SAVE_INTERVAL_S = 0.0
_, vehicle, marker, fault = sys.argv
sys.argv = [sys.argv[0], vehicle]
if not os.path.exists(marker):
    open(marker, "w").close()
    build = pipeline.build
    def failing(vehicle):
        running = build(vehicle)
        def step(state, chunk):
            if chunk.t[-1] > 62.0:
                {"dies": lambda: os.kill(os.getpid(), 9), "hangs": lambda: time.sleep(1000)}[fault]()
            return running.step(state, chunk)
        return running._replace(step=step)
    pipeline.build = failing
sys.exit(estimator_process.main())
"""


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("fault", ["dies", "hangs"])
def test_a_child_that_fails_is_followed_by_one_that_goes_on(fault, tmp_path, monkeypatch) -> None:
    """Without a state file: the next child process estimates within one second of the data that it gets."""
    monkeypatch.setattr(estimator_process, "ANSWER_TIMEOUT_S", 3.0)
    outputs: list[tuple[float, Any]] = []
    command = [sys.executable, "-c", FAILS_ONCE, "generic", str(tmp_path / "failed"), fault]
    running = Estimating("generic", lambda t, item: outputs.append((t, item)), command)
    before = list(Window(0.0, 60.0).frames(open_log(LOG)))
    running.put(columns_of(before))
    wait(lambda: running.counts().done == len(before))
    running.put(columns_of([Frame(64.5, 0, 1, b"")]))
    wait(lambda: running.counts().restarts == 1 and running.counts().ready)
    after = list(Window(66.0, 70.0).frames(open_log(LOG)))
    running.put(columns_of(after))
    assert running.close(60.0)
    counts = running.counts()
    assert counts.restarts == 1
    assert counts.dropped == 1
    assert counts.done == len(before) + len(after)
    events = [item.what for _, item in outputs if isinstance(item, Event)]
    assert events == ["estimator_restarted", "state_restored"]
    assert "fopdt" in ok(item for t, item in outputs if 59.0 <= t <= 60.0)
    # what one speaks that saw the same frames and never failed
    alone = outputs_of(pipeline.build(read_vehicle("generic")), [*before, *after])
    expected = within_a_second(alone)
    assert "fopdt" in expected
    assert within_a_second(item for _, item in outputs) == expected


def within_a_second(items: Iterable[Any]) -> set[str]:
    """Estimators with status `ok` in the first second from 66 s on."""
    return ok(item for item in items if isinstance(item, Estimate) and 66.0 <= item.t <= 67.0)


def wait(done) -> None:
    """Wait until a condition holds, a minute at most."""
    deadline = time.monotonic() + 600.0
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.02)


# dies of every state that it is given
ALLERGIC = """
import pickle, sys
def say(kind, payload=None):
    pickle.dump((kind, payload), sys.stdout.buffer)
    sys.stdout.buffer.flush()
say("ready")
while True:
    try:
        chunk = pickle.load(sys.stdin.buffer)
    except EOFError:
        break
    if isinstance(chunk, bytes):
        sys.exit(1)
    say("out", (len(chunk[0]), [], {}, []))
say("end")
"""


def test_a_state_that_ends_a_child_is_not_given_to_the_next() -> None:
    """One restart, not one after the other."""
    items: list[Any] = []
    running = Estimating(
        "generic", lambda t, item: items.append(item), [sys.executable, "-c", ALLERGIC], b"poison"
    )
    wait(lambda: running.counts().restarts == 1 and running.counts().ready)
    running.put(columns_of([Frame(0.1 * k, 0, 1, b"") for k in range(50)]))
    assert running.close(30.0)
    assert running.counts().done == 50
    assert running.counts().restarts == 1
    assert running.state is None


@pytest.mark.slow("whole commands, one after the other")
def test_a_disk_that_fills_up_in_the_drive_is_told_and_costs_no_estimate(
    tmp_path, learnt, monkeypatch
) -> None:
    """The session goes on; the last report and the exit code say that the state could not be saved."""
    path = tmp_path / "driver.json"

    def full(path: Path, _: bytes) -> None:
        raise OutputError(f"{path}: the state cannot be written (No space left on device)")

    monkeypatch.setattr(state_file, "write", full)
    part = list(Window(0.0, 4.0).frames(open_log(LOG)))
    config = {"interface": "virtual", "channel": str(tmp_path)}
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, part, 1.0))
    sender.start()
    settings = SessionSettings("generic", state=path, finish=60.0)
    items = list(session(buses, settings, stopped=lambda: not sender.is_alive()))
    last = items[-1]
    assert isinstance(last, World)
    assert last.unsaved == f"{path}: the state cannot be written (No space left on device)"
    assert last.estimator is not None
    assert last.estimator.done == last.estimator.offered == len(part)
    assert exit_code(last, lost=False) == NOT_WRITTEN
    assert [line.text for line in health_lines(last) if line.wrong] == [last.unsaved]
