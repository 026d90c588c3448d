"""DBC files that the format's grammar refuses: read where they have one meaning, and nothing else changes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import cantools
import pytest

from canid.signals.dbc_text import decoded, read_tolerantly
from canid.signals.dbc_text.parsing import Content, Message, Parser
from canid.signals.vehicle.database import Dbc, load
from canid.values.errors import ConfigError
from canid.values.shipped_files import shipped
from tests.fixtures import measured_logs

SIGNAL = ' SG_ Speed : 7|16@0+ (0.01,-2) [0|250] "km/h" X\n'
MESSAGE = "BO_ 288 MOTION: 8 X\n" + SIGNAL
NEXT = 'BO_ 289 NEXT: 8 X\n SG_ Next : 0|8@1- (1,0) [0|0] "" X\n'


PARSER = Parser()


@pytest.fixture(autouse=True, scope="module")
def _one_child() -> Iterator[None]:
    """One process parses the small files of all tests here: its start takes longer than they do."""
    with PARSER:
        yield


def read(folder: Path, data: bytes | str) -> tuple[Dbc, list[str]]:
    file = folder / "x.dbc"
    file.write_bytes(data if isinstance(data, bytes) else data.encode())
    dbc, warnings, _ = load(file, None, PARSER)
    return dbc, warnings


# what is wrong -> (text, what a warning says); MOTION.Speed and NEXT.Next must come out as they are
DEFECTS = {
    "a value table of no signal": (MESSAGE + NEXT + 'VAL_ 288 Nothing 0 "a";\nVAL_ 9 S 0 "a" ;', "lines 5, 6"),
    "a value table without its semicolon": (MESSAGE + NEXT + 'VAL_ 288 Speed 99 "a"\nVAL_ 289 Next 0 "b";', "line 5"),
    "a comment without its semicolon": ('CM_ "radar"\n' + MESSAGE + NEXT, "comments, left out: line 1"),
    "a comment with quotes": ('CM_ BO_ 288 "the "real" one";\n' + MESSAGE + NEXT, "comments, left out: line 1"),
    "a comment over lines with quotes": (
        MESSAGE + 'CM_ SG_ 288 Speed "one "\ntwo" and\nthree";\n' + NEXT, "comments, left out: line 3"
    ),
    "a comment without its closing quote": (MESSAGE + 'CM_ "open ;\n' + NEXT, "comments, left out: line 3"),
    "a comment on nothing": ('CM_ 7 "x";\n' + MESSAGE + NEXT, "comments, left out: line 1"),
    "numbers without a leading 0": (MESSAGE.replace("0.01", ".01") + NEXT, ".5: line 2"),
    "a decimal comma": (MESSAGE.replace("0.01,-2", "0,01,-2") + NEXT, "decimal commas, read as points: line 2"),
    "decimal commas and a semicolon": (MESSAGE.replace("0.01,-2", "0,01;-2,0") + NEXT, "decimal commas"),
    "no receiver": (MESSAGE.replace('" X', '"') + NEXT, "receivers or senders"),
    "no sender": (MESSAGE.replace("8 X", "8") + NEXT, "receivers or senders"),
    "no range": (MESSAGE.replace("[0|250] ", "") + NEXT, "without a range"),
    "no blanks": (MESSAGE.replace(" :", ":").replace(" (", "(").replace(" [", "[").replace("] ", "]") + NEXT
                  + 'VAL_ 288 None 0"a"1"b";', "line 5"),
    "an id in hexadecimal": (MESSAGE.replace("288", "0x120") + NEXT, "hexadecimal"),
    "an attribute that is not defined": (MESSAGE + NEXT + 'BA_ "Paint" BO_ 288 5;', ""),
    "a remark of another language": ("# radar\n" + MESSAGE + "/* that was it */\n" + NEXT, "comments"),
    "a list that goes on": (MESSAGE.replace('" X', '" X,\n   Y, Z') + NEXT + 'VAL_ 1 A 0 "a";', "line 6"),
    "a type of no signal": (MESSAGE + NEXT + "SIG_VALTYPE_ 288 Nothing : 1;", "line 5"),
    "a sender with a digit first": (MESSAGE.replace("8 X", "8 2X") + NEXT, "receivers or senders"),
}  # fmt: skip


@pytest.mark.parametrize("what", DEFECTS)
def test_one_meaning_is_read(what: str, tmp_path: Path) -> None:
    """cantools refuses the text; canid reads the signals that were meant, and says which line was repaired."""
    text, says = DEFECTS[what]
    with pytest.raises(Exception, match=r"."):
        cantools.database.load_string(text, "dbc", strict=False)
    dbc, warnings = read(tmp_path, text)
    sound, _ = read(tmp_path, MESSAGE + NEXT)
    found = {name: [one[:11] for one in of.signals] for name, of in dbc.messages.items()}
    expected = {name: [one[:11] for one in of.signals] for name, of in sound.messages.items()}
    if what == "no range":
        found["MOTION"], expected["MOTION"] = ([one[:8] for one in x["MOTION"]] for x in (found, expected))
    assert found == expected
    assert [of[:4] for of in dbc.messages.values()] == [of[:4] for of in sound.messages.values()]
    assert any(says in line for line in warnings), warnings


OF_TWO = ' SG_ Page M : 32|8@1+ (1,0) [0|0] "" X\n SG_ Part m0M : 40|8@1+ (1,0) [0|0] "" X\n'
# what is wrong -> (text, line, reason, what is left of MOTION)
LEFT_OUT = {
    "an id of more than 29 bits": (MESSAGE.replace("288", "1075054137") + NEXT, 1, "29 bits", None),
    "an ambiguous comma": (MESSAGE.replace("0.01,-2", "1,5,0") + NEXT, 2, "several meanings", 0),
    "no sign": (MESSAGE.replace("@0+", "@0") + NEXT, 2, "no signal", 0),
    "no length of the message": (MESSAGE.replace(": 8 X", ": X") + NEXT, 1, "no number of bytes", None),
    "a misspelt message": ('BO_ 7 FIRST: 8 X\n SG_ A : 0|8@1+ (1,0) [0|0] "" X\n' + MESSAGE.replace("BO_", "B0_") + NEXT,
                           3, "no statement", None),
    "pages without a selector": (MESSAGE.replace("Speed :", "Speed m1 :") + NEXT + 'VAL_ 1 A 0 "a";', 2, "page", 0),
    "pages without a selector, which cantools reads": (MESSAGE.replace("Speed :", "Speed m1 :") + NEXT, 2, "page", 0),
    "pages of one of two selectors": (MESSAGE.replace("Speed :", "Speed m1 :") + OF_TWO + NEXT, 2, "page", 1),
    "a type that cannot be read": (MESSAGE + NEXT + "SIG_VALTYPE_ 288 Speed : float;", 2, "line 5 describes it", 0),
}  # fmt: skip


@pytest.mark.parametrize("what", LEFT_OUT)
def test_no_meaning_is_left_out(what: str, tmp_path: Path) -> None:
    """What has several meanings is left out with line, text and reason; the other messages are read."""
    text, line, why, left = LEFT_OUT[what]
    dbc, warnings = read(tmp_path, text)
    assert any(f"line {line}, " in said and why in said for said in warnings), warnings
    motion = dbc.messages.get("MOTION")
    assert (None if motion is None else len(motion.signals)) == left
    assert dbc.messages["NEXT"].signals[0].signed
    assert len(dbc.messages.get("FIRST", motion or dbc.messages["NEXT"]).signals) <= 1


@pytest.mark.parametrize("end", [" SG_ Cut : 0|16@1+", " SG_ Cut : 0|16@1+\n", " SG_ Cu"])
def test_a_file_that_ends_within_a_signal(end: str, tmp_path: Path) -> None:
    """cantools drops that signal without a word; canid says which line is left out."""
    assert cantools.database.load_string(MESSAGE + end, "dbc", strict=False).messages
    dbc, warnings = read(tmp_path, MESSAGE + end)
    assert [signal.name for signal in dbc.messages["MOTION"].signals] == ["Speed"]
    assert any("line 3" in warning and "left out" in warning for warning in warnings)


def test_a_file_without_meaning_is_refused(tmp_path: Path) -> None:
    """A text that is no DBC is refused with the line, its text and the reason."""
    with pytest.raises(ConfigError, match=r"line 1, 'name,unit': no statement of a DBC"):
        read(tmp_path, "name,unit\nspeed,km/h\n")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16", "utf-16-le"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, end: str, tmp_path: Path) -> None:
    """Units with a degree sign are the same in every encoding; lines may end as they like."""
    text = (MESSAGE + NEXT).replace("km/h", "°C").replace("\n", end)
    dbc, _ = read(tmp_path, text.encode(encoding))
    assert dbc.messages["MOTION"].signals[0].unit == "°C"
    assert dbc.messages["NEXT"].signals[0].name == "Next"


def test_names_given_twice(tmp_path: Path) -> None:
    """Of messages and signals with one name the last keeps it, the others get a name of their own; said once."""
    dbc, warnings = read(
        tmp_path, MESSAGE + SIGNAL.replace("7|16", "23|16") + MESSAGE.replace("288", "290") + NEXT
    )
    assert {name: of.id for name, of in dbc.messages.items()} == {
        "MOTION_0x120": 288,
        "MOTION": 290,
        "NEXT": 289,
    }
    assert [one.name for one in dbc.messages["MOTION_0x120"].signals] == ["Speed_bit7", "Speed"]
    assert sum("of one name" in line or "the name of 2 messages" in line for line in warnings) == 2


# of VECTOR__INDEPENDENT_SIG_MSG, whose signals are in no frame
_UNASSIGNED_ID = 0x40000000


def by_regex(text: str) -> dict[tuple[int, str], tuple[object, ...]]:
    """A second reading: BO_ and SG_ lines alone."""
    found: dict[tuple[int, str], tuple[object, ...]] = {}
    id_ = -1
    for line in text.splitlines():
        if message := re.match(r"\s*BO_ (\d+) ", line):
            id_ = int(message[1]) & 0x7FFFFFFF
        elif signal := re.match(
            r"\s*SG_ (\w+)\s*[mM]?\w*\s*: ?(\d+)\|(\d+)@([01])([+-]) *\( ?([^,]+), ?([^)]+)\)", line
        ):
            name, start, length, order, sign, scale, offset = signal.groups()
            place = (int(start), int(length), order == "0", sign == "-", float(scale), float(offset))
            found[id_, name] = place
    return found


def public_files() -> list[Path]:
    # what people reported is read as its own README says, which is not always what this reader by lines finds
    return sorted({*measured_logs.files("*/*.dbc"), *shipped().rglob("*.dbc")})


@pytest.mark.slow("parses hostile files in children")
@measured_logs.needs_measured
def test_public_files_are_read_as_they_are_written() -> None:
    """Every signal of every file: id, start, length, byte order, sign, factor and offset as a second reading has them;
    and where cantools reads a file, line-by-line reading gives all that cantools gives, and repairs nothing.
    """
    repaired = 0
    with Parser() as parser:
        for file in public_files():
            text = decoded(file.read_bytes())
            ours = read_tolerantly(text)
            try:
                loaded = cantools.database.load_string(text, "dbc", strict=False)
            except Exception:  # of any kind: a file to repair
                repaired += 1
            else:
                assert not ours.repairs, file
                assert not ours.left_out, file
                check_same(file, ours, loaded, parser)
            second = by_regex(text)
            places = {
                (of.id, one.name): (one.start, one.length, one.motorola, one.signed, one.scale, one.offset)
                for of in ours.messages
                for one in of.signals
            }
            lost = {_UNASSIGNED_ID} | {(int(one.was.split()[1]) & 0x7FFFFFFF) for one in ours.left_out}
            assert places == {key: place for key, place in second.items() if key[0] not in lost}, file
    assert repaired > 5


def check_same(file: Path, ours: Content, loaded: object, parser: Parser) -> None:
    theirs = parser.dbc(".dbc", file.read_bytes())
    assert len(theirs.messages) == len(ours.messages) == len(loaded.messages)  # type: ignore[attr-defined]
    for one, other in zip(ours.messages, theirs.messages, strict=True):
        assert repr(Message(*one)) == repr(other), file
    assert set(ours.overlapping) == set(theirs.overlapping), file
