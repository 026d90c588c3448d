"""Measured drives in halves and quarters: no two quotable answers of one drive may exclude each other."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

from benchmarks.measured_drives.__main__ import part
from canid import identify, read_trace
from canid.mathematics.identification.identifiability import PARAMETERS, apart, quotable
from tests.fixtures.measured_logs import LOGS, LONG_LOGS

PARTS = ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0))


def table(data: Path) -> str:
    """One row a drive: how many pairs of quotable numbers were compared, and which exclude each other."""
    lines = ["| log | pairs | disjoint |", "|---|---|---|"]
    for name, vehicle in (*LONG_LOGS, *LOGS):
        if not (data / name).exists():
            continue
        trace = read_trace(data / name, vehicle)
        answers = []
        for begin, end in PARTS:
            cut = part(trace, begin, end)
            cut = cut._replace(bound=None, variance=None)
            for method, found in identify(cut, select_orders=False, sliding=False).whole.items():
                if found is not None:
                    answers.append((method, begin, end, found.channels))
        pairs, disjoint = 0, []
        for one, other in combinations(answers, 2):
            for channel in one[3]:
                for what in PARAMETERS:
                    if quotable(one[3][channel], what) and quotable(other[3][channel], what):
                        pairs += 1
                        if apart([getattr(one[3][channel], what), getattr(other[3][channel], what)]):
                            disjoint.append(f"{channel} {what} {one[0]} {one[1:3]} {other[0]} {other[1:3]}")
        lines.append(f"| {name} | {pairs} | {'; '.join(disjoint) or 'none'} |")
        print(lines[-1], flush=True)
    return "\n".join(lines)
