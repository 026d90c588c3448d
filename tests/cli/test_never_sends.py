"""0 sends: an installed plug-in interface logs everything that is done to its bus, in every verb and configuration."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.fixtures.forks import Forks

ROOT = Path(__file__).parents[2]
LOG = ROOT / "replay_logs/following_mixed.blf"
VEHICLE = ROOT / "dbc/generic.toml"

# Logs each attribute that anybody asks a bus for, its own code included, and each that anybody sets.
PLUGIN = """
import os, time
import can

LOG = open(os.environ["WITNESS_LOG"], "a", buffering=1)

class WitnessBus(can.BusABC):
    def __init__(self, channel=None, can_filters=None, **more):
        LOG.write(f"opened {channel} {sorted(more)}\\n")
        self.channel_info, self.count = f"witness {channel}", 0
        super().__init__(channel, can_filters=can_filters)

    def __getattribute__(self, name):
        LOG.write(f"get {name}\\n")
        return super().__getattribute__(name)

    def __setattr__(self, name, value):
        LOG.write(f"set {name}\\n")
        super().__setattr__(name, value)

    def _recv_internal(self, timeout):
        self.count += 1
        time.sleep(0.005)
        return can.Message(time.time(), 0x100 + self.count % 64, False, data=bytes(8)), False

    def send(self, msg, timeout=None):
        LOG.write("SENT\\n")
"""
# What reading needs: python-can's recv, its filters, its destructor, and the closing.
ALLOWED_GETS = {
    *("recv", "_recv_internal", "shutdown", "__class__", "__init__", "__del__", "_is_shutdown", "count"),
    *("channel_info", "filters", "_filters", "set_filters", "_apply_filters", "_matches_filters"),
    # BusABC.shutdown stops periodic tasks, of which there are none
    *("stop_all_periodic_tasks", "_periodic_tasks", "RECV_LOGGING_LEVEL"),
}
ALLOWED_SETS = {"channel_info", "count", "_periodic_tasks", "_filters", "filters", "_is_shutdown"}


def install(folder: Path) -> None:
    """Write the plug-in and its entry point into a folder of packages."""
    info = folder / "canid_witness-1.0.dist-info"
    info.mkdir(parents=True)
    (folder / "canid_witness.py").write_text(PLUGIN)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: canid-witness\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[can.interface]\nwitness = canid_witness:WitnessBus\n")


def environment(packages: Path) -> dict[str, str]:
    """The environment with the plug-in, and without any configuration of a bus."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith("CAN_")}
    return clean | {"PYTHONPATH": f"{packages}{os.pathsep}{ROOT}", "OMP_NUM_THREADS": "1"}


class Witness(NamedTuple):
    """The plug-in, and a folder that is home and current folder."""

    folder: Path
    packages: Path
    forks: Forks | None  # None: each command is a process of its own

    @property
    def log(self) -> Path:
        return self.folder / "witness.log"

    def run(self, *words: object, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        """Run canid in an empty home and current folder."""
        self.log.write_text("")
        full = (
            environment(self.packages)
            | {"WITNESS_LOG": str(self.log), "HOME": str(self.folder)}
            | (env or {})
        )
        if self.forks is not None:
            return self.forks.run(*words, env=full, cwd=self.folder)
        return subprocess.run(
            [sys.executable, "-m", "canid", *map(str, words)],
            cwd=self.folder,
            env=full,
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )

    def lines(self) -> list[str]:
        return self.log.read_text().splitlines()

    def opened(self) -> int:
        return sum(line.startswith("opened") for line in self.lines())

    def check(self) -> None:
        """Assert that nothing was done to a bus but what reading needs."""
        lines = self.lines()
        assert "SENT" not in lines
        gets = {line.removeprefix("get ") for line in lines if line.startswith("get ")}
        sets = {line.removeprefix("set ") for line in lines if line.startswith("set ")}
        assert gets <= ALLOWED_GETS
        assert sets <= ALLOWED_SETS


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Forks | None]]:
    """The plug-in in a folder of packages, and canid started with it."""
    packages = tmp_path_factory.mktemp("packages")
    install(packages)
    if not hasattr(os, "fork"):
        yield packages, None
        return
    with Forks(environment(packages), tmp_path_factory.mktemp("forks")) as forks:
        yield packages, forks


@pytest.fixture
def witness(tmp_path: Path, installed: tuple[Path, Forks | None]) -> Witness:
    return Witness(tmp_path, *installed)


@pytest.fixture
def started(tmp_path: Path) -> Witness:
    """The same with processes that start anew, and packages that a test may change."""
    install(tmp_path / "packages")
    return Witness(tmp_path, tmp_path / "packages", None)


CONF = "[default]\ninterface = witness\nchannel = c\n"
NAMED = ["-i", "witness", "-c", "x"]
# 20 ways: the words, the environment, ~/.canrc
WAYS: dict[str, tuple[list[str], dict[str, str], str]] = {
    "-i -c": (NAMED, {}, ""),
    "-i alone": (["-i", "witness"], {}, ""),
    "-c, interface from the environment": (["-c", "x"], {"CAN_INTERFACE": "witness"}, ""),
    "CAN_INTERFACE CAN_CHANNEL": ([], {"CAN_INTERFACE": "witness", "CAN_CHANNEL": "x"}, ""),
    "CAN_CONFIG": ([], {"CAN_CONFIG": json.dumps({"interface": "witness", "channel": "x"})}, ""),
    "bustype": ([], {"CAN_CONFIG": json.dumps({"bustype": "witness", "channel": "x"})}, ""),
    "can.conf": ([], {}, CONF),
    "can.conf and -c": (["-c", "y"], {}, CONF),
    "can.conf and CAN_CONFIG": ([], {"CAN_CONFIG": json.dumps({"bitrate": 250000})}, CONF),
    "two channels": ([*NAMED, "-c", "y"], {}, ""),
    "three channels": ([*NAMED, "-c", "y", "-c", "z"], {}, ""),
    "filter": ([*NAMED, "--filter", "100:7C0"], {}, ""),
    "two filters": ([*NAMED, "--filter", "100:7FF", "101:7FF"], {}, ""),
    "bitrate": ([*NAMED, "-b", "500000"], {}, ""),
    "fd": ([*NAMED, "--fd", "--data-bitrate", "2000000"], {}, ""),
    "timing": ([*NAMED, "--timing", "f_clock=8000000", "brp=1", "tseg1=5", "tseg2=2", "sjw=1"], {}, ""),
    "bus-kwargs": ([*NAMED, "--bus-kwargs", "receive_own_messages=True", "send=True", "a=1"], {}, ""),
    "state=ACTIVE": (
        [*NAMED, "--bus-kwargs", "state=ACTIVE", "listen_only=False", "driver_mode=True"],
        {},
        "",
    ),
    "state in can.conf": ([], {}, CONF + "state = ACTIVE\nlisten_only = False\nmonitor = False\n"),
    "auto_reset": ([*NAMED], {"CAN_CONFIG": json.dumps({"auto_reset": True, "single_handle": True})}, ""),
}


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("way", WAYS)
def test_recording_sends_nothing(witness: Witness, way: str) -> None:
    """`record` under 20 ways of configuration: frames come, and nothing but reading is done."""
    words, env, conf = WAYS[way]
    (witness.folder / ".canrc").write_text(conf)
    done = witness.run("record", "-o", "out.blf", "--duration", "0.4", "--json", "-", *words, env=env)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["frames"] > 0
    assert witness.opened() == max(1, words.count("-c"))
    witness.check()


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("way", ["can.conf and CAN_CONFIG", "state in can.conf", "two channels"])
@pytest.mark.parametrize("verb", ["live", "check"])
def test_looking_sends_nothing(witness: Witness, verb: str, way: str) -> None:
    """`live` and `check` on the bus."""
    words, env, conf = WAYS[way]
    (witness.folder / ".canrc").write_text(conf)
    more = (
        ["-i", "witness"] if verb == "check" and "-i" not in words else []
    )  # check needs a bus that is named
    done = witness.run(verb, "--vehicle", VEHICLE, "--duration", "0.5", *more, *words, env=env)
    assert done.returncode in (0, 1), done.stderr
    assert witness.opened() >= 1
    witness.check()


EVERYWHERE = {
    "CAN_INTERFACE": "witness",
    "CAN_CHANNEL": "x",
    "CAN_CONFIG": json.dumps({"interface": "witness"}),
}


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize(
    "words",
    [
        ["identify", "--vehicle", VEHICLE, "--stop", "20", LOG],
        ["diagnose", "--vehicle", VEHICLE, "--stop", "20", LOG],
        ["replay", "--vehicle", VEHICLE, "--speed", "max", "--stop", "5", LOG],
        ["simulate", "out.blf", "--minutes", "0.2"],
        ["export", "--vehicle", VEHICLE, "--stop", "10", "-o", "out", LOG],
        ["recover", "-o", "clean.blf", LOG],
        ["init", "-o", "car.toml", ROOT / "dbc/generic.dbc"],
        ["check", "--vehicle", VEHICLE, LOG],
        ["check", "--vehicle", VEHICLE],
        ["check"],
        ["demo", "--speed", "60"],
    ],
    ids=lambda words: " ".join(str(word) for word in words[:1]),
)
def test_no_other_verb_opens_a_bus_that_is_configured(witness: Witness, words: list[object]) -> None:
    """With the bus in can.conf, CAN_INTERFACE and CAN_CONFIG at once: logs are read, the bus is not even opened."""
    (witness.folder / ".canrc").write_text(CONF)
    done = witness.run(*words, env=EVERYWHERE)
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 1, 2, 4), done.stderr  # 20 s of a log may be too short for an answer
    assert witness.lines() == []


@pytest.mark.parametrize("arm", [[], ["--arm", "y"], ["--arm", ""], ["--arm", "X"], ["--arm", "witness"]])
def test_replay_onto_an_unarmed_bus_is_refused(witness: Witness, arm: list[str]) -> None:
    """No --arm, or that of another channel: exit 2 in one line, nothing is opened."""
    done = witness.run("replay", "--onto", "--speed", "max", "--stop", "0.2", *NAMED, *arm, LOG)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert witness.lines() == []


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize(
    ("words", "env"),
    [
        ([], EVERYWHERE),
        (["-c", "x"], {"CAN_INTERFACE": "witness"}),
        (["-c", "x"], {"CAN_CONFIG": json.dumps({"interface": "witness"})}),
        (["-i", "witness"], {"CAN_CHANNEL": "x"}),
    ],
)
def test_an_armed_bus_is_the_one_on_the_command_line(
    witness: Witness, words: list[str], env: dict[str, str]
) -> None:
    """--arm x with an interface or a channel from elsewhere: exit 2, nothing is opened."""
    (witness.folder / ".canrc").write_text(CONF)
    done = witness.run(
        "replay", "--onto", "--arm", "x", "--speed", "max", "--stop", "0.2", *words, LOG, env=env
    )
    assert done.returncode == 2
    assert "on the command line" in done.stderr
    assert witness.lines() == []


@pytest.mark.slow("whole commands, one after the other")
def test_what_is_armed_is_sent_to_with_nothing_from_files(witness: Witness) -> None:
    """--arm x with -i and -c: sends, which the log shows, and no file adds a parameter to that bus."""
    (witness.folder / ".canrc").write_text(CONF + "bitrate = 1\ndevice_id = 7\n")
    done = witness.run("replay", "--onto", "--arm", "x", "--speed", "max", *NAMED, LOG, env=EVERYWHERE)
    assert done.returncode == 0, done.stderr
    assert witness.lines()[0] == "opened x []"
    assert witness.lines().count("SENT") > 100


@pytest.mark.slow("whole commands, one after the other")
def test_a_plug_in_named_virtual_is_no_virtual_bus(started: Witness) -> None:
    """An installed package may replace python-can's interface of that name: it must be armed as a physical bus."""
    points = started.folder / "packages/canid_witness-1.0.dist-info/entry_points.txt"
    points.write_text("[can.interface]\nvirtual = canid_witness:WitnessBus\n")
    done = started.run("replay", "--onto", "--speed", "max", "--stop", "0.2", "-i", "virtual", "-c", "x", LOG)
    assert done.returncode == 2
    assert "a physical bus" in done.stderr
    done = started.run("record", "-o", "out.blf", "--duration", "0.3", "-i", "virtual", "-c", "x")
    assert "could not be verified" in done.stderr
    started.check()


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("place", ["an entry point", "a module next to the log"])
def test_no_code_comes_from_the_current_folder(started: Witness, place: str) -> None:
    """A plug-in, or the module of an installed one, in the folder where canid is called: refused, not imported."""
    (started.folder / "canid_hostile.py").write_text("import pathlib; pathlib.Path('hostile').touch()\n")
    info = (
        started.folder if place == "an entry point" else started.folder / "packages"
    ) / "canid_hostile-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: canid-hostile\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[can.interface]\nhostile = canid_hostile:Bus\n")
    (started.folder / "can.conf").write_text("[default]\ninterface = hostile\nchannel = x\n")
    for words in (["record", "-o", "out.blf"], ["record", "-o", "out.blf", "-i", "hostile", "-c", "x"]):
        done = started.run(*words, "--duration", "0.3")
        assert done.returncode in (2, 3), done.stderr
        assert done.stderr.count("\n") == 1
    assert not (started.folder / "hostile").exists()


@pytest.mark.slow("whole commands, one after the other")
def test_a_drivers_module_does_not_come_from_the_current_folder(started: Witness) -> None:
    """serial.py, usb.py, ... next to the log are not what python-can imports."""
    for module in (
        "serial",
        "usb",
        "cantact",
        "msgpack",
        "typing_extensions",
        "gs_usb",
        "canalystii",
        "nixnet",
    ):
        text = "import pathlib; pathlib.Path('hostile').touch()\n"
        (started.folder / f"{module}.py").write_text(text)
    for interface in ("slcan", "gs_usb", "cantact", "udp_multicast"):
        words = ("-i", interface, "-c", "/dev/null", "--duration", "0.1")
        done = started.run("record", "-o", "o.blf", *words)
        assert done.returncode in (0, 3), done.stderr
    assert not (started.folder / "hostile").exists()


@pytest.mark.slow("whole commands, one after the other")
def test_what_a_channel_or_a_parameter_must_not_do(witness: Witness) -> None:
    """spy:// would write a file, dll= and override_library_name= load a library: exit 2, one line."""
    target = witness.folder / "written"
    for words, env in (
        (["-i", "slcan", "-c", f"spy:///dev/null?file={target}"], {}),
        (["-i", "serial", "-c", f"SPY:///dev/null?file={target}"], {}),
        (["-i", "witness"], {"CAN_CHANNEL": f"spy:///dev/null?file={target}"}),
        (["-i", "usb2can", "-c", "x", "--bus-kwargs", "dll=evil.dll"], {}),
        (["-i", "usb2can", "-c", "x"], {"CAN_CONFIG": json.dumps({"dll": "/tmp/evil.dll"})}),
        (["-i", "neovi", "-c", "x"], {"CAN_CONFIG": json.dumps({"override_library_name": "/tmp/evil.so"})}),
    ):
        done = witness.run("record", "-o", "out.blf", "--duration", "0.2", *words, env=env)
        assert done.returncode == 2, (words, done.stderr)
        assert done.stderr.count("\n") == 1
    assert not target.exists()
    assert witness.lines() == []
