"""The base of CAN FD lines in an .asc whose header says `base dec`: hexadecimal as Vector writes them, or decimal.

The cells say which: a hexadecimal byte always has two digits, a decimal one is never padded. Where they say nothing,
the lines are Vector's. A log's lines are of one program: what most of the first of them say holds for all.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Block, LineCount, blocks_and_long_lines, line
from canid.values.frame_columns import MAX_EXTENDED_ID, MAX_STANDARD_ID

# lines that say it, of which most decide: a few damaged ones among them do not matter
_ENOUGH_LINES = 64
# of one log; it has to be read ahead where its first CAN FD line says nothing
_MAX_READ_AHEAD_BYTES = 16 * 1024 * 1024
HEXADECIMAL = "base dec, but CAN FD lines are hexadecimal, as Vector writes them: they are read so"
DECIMAL = "base dec, and CAN FD lines are decimal too, as their bytes show: they are read so"


def of_log(path: Path, number: int) -> int:
    """16 or 10: the base of CAN FD lines from line `number` on, to the end of that log.

    Args:
        path: of the file.
        number: of a line of the log, counted from 1.
    """
    votes = said = 0
    state = ReadState(size=path.stat().st_size)
    for block in blocks_and_long_lines(path, state, LineCount()):
        if not isinstance(block, Block) or block.number + len(block.ends) <= number:
            continue
        if b"CANFD" not in block.data.upper():
            continue
        begin = 0
        for k, end in enumerate(block.ends.tolist()):
            first, begin = begin, end
            if block.number + k < number:
                continue
            words = line(block, k, first, end).text.split()
            if words and words[0].lower() == "date":
                return 10 if votes < 0 else 16
            vote = evidence(words)
            votes, said = votes + vote, said + abs(vote)
            if said >= _ENOUGH_LINES:
                return 10 if votes < 0 else 16
        if block.at > _MAX_READ_AHEAD_BYTES:
            break
    return 10 if votes < 0 else 16


def fd_lines(block: Block) -> npt.NDArray[np.bool_]:
    r"""Which lines may be those of CAN FD channels: the word stands in them.

    >>> fd_lines(Block(b"0.5 1 1 Rx d 0\n0.5 CANFD 1 Rx\n", np.array([15, 30]), 1)).tolist()
    [False, True]
    """
    has_word = np.zeros(len(block.ends), bool)
    at = block.data.find(b"CANFD")
    places = []
    while at >= 0:
        places.append(at)
        at = block.data.find(b"CANFD", at + 5)
    has_word[block.ends.searchsorted(np.array(places, np.int64), "right")] = True
    return has_word


def evidence(words: list[str]) -> int:
    """1: the words of a CAN FD line show that it is hexadecimal; -1: decimal; 0: they do not say, or it is no such line.

    >>> line = "1.0 CANFD 2 Rx 102 1 0 2 2 {} 0 0 1000 0"
    >>> [evidence(line.format(data).split()) for data in ("20 0e", "20 14", "20 0")]
    [1, 0, -1]
    """
    if len(words) < 9 or words[1].upper() != "CANFD":
        return 0
    if words[3].lower() in ("rx", "tx"):
        at, id_ = 7 if words[5] in ("0", "1") else 8, words[4]
    elif words[4].lower() in ("rx", "tx"):
        at, id_ = 8, words[3]
    else:
        return 0
    if len(words) < at + 2 or not words[at + 1].isdecimal() or len(words[at + 1]) > 2:
        return 0
    dlc, length = words[at], int(words[at + 1])
    cells = words[at + 2 : at + 2 + length]
    decimal = any(len(cell) in (1, 3) for cell in cells) or (dlc.isdecimal() and len(dlc) == 2)
    hexadecimal = any(len(cell) == 2 and (cell[0] == "0" or not cell.isdecimal()) for cell in cells)
    if decimal != hexadecimal:
        return -1 if decimal else 1
    number = id_.removesuffix("x")
    if decimal or not number.isalnum() or len(number) > 10:
        return 0
    if not (number.isdecimal() and dlc.isdecimal()):
        return 1
    most = MAX_EXTENDED_ID if id_.endswith("x") else MAX_STANDARD_ID
    return -1 if int(number, 16) > most else 0
