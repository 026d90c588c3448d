"""What a pipeline makes of frames, in one run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from canid.models.pipeline.pipeline import Output, Pipeline
from canid.values.frame_columns import chunks
from canid.values.types import Frame


def outputs(pipeline: Pipeline, frames: Iterable[Frame]) -> Iterator[Output]:
    """Every output, in order."""
    state = pipeline.init()
    for chunk in chunks(frames, 4096):
        state, out = pipeline.step(state, chunk)
        for _, item in out:
            yield item
