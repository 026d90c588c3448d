"""ARX predictor of the driver: the output from its own past and from the driver's inputs."""

from __future__ import annotations

from collections.abc import Sequence

from canid.models.monitor import features
from canid.models.monitor.predictor import Misfit, Predictor, scaled_coefficients

# rows; 1 s of its own past whitens noise of one to three states
OUTPUT_LAGS = range(1, 6)
# rows; dead times begin at 0.2 s, and after 1.4 s the rest of a response is in the output's own past
INPUT_LAGS = range(1, 8)
# the headway changes with the sum of the range rate: every second lag is nearly redundant
SLOW_INPUT_LAGS = {"headway_error": range(1, 8, 2)}

# of a gain; drivers' gains of one road and hour scatter by some 10 % (Chen & Ulsoy 2001 find more over hours)
GAIN_MARGIN = 0.1


def predictor(names: Sequence[str]) -> Predictor:
    """Make the predictor of a driver with these inputs.

    Example:
        >>> [m.says for m in predictor(["lateral_offset"]).misfits]
        ['the driver responds {more} strongly to lateral offset than learnt']
    """
    lagged = [(features.OUTPUT, k) for k in OUTPUT_LAGS]
    places = []
    for i, name in enumerate(names):
        lags = SLOW_INPUT_LAGS.get(name, INPUT_LAGS)
        places.append(range(len(lagged), len(lagged) + len(lags)))
        lagged += [(features.FIRST_INPUT + i, k) for k in lags]
    words = [name.replace("_", " ") for name in names]
    # each gain by itself, and all of them together
    responses: list[tuple[tuple[str, ...], tuple[tuple[int, ...], ...]]] = [
        ((word,), (tuple(gain),)) for word, gain in zip(words, places, strict=True)
    ]
    if len(responses) > 1:
        responses.append((tuple(words), tuple(tuple(gain) for gain in places)))
    misfits = [
        Misfit(
            f"the driver responds {{more}} strongly to {' and '.join(inputs)} than learnt",
            scaled_coefficients([i for gain in gains for i in gain]),
            GAIN_MARGIN,
            gains,
        )
        for inputs, gains in responses
    ]
    return Predictor(
        "the driver's output",
        "driver",
        f"the driver's output and {' and '.join(words)}",
        features.OUTPUT,
        tuple(lagged),
        tuple(range(len(lagged) + 1)),
        tuple(misfits),
        noise_scales=True,  # as people's noise does: Harris & Wolpert 1998
    )
