"""The frame account: frames, events, lines of no interest and damaged lines are all lines, and every verb has the same."""

from __future__ import annotations

import gzip
import json
import random
import re
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.drive.drive_reader import read_drive
from canid.io.logs import open_log
from canid.ui.cli import main
from canid.values.errors import DAMAGED, DONE, ConfigError
from tests.formats_oracle.generators import GENERATORS
from tests.formats_oracle.written import Written

FILES = 4
DBC = 'VERSION ""\nBU_: A\nBO_ {id} M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n'
VEHICLE = """dbc = ["a.dbc"]
[driver]
task = "car_following"
output = "pedal"
[signals]
pedal = {signal = "M.S", unit = "%"}
speed = {signal = "M.S", unit = "m/s"}
gap = {signal = "M.S", unit = "m"}
range_rate = {signal = "M.S", unit = "m/s"}
"""


@pytest.mark.slow("five verbs on each of a dozen files")
@pytest.mark.parametrize("name", GENERATORS)
def test_every_verb_has_all_frames(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`check`, `look`, `export`, `replay --onto`, `recover` and `identify` count what was written, damage included."""
    for k in range(FILES):
        rng = random.Random(f"{seed} {k}")
        written = GENERATORS[name](rng)
        monkeypatch.setenv("CANID_TIME_ZONE", written.zone)
        path = tmp_path / f"drawn{k}{written.suffix}"
        path.write_bytes(written.content)
        data = [one for one in written.frames if not one.marks & {"remote", "error"}]
        n = len(written.frames)
        account(path, written)

        expected = DAMAGED if written.counts.damaged else DONE

        def ran(*words: str, how: object = written.properties, expected: int = expected) -> Any:
            code = main([*words, "--json", str(tmp_path / "j.json")])
            shown = capsys.readouterr()
            assert code == expected, (words, shown.err, how)
            return json.loads((tmp_path / "j.json").read_text())

        assert ran("check", str(path))["frames"] == n
        assert ran("look", str(path))["frames"] == n
        sent = ran("replay", "--onto", str(path), "-i", "virtual", "-c", f"account{k}", "--speed", "max")
        assert sent["sent"] + sent["not_sent"] == n
        assert sent["not_sent"] == sum("error" in one.marks for one in written.frames)
        recovered = ran("recover", str(path), "-o", str(tmp_path / f"copy{k}.blf"))
        assert (recovered["frames"], recovered["others"]) == (n, written.counts.others)
        assert len(list(open_log(tmp_path / f"copy{k}.blf"))) == n
        if not data:
            continue
        wanted = data[0]
        number = wanted.id | (0x8000_0000 if wanted.extended else 0)
        (tmp_path / "a.dbc").write_text(DBC.format(id=number))
        files = ran("export", str(path), "--dbc", str(tmp_path / "a.dbc"), "-o", str(tmp_path / f"out{k}"))
        same = [one for one in data if (one.id, one.extended) == (wanted.id, wanted.extended)]
        assert sum(each["rows"] for each in files) == len(same)
        (tmp_path / "v.toml").write_text(VEHICLE)
        # what `identify`, `diagnose` and `compare` read
        assert frames_of_drive(path, tmp_path / "v.toml") == n


def account(path: Path, written: Written) -> None:
    """Every line or object of the file is in one class, and in one only; of a text file without UTF-16 all lines."""
    log = open_log(path)
    counted = len(list(log)), log.events_read, log.others, log.damaged
    counts = written.counts
    assert counted == (len(written.frames), counts.events, counts.others, counts.damaged)
    packed = written.content[:2] == b"\x1f\x8b"
    text = gzip.decompress(written.content) if packed else written.content
    if log.format.is_text and text[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        assert sum(counted) == sum(bool(line.strip()) for line in text.splitlines())


def frames_of_drive(path: Path, vehicle: Path) -> int:
    """How many frames the reader of drives counts; with an error where the interface's clock steps back and no value is
    left.
    """
    try:
        return read_drive(path, vehicle, estimating=False).health.frames
    except ConfigError as error:
        counted = re.search(
            r"its ([\d,]+) frames hold no value that v maps: \d+ frames go back in time", str(error)
        )
        if counted is None:
            raise
        return int(counted[1].replace(",", ""))
