"""The estimator contract: settings, pure functions of a state, and whole-drive identification, as one value.

An estimator is a file in this folder that defines such a value, and a line in `ESTIMATORS`. Its name is also the
section of the vehicle file that holds its settings, and its key in JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from canid.mathematics.estimators import stated_latency
from canid.values.types import Channel, Estimate, Latency, ResidualTests, Sample, Trace

Settings = TypeVar("Settings")
Setup = TypeVar("Setup")
State = TypeVar("State")


class WholeDrive(NamedTuple):
    """What an estimator finds in all data of a drive at once."""

    channels: Mapping[str, Channel]  # input name -> Channel
    model: Any = None  # the estimator's own fit, for callers in Python
    fit_percent: float | None = None  # NaN: not known; None: the method has none
    residual_tests: ResidualTests | None = None
    specification: str = ""  # follows the estimator's name in text: "(2,2,1), dead time 1 sample"
    details: Mapping[
        str, Any
    ] = {}  # more keys in JSON: numbers, texts, arrays, NamedTuples and mappings of such
    lines: tuple[str, ...] = ()  # more lines in text
    separate: Any = (
        None  # of ARMAX: the Box-Jenkins fit of which the channels are; None: they are the model's
    )
    # how fit_percent was made: the output simulated from the inputs alone, or predicted from its own past, one step ahead
    fit_kind: Literal["simulated", "one_step"] = "simulated"

    def __repr__(self) -> str:
        fit = "" if self.fit_percent is None else f"fit {self.fit_percent:.0f} %"
        lines = [fit] * bool(fit) + [f"{name}: {channel!r}" for name, channel in self.channels.items()]
        return f"WholeDrive({', '.join(lines)})"


class Running(NamedTuple, Generic[State]):
    """An estimator bound to its inputs, its grid and its settings."""

    name: str
    init: Callable[[], State]
    advance: Callable[[State, Sample], tuple[State, bool]]
    estimate: Callable[[State, Sample], tuple[State, Estimate]]
    check_state: Callable[[State], Iterable[str]]  # problems of a restored state
    forget: Callable[[State, float], State]  # see `Estimator.forget`

    def step(self, state: State, sample: Sample) -> tuple[State, Estimate | None]:
        """Take one sample; the estimate, where one is due."""
        state, due = self.advance(state, sample)
        return self.estimate(state, sample) if due else (state, None)


class Estimator(NamedTuple, Generic[Settings, Setup, State]):
    """One identification method, unbound.

    State and settings are NamedTuples. The annotations of the state's fields are what saves, restores and checks it
    (`models.saving.state_codec`, `state_constraints`); those of the settings, with pydantic's constraints, are what checks
    the vehicle file's section. All functions are pure.
    """

    name: str
    settings: type[Settings]  # every field has a default
    configure: Callable[
        [tuple[str, ...], float, Settings], Setup
    ]  # input names, dt [s]; ValueError: no sense in it
    init: Callable[[Setup], State]
    # Take a sample, and say whether an estimate is due: when the kind of status changes, and every
    # `status.ESTIMATE_EVERY_S` (see `status.due`).
    advance: Callable[[Setup, State, Sample], tuple[State, bool]]
    # Make the estimate that is due. A caller that reports few of them does not ask for the others: see `windows.py`.
    estimate: Callable[[Setup, State, Sample], tuple[State, Estimate]]
    identify: Callable[[Trace, Settings], WholeDrive | None] | None = (
        None  # None: windows only; returns None: no model
    )
    check_state: Callable[[Setup, State], Iterable[str]] | None = (
        None  # why a restored state is not of this setup
    )
    # the state without what was learned before so many s, where a finding says that it is wrong
    # (`signal_checks.forgotten_at`); None: nothing is remembered
    forget: Callable[[Setup, State, float], State] | None = None

    def _late(self, setup: Setup, latency: Latency, state: State, sample: Sample) -> tuple[State, Estimate]:
        """Make the estimate that is due, its dead times from what the radar saw."""
        state, made = self.estimate(setup, state, sample)
        return state, made._replace(channels=stated_latency.channels(made.channels, latency))

    def make(
        self, input_names: tuple[str, ...], dt: float, settings: Settings | None = None
    ) -> Running[State]:
        """Bind inputs, grid and settings.

        Args:
            input_names: in the order of `Sample.inputs`.
            dt: s, the grid of the samples.
            settings: None: the defaults.

        Raises:
            ValueError: settings that make no sense.

        >>> from canid.mathematics.estimators.fopdt import FOPDT
        >>> from canid.values.types import LearnGate
        >>> estimator = FOPDT.make(("range_rate",), 0.1)
        >>> first = Sample(0.0, 20.0, (0.1,), LearnGate.OPEN, True, 0, {})
        >>> state, estimate = estimator.step(estimator.init(), first)
        >>> estimate.status
        <Status.CONVERGING: 'converging'>
        """
        given = self.settings() if settings is None else settings
        setup, latency = self.configure(input_names, dt, given), getattr(given, "latency", None)
        check_state = partial(self.check_state, setup) if self.check_state is not None else lambda state: ()
        forget = partial(self.forget, setup) if self.forget is not None else lambda state, since: state
        return Running(
            self.name,
            partial(self.init, setup),
            partial(self.advance, setup),
            partial(self.estimate, setup) if latency is None else partial(self._late, setup, latency),
            check_state,
            forget,
        )


AnyEstimator = Estimator[Any, Any, Any]
AnyRunning = Running[Any]
