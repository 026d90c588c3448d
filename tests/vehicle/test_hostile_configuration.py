"""A vehicle file or a DBC made to hurt: one line or a few, exit 2, within 5 s and 300 MB, whatever is in it."""

from __future__ import annotations

import io
import os
import socket
import sys
import time
from collections import OrderedDict
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.analysis.proposal import proposal
from canid.signals.dbc_text import parsing
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.values.errors import DONE, USAGE, ConfigError
from canid.values.processes import child_process
from canid.values.shipped_files import shipped
from tests.fixtures import measured_process
from tests.fixtures.measured_process import Ran
from tests.fixtures.vehicle_files import (
    DBC_HEAD,
    DBC_SIGNAL,
    MAX_CPU_S,
    MAX_MEMORY_BYTES,
    TOML,
    write_vehicle,
)

ROOT = Path(__file__).parents[2]
# The promise is of an idle machine. Where other jobs run, processor time grows by what they push out of the caches, and
# the clock says nothing: it bounds what hangs.
CPU_S, CLOCK_S = 1.6 * MAX_CPU_S, 150.0


def canid(*words: str | Path) -> Ran:
    """Run `canid ...` in a process of its own, whose memory is measured."""
    with TemporaryDirectory() as folder:
        return measured_process.canid(*words, folder=Path(folder))


def here(*words: str | Path) -> Ran:
    """Run `canid ...` in this process, and the parser in its own as ever; the memory is not measured."""
    out, err, began, before = io.StringIO(), io.StringIO(), time.monotonic(), sum(os.times()[:4])
    with redirect_stdout(out), redirect_stderr(err):
        code = main([*map(str, words)])
    took = sum(os.times()[:4]) - before
    return Ran(code, out.getvalue(), err.getvalue(), took, time.monotonic() - began, 0.0)


def check_refused(
    *words: str | Path, most_lines: int = 1, run: Callable[..., Ran] = here, more_s: float = 0.0
) -> str:
    """Run a command that must refuse its configuration, in time and memory; return what it said."""
    ran = run(*words)
    assert ran.code == USAGE, ran
    assert ran.err.startswith("canid: "), ran.err[:500]
    assert "Traceback" not in ran.err
    lines = ran.err.splitlines()
    assert len(lines) <= most_lines, ran.err[:2000]
    assert len(ran.err) < 600 * most_lines, len(ran.err)
    assert ran.cpu < CPU_S + more_s, ran
    assert ran.wall < CLOCK_S, ran
    assert ran.memory < MAX_MEMORY_BYTES, ran
    return ran.err


def plain(n: int) -> str:
    messages = [
        f"BO_ {2**31 + k} M{k}: 8 X\n"
        + "".join(f' SG_ S{s} : {8 * s}|8@1+ (0.1,-40) [0|100] "km/h" X\n' for s in range(8))
        for k in range(n // 8)
    ]
    return DBC_HEAD + "".join(messages)


def pages(n: int) -> str:
    lines = [f' SG_ S{k} m{k} : 16|8@1+ (0.1,-40) [0|100] "km/h" X\n' for k in range(n)]
    return DBC_HEAD + 'BO_ 1 M: 8 X\n SG_ MX M : 0|16@1+ (1,0) [0|0] "" X\n' + "".join(lines)


def deep_pages(n: int) -> str:
    lines = [f' SG_ S{k} m0M : {k % 512}|1@1+ (1,0) [0|0] "" X\n' for k in range(1, n)]
    ranges = [f"SG_MUL_VAL_ 1 S{k} S{k - 1} 0-0;\n" for k in range(1, n)]
    return (
        DBC_HEAD
        + 'BO_ 1 M: 64 X\n SG_ S0 M : 0|1@1+ (1,0) [0|0] "" X\n'
        + "".join(lines)
        + "\n"
        + "".join(ranges)
    )


def one(signal: str, message: str = "BO_ 1 M: 8 X\n", more: str = "") -> str:
    return DBC_HEAD + message + signal + "\n" + more


TOMLS: dict[str, Callable[[], str | bytes]] = {
    "100,000 nested brackets": lambda: "a = " + "[" * 100_000 + "]" * 100_000,
    "100,000 nested tables": lambda: "a = " + "{a=" * 60_000 + "1" + "}" * 60_000,
    "a dotted key of 100,000 parts": lambda: ".".join("a" * 100_000) + " = 1",
    "headers of 100 parts": lambda: "".join(f"[{'.'.join([f'a{k}'] * 100)}]\n" for k in range(700)),
    "dotted keys of 500 parts": lambda: "".join(f"{'.'.join([f'a{k}'] * 500)} = 1\n" for k in range(125)),
    "a 5,000-digit integer": lambda: TOML.replace('"Car"', "9" * 5000),
    "a 4,000-digit integer as scale": lambda: TOML + f"brake = {{ signal = 'A.B', scale = {'9' * 4000} }}",
    "a 4,000-digit integer as order": lambda: TOML + f"[armax]\nna = {'9' * 4000}",
    "250,000 keys": lambda: "".join(f"k{k}=1\n" for k in range(30_000)),
    "10,000 roles": lambda: TOML + "".join(f'role{k} = "A.B"\n' for k in range(8_000)),
    "10,000 keys of an entry": lambda: TOML + "brake = {" + ",".join(f"k{k}=1" for k in range(10_000)) + "}",
    "10,000 DBC files": lambda: TOML.replace('"car.dbc"', ",".join(['"car.dbc"'] * 10_000)),
    "a name of 200 kB": lambda: TOML.replace("Car", "x" * 200_000),
    "a signal's name of 200 kB": lambda: TOML.replace("PedalPosition", "x" * 200_000),
    "a unit of 200 kB": lambda: TOML + f"accel = {{ signal = 'A.B', unit = '{'x' * 200_000}' }}",
    "a role's name with escapes": lambda: TOML + '"\\u001b[2J\\nx: y" = "A.B"',
    "a file of 300 kB": lambda: TOML + "#" * 300_000,
    "a file of 30 MB": lambda: b"#" * 30_000_000,
    "no text": lambda: b"\xff\xfe" * 1000,
    "tracks without end": lambda: TOML + '[lead]\ntracks = "T_{0..1000000000}"\ndistance = "D"\nrate = "R"',
    "tracks with digits without end": lambda: TOML + f'[lead]\ntracks = "T_{{0..{"9" * 250}}}"',
    "valid with NaN": lambda: TOML + "accel = { signal = 'CHASSIS_DATA.LongAccel', valid = [nan, inf] }",
    "stale below zero": lambda: TOML + "accel = { signal = 'CHASSIS_DATA.LongAccel', stale = -1 }",
    "stale for ever": lambda: TOML + "accel = { signal = 'CHASSIS_DATA.LongAccel', stale = 1e300 }",
    "a scale of 0": lambda: TOML + "accel = { signal = 'CHASSIS_DATA.LongAccel', scale = 0 }",
    "a scale of 1e308": lambda: TOML + "accel = { signal = 'CHASSIS_DATA.LongAccel', scale = 1e308 }",
    "an offset of 1e308": lambda: TOML + "accel = { signal = 'CHASSIS_DATA.LongAccel', offset = -1e308 }",
    "100,000 numbers that mean true": lambda: (
        TOML + f"brake = {{ signal = 'A.B', on = [{','.join(['1'] * 100_000)}] }}"
    ),
    "a window of 1e9 s": lambda: TOML + "[fopdt]\nwindow = 1e9",
    "a lag of 1e9 s": lambda: TOML + "[fopdt]\ntau_max = 1e9\ndead_time_max = 1e9",
    "a lag of 1e-300 s": lambda: TOML + "[fopdt]\ntau_max = 1e-300",
    "a refit every 1e-300 s": lambda: TOML + "[fopdt]\nrefit = 1e-300",
    "an order of 10^6": lambda: TOML + "[armax]\nna = 1000000",
    "a start of 1e300 s": lambda: TOML + "[armax]\nstart = 1e300",
    "a headway of infinity": lambda: TOML + "[driver]\nheadway_desired = inf",
    "noise of 1e-300": lambda: TOML + "[lead]\ngap_noise = 1e-300",
    "noise of 1e300": lambda: TOML + "[lead]\nrange_rate_noise = 1e300",
    "a prior of 1e-300": lambda: TOML + "[fopdt.prior]\ntau = 1e-300\ntau_factor = 1.0000000001",
    "a bus of 10^30": lambda: TOML.replace('"car.dbc"', f'{{ file = "car.dbc", bus = {10**30} }}'),
    "a DBC's name with a NUL": lambda: TOML.replace("car.dbc", "a\\u0000b"),
    "a DBC's name of 100 kB": lambda: TOML.replace("car.dbc", "x" * 100_000),
    "a DBC's name of 3 kB": lambda: TOML.replace("car.dbc", "x" * 3_000),
    "DBC is /dev/zero": lambda: TOML.replace("car.dbc", "/dev/zero"),
    "DBC is /dev/stdin": lambda: TOML.replace("car.dbc", "/dev/stdin"),
    "DBC is the folder": lambda: TOML.replace("car.dbc", "."),
}


# one for each limit: nesting, keys, roles, files, text, size
LARGEST = (
    "100,000 nested brackets", "headers of 100 parts", "250,000 keys", "10,000 roles", "10,000 DBC files",
    "a name of 200 kB", "a file of 30 MB",
)  # fmt: skip


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize("what", TOMLS)
def test_a_hostile_vehicle_file(what: str, tmp_path: Path) -> None:
    """Nesting, numbers, names, sizes and settings that are bombs: refused, quickly and in little memory."""
    run = canid if what in LARGEST else here
    check_refused("check", "--vehicle", write_vehicle(tmp_path, TOMLS[what]()), most_lines=6, run=run)


DBCS: dict[str, Callable[[], str | bytes]] = {
    "a million signals": lambda: plain(1_000_000),
    "35,000 signals": lambda: plain(35_000),
    "20,000 pages": lambda: pages(20_000),
    "1,500 pages deep": lambda: deep_pages(1_500),
    "pages that are expanded": lambda: one(
        ' SG_ S0 M : 0|32@1+ (1,0) [0|0] "" X\n SG_ S1 m0 : 32|8@1+ (1,0) [0|0] "" X\n',
        more="SG_MUL_VAL_ 1 S1 S0 0-4000000000;\n",
    ),
    "pages in a circle": lambda: one(
        ' SG_ A m0M : 0|8@1+ (1,0) [0|0] "" X\n SG_ B m0M : 8|8@1+ (1,0) [0|0] "" X\n',
        more="SG_MUL_VAL_ 1 A B 0-0;\nSG_MUL_VAL_ 1 B A 0-0;\n",
    ),
    "a signal of 10^8 bits": lambda: one(DBC_SIGNAL.replace("0|8", "0|100000000")),
    "a signal that begins at bit 10^8": lambda: one(DBC_SIGNAL.replace("0|8", "100000000|8")),
    "a message of 10^8 bytes": lambda: one(DBC_SIGNAL, "BO_ 1 M: 100000000 X\n"),
    "a number of 5,000 digits": lambda: one(DBC_SIGNAL.replace("(1,0)", f"({'9' * 5000},0)")),
    "100,000 senders": lambda: one(
        DBC_SIGNAL, more="BO_TX_BU_ 1 : " + ",".join(f"N{k}" for k in range(100_000)) + ";\n"
    ),
    "a million words": lambda: DBC_HEAD + "a " * 1_000_000,
    "a million semicolons": lambda: DBC_HEAD + ";" * 1_000_000,
    "an open quotation": lambda: DBC_HEAD + 'CM_ "' + '\\"' * 1_000_000,
    "100,000 texts of a value": lambda: one(
        DBC_SIGNAL, more="VAL_ 1 S " + " ".join(f'{k} "a{k}"' for k in range(400_000)) + " ;\n"
    ),
    "20,000 messages of one name": lambda: DBC_HEAD + ("BO_ 1 M: 8 X\n" + DBC_SIGNAL) * 20_000,
    "zeros": lambda: bytes(10_000_000),
    "random bytes": lambda: os.urandom(3_000_000),
    "17 MB": lambda: DBC_HEAD + " " * 17_000_000,
}


# they reach the limits of signals, processor time and memory
WORST = ("a million signals", "1,500 pages deep", "pages that are expanded", "100,000 texts of a value")


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The parser gets 0.3 s of processor time instead of 3 s."""
    limits = "parsing.CPU_S, parsing.CPU_STARTS, parsing.CPU_S_PER_SIGNAL = 0.3, 0.0, 0.0"
    code = f"from canid.signals.dbc_text import parsing; {limits}; raise SystemExit(parsing.main())"
    command = [sys.executable, "-c", code]
    monkeypatch.setattr(child_process, "command", lambda module: command)
    monkeypatch.setattr(parsing, "_kept", OrderedDict())


def check_dbc(folder: Path, dbc: str | bytes, run: Callable[..., Ran]) -> None:
    """`check` refuses it, and `init` proposes something or refuses it too."""
    # its messages are none of those that the vehicle names: what is read in time is refused for that
    said = check_refused("check", "--vehicle", write_vehicle(folder, TOML, dbc), most_lines=6, run=run)
    assert "dbc" in said or "no message" in said
    ran = run("init", str(folder / "car.dbc"), "-o", str(folder / "new.toml"))
    assert ran.code in (DONE, USAGE), ran
    assert ran.cpu < CPU_S, ran
    assert ran.memory < MAX_MEMORY_BYTES, ran
    assert "Traceback" not in ran.err


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize("what", WORST)
def test_what_a_dbc_may_take(what: str, tmp_path: Path) -> None:
    """Everything that makes cantools slow, large or recursive ends after 3 s of processor time or 160 MB."""
    check_dbc(tmp_path, DBCS[what](), canid)


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("what", DBCS)
def test_a_hostile_dbc(what: str, tmp_path: Path) -> None:
    """The same of every other way to make it so, with a tenth of the time."""
    check_dbc(tmp_path, DBCS[what](), here)


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        (
            ".kcd",
            '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
            + "".join(
                f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefghi", "bcdefghij", strict=True)
            )
            + "]><x>&j;</x>",
        ),
        (".arxml", '<?xml version="1.0"?>' + "<a>" * 200_000),
        (".sym", "FormatVersion=6.0\n" + "{" * 500_000),
        (".cdd", "<a/>" * 500_000),
        (".txt", "a " * 300_000),
    ],
)
def test_other_formats_of_cantools(suffix: str, text: str, tmp_path: Path) -> None:
    """Entities within entities, elements without end: the same limits for whatever cantools reads."""
    (tmp_path / f"car{suffix}").write_text(text)
    check_refused(
        "check", "--vehicle", write_vehicle(tmp_path, TOML.replace("car.dbc", f"car{suffix}")), most_lines=5
    )


@pytest.mark.slow("parses hostile files in children")
def test_many_files_share_one_limit(tmp_path: Path) -> None:
    """Sixty DBC files that take a second each are stopped as one that takes a minute is."""
    for k in range(60):
        (tmp_path / f"{k}.dbc").write_text(plain(8_000) + f"\n// {k}\n")
    names = ", ".join(f'"{k}.dbc"' for k in range(60))
    check_refused(
        "check",
        "--vehicle",
        write_vehicle(tmp_path, TOML.replace('"car.dbc"', names)),
        most_lines=31,
        run=canid,
        more_s=parsing.CPU_S_PER_SIGNAL * parsing.MAX_SIGNALS,
    )


@pytest.mark.parametrize("name", ["car.toml", "car.dbc"])
@pytest.mark.parametrize("kind", ["pipe", "socket", "zero", "folder", "loop"])
def test_what_is_no_file(name: str, kind: str, tmp_path: Path) -> None:
    """A pipe that nobody writes to, a socket, a device, a folder, a link to itself: said, never waited for."""
    path = write_vehicle(tmp_path)
    bad = tmp_path / name
    bad.unlink()
    if kind == "pipe":
        os.mkfifo(bad)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as other:
            other.bind(os.path.relpath(bad))
    elif kind == "zero":
        bad.symlink_to("/dev/zero")
    elif kind == "loop":
        bad.symlink_to(bad)
    else:
        bad.mkdir()
    assert name in check_refused("check", "--vehicle", path, most_lines=2)


LARGE_FILES = ("cadillac_ct6_object", "FORD_CADS", "vw_mqb", "vw_pq")


@pytest.mark.slow("parses hostile files in children")
def test_what_large_files_there_are_is_read(tmp_path: Path, measured: Path) -> None:
    """The largest public DBC files pass with room to spare, and so does one of 16,000 signals."""
    for name in LARGE_FILES:
        assert "[signals]" in proposal(measured / "opendbc" / f"{name}.dbc").text
    text = (shipped() / "generic.dbc").read_text() + plain(16_000).partition("BU_: X\n")[2]
    path = write_vehicle(tmp_path, TOML, text.replace("BO_TX_BU_", "BO_TX_BU_"))
    ran = canid("check", "--vehicle", path)
    assert ran.code == DONE, ran


@pytest.mark.slow("parses hostile files in children")
@settings(max_examples=40, deadline=None, derandomize=True)
@given(data=st.data())
def test_any_value_of_any_key_is_read_or_refused(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Whatever stands behind a key: a vehicle whose pipeline can be built and stepped, or a ConfigError."""
    from canid.models.pipeline import pipeline
    from canid.values.frame_columns import columns_of
    from canid.values.types import Frame

    keys = {
        "signals.accel": (
            "signal = 'CHASSIS_DATA.LongAccel', ",
            ("scale", "offset", "valid", "stale", "bus", "on"),
        ),
        "lead": ("", ("in_path", "gap_noise", "range_rate_noise", "tracks", "rate_sign")),
        "driver": ("", ("headway_desired", "output", "task")),
        "armax": ("", ("na", "nb", "nc", "nk", "start", "forgetting")),
        "fopdt": ("", ("window", "refit", "tau_max", "dead_time_max")),
        "fopdt.prior": ("tau = 0.3, ", ("tau_factor", "dead_time", "same_tau", "range_rate", "atypical")),
        "fopdt.prior.range_rate": ("K = 3.0, ", ("K_sd", "K", "tau_plus_dead_time", "dead_time")),
    }
    section = data.draw(st.sampled_from(sorted(keys)))
    first, names = keys[section]
    numbers = st.one_of(
        st.floats().map(lambda x: repr(x).replace("e+", "e")),
        st.integers(-(10**30), 10**30).map(str),
        st.sampled_from(
            [
                "0.15",
                "20.0",
                "600",
                "10",
                "50",
                "1e-12",
                "1e12",
                "[]",
                "{}",
                "true",
                "''",
                "[1, 2]",
                "'pedal'",
            ]
        ),
        st.lists(st.floats(), max_size=3).map(repr),
    )
    key, value = data.draw(st.sampled_from(names)), data.draw(numbers)
    folder = tmp_path_factory.mktemp("car")
    if section == "signals.accel":
        text = TOML + f"accel = {{ {first}{key} = {value} }}"
    else:
        text = TOML + f"[{section}]\n" + first.replace(", ", "\n") + f"{key} = {value}"
    try:
        vehicle = read_vehicle(write_vehicle(folder, text))
    except ConfigError as error:
        said = str(error).splitlines()
    else:
        said = []
    assert all(len(line) < 400 for line in said)
    if said:
        return
    running = pipeline.build(vehicle)
    state = running.init()
    for k in range(100):
        frames = [
            Frame(0.02 * k, 0, id_, bytes((k * id_ + n) % 256 for n in range(8)))
            for id_ in (0x110, 0x120, 0x130, 0x150)
        ]
        state, _ = running.step(state, columns_of(frames))
