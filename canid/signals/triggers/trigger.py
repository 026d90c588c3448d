"""What triggers a recording, and how much of it is kept."""

from __future__ import annotations

import math
from typing import NamedTuple

from canid.signals.triggers.conditions import Condition, Happened, events, has_misfit, parse
from canid.values.errors import ConfigError

# s before a trigger that can be asked for: what a full 1 Mbit/s bus (8,000 frames/s) brings in it fits into the buffer
# (`io.recording.pre_trigger_buffer`) together with 30 s of frames that the conditions were not evaluated for yet
MAX_PRE_S = 60.0
# s after a trigger: longer than a day is a recording without triggers
MAX_POST_S = 86_400.0
# conditions of one recording
MAX_CONDITIONS = 32
# s, defaults: a manoeuvre and what led to it
PRE_S, POST_S = 10.0, 20.0


class Trigger(NamedTuple):
    """Conditions, of which one is enough, and the times around the frames for which one is true."""

    conditions: tuple[str, ...]
    pre: float = PRE_S  # s before the first frame for which a condition is true
    post: float = POST_S  # s after the last one

    @property
    def parsed(self) -> tuple[Condition, ...]:
        """The conditions, parsed."""
        return tuple(parse(text) for text in self.conditions)

    @property
    def decodes(self) -> bool:
        """Whether frames must be decoded: not where marks and the recorder's own events are all."""
        return any(
            not isinstance(comparison, Happened) or comparison.event not in RECORDER_EVENTS
            for comparison in self.parsed
        )

    @property
    def own_events(self) -> frozenset[str]:
        """Events of the recorder that trigger."""
        alone = {comparison.event for comparison in self.parsed if isinstance(comparison, Happened)}
        return frozenset(alone & set(RECORDER_EVENTS) - {"mark"})


# events that conditions can name: of the recorder, and of the pipeline
RECORDER_EVENTS = (
    "mark",
    "bus_lost",
    "bus_back",
    "bus_off",
    "error_passive",
    "frames_dropped",
    "rx_overflow",
)
PIPELINE_EVENTS = (
    "target_change",
    "lead_lost",
    "gain_step",
    "ambiguous_bus",
    "ambiguous_source",
    "clock_step",
)


def checked(trigger: Trigger) -> Trigger:
    """The trigger, once its texts and times are right; its signals are found by `resolve`.

    Raises:
        ConfigError: a condition is none, or a time is out of range.

    Example:
        >>> checked(Trigger(("brake > 0",), pre=5.0)).post
        20.0
    """
    if not trigger.conditions:
        raise ConfigError('a trigger needs a condition, such as --trigger "brake > 0" or --trigger mark')
    if len(trigger.conditions) > MAX_CONDITIONS:
        raise ConfigError(f"{len(trigger.conditions)} conditions; {MAX_CONDITIONS} is the most")
    if not (math.isfinite(trigger.pre) and 0.0 <= trigger.pre <= MAX_PRE_S):
        raise ConfigError(f"--pre {trigger.pre:g}: from 0 to {MAX_PRE_S:g} s are kept in memory")
    if not (math.isfinite(trigger.post) and 0.0 <= trigger.post <= MAX_POST_S):
        raise ConfigError(f"--post {trigger.post:g}: must be from 0 to {MAX_POST_S:g} s")
    for text, condition in zip(trigger.conditions, trigger.parsed, strict=True):
        inside = events(condition) & set(RECORDER_EVENTS)
        if inside and not isinstance(condition, Happened):
            name = min(inside)
            raise ConfigError(
                f'--trigger "{text}": {name} is the recorder\'s, which decodes nothing: '
                f"it stands alone, in a --trigger of its own"
            )
    return trigger


def needs_vehicle(trigger: Trigger) -> bool:
    """Whether the conditions name signals, the monitor, or events of the pipeline.

    >>> needs_vehicle(Trigger(("mark", "event bus_off"))), needs_vehicle(Trigger(("speed > 3",)))
    (False, True)
    """
    return trigger.decodes


def needs_estimators(trigger: Trigger) -> bool:
    """Whether the conditions ask the monitor, or name an event of an estimator.

    >>> needs_estimators(Trigger(("misfit or speed > 3",))), needs_estimators(Trigger(("speed > 3",)))
    (True, False)
    """
    return any(has_misfit(condition) or "gain_step" in events(condition) for condition in trigger.parsed)
