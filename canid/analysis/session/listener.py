"""`canid.Listener`: estimates from the messages of a python-can Notifier.

On the bus's thread a message is appended to a queue, nothing else. A thread of the listener makes frames of what
waits and gives them to the estimator process, the same one as of `canid live`.
"""

from __future__ import annotations

import asyncio
import inspect
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from canid.analysis.session.estimator_process import CHUNK_S, Estimating
from canid.analysis.session.listener_delivery import Called, Delivery, Queued, Waiting
from canid.io.buses import python_can
from canid.io.buses.message_stamps import MessageStamps
from canid.io.files import state_keeper
from canid.values.errors import CanidError, one_line
from canid.values.frame_columns import columns_of
from canid.values.types import Estimate, Event, Sample

if TYPE_CHECKING:
    from canid.io.buses.python_can import Listener as _PythonCanListener
    from canid.signals.vehicle import Vehicle
    from canid.values.types import MonitorReport, SignalReport
else:
    _PythonCanListener = python_can.load().Listener

# messages that wait for the listener's thread, which takes all of them every 0.03 s: 10 s of a full 500 kbit/s bus
MAX_WAITING_MESSAGES = 40_000
# s between two saved states, as of `canid live --state`
SAVE_INTERVAL_S = 10.0
# s that the estimators have, after stop(), for what still waits for them
FINISH_S = 1.0

_log = logging.getLogger("canid.listener")


class ListenerCounts(NamedTuple):
    """What became of the messages and estimates of a listener."""

    received: int  # messages that the Notifier gave
    estimated: int  # frames that the estimators have processed
    bad: int  # messages that are no frames, or that no bus can carry
    dropped: int  # messages and frames for which there was no room, or with which the estimator process died
    estimates: int
    estimates_dropped: int  # nobody took them in time, or the event loop was closed
    callback_errors: int
    restarts: int  # of the estimator process
    ready: bool  # the estimator process runs; it takes a second or two to start, and messages wait for it


class Listener(_PythonCanListener):
    """Estimates from a running python-can bus: a listener for `can.Notifier`.

    Nothing is sent, nothing that goes wrong is raised into the bus's thread, and nothing blocks it: frames that cannot
    be used and errors of callbacks are counted (`counts`) and the first of each kind is reported. The estimators run in a
    process of their own, and give the numbers of `canid replay` on the same frames.

    Args:
        vehicle: a vehicle file, its name, or what `read_vehicle` returned.
        on_estimate: called with every `Estimate`, in a thread of the listener; it may take its time.
        queue: an `asyncio.Queue` that gets the estimates instead, on the thread of its loop.
        loop: of `queue`; default: the running one.
        on_error: called once for each kind of trouble, with an exception whose text is one line for the user; default:
            a warning of the logger "canid.listener".
        on_other: called with everything else that comes out: reports of the monitor, findings on signals, events.
        state: go on from what was learnt before and saved in this file; save there every 10 s and at the end.
        channels: of several buses, `Message.channel` of bus 0, 1, ... of the vehicle file; default: as they come.
        finish: s that `stop()` gives the estimators for the frames that still wait for them.

    Without `on_estimate` and `queue`, iterate over the listener: `for estimate in listener`, until `stop()`.

    Raises:
        TypeError: the callback cannot be called.
        ValueError: both a callback and a queue, a coroutine as the callback, or a queue without a loop.
        ConfigError: the vehicle file is wrong, or the state file cannot be read.
        OutputError: the state file cannot be written.

    Example:
        >>> import can
        >>> with can.Bus("doctest", interface="virtual") as bus, Listener("generic") as listener:
        ...     notifier = can.Notifier(bus, [listener])
        ...     notifier.stop()
        >>> list(listener), listener.counts().received
        ([], 0)
    """

    def __init__(
        self,
        vehicle: Vehicle | str | Path,
        on_estimate: Callable[[Estimate], object] | None = None,
        *,
        queue: asyncio.Queue[Estimate] | None = None,
        loop: asyncio.AbstractEventLoop | None = None,
        on_error: Callable[[Exception], object] | None = None,
        on_other: Callable[[MonitorReport | SignalReport | Event], object] | None = None,
        state: str | Path | None = None,
        channels: Sequence[Any] = (),
        finish: float = FINISH_S,
    ) -> None:
        """Check everything, and start the estimator process."""
        from canid.signals.vehicle import read_vehicle

        path = str(vehicle) if isinstance(vehicle, str | Path) else str(vehicle.path)
        if isinstance(vehicle, str | Path):
            read_vehicle(vehicle)
        saved = state_keeper.saved(state)
        self._save = state_keeper.saver(state, saved)
        self._report, self._other, self._finish = on_error, on_other, finish
        self._reported: set[str] = set()
        self._received = self._bad = self._dropped = self._estimates = self._other_errors = 0
        self._waiting: deque[tuple[Any, int]] = deque()
        self._stamps = MessageStamps(channels)
        self._stopping, self._stopped = threading.Event(), threading.Event()
        self._room = MAX_WAITING_MESSAGES  # 0: stopped; what still comes is dropped, and counted
        self._collector: threading.Thread | None = None  # calls `on_other`
        self._delivery = self._delivered_to(on_estimate, queue, loop)
        self._estimating = Estimating(
            path, self._take, state=saved, interfaces={str(each): k for k, each in enumerate(channels)}
        )
        self._thread = threading.Thread(target=self._feed, name="canid-listener", daemon=True)
        self._thread.start()

    def on_message_received(self, msg: Any) -> None:
        """Take a message; never raises, never blocks."""
        self._received += 1
        if len(self._waiting) < self._room:
            self._waiting.append((msg, time.time_ns()))
        else:
            self._dropped += 1

    def on_error(self, exc: Exception) -> None:
        """The Notifier's bus has failed: report it, and leave the handling to python-can and other listeners."""
        self._complain("the bus", exc)
        # what python-can takes as "not handled": a listener that handles it would keep a lost bus spinning
        raise NotImplementedError

    def stop(self) -> None:
        """Let the estimators finish what was received, deliver it, save the state. A second call does nothing.

        From within a callback it returns at once, and the rest is done behind it.
        """
        self._room = 0
        self._stopping.set()
        if threading.current_thread() not in (self._thread, self._collector) and not self._delivery.inside():
            # what the thread waits for: the estimators, the callback, and one more second for the state file
            self._stopped.wait(2.0 * self._finish + 2.0)

    def counts(self) -> ListenerCounts:
        """What became of messages and estimates so far."""
        counts = self._estimating.counts()
        return ListenerCounts(
            self._received,
            counts.done,
            self._bad,
            self._dropped + counts.dropped,
            self._estimates,
            self._delivery.dropped,
            self._delivery.failed + self._other_errors,
            counts.restarts,
            counts.ready,
        )

    @property
    def missing(self) -> list[str]:
        """Mapped signals that never came, as sentences."""
        return list(self._estimating.missing)

    def __iter__(self) -> Iterator[Estimate]:
        """The estimates as they come, until `stop()`; where nobody takes them the oldest are dropped, and counted.

        Raises:
            ValueError: they go to a callback or a queue.
        """
        if not isinstance(self._delivery, Waiting):
            raise ValueError(
                "this Listener's estimates go to its callback or queue; iterate over one without"
            )
        return iter(self._delivery)

    def __enter__(self) -> Self:
        """Return the listener."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop."""
        self.stop()

    def __repr__(self) -> str:
        counts = self.counts()
        state = "stopped" if self._stopping.is_set() else "listening" if counts.ready else "starting"
        return (
            f"<canid.Listener {state}: {counts.received:,} messages, {counts.estimates:,} estimates,"
            f" {counts.dropped:,} dropped>"
        )

    # --- the threads of the listener ---

    def _delivered_to(
        self,
        callback: Callable[[Estimate], object] | None,
        queue: asyncio.Queue[Estimate] | None,
        loop: asyncio.AbstractEventLoop | None,
    ) -> Delivery:
        if callback is not None and queue is not None:
            raise ValueError("Listener: give on_estimate or queue, not both")
        if queue is not None:
            try:
                loop = loop or asyncio.get_running_loop()
            except RuntimeError:
                raise ValueError(
                    "Listener: outside of a running event loop a queue needs loop=... as well"
                ) from None
            return Queued(queue, loop, self._complain)
        if callback is None:
            return Waiting()
        if not callable(callback):
            raise TypeError(f"Listener: on_estimate is {callback!r}; give a function of one estimate")
        if inspect.iscoroutinefunction(callback):
            raise ValueError("Listener: on_estimate is a coroutine function; give a queue=asyncio.Queue()")
        return Called(callback, self._complain)

    def _feed(self) -> None:
        """Give the estimator process what was received, every `CHUNK_S`; at the end, finish and save."""
        due = time.monotonic() + SAVE_INTERVAL_S
        while not self._stopping.wait(CHUNK_S):
            self._pass_on()
            if time.monotonic() >= due:
                due = time.monotonic() + SAVE_INTERVAL_S
                self._keep_state()
        self._pass_on()
        self._estimating.close(self._finish)
        self._keep_state()
        self._delivery.stop(self._finish)
        self._stopped.set()

    def _pass_on(self) -> None:
        waiting, frames = self._waiting, []
        for _ in range(len(waiting)):
            message, arrived_ns = waiting.popleft()
            try:
                frames.append(self._stamps.frame(message, arrived_ns))
            except Exception as error:  # whatever a back end has put into a message
                self._bad += 1
                self._complain("a message", error)
        if frames:
            self._estimating.put(columns_of(frames))

    def _keep_state(self) -> None:
        why = self._save(self._estimating.state)
        if why:
            self._complain("the state file", CanidError(why))

    def _take(self, _: float, item: Any) -> None:
        """One output of the estimator process, from the thread that collects them."""
        self._collector = threading.current_thread()
        if isinstance(item, Estimate):
            self._estimates += 1
            self._delivery.put(item)
        elif not isinstance(item, Sample):
            if isinstance(item, Event) and item.what.startswith("estimator_"):
                self._complain(item.what, CanidError(item.says))
            if self._other is not None:
                try:
                    self._other(item)
                except Exception as error:  # of any kind: it is the user's code
                    self._other_errors += 1
                    self._complain("on_other", error)

    def _complain(self, what: str, error: BaseException) -> None:
        """Report the first trouble of each kind; never raises."""
        if what in self._reported:
            return
        self._reported.add(what)
        says = f"canid.Listener: {what}: {one_line(error)}; further ones are only counted"
        if self._report is None:
            _log.warning("%s", says)
            return
        try:
            reported = CanidError(says)
            reported.__cause__ = error
            self._report(reported)
        except Exception as failed:  # of any kind: it is the user's code
            _log.warning(
                "canid.Listener: on_error itself has failed: %s (it was to report: %s)",
                one_line(failed),
                says,
            )
