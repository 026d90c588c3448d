"""Lines of Python source: code, docstrings and comments, blank."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

# tokens that are no code of their own
LAYOUT = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
}  # fmt: skip


class Lines(NamedTuple):
    """Physical lines of source by what they hold."""

    code: int
    text: int  # docstrings and comments that stand alone
    blank: int  # outside of strings and docstrings

    def __add__(self, other: Lines) -> Lines:  # type: ignore[override]
        return Lines(*(a + b for a, b in zip(self, other, strict=True)))


def docstring_lines(tree: ast.Module) -> set[int]:
    """Line numbers of all docstrings of a module."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                lines |= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return lines


def lines_of(source: str) -> Lines:
    r"""Count the lines of one module.

    A line of code with a comment behind it is code; a blank line within a docstring is text.

    >>> lines_of("def f():\n    'Doc.'\n\n    return (\n        1\n    )  # why\n# alone\n")
    Lines(code=4, text=2, blank=1)
    """
    code: set[int] = set()
    comments: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            comments.add(token.start[0])
        elif token.type not in LAYOUT:
            code |= set(range(token.start[0], token.end[0] + 1))
    docs = docstring_lines(ast.parse(source))
    code -= docs
    text = (docs | comments) - code
    return Lines(len(code), len(text), len(source.splitlines()) - len(code) - len(text))


def lines_in(paths: Iterable[Path]) -> Lines:
    """Count the lines of some files."""
    return sum((lines_of(path.read_text(encoding="utf-8")) for path in paths), Lines(0, 0, 0))
