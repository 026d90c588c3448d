"""The driver's predictor: his output from its own past and from his inputs."""

from __future__ import annotations

from collections.abc import Sequence

from canid.screening import rows
from canid.screening.predictor import Misfit, Predictor, scaled

# rows; 1 s of its own past whitens noise of one to three states
_OWN = range(1, 6)
# rows; dead times begin at 0.2 s, and after 1.4 s what is left of an answer is in the output's own past
_INPUT = range(1, 8)
# the headway changes with the sum of the range rate: every second lag says the same
_SLOW = {"headway_error": range(1, 8, 2)}

# Drivers' gains of one road and hour scatter by some 10 % (Chen & Ulsoy 2001 find more over hours)
MARGIN = 0.1


def predictor(names: Sequence[str]) -> Predictor:
    """Make the predictor of a driver with these inputs.

    Example:
        >>> [m.says for m in predictor(["lateral_offset"]).misfits]
        ['he answers lateral offset {more} strongly than learnt']
    """
    lagged = [(rows.ANSWER, k) for k in _OWN]
    where = []
    for i, name in enumerate(names):
        lags = _SLOW.get(name, _INPUT)
        where.append(range(len(lagged), len(lagged) + len(lags)))
        lagged += [(rows.FIRST_INPUT + i, k) for k in lags]
    words = [name.replace("_", " ") for name in names]
    ways: list[tuple[tuple[str, ...], tuple[tuple[int, ...], ...]]] = [
        ((word,), (tuple(way),)) for word, way in zip(words, where, strict=True)
    ]
    if len(ways) > 1:
        ways.append((tuple(words), tuple(tuple(way) for way in where)))
    misfits = [
        Misfit(
            f"he answers {' and '.join(of)} {{more}} strongly than learnt",
            scaled([i for gain in gains for i in gain]),
            MARGIN,
            gains,
        )
        for of, gains in ways
    ]
    return Predictor(
        "the driver's output",
        "driver",
        f"the driver's output and {' and '.join(words)}",
        rows.ANSWER,
        tuple(lagged),
        tuple(range(len(lagged) + 1)),
        tuple(misfits),
        grows=True,  # people's noise does: Harris & Wolpert 1998
    )
