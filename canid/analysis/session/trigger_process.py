"""The child process of `canid record --trigger`: decodes frames and evaluates conditions, without estimators."""

from __future__ import annotations

import sys

from canid.analysis.session.estimator_process import asked, serve
from canid.values.processes.serve import Connection
from canid.values.types import Columns


def main() -> int:
    """Run as the child: frames in, truth of the conditions out, until the input ends."""
    return serve(_evaluate)


def _evaluate(arguments: list[str], parent: Connection) -> None:
    from canid.models.pipeline import pipeline
    from canid.signals.triggers.evaluation import watch

    vehicle, trigger, _ = asked(arguments)
    if trigger is None:
        raise ValueError("no trigger")
    watching = watch(trigger, vehicle)
    # headway, radar tracks and the pipeline's events come with the samples
    running = pipeline.build(vehicle, estimating=False) if watching.names.needs_samples else None
    state = running.init() if running is not None else None
    parent.answer(("ready", None))
    for message in parent.messages():
        chunk = Columns(*message)
        out: list[tuple[int, pipeline.Output]] = []
        if running is not None and state is not None:
            state, out = running.step(state, chunk)
        runs, never = watching.step(chunk, out)
        parent.answer(("out", (len(chunk.t), [], {}, never, runs)))
    parent.answer(("end", None))


if __name__ == "__main__":
    sys.exit(main())
