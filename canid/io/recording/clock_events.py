"""What the clocks that stamp frames do, as events: steps, stamps out of order, offsets."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from canid.io.buses.bus_reader import Arrival, BusReader

# s between two clocks from which on it is reported: less cannot be distinguished from delays
MIN_APART_S = 0.5


class ClockEvents:
    """Watches the clocks of all buses, in the thread that stamps; `report(what, says)` takes events."""

    def __init__(self, buses: Sequence[BusReader], report: Callable[[str, str], object]):
        self._buses = buses
        self._report = report
        self._added = [0] * len(buses)  # ns, as reported
        self._apart = [0.0] * len(buses)  # s, from the first one's clock, as reported

    def received(self, arrival: Arrival) -> None:
        """Report steps, and what is added to the stamps of a clock with its own zero."""
        each, ns = self._buses[arrival.bus], arrival.frames.ns
        name = each.bus.name
        for step in each.watch.update_many(ns, arrival.at):
            offset = against_this_computer(int(ns[-1]), arrival.at)
            self._report(
                "clock_step", f"{name}: the clock that stamps the frames stepped by {step:+.2f} s{offset}"
            )
        added = each.bus.offset_ns
        if added != self._added[arrival.bus]:
            self._added[arrival.bus] = added
            zero = np.datetime64(added // 10**6, "ms")
            says = f"{name}: its stamps do not count from 1970: {zero} UTC is added to each"
            self._report("stamp_offset", says)

    def since_the_last_call(self) -> None:
        """Report stamps that are not in the order in which frames came, and clocks that disagree."""
        for each in self._buses:
            count, most = each.watch.order()
            if count:
                what = "a frame is" if count == 1 else f"{count:,} frames are"
                says = f"{each.bus.name}: {what} stamped up to {most:.6f} s before the frame that came before"
                self._report("clock_order", f"{says}; recorded in the order in which they came, as stamped")
        first = self._buses[0].watch.lead_ns
        for k, each in enumerate(self._buses):
            lead = each.watch.lead_ns
            if first is None or lead is None:
                continue
            apart = (lead - first) * 1e-9
            if abs(apart - self._apart[k]) > MIN_APART_S:
                self._apart[k] = apart
                than = f"{'ahead of' if apart > 0 else 'behind'} that of {self._buses[0].bus.name}"
                self._report("clocks_differ", f"{each.bus.name}: its clock is {abs(apart):.2f} s {than}")


def against_this_computer(ns: int, at: float) -> str:
    """How far a stamp is from this computer's clock when the frame came, `at` s of the monotonic clock; "": nearly equal."""
    offset = ns * 1e-9 - (time.time() - (time.monotonic() - at))
    return f", {offset:+.2f} s against this computer's clock" if abs(offset) > MIN_APART_S else ""
