"""The diagnosis of the drive so far: the same as of the log, cheap, and no danger to the session."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import canid
from canid.analysis.drive import drive_reader
from canid.analysis.session.diagnosis_process import MAX_FAILURES, PACKED, Diagnosing
from canid.analysis.session.session import SessionSettings
from canid.io.buses.bus_opener import open_buses
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.io.recording.controls import Controls
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import live_session
from canid.ui.cli.output import background_diagnosis, output_kinds
from canid.ui.cli.output.outputs import Output
from canid.ui.views.diagnosis_report import diagnosis_answer, diagnosis_json
from canid.ui.views.terminal_view.state import View
from canid.values.findings import Report
from canid.values.text import json_values
from canid.values.types import Driver, Event, LearnGate, Sample

LOGS = Path(__file__).parents[2] / "replay_logs"
DRIVE = LOGS / "following_urban.blf"
# s; bounds what hangs, no more
PATIENCE_S = 300.0
# a child that answers a text, after what stands before it
CHILD = """
import os, sys
from pathlib import Path
from canid.values.processes.serve import connect
parent = connect()
messages = parent.messages()
next(messages)
for message in messages:
    {first}
    parent.answer(("report", len(message), {cpu_s}))
"""


def command(text: str) -> list[str]:
    return [sys.executable, "-c", text]


@contextmanager
def diagnosing(text: str, interval_s: float = 1e9) -> Iterator[Diagnosing]:
    process = Diagnosing(Driver(), interval_s=interval_s, command=command(text))
    try:
        yield process
    finally:
        process.close()


def samples(n: int, first: int = 0) -> Iterator[Sample]:
    for k in range(first, first + n):
        yield Sample(0.1 * k, 1.0, (0.0, 0.0), LearnGate.OPEN, True, 0, {})


def until(condition: Callable[[], object], seconds: float = PATIENCE_S) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def as_json(report: Report) -> str:
    return json_values.document("diagnose", diagnosis_json.document(report, "", ""))


@pytest.mark.slow("diagnoses one drive three times")
def test_the_diagnosis_in_the_background_is_that_of_the_log() -> None:
    """Asked for in the middle and at the end, in whatever parts the samples come; the child keeps what it has."""
    vehicle = read_vehicle("generic")
    with_whole = Diagnosing(vehicle.driver)
    try:
        asked = False
        for step in drive_reader.run(open_log(DRIVE), vehicle):
            for item in step.out:
                with_whole.put(item)
            if not asked and step.chunk.t[-1] > 100.0:
                asked = True
                # at the ordinary priority: a busy machine leaves next to nothing for the lowest one
                with_whole.finish(PATIENCE_S)
        with_whole.finish(PATIENCE_S)
        early, last = with_whole.diagnoses()
    finally:
        with_whole.close()
    assert early.t < 110.0 < 170.0 < last.t
    assert as_json(last.report) == as_json(
        canid.diagnose(DRIVE, "generic")._replace(provenance=last.report.provenance)
    )


@pytest.mark.slow("a session of 12 s and two diagnoses")
def test_a_session_on_a_bus_gives_the_diagnosis_of_its_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is lost, the page is there, and its answer is that of `canid diagnose` on the recording."""
    # a busy machine is not what is tested
    monkeypatch.setattr(live_session, "SESSION_PATIENCE_S", PATIENCE_S)
    bus = {"interface": "virtual", "channel": str(tmp_path)}
    buses = open_buses([{**bus, "preserve_timestamps": True}])
    sender = threading.Thread(target=onto, args=(bus, open_log(DRIVE), 15.0))
    page = Output("--diagnose", str(tmp_path / "page.html"), output_kinds.PAGE)
    settings = SessionSettings("generic", tmp_path / "drive.blf", finish=PATIENCE_S)
    with background_diagnosis.running(page, "generic", Controls()) as diagnosis:
        sender.start()
        code, _ = live_session.watch(
            buses, settings, View("test"), stop=lambda: not sender.is_alive(), diagnosis=diagnosis
        )
    assert code == 0
    assert "<title>" in (tmp_path / "page.html").read_text(encoding="utf-8")
    shown = capsys.readouterr().out
    report = canid.diagnose(tmp_path / "drive.blf", "generic")
    answer = diagnosis_answer.summary(report)
    assert "\n".join(answer[:5]) in shown
    assert len(list(open_log(tmp_path / "drive.blf"))) == len(list(open_log(DRIVE)))


@pytest.mark.long("sessions with child processes")
def test_a_child_that_dies_costs_its_diagnosis_alone(tmp_path: Path) -> None:
    """The next one gets all samples again."""
    once = f"if not os.path.exists({str(tmp_path / 'died')!r}): Path({str(tmp_path / 'died')!r}).touch(); os._exit(9)"
    with diagnosing(CHILD.format(first=once, cpu_s=0.0)) as process:
        for sample in samples(3 * PACKED):
            process.put(sample)
        process.ask()
        until(lambda: (tmp_path / "died").exists())
        until(lambda: process._failures == 1)
        process.ask()
        until(lambda: process.latest() is not None)
        latest = process.latest()
        assert latest is not None
        assert latest.report == 3  # type: ignore[comparison-overlap]
        for sample in samples(PACKED, 3 * PACKED):
            process.put(sample)
        process.ask()
        until(lambda: len(process.diagnoses()) == 1 if process.latest() is latest else True)
        process.finish(PATIENCE_S)
    assert not process.failure


def test_one_that_fails_again_and_again_is_given_up_with_its_reason() -> None:
    """The reason comes as an event, once."""
    with diagnosing("import sys; sys.exit(3)") as process:
        diagnosis = background_diagnosis.BackgroundDiagnosis(None, process, Controls())
        process.put(next(samples(1)))
        for failures in range(1, MAX_FAILURES + 1):
            process.ask()
            until(lambda n=failures: process._failures == n)
        events = [*diagnosis.events(), *diagnosis.events()]
    assert [event.what for event in events] == ["diagnosis_ended"]
    assert events[0].says.startswith("no further diagnosis of the drive so far: ")


@pytest.mark.long("sessions with child processes")
def test_a_long_diagnosis_puts_off_the_next(tmp_path: Path) -> None:
    """They take a tenth of a core on average: after 300 s of computing nothing is due for 45 minutes."""
    with diagnosing(CHILD.format(first="", cpu_s=300.0), interval_s=0.05) as process:
        for k in range(40):
            for sample in samples(5, 5 * k):
                process.put(sample)
            time.sleep(0.05)
        until(lambda: process.latest() is not None)
        assert len(process.diagnoses()) == 1


def test_nothing_waits_for_a_child_that_hangs() -> None:
    """Neither the session nor its end."""
    with diagnosing("import time; time.sleep(1000)") as process:
        for sample in samples(2 * PACKED):
            process.put(sample)
        process.ask()
        until(lambda: process._child is not None)
        process.finish(0.2)
        assert process.latest() is None
    assert not process._thread.is_alive()


@pytest.mark.long("sessions with child processes")
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_child_has_the_lowest_priority() -> None:
    """Until somebody waits for it."""
    nice = "int(Path('/proc/self/stat').read_text().rsplit(')')[1].split()[16])"
    text = CHILD.format(first=f"message = [0] * {nice}", cpu_s=0.0)
    with diagnosing(text) as process:
        process.put(next(samples(1)))
        process.ask()
        until(lambda: process.latest() is not None)
        assert process.latest().report == 19  # type: ignore[union-attr, comparison-overlap]


def test_the_view_shows_the_latest_one_and_events_beside_it() -> None:
    """A diagnosis is no event of the list."""
    from canid.ui.views.terminal_view.picture import render
    from canid.ui.views.terminal_view.state import update
    from canid.values.types import DIAGNOSIS

    view = View("test")
    for says in ("first", "second"):
        view = update(view, Event(1.0, DIAGNOSIS, f"diagnosis of the drive so far: {says}"))
    text = ["".join(span.text for span in line) for line in render(view, 80, 24)]
    assert [line for line in text if "diagnosis" in line] == ["diagnosis of the drive so far: second"]
    assert view.events == ()


def test_a_key_and_a_page_ask_for_a_diagnosis() -> None:
    """Through the controls, once."""
    from canid.ui.web import requests

    controls = Controls()
    for allowed in (requests.OF_SESSION, requests.OF_REPLAY):
        request = requests.parsed('{"do": "diagnose", "more": 1}', allowed)
        assert request == {"do": "diagnose"}
        requests.obey(request, controls)
        assert [controls.take_diagnose(), controls.take_diagnose()] == [True, False]
