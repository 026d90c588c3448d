"""What `live`, `record` and `demo` share: a session on a bus, shown, until it ends; and its exit code."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from typing import Any

from canid.cli import options, show
from canid.cli.interrupt import Interrupt
from canid.errors import DONE, NO_BUS, NOT_WRITTEN
from canid.frames.bus import ReceiveOnlyBus
from canid.frames.rotation import Rotation
from canid.session import Result, World, session
from canid.types import Estimate, Screened
from canid.views import as_json, summary, world
from canid.views.screen import BusLine, View

# s after which a mapped signal that never came is told: slow messages come once a second
MISSED = 5.0


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
        buses = open_buses(configs_of(args))
        for bus in buses:
            options.talk(bus.listen_only.says)
        title = " · ".join(["canid live" if vehicle else "canid record", *(bus.name for bus in buses)])
        code, _ = watch(
            buses,
            vehicle,
            View(title),
            record=record,
            state=state,
            duration=args.duration,
            json=args.json,
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
    json: str | None,
    stop: Callable[[], bool],
    state: str | None = None,
    rotation: Rotation | None = None,
) -> tuple[int, summary.Tally]:
    """Show a session until it ends; returns the exit code and what was estimated.

    A view or a JSON file that cannot be written ends a session that only looks, never one that records.
    """
    tally = summary.Tally()
    last: World | None = None
    blind = False
    with ExitStack() as stack:
        for bus in buses:
            stack.callback(bus.shutdown)
        sink = stack.enter_context(options.sink(json))
        screen = show.display(view, json=json)

        def put(item: Result | World) -> None:
            if isinstance(item, World):
                for event in item.events:
                    screen.put(event)
                screen.lines(lines(item), item.output)
                return
            screen.put(item.item)
            if isinstance(item.item, Estimate | Screened):
                show.write_json(sink, item.item)
                if sink is not None:
                    sink.flush()

        told = session(
            buses,
            vehicle,
            record=record,
            duration=duration,
            stopped=stop,
            state=state,
            rotation=rotation,
        )
        with closing(told) as running:
            try:
                for item in running:
                    if isinstance(item, World):
                        last = item
                    elif isinstance(item.item, Estimate):
                        tally.put(item.item)
                    if blind:
                        continue
                    try:
                        put(item)
                    except Exception as error:  # a terminal that is gone, a number that cannot be shown
                        if not record:
                            raise
                        blind = True
                        why = (
                            error.strerror
                            if isinstance(error, OSError)
                            else f"{type(error).__name__}: {error}"
                        )
                        options.talk(f"output cannot be written ({why}); the recording goes on")
            finally:
                if not blind:
                    screen.close()
        assert last is not None
        if sink is not None and vehicle is None and not blind:
            sink.write(as_json.line(to_json(last)) + "\n")
    if blind:
        return NOT_WRITTEN, tally
    tell = options.talk if json == "-" else print
    tell("")
    for line in lines(last):
        tell(line.says)
    for text in summary.estimates(tally):
        tell(text)
    for text in summary.health(None, "", last.counters, ()):
        options.talk(text)
    return code_of(last, lost=not stop() and last.lost), tally


def to_json(now: World) -> dict[str, Any]:
    """What `canid record --json` tells in the end."""
    r = now.recorder
    buses = [b._asdict() | {"load": as_json.number(b.load)} for b in r.buses]
    told = {
        key: getattr(r, key)
        for key in ("state", "frames", "written", "bytes", "errors", "files", "drops_disk", "start_ns")
    }
    return told | {"path": str(r.path or ""), "elapsed": now.elapsed, "drops": r.drops_bus, "buses": buses}


def lines(now: World) -> list[BusLine]:
    """Recorder, buses and estimator, a line each; then what is missing."""
    r = now.recorder
    out = [
        world.recorder(r.state, str(r.path or ""), r.frames, r.written, r.bytes, r.lag, r.drops_disk, r.files)
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
        )
        for b in r.buses
    ]
    if now.estimator is not None:
        e = now.estimator
        out.append(world.estimator(e.ready, e.offered, e.done, e.dropped, e.restarts))
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
    if now.recorder.state.startswith("failed") or now.unsaved:
        return NOT_WRITTEN
    return NO_BUS if lost else DONE
