"""Memory that dividing a hostile DBC text takes."""

from __future__ import annotations

import tracemalloc

import pytest

from canid.signals.dbc_text.statements import divided
from canid.signals.dbc_text.tables import choices, values

# bytes for each character: line numbers, statements and their texts take up to 40
PER_CHARACTER = 60
REPEATED = 15_000
TEXTS = {
    "escapes in a comment": 'CM_ "' + '\\"' * REPEATED,
    "escapes in a text of a number": 'VAL_ 12 x 0 "' + '\\"a' * REPEATED + '";',
    "escapes in an enumeration": 'BA_DEF_ "x" ENUM "' + '\\"a' * REPEATED + '";',
    "pairs of quotes": "BA_ " + '""' * REPEATED,
    "a list over lines": "BU_: a" + "\na" * REPEATED,
    "words over lines": "NS_ :" + "\na" * REPEATED,
    "remarks": "//\n" * REPEATED,
    "a string over lines": 'BA_ "x' + "\n" * REPEATED,
}


@pytest.mark.parametrize("kind", TEXTS)
def test_what_repeats_takes_no_memory_of_its_own(kind: str) -> None:
    """No repetition in a text is remembered: the limit of 4 MB of text would then be one of 1 GB of memory."""
    text = TEXTS[kind]
    tracemalloc.start()
    try:
        divided(text), values(text), choices(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < PER_CHARACTER * len(text)
