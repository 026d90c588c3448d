"""Differences between two folders of results."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

# relative; the order of a sum may change
TOLERANCE = 1e-9
# may change with the layout of a result or with a release, not with what the result says; versions: of canid and packages
IGNORED = {"schema", "versions"}


class Compared(NamedTuple):
    """What a comparison of two folders gave."""

    results: int  # that both folders hold
    alone: tuple[str, ...]  # results of one folder only
    different: dict[str, tuple[str, ...]]  # result -> differences of exit code or JSON
    texts: tuple[str, ...]  # results whose printed text differs
    largest: float  # relative difference of two numbers that count as equal


def differences(a: Any, b: Any, at: str = "") -> Iterator[tuple[str, float]]:
    """Differences of two values of JSON: where and what, and its relative size; 0 for what is no number.

    >>> [text for text, size in differences({"K": 1.0, "schema": 1}, {"K": 1.1, "schema": 2})]
    ['K: 1.0 is 1.1']
    >>> list(differences([1.0], [1.0 + 1e-12]))[0][1] < TOLERANCE
    True
    """
    if isinstance(a, dict) and isinstance(b, dict):
        for key in a.keys() | b.keys():
            if key in IGNORED:
                continue
            if key not in a or key not in b:
                yield f"{at}.{key}: only in {'one' if key in a else 'two'}".lstrip("."), math.inf
            else:
                yield from differences(a[key], b[key], f"{at}.{key}".lstrip("."))
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, (left, right) in enumerate(zip(a, b, strict=True)):
            yield from differences(left, right, f"{at}[{k}]")
    elif type(a) is float and type(b) is float and a != b:
        yield f"{at}: {a} is {b}", abs(a - b) / max(abs(a), abs(b))
    elif type(a) is not type(b) or a != b:
        yield f"{at}: {a!r:.80} is {b!r:.80}", math.inf


def compare(one: Path, two: Path) -> Compared:
    """Compare the results of two folders."""
    names = [{path.stem for path in folder.glob("*.json")} for folder in (one, two)]
    different: dict[str, tuple[str, ...]] = {}
    texts, largest = [], 0.0
    for name in sorted(names[0] & names[1]):
        a, b = (json.loads((folder / f"{name}.json").read_text("utf-8")) for folder in (one, two))
        found = list(differences({k: a[k] for k in ("exit", "json")}, {k: b[k] for k in ("exit", "json")}))
        largest = max([largest, *(size for _, size in found if size <= TOLERANCE)])
        beyond = tuple(text for text, size in found if size > TOLERANCE)
        if beyond:
            different[name] = beyond
        if any(a[stream] != b[stream] for stream in ("stdout", "stderr")):
            texts.append(name)
    return Compared(
        len(names[0] & names[1]), tuple(sorted(names[0] ^ names[1])), different, tuple(texts), largest
    )
