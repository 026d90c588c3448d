"""No number of the command line reaches code that cannot take it: each has bounds, and what lies outside is one line."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from canid.ui.cli import Parser, main
from canid.ui.cli.verbs import VERBS
from canid.values import bounded_numbers

LOG = str(Path(__file__).parents[2] / "replay_logs" / "following_urban.blf")
NUMBERS = (
    *("0", "-0", "-1", "-0.5", "1e-300", "0.2", "1", "7", "1e3", "1e17", "1e300", "9" * 400, "9" * 5000),
    *(
        "nan",
        "-nan",
        "inf",
        "-inf",
        "infinity",
        "1e999",
        "0x10",
        "1_000",
        "٣",
        "½",
        "",
        " ",
        "\n",
        "None",
        "1,2",
        "%",
    ),
    *("0.0001d", "99999999T", "0.1k", "9" * 30 + "d", "100%", "1e5%", "0%", "1kb", "1b"),
)
# of these 0 means something
MAY_BE_ZERO = {
    *("--duration", "--start", "--stop", "--pre", "--post", "--seed", "--bus", "--id", "--at"),
    *("--min-episode", "--gate-fit", "--bootstraps", "--c1", "--push"),
}
MAY_BE_NEGATIVE = {"--c1"}


def options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The actions of a parser, and of those below it."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from options(below)
        else:
            yield action


def every_option() -> Iterator[tuple[str, argparse.Action]]:
    """Each action of each verb and of its parts."""
    for verb in VERBS:
        for part in ("", *verb.parts):
            parser = Parser(prog=f"canid {verb.name} {part}".rstrip())
            verb.module(part).arguments(parser)
            for action in options(parser):
                yield parser.prog, action


TYPED = [(verb, action) for verb, action in every_option() if action.type is not None]


def values(action: argparse.Action, text: str) -> list[float]:
    """The numbers that an option takes from a text; none: it refuses the text."""
    try:
        read = action.type(text)  # type: ignore[operator]
    except (argparse.ArgumentTypeError, ValueError):
        return []
    found = read if isinstance(read, tuple | list) else [read]
    return [each for each in found if isinstance(each, int | float) and not isinstance(each, bool)]


@pytest.mark.parametrize(
    ("verb", "action"), TYPED, ids=[f"{verb} {action.option_strings[-1]}" for verb, action in TYPED]
)
def test_an_option_takes_numbers_within_bounds_alone(verb: str, action: argparse.Action) -> None:
    """Of hostile texts: what is taken is finite, at most 10^17, above 0 or 0 where that means something; `max` aside."""
    assert action.type not in (int, float, complex, str), f"{verb}: use canid.values.bounded_numbers"
    name = action.option_strings[-1]
    for text in NUMBERS:
        for value in values(action, text):
            assert math.isfinite(value), text
            assert abs(value) <= 1e17, text
            assert value > 0 or name in MAY_BE_NEGATIVE or (value == 0 and name in MAY_BE_ZERO), text


def test_every_option_that_says_a_number_has_such_a_type() -> None:
    """By its placeholder: N, S, TIME, SIZE, ... are numbers, and no default lies outside of what may be given."""
    for verb, action in every_option():
        if action.option_strings and action.metavar in (
            "N",
            "S",
            "M",
            "X",
            "C",
            "A",
            "TIME",
            "SIZE",
            "PERCENT",
        ):
            assert action.type is not None, f"{verb} {action.option_strings}"


@pytest.mark.parametrize(
    "words",
    [
        ("fleet", "causes", "DIR", "--workers", "0"),
        ("fleet", "causes", "DIR", "--workers", "-1"),
        ("fleet", "query", "DIR", "drives", "--memory", "99999999T"),
        ("fleet", LOG, "--vehicle", "generic", "--timeout", "9999999999999d"),
        ("replay", LOG, "--vehicle", "generic", "--speed", "1e-300"),
        ("export", LOG, "--vehicle", "generic", "--dt", "1e300"),
        ("export", LOG, "--vehicle", "generic", "--dt", "0.5"),
        ("export", LOG, "--vehicle", "generic", "--raster", "1e-300"),
        ("simulate", "a.blf", "--seed", "-1"),
        ("simulate", "a.blf", "--minutes", "1e-9"),
        ("simulate", "a.blf", "--hide", "headway_dead_zone=nan"),
        ("study", "grover", "--reproduce", "--minutes", "1,nan"),
        ("study", "grover", "--reproduce", "--seed", "-1"),
        ("study", "grover", "--reproduce", "--jobs", "-1"),
        ("record", "-i", "virtual", "-c", "a", "--file-size", "9" * 400),
        ("record", "-i", "virtual", "-c", "a", "--duration", "inf"),
        ("record", "-i", "virtual", "-c", "a", "--bitrate", "0"),
        ("record", "-i", "virtual", "-c", "a", "--filter=-1:7FF"),
        ("record", "-i", "virtual", "-c", "a", "--filter", "1FFFFFFFF:7FF"),
        ("look", LOG, "--bus", "9" * 5000),
    ],
)
def test_a_number_outside_is_one_line(
    words: tuple[str, ...],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Exit code 2, which option it is, and nothing begins: no file, no traceback."""
    monkeypatch.chdir(tmp_path)
    assert main([*words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    option = next(word for word in reversed(words) if word.startswith("--")).partition("=")[0]
    assert f"argument {option}" in line or re.search(f"argument -./{option}:", line)
    assert len(line) < 300
    assert list(tmp_path.iterdir()) == []


def test_the_error_names_the_bounds() -> None:
    """Of a number outside it says which are inside, of what is no number what one is."""
    with pytest.raises(argparse.ArgumentTypeError, match="at least 1, at most 10,000"):
        bounded_numbers.processes("0")
    with pytest.raises(argparse.ArgumentTypeError, match=r'^"x" is not a number of processes$'):
        bounded_numbers.processes("x")
