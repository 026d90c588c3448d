"""Attacks by files next to the log: modules, packages, plug-ins and configuration in the current folder."""

from __future__ import annotations

import importlib.metadata
import math
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.attack.overwriting import made
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT
from canid.values.shipped_files import shipped

PROMISE = "no code from the current folder, in any verb or child process"
VERBS = 2  # in a round
LIKELY = (
    *("queue", "pickle", "calendar", "asammdf", "numpy", "typing", "json", "can", "canid", "sitecustomize"),
    *("usercustomize", "site", "os", "io", "re", "enum", "struct", "zlib", "scipy", "pandas", "pyarrow"),
    *("cantools", "rich", "msgpack", "serial", "pydantic", "matplotlib", "random", "secrets", "socket"),
    *("subprocess", "threading", "tomllib", "copyreg", "_compat_pickle", "runpy", "pkgutil", "encodings"),
    *(
        "decimal",
        "fractions",
        "statistics",
        "numbers",
        "gzip",
        "bz2",
        "lzma",
        "locale",
        "gettext",
        "argparse",
    ),
)
# What a hostile module leaves: who imported it, and whether canid's command line had begun by then.
MODULE = """
import sys
with open({marker!r}, "a") as file:
    file.write(repr([__name__, 'canid.ui.cli' in sys.modules, sys.flags.isolated, sys.argv[:4], sys.path[:3]]) + "\\n")
"""
COMMANDS = {
    "record": ("record", "-i", "virtual", "-c", "x", "--duration", "0.2", "-o", "out.blf"),
    "live": ("live", "-i", "virtual", "-c", "x", "--duration", "1", "--vehicle", "car.toml"),
    "replay": ("replay", "drive.blf", "--vehicle", "car.toml", "--stop", "3"),
    "identify": ("identify", "drive.blf", "--vehicle", "car.toml", "--stop", "3"),
    "diagnose": ("diagnose", "drive.blf", "--vehicle", "car.toml", "--stop", "3", "--report", "out.html"),
    "check": ("check", "drive.blf", "--vehicle", "car.toml"),
    "check on a bus": ("check", "-i", "virtual", "-c", "x", "--duration", "0.3", "--vehicle", "car.toml"),
    "export": ("export", "drive.blf", "--vehicle", "car.toml", "-o", "table", "--stop", "3"),
    "parquet": (
        "export",
        "drive.blf",
        "--vehicle",
        "car.toml",
        "-o",
        "table",
        "--to",
        "parquet",
        "--stop",
        "3",
    ),
    "recover": ("recover", "drive.blf", "-o", "copy.blf"),
    "simulate": ("simulate", "new.blf", "--minutes", "0.05"),
    "init": ("init", "generic.dbc", "-o", "new.toml"),
    "mf4": ("check", "drive.mf4", "--vehicle", "car.toml"),
    "hostile plug-in": ("record", "-i", "hostile", "-c", "x", "--duration", "0.2", "-o", "out.blf"),
    "plug-in of can.conf": ("record", "--duration", "0.2", "-o", "out.blf"),
    "slcan": ("record", "-i", "slcan", "-c", "/dev/null", "--duration", "0.1", "-o", "out.blf"),
    "udp_multicast": (
        "record",
        "-i",
        "udp_multicast",
        "-c",
        "239.74.163.2",
        "--bus-kwargs",
        "hop_limit=0",
        "--duration",
        "0.2",
        "-o",
        "out.blf",
    ),
    "help": ("--help",),
}


def installed() -> Path | None:
    """The installed command; None: this interpreter has none."""
    path = Path(sys.executable).parent / "canid"
    return path if path.exists() else None


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Some verbs, in a folder full of modules."""
    here, marker = folder / "here", folder / "imported"
    here.mkdir()
    names = set(LIKELY) | set(rng.sample(sorted(sys.stdlib_module_names), 60)) | _distributions(rng)
    for name in names:
        _plant(here, name, marker, rng)
    text = MODULE.format(marker=str(marker))
    (here / "evil.pth").write_text(f"import os; open({str(marker)!r}, 'a').write('pth')\n")
    (here / "lib/site-packages").mkdir(parents=True)
    (here / "lib/site-packages/evil.pth").write_text((here / "evil.pth").read_text())
    (here / "pyvenv.cfg").write_text(f"home = {here}\ninclude-system-site-packages = false\n")
    (here / ".pdbrc").write_text(f"open({str(marker)!r}, 'a')\n")
    info = here / "hostile-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hostile\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[can.interface]\nhostile = hostile_bus:Bus\nvirtual = hostile_bus:Bus\n"
    )
    (here / "hostile_bus.py").write_text(text)
    (here / "can.conf").write_text("[default]\ninterface = hostile\nchannel = x\n")
    shutil.copy(made() / "simulated.blf", here / "drive.blf")
    (here / "drive.mf4").write_bytes(b"MDF     4.10    " + bytes(200))
    shutil.copy(shipped() / "generic.toml", here / "car.toml")
    shutil.copy(shipped() / "generic.dbc", here / "generic.dbc")
    as_module = rng.random() < 0.3 or installed() is None
    wrong = []
    verbs = rng.sample(sorted(COMMANDS), VERBS)
    for verb in verbs:
        marker.unlink(missing_ok=True)
        start = [sys.executable, "-m", "canid"] if as_module else [str(installed())]
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("CAN_", "PYTHONPATH"))}
        environment |= {"OMP_NUM_THREADS": "1", "HOME": str(here)}
        if as_module:
            environment["PYTHONPATH"] = str(ROOT)
            # `python -m canid` would find the folder's own canid, before ours has begun: that is Python's
            shutil.rmtree(here / "canid", True)
            (here / "canid.py").unlink(missing_ok=True)
        done = subprocess.run(
            [*start, *COMMANDS[verb]],
            cwd=here,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=300,
            check=False,
        )
        loaded = marker.read_text().splitlines() if marker.exists() else []
        if as_module:  # what Python itself imports before canid has begun
            loaded = [line for line in loaded if ", True, " in line.partition("]")[0] or "'-c'" in line]
        wrong += [f"{verb}: {line}" for line in loaded[:3]]
        if "Traceback" in done.stderr and not as_module:
            wrong.append(f"{verb}: {done.stderr[-300:]}")
        for name in ("out.blf", "out.html", "new.blf", "new.toml", "copy.blf"):
            (here / name).unlink(missing_ok=True)
    group = "`python -m canid`" if as_module else "the installed command"
    yield Outcome(
        f"{group} in a folder with 100 and more hostile modules, packages, .pth, can.conf, plug-ins",
        math.nan,
        0,
        "; ".join(wrong),
        tried=len(verbs),
    )


def _distributions(rng: random.Random) -> set[str]:
    """Some top-level modules of what is installed here."""
    names = {name for name in importlib.metadata.packages_distributions() if name.isidentifier()}
    return set(rng.sample(sorted(names), min(30, len(names))))


def _plant(here: Path, name: str, marker: Path, rng: random.Random) -> None:
    text = MODULE.format(marker=str(marker))
    if rng.random() < 0.7:
        (here / f"{name}.py").write_text(text)
        return
    (here / name).mkdir(exist_ok=True)
    (here / name / "__init__.py").write_text(text)
