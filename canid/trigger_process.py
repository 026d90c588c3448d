"""The child process of `canid record --trigger`: decodes frames and evaluates conditions, without estimators."""

from __future__ import annotations

import pickle
import sys
from typing import IO

from canid.estimator_process import Send, serve, trigger_of
from canid.types import Columns


def main() -> int:
    """Run as the child: frames in, truth of the conditions out, until the input ends."""
    return serve(_evaluate)


def _evaluate(arguments: list[str], source: IO[bytes], send: Send) -> None:
    from canid import pipeline
    from canid.triggers.evaluation import watch
    from canid.vehicle import read_vehicle

    vehicle = read_vehicle(arguments[0])
    watching = watch(trigger_of(arguments[1]), vehicle)
    # headway, radar tracks and the pipeline's events come with the samples
    running = pipeline.build(vehicle, estimating=False) if watching.names.needs_samples else None
    state = running.init() if running is not None else None
    send("ready")
    while True:
        try:
            chunk = Columns(*pickle.load(source))
        except EOFError:
            break
        out: list[tuple[int, pipeline.Output]] = []
        if running is not None and state is not None:
            state, out = running.step(state, chunk)
        runs, never = watching.step(chunk, out)
        send("out", (len(chunk.t), [], {}, never, runs))
    send("end")


if __name__ == "__main__":
    sys.exit(main())
