"""Words of an older private vocabulary that the glossary (docs/glossary.md) replaces, and where each may stand."""

from __future__ import annotations

import re
from collections.abc import Iterator

OLD_WORDS = (
    "told", "foretold", "foreseen", "foretells", "beside", "doubt", "doubts", "wish", "wishes", "wander", "wanders",
    "wandering", "colour", "colours", "coloured", "recoloured", "valley", "valleys", "foot", "moment", "moments",
    "look", "looks", "looked", "tell", "tells", "shadow", "glance", "temper", "laid",
)  # fmt: skip
# where a word has its plain or its technical sense
ALLOWED = (
    r"\b(method of |sample |matching |central )moments?\b",
    r"\bmoments? (estimator|equations?|conditions?|method|matching|of (the |a )?(residual|distribution|inertia))",
    r"\b(by|from|of) moments\b",
    r"\blook(s|ed)? ?(up|like|for|after|identifiable)\b",
    # the verb
    r"\b(canid|cli|commands|test|docs|benchmarks|first)[ ./_]look\b",
    r"\blook(\.md|\.py|_text|_json|-json|:)|[`\"'\[]look\b|^look$",
    r"look_json\.Look|import Look\b|class Look\b|return Look\(|: Look\}",
    r"\b(left|other|on) foot\b",
    r"\bfile\.tell\(\)",
    # names of tests in the stored outcomes of hidden_effects
    r'"(instead of a )?wander"',
    # the name of a random stream: another one would be another drive
    r'_rng\(seed, "wander"\)',
    r"\bshadow(s|ed|ing)? (a |the )?(name|builtin|import|module|variable)",
)
_OLD = re.compile(rf"\b({'|'.join(OLD_WORDS)})\b", re.IGNORECASE)
_ALLOWED = re.compile("|".join(ALLOWED), re.IGNORECASE)


def old_words(text: str) -> Iterator[tuple[int, str]]:
    """Find the old words of a text.

    Args:
        text: code or prose.

    Yields:
        The number of the line, from 1, and the word.

    Example:
        >>> list(old_words("by the method of moments\\nas the driver is told"))
        [(2, 'told')]
    """
    if not _OLD.search(text):
        return
    for number, line in enumerate(text.splitlines(), 1):
        for found in _OLD.finditer(_ALLOWED.sub("", line)):
            yield number, found[0]
