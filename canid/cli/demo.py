"""`canid demo`: no hardware, no files: a simulated drive with known truth on a virtual bus, through the whole of canid."""

from __future__ import annotations

import argparse
import json
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

from canid.cli import options, output_kinds, outputs, sessions
from canid.cli.interrupt import Interrupt
from canid.cli.outputs import Output
from canid.cli.simulate import check_log, declared, write
from canid.cli.talk import talk, teller
from canid.errors import CHECK_FAILED, DONE
from canid.types import Channel, Identifiable, Interval
from canid.views import words
from canid.views.screen import View

# times as fast as the drive was: three minutes in half a minute
SPEED = 6.0
LOG = "following_urban"
CHANNEL = "canid-demo"
# the cause that the second drive hides, and its chance
HIDDEN, HIDDEN_SEED = "relative_speed_dead_zone", 21
# s to let the last frames arrive
SETTLE = 1.0


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o", "--output", metavar="DIR", default="demo_out", help="folder of the recording; default: demo_out"
    )
    parser.add_argument(
        "--speed",
        type=options.speed,
        default=SPEED,
        metavar="X",
        help=f"times as fast as the drive was; default: {SPEED:g}",
    )
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Play the drive onto a virtual bus, and run a live session on it."""
    from canid.frames import open_log
    from canid.frames.bus import open_buses
    from canid.frames.send import onto
    from canid.vehicle.reading import shipped

    log = shipped().parent / "replay_logs" / f"{LOG}.blf"
    truth = json.loads(log.with_name(f"{LOG}.truth.json").read_text(encoding="utf-8"))["channels"]
    out = Path(args.output)
    out.mkdir(parents=True, exist_ok=True)
    json_file = options.json_output(args)
    recording = Output("-o", str(out / "demo.blf"), output_kinds.RECORDING)
    hidden = declared(out / "hidden.blf", force=True)
    report = Output("-o", str(out / "report.html"), output_kinds.PAGE)
    outputs.check([json_file, recording, *hidden, report])
    check_log(hidden[0])
    bus = {"interface": "virtual", "channel": CHANNEL}
    known = tuple((words.INPUT_WORDS[name], _truth(of)) for name, of in truth.items())
    talk(f"{log.name}, a simulated drive of 3 minutes, on a virtual bus, {args.speed:g} times as fast")
    for name, values in known:
        talk(f"truth: {name}: {values}")
    with Interrupt() as stop:
        buses = open_buses([{**bus, "preserve_timestamps": True}])
        ended = threading.Event()

        def play() -> None:
            onto(bus, open_log(log), speed=args.speed)
            ended.wait(SETTLE)
            ended.set()

        threading.Thread(target=play, daemon=True).start()
        view = View(f"canid demo · {log.name}", truth=known)
        code, tally = sessions.watch(
            buses,
            "generic",
            view,
            record=recording.path,
            duration=None,
            json=json_file,
            stop=lambda: stop() or ended.is_set(),
        )
    if stop():
        return stop.code
    told = {name: e.channels for name, e in tally.last_ok.items()}
    tell = teller(args.json)
    hits = [line for name, channels in told.items() for line in compare(name, channels, truth)]
    for line in hits:
        tell(line)
    diagnosed(hidden, report, tell)
    tell(f"open {report.path} for the whole diagnosis")
    tell("next: canid replay replay_logs/following_urban.blf --vehicle generic")
    tell("      canid check YOUR.blf            what is in your own log")
    tell("      canid init YOUR.dbc             a vehicle file for your own car")
    return code or (DONE if told else CHECK_FAILED)


def diagnosed(hidden: tuple[Output, Output], report: Output, tell: Callable[[str], None]) -> None:
    """Hide a cause in a simulated drive, log it, diagnose the log, and write the report."""
    from canid.cli.provenance import provenance
    from canid.diagnosis.diagnosing import diagnose
    from canid.logs import read_trace
    from canid.simulation import simulate
    from canid.vehicle import read_vehicle
    from canid.views import diagnosed as shown
    from canid.views.report import page

    talk("and now a drive of 5 minutes that hides something; canid diagnoses its log")
    vehicle = read_vehicle("generic")
    simulation = simulate(minutes=5, seed=HIDDEN_SEED, profile="urban", hide={HIDDEN: ()})
    log = hidden[0].path
    write(*hidden, simulation, vehicle)
    told = diagnose(read_trace(log, vehicle))
    again = f"canid diagnose {log} --vehicle generic --report"
    told = told._replace(provenance=provenance(log, vehicle, again))
    for line in shown.text(told, log, vehicle.name)[:6]:
        tell(line)
    tell(f"hidden was: {', '.join(f'{k} {v}' for k, v in simulation.truth['hidden'].items())}")
    with outputs.opened_file(report) as file:
        file.write(page(told))


def _truth(of: dict[str, float]) -> str:
    return f"K {of['K']:.2f}, τ {of['tau']:.2f} s, θ {of['dead_time']:.2f} s"


def compare(name: str, channels: Mapping[str, Channel], truth: Mapping[str, dict[str, float]]) -> list[str]:
    """Each estimated number beside its truth."""
    lines = []
    for channel, ch in channels.items():
        of = truth[channel] | {"tau_plus_dead_time": truth[channel]["tau"] + truth[channel]["dead_time"]}
        shown = {
            Identifiable.OK: ("K", "tau", "dead_time"),
            Identifiable.SUM_ONLY: ("K", "tau_plus_dead_time"),
        }
        for what in shown.get(ch.status, ("K",) if ch.status is Identifiable.GAIN_ONLY else ()):
            iv: Interval = getattr(ch, what)
            inside = "inside" if iv.low <= of[what] <= iv.high else "OUTSIDE"
            lines.append(
                f"{name:6} {words.INPUT_WORDS[channel]:14} {words.SYMBOLS[what]:4} {words.interval(iv):20} "
                f"truth {of[what]:.2f}: {inside}"
            )
    return lines
