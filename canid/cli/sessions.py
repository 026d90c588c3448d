"""What `live`, `record` and `demo` share: a session on a bus, shown, until it ends; and its exit code."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from typing import Any

from canid.cli import options, output_kinds, outputs, show, streams
from canid.cli.interrupt import Interrupt
from canid.cli.outputs import DetachedOutput, Output, StandardOutput, TextOutput
from canid.cli.priority import raise_priority
from canid.cli.talk import talk, teller
from canid.errors import DONE, NO_BUS, NOT_WRITTEN
from canid.frames.bus import ReceiveOnlyBus
from canid.frames.rotation import Rotation
from canid.session import Result, World, session
from canid.types import Estimate, Screened
from canid.views import as_json, summary, world
from canid.views.screen import BusLine, View

# s after which a mapped signal that never came is told: slow messages come once a second
MISSED = 5.0
# s that the end of a session waits for a reader of --json who does not read
PATIENCE = 0.3


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.frames.command_line import add_bus_arguments

    parser.add_argument("--duration", type=options.seconds, metavar="S", help="end by itself after S seconds")
    options.json_file(parser)
    add_bus_arguments(parser)


def run(
    args: argparse.Namespace,
    *,
    vehicle: str | None,
    record: str | None,
    state: str | None = None,
    rotation: Rotation | None = None,
) -> int:
    """Open the bus and run a session on it."""
    from canid.frames.bus import open_buses
    from canid.frames.command_line import configs_of

    with Interrupt() as stop:  # before the first word: who reads it may send a signal
        json = options.json_output(args)
        option = "--record" if vehicle else "-o"
        recording = Output(option, record, output_kinds.RECORDING) if record else None
        kept = Output("--state", state, output_kinds.STATE) if state else None
        outputs.check([recording, kept, json], options.read_by(args))
        if streams.detach():  # a process of its own, not a program that uses canid as a library
            raise_priority()
        buses = open_buses(configs_of(args))
        for bus in buses:
            if not bus.listen_only.warns:  # a warning comes as an event, and stays in the view
                talk(bus.listen_only.says)
            if bus.configured_by:
                talk(f"{bus.name}: configured by {', '.join(bus.configured_by)}")
        title = " · ".join(["canid live" if vehicle else "canid record", *(bus.name for bus in buses)])
        code, _ = watch(
            buses,
            vehicle,
            View(title),
            record=record,
            state=state,
            duration=args.duration,
            json=json,
            stop=stop,
            rotation=rotation,
        )
    return stop.code if stop() and code == DONE else code


def watch(
    buses: Sequence[ReceiveOnlyBus],
    vehicle: str | None,
    view: View,
    *,
    record: str | None,
    duration: float | None,
    json: Output | None,
    stop: Callable[[], bool],
    state: str | None = None,
    rotation: Rotation | None = None,
) -> tuple[int, summary.Tally]:
    """Show a session until it ends; returns the exit code and what was estimated.

    Nothing that is shown or said is waited for (`streams.detach`, `DetachedOutput`). An output that cannot be written
    ends a session that only looks, never one that records.
    """
    streams.detach()
    tally = summary.Tally()
    last: World | None = None
    blind = ""
    with ExitStack() as stack:
        for bus in buses:
            stack.callback(bus.shutdown)
        file = DetachedOutput(json) if json is not None and not json.stdout else None
        if file is not None:
            stack.callback(file.finish, PATIENCE)  # what an error leaves behind
        sink: TextOutput | None = file or (StandardOutput() if json is not None else None)
        screen = show.display(view, json="-" if json is not None and json.stdout else None)

        def put(item: Result | World) -> None:
            if isinstance(item, World):
                for event in item.events:
                    screen.put(event)
                warnings = [
                    BusLine(bus.listen_only.says, wrong=True) for bus in buses if bus.listen_only.warns
                ]
                screen.lines([*lines(item), *warnings], item.output)
                return
            screen.put(item.item)
            if isinstance(item.item, Estimate | Screened):
                show.write_json(sink, item.item)

        running = stack.enter_context(
            closing(
                session(
                    buses,
                    vehicle,
                    record=record,
                    duration=duration,
                    stopped=stop,
                    state=state,
                    rotation=rotation,
                )
            )
        )
        try:
            for item in running:
                if isinstance(item, World):
                    last = item
                elif isinstance(item.item, Estimate):
                    tally.put(item.item)
                if not record and (error := (file and file.error) or streams.standard_output_error()):
                    raise error
                if blind:
                    continue
                try:
                    put(item)
                except Exception as error:  # a number that cannot be shown
                    if not record:
                        raise
                    blind = f"{type(error).__name__}: {error}"
                    talk(f"output cannot be written ({blind}); the recording goes on")
        finally:
            if not blind:
                screen.close()
        assert last is not None
        if sink is not None and vehicle is None:
            sink.write(as_json.line(to_json(last)) + "\n")
        tell = teller("-" if json is not None and json.stdout else None)
        tell("")
        for line in lines(last):
            tell(line.says)
        for text in summary.estimates(tally):
            tell(text)
        for text in summary.health(None, "", last.counters, ()):
            talk(text)
        unwritten = file.finish(PATIENCE) if file is not None else ""
        if unwritten:
            talk(unwritten)
    if blind or unwritten:
        return NOT_WRITTEN, tally
    return code_of(last, lost=not stop() and last.lost), tally


def to_json(now: World) -> dict[str, Any]:
    """What `canid record --json` tells in the end."""
    r = now.recorder
    buses = [b._asdict() | {"load": as_json.number(b.load)} for b in r.buses]
    told = {
        key: getattr(r, key)
        for key in (
            "state",
            "frames",
            "written",
            "bytes",
            "errors",
            "files",
            "drops_disk",
            "events_unwritten",
            "start_ns",
        )
    }
    return told | {"path": str(r.path or ""), "elapsed": now.elapsed, "drops": r.drops_bus, "buses": buses}


def lines(now: World) -> list[BusLine]:
    """Recorder, buses and estimator, a line each; then what is missing."""
    r = now.recorder
    out = [
        world.recorder(
            "stopping" if now.stopping else r.state,
            str(r.path or ""),
            r.frames,
            r.written,
            r.bytes,
            r.lag,
            r.drops_disk,
            r.files,
            r.events_unwritten,
        )
    ]
    total = sum(b.frames for b in r.buses) or 1
    out += [
        world.bus(
            b.name,
            b.state,
            b.frames,
            r.rate * b.frames / total,
            b.load,
            b.drops,
            b.errors,
            b.controller,
            None if b.tec is None or b.rec is None else (b.tec, b.rec),
            b.impossible,
        )
        for b in r.buses
    ]
    behind = 0
    if now.estimator is not None:
        e = now.estimator
        behind = max(e.offered - e.done - e.dropped, 0)
        out.append(world.estimator(e.ready, e.offered, e.done, e.dropped, e.restarts))
    if now.stopping:
        waits_for = world.stopping(r.waiting, behind)
        out += [waits_for] if waits_for is not None else []
    if now.unsaved:
        out.append(BusLine(now.unsaved, wrong=True))
    if now.elapsed > MISSED:
        if not r.frames:
            out.append(BusLine("no frame has come: bit rate? termination? is another node on?", wrong=True))
        else:
            out += [BusLine(sentence, wrong=True) for sentence in now.missing]
    return out


def code_of(now: World, *, lost: bool) -> int:
    """The exit code that the end of a session deserves."""
    if now.recorder.state.startswith("failed") or now.unsaved or now.recorder.events_unwritten:
        return NOT_WRITTEN
    return NO_BUS if lost else DONE
