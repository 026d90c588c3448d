"""All that a session or a replay is shown to: the display, JSON lines, the live page, publishers.

An observer that raises is dropped, and never ends the session. What the user has asked to see on the terminal or as JSON
ends a session that does not record, never one that does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from canid.ui.cli.output.display import Item, Observer
from canid.ui.terminal.messages import info
from canid.ui.views.terminal_view.state import HealthLine


class Observers:
    """Several observers as one."""

    def __init__(
        self, outputs: Iterable[Observer], others: Iterable[Observer] = (), *, recording: bool = False
    ) -> None:
        """Take them.

        Args:
            outputs: the display and JSON lines: what they raise is raised, unless the session records.
            others: what they raise ends their own service alone.
            recording: the session records.
        """
        self.failure = ""  # why the outputs show nothing any more
        self._outputs, self._others = list(outputs), list(others)
        self._recording = recording

    def put(self, item: Item) -> None:
        """Show one output of the pipeline."""
        self._each(lambda observer: observer.put(item))

    def lines(self, lines: Sequence[HealthLine], output: str = "") -> None:
        """Show the state of buses, recorder and estimators, or of the reading."""
        self._each(lambda observer: observer.lines(lines, output))

    def status(self, values: dict[str, Any]) -> None:
        """Give numbers on the session or the replay."""
        self._each(lambda observer: observer.status(values))

    def close(self) -> None:
        """Close all."""
        for observer in self._others:
            _end(observer)
        for observer in self._outputs:
            observer.close()

    def _each(self, show: Callable[[Observer], None]) -> None:
        for observer in [*self._others]:
            try:
                show(observer)
            except Exception as error:  # of any kind: the session goes on without it
                self._others.remove(observer)
                info(
                    f"{type(observer).__name__} has failed ({type(error).__name__}: {error}); the session goes on"
                )
                _end(observer)
        try:
            for observer in self._outputs:
                show(observer)
        except Exception as error:  # such as a number that cannot be shown
            if not self._recording:
                raise
            self.failure = f"{type(error).__name__}: {error}"
            for observer in self._outputs:
                _end(observer)  # the terminal is restored, and shows this line
            self._outputs = []
            info(f"output cannot be written ({self.failure}); the recording goes on")


def _end(observer: Observer) -> None:
    try:
        observer.close()
    except Exception as error:
        info(f"{type(observer).__name__} cannot be closed ({error})")
