"""Names are data: nothing that a terminal acts on reaches it."""

from __future__ import annotations

import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from canid.ui.views.terminal_view.picture import render
from canid.ui.views.terminal_view.state import HealthLine, View
from canid.values.terminal_text import terminal_text
from canid.values.types import Event
from tests.terminal import plain

# with lone surrogates: a file name that is not UTF-8 has them
ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=60)


@given(ANY_TEXT)
def test_no_text_moves_a_terminal(text: str) -> None:
    """Whatever the text, every character left is printable or a plain space, and printable text is unchanged."""
    shown = terminal_text(text)
    assert all(character.isprintable() or unicodedata.category(character) == "Zs" for character in shown)
    assert not set(shown) & set(map(chr, [*range(0x20), *range(0x7F, 0xA0), 0x2028, 0x2029]))
    shown.encode("utf-8")
    if text.isprintable():
        assert shown == text


@given(ANY_TEXT)
def test_two_names_that_differ_are_shown_differently_unless_they_spell_an_escape(text: str) -> None:
    """An escape is made of the character's own code: nothing is merely dropped."""
    assert len(terminal_text(text)) >= len(text)


@given(ANY_TEXT, ANY_TEXT, ANY_TEXT)
def test_the_live_view_shows_no_foreign_control_character(title: str, line: str, says: str) -> None:
    """The live view with hostile names has no escape sequence when colors are off."""
    view = View(
        title, lines=(HealthLine(line),), events=(Event(0.0, "x", says),), output=title, truth=((line, says),)
    )
    shown = plain(render(view, 100, 30)).replace("\n", "")
    assert not set(shown) & set(map(chr, [*range(0x20), *range(0x7F, 0xA0), 0x202E, 0x2028]))
    shown.encode("utf-8")


def test_a_progress_bar_says_nothing_of_a_time_that_it_does_not_know() -> None:
    from rich.progress import Progress

    from canid.ui.terminal.progress import time_left

    column = time_left()
    bar = Progress(column)
    bar.add_task("reading", total=None)
    (task,) = bar.tasks
    assert column.render(task).plain == ""
