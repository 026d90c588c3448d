"""`canid demo`: two simulated drives on a virtual bus, recorded and analysed by all of canid; needs no hardware.

The first has known parameters and is estimated live; the second hides an effect, which is found from its recording.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import threading
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path

from canid.analysis.session.session import SessionSettings, World, session
from canid.io.recording.controls import Controls
from canid.mathematics.identification.identifiability import QUOTABLE
from canid.ui.cli import live_session
from canid.ui.cli.commands.simulate import check_log, declared, write
from canid.ui.cli.interrupt import Interrupt
from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, line_printer
from canid.ui.views.end_summary import EstimateTally
from canid.ui.views.terminal_view.state import View
from canid.values import bounded_numbers
from canid.values.errors import CHECK_FAILED, DONE
from canid.values.text import estimate_text
from canid.values.text.names import SYMBOLS, method, readable
from canid.values.text.numbers import number
from canid.values.types import Channel, Identifiable, Interval

# factor of real time: three minutes take half a minute
DEFAULT_SPEED = 6.0
DRIVE = "following_urban"
CHANNEL = "canid-demo"
HIDDEN_CHANNEL = "canid-demo-hidden"
# the drive with a hidden effect
HIDDEN_SEED = 21
HIDDEN_MINUTES = 5
HIDDEN_PROFILE = "urban"
# s for the last frames to arrive
SETTLE_S = 1.0


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        default="demo_out",
        help="folder for the recording and the report; default: demo_out",
    )
    parser.add_argument(
        "--speed",
        type=bounded_numbers.speed,
        default=DEFAULT_SPEED,
        metavar="X",
        help=f"factor of real time; default: {DEFAULT_SPEED:g}",
    )
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Play a drive onto a virtual bus, compare the estimates with the truth; record and diagnose a second drive."""
    from canid.values.shipped_files import shipped

    log = shipped().parent / "replay_logs" / f"{DRIVE}.blf"
    truth = json.loads(log.with_name(f"{DRIVE}.truth.json").read_text(encoding="utf-8"))["channels"]
    out = Path(args.output)
    out.mkdir(parents=True, exist_ok=True)
    json_file = options.json_output(args)
    recording = Output("-o", str(out / "demo.blf"), output_kinds.RECORDING)
    hidden = declared(out / "hidden.blf", force=True)
    hidden_recording = Output("-o", str(out / "hidden_recorded.blf"), output_kinds.RECORDING)
    report = Output("-o", str(out / "report.html"), output_kinds.PAGE)
    outputs.check([json_file, recording, *hidden, hidden_recording, report])
    check_log(hidden[0])
    known = tuple((readable(name), _truth(values)) for name, values in truth.items())
    info(f"{log.name}: a simulated drive of 3 minutes on a virtual bus, at {args.speed:g} × real time")
    for name, values in known:
        info(f"truth: {name}: {values}")
    view = View(f"canid demo · {log.name}", truth=known)
    with Interrupt() as stop:
        code, tally = play_and_watch(log, args.speed, view, recording.path, json_file, stop)
    if stop():
        return stop.code
    estimated = {name: e.channels for name, e in tally.last_ok.items()}
    show = line_printer(args.json)
    comparison = [line for name, channels in estimated.items() for line in compare(name, channels, truth)]
    for line in comparison:
        show(line)
    diagnosed = diagnose_hidden(hidden, hidden_recording, report, show)
    show(f"full diagnosis: {report.path}")
    for line in next_steps(recording.path):
        show(line)
    return code or (DONE if estimated and diagnosed else CHECK_FAILED)


def next_steps(recording: str) -> list[str]:
    """Commands that go on from here: they work in any folder, with what the demo has written.

    Example:
        >>> next_steps("demo_out/demo.blf")[0]
        'next: canid replay demo_out/demo.blf --vehicle generic'
    """
    drive = f"{shlex.quote(recording)} --vehicle generic"
    return [
        f"next: canid replay {drive}",
        f"      canid identify {drive} --report drive.html",
        f"      canid check {drive}",
        "then: canid check YOUR.blf            list the contents of your own log",
        "      canid init YOUR.dbc             propose a vehicle file for your own car",
    ]


def play_and_watch(
    log: Path, speed: float, view: View, record: str, json: Output | None, stop: Interrupt
) -> tuple[int, EstimateTally]:
    """Play a log onto a virtual bus, and run a live session on that bus; returns its exit code and estimates."""
    from canid.io.buses.bus_opener import open_buses
    from canid.io.buses.send import onto
    from canid.io.logs import open_log

    bus = {"interface": "virtual", "channel": CHANNEL}
    buses = open_buses([{**bus, "preserve_timestamps": True}])
    ended = threading.Event()

    def play() -> None:
        onto(bus, open_log(log), speed=speed)
        ended.wait(SETTLE_S)
        ended.set()

    threading.Thread(target=play, daemon=True).start()
    return live_session.watch(
        buses,
        SessionSettings("generic", record),
        view,
        json=json,
        stop=lambda: stop() or ended.is_set(),
        end_at_once=stop.end_at_once,
        controls=Controls(),
    )


def record_at_once(log: str, recording: str) -> World:
    """Play a log onto a virtual bus without pauses and record it, as `canid record` does; returns the recorder's end.

    On `virtual` the log's own times go along, so the recording has the duration of the drive.
    """
    from canid.io.buses.bus_opener import open_buses
    from canid.io.buses.send import onto
    from canid.io.logs import open_log

    bus = {"interface": "virtual", "channel": HIDDEN_CHANNEL}
    buses = open_buses([{**bus, "preserve_timestamps": True}])
    sender = threading.Thread(target=onto, args=(bus, open_log(log)), kwargs={"speed": math.inf}, daemon=True)
    sender.start()
    # what the bus still holds when the sender has ended is drained
    recorded = session(buses, SessionSettings(record=recording), stopped=lambda: not sender.is_alive())
    with closing(recorded) as running:
        (*_, last) = (item for item in running if isinstance(item, World))
    return last


def diagnose_hidden(
    hidden: tuple[Output, Output], recording: Output, report: Output, show: Callable[[str], None]
) -> bool:
    """Simulate a drive with a hidden effect, record it from a virtual bus, diagnose the recording, write the report.

    Returns:
        Whether the hidden effect is among the findings.
    """
    from canid.analysis.drive.drive_reader import read_trace
    from canid.models.diagnosis.diagnose import diagnose
    from canid.models.effects import CATALOGUE
    from canid.models.simulation import simulate
    from canid.signals.vehicle import read_vehicle
    from canid.ui.cli.provenance import provenance
    from canid.ui.views.diagnosis_report import diagnosis_answer
    from canid.ui.views.diagnosis_report.diagnosis_document import page

    info(
        f"now a simulated drive of {HIDDEN_MINUTES} minutes with a hidden effect: "
        "onto the bus at once, recorded, and diagnosed"
    )
    vehicle = read_vehicle("generic")
    effect = next(each for each in CATALOGUE if each.in_demo)
    simulation = simulate(
        minutes=HIDDEN_MINUTES, seed=HIDDEN_SEED, profile=HIDDEN_PROFILE, hide={effect.id: ()}
    )
    write(*hidden, simulation, vehicle)
    recorder = record_at_once(hidden[0].path, recording.path).recorder
    log = str(recorder.path)
    info(f"{log}: {recorder.frames:,} frames recorded, {recorder.drops_bus + recorder.drops_disk} dropped")
    diagnosis = diagnose(read_trace(log, vehicle))
    command = f"canid diagnose {log} --vehicle generic --report"
    diagnosis = diagnosis._replace(provenance=provenance((log,), vehicle, command))
    for line in diagnosis_answer.summary(diagnosis, log, vehicle.name):
        show(line)
    strength = simulation.truth["hidden"][effect.id]
    planted = [f"{p.name} {number(strength[p.name], p.unit)}" for p in effect.parameters]
    show(f"hidden effect: {readable(effect.id)}, {', '.join(planted)}")
    with complete_files.opened_file(report) as file:
        file.write(page(diagnosis, vehicle.name))
    return any(effect.id in (finding.effect, *finding.rivals) for finding in diagnosis.findings)


def _truth(values: dict[str, float]) -> str:
    return f"K {values['K']:.2f}, τ {values['tau']:.2f} s, θ {values['dead_time']:.2f} s"


def compare(name: str, channels: Mapping[str, Channel], truth: Mapping[str, dict[str, float]]) -> list[str]:
    """One line per estimated parameter: its interval, and the truth."""
    lines = []
    for channel, ch in channels.items():
        true_values = truth[channel] | {
            "tau_plus_dead_time": truth[channel]["tau"] + truth[channel]["dead_time"]
        }
        quotable = QUOTABLE[ch.status]
        # the sum is redundant where both of its parts are quoted
        for what in quotable[:3] if ch.status is Identifiable.OK else quotable:
            iv: Interval = getattr(ch, what)
            inside = "inside" if iv.low <= true_values[what] <= iv.high else "OUTSIDE"
            lines.append(
                f"{method(name):6} {readable(channel):14} {SYMBOLS[what]:4} {estimate_text.fixed(iv):20} "
                f"truth {true_values[what]:.2f}: {inside}"
            )
    return lines
