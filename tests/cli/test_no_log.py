"""What is given as a log and is none is a usage error of every verb; a log without frames is a log."""

from __future__ import annotations

import gzip
import json
import os
import random
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.io.logs import open_log
from canid.models.simulation import Car
from canid.values.errors import DAMAGED, DONE, USAGE
from canid.values.text.model_json import to_json
from tests.simulation.test_model_drive import drawn, model_of

Canid = Callable[..., Any]
ROOT = Path(__file__).parents[2]
PNG = (ROOT / "docs/images/web_phone.png").read_bytes()[:50_000]
ELF = Path(sys.executable).resolve().read_bytes()[:50_000]
PROSE = "Dear reader,\n\nthis is no log at all; it has 3 commas, 2 numbers, and a line.\n" * 40
CONTENTS = {"picture": PNG, "program": ELF, "prose": PROSE.encode(), "zeros": bytes(5000), "empty": b""}
SUFFIXES = (".blf", ".asc", ".log", ".trc", ".csv", ".mf4", ".parquet", ".log.gz")
# the words of a call in which LOG is the input
VERBS: dict[str, tuple[str, ...]] = {
    "look": ("look", "LOG"),
    "identify": ("identify", "LOG", "--vehicle", "generic"),
    "identify a table": ("identify", "LOG"),
    "diagnose": ("diagnose", "LOG", "--vehicle", "generic"),
    "compare": ("compare", "LOG", "LOG", "--vehicle", "generic"),
    "replay": ("replay", "LOG", "--vehicle", "generic", "--speed", "max"),
    "replay onto": ("replay", "LOG", "--onto", "-i", "virtual", "-c", "nobody", "--speed", "max"),
    "export": ("export", "LOG", "--vehicle", "generic"),
    "export a vehicle type": ("export", "LOG", "--vehicle", "generic", "--to", "sumo"),
    "recover": ("recover", "LOG"),
    "check": ("check", "LOG", "--vehicle", "generic"),
    "check alone": ("check", "LOG"),
    "simulate": ("simulate", "out.blf", "--model", "MODEL", "--lead", "LOG"),
    "study": ("study", "grover", "LOG", "--vehicle", "generic"),
    "init": ("init", "DBC", "--log", "LOG"),
}


def place(folder: Path, kind: str, suffix: str) -> Path:
    path = folder / f"given{suffix}"
    if kind == "folder":
        path.mkdir()
    elif kind == "plain folder":
        return folder
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "long":
        return folder / ("x" * 300 + suffix)
    elif kind == "link to a device":
        path.symlink_to("/dev/zero")
    elif suffix.endswith(".gz") and kind != "picture":
        path.write_bytes(gzip.compress(CONTENTS[kind]))
    else:
        path.write_bytes(CONTENTS[kind])
    return path


KINDS = (*CONTENTS, "folder", "plain folder", "pipe", "loop", "long", "link to a device")


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("verb", VERBS)
def test_what_is_no_log_is_a_usage_error(
    verb: str, canid: Canid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """A folder, a pipe, a device, a picture, a program, prose, zeros, nothing, under the name of any format: exit 2, one
    line that names it, and no file is made."""
    rng = random.Random(seed)
    given = {"DBC": ROOT / "dbc/generic.dbc", "MODEL": tmp_path / "model.json"}
    if "MODEL" in VERBS[verb]:
        model = to_json(model_of(drawn(np.random.default_rng(3)), Car()))
        given["MODEL"].write_text(json.dumps({"verdict": "adequate", "model": model}), encoding="utf-8")
    for kind in KINDS:
        # all would take minutes
        for suffix in rng.sample(SUFFIXES, 3):
            folder = tmp_path / f"{kind} {suffix}"
            folder.mkdir()
            monkeypatch.chdir(folder)
            path = place(folder, kind, suffix)
            before = set(os.listdir(folder))
            ran = canid(*[(given | {"LOG": path}).get(word, word) for word in VERBS[verb]])
            shown = f"{verb}, {kind}, {suffix}: {ran}"
            if kind == "empty" and suffix in (".log", ".log.gz") and verb in ("look", "recover"):
                assert ran.code == DONE, shown
                continue
            assert ran.code == USAGE, shown
            assert "Traceback" not in ran.err, shown
            assert path.name[:40] in ran.err, shown
            assert set(os.listdir(folder)) == before, shown


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_a_recording_of_a_silent_bus_is_a_log(suffix: str, canid: Canid, tmp_path: Path) -> None:
    """`look` and `recover` end with exit code 0; what needs frames says that there are none, exit code 2."""
    path = tmp_path / f"silent{suffix}"
    canid("record", "-i", "virtual", "-c", tmp_path, "-o", path, "--duration", "0.3")
    assert list(open_log(path)) == []
    ran = canid("look", path)
    assert ran.code == DONE
    assert f"{path} holds no frames\n" in ran.err
    assert canid("recover", path, "-o", tmp_path / f"copy{suffix}").code == DONE
    assert list(open_log(tmp_path / f"copy{suffix}")) == []
    onto = ("--onto", "-i", "virtual", "-c", tmp_path)
    for verb in ("identify", "check", "replay", "export", "replay onto"):
        ran = canid(verb.split()[0], path, *(onto if verb == "replay onto" else ("--vehicle", "generic")))
        assert ran.code == USAGE
        assert "holds no frames" in ran.line


@pytest.mark.parametrize("verb", ["look", "identify", "check", "recover", "export", "replay"])
def test_a_damaged_log_stays_4(verb: str, canid: Canid, log: Path, tmp_path: Path) -> None:
    """Of a log whose rest is used, and of one that is known by its header and has nothing left."""
    data = log.read_bytes()
    more = () if verb in ("look", "recover") else ("--vehicle", "generic")
    for name, content in {
        "part": data[: len(data) // 2],
        "none": data[:144] + bytes(9000),
        "header": data[:40],
    }.items():
        path = tmp_path / f"{name}.blf"
        path.write_bytes(content)
        ran = canid(verb, path, *more, *(("-o", tmp_path / f"{name}_out") if verb == "export" else ()))
        assert ran.code == DAMAGED, (name, ran)
    shutil.rmtree(tmp_path, ignore_errors=True)
