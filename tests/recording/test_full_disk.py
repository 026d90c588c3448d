"""A file that may not grow any more ends, and the recording goes on: all that is stated is what readers find."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path

import pytest

from canid.io.buses import python_can
from canid.io.logs import open_log
from canid.values.errors import LogError

# a recorder whose files may not grow beyond a limit: EFBIG at that very byte
CHILD = """
import json, random, resource, signal, sys, time
from canid.io.buses import python_can
from canid.io.buses.bus_opener import open_buses
from canid.io.recording.recorder import Recorder
path, limit, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
can = python_can.load()
sender = can.Bus("full", interface="virtual")
recorder = Recorder(open_buses([dict(interface="virtual", channel="full")]), path).start()
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
rng = random.Random(seed)
i = 0
end = time.monotonic() + 60
while recorder.stats().files < 4 and not recorder.stats().state.startswith("failed") and time.monotonic() < end:
    for _ in range(rng.choice((1, 10, 100, 3000))):
        data = i.to_bytes(4, "big") + rng.randbytes(rng.randrange(5))
        sender.send(can.Message(arbitration_id=i % 2048, data=data, is_extended_id=False))
        i += 1
    time.sleep(rng.choice((0.0, 0.01, 0.1)))
    if rng.random() < 0.02:
        break  # the end comes first, and finds the disk full
stats = recorder.stop()
print(json.dumps([stats.state, stats.written, stats.frames, stats.drops_disk]))
"""
# limits per format, one of them drawn; a process each
SEEDS = 3


def read(path: Path) -> tuple[list[int], str]:
    """Numbers of the frames that canid reads, and its complaint."""
    try:
        log = open_log(path)
        found = [int.from_bytes(frame.data[:4], "big") for frame in log]
    except LogError as error:
        return [], "" if path.stat().st_size == 0 else str(error)
    return found, log.damage.says if log.damage else ""


@pytest.mark.slow("recordings in real time")
@pytest.mark.parametrize("suffix", [".blf", ".asc", ".log"])
@pytest.mark.parametrize("seed", range(SEEDS))
def test_the_count_of_a_full_disk_is_what_readers_find(suffix: str, seed: int, tmp_path: Path) -> None:
    """At a drawn byte, with drawn bursts: all files together hold what is stated, for canid and python-can."""
    path = tmp_path / f"x{suffix}"
    limit = random.Random(f"{suffix} {seed}").choice((200, 1000, 20_000, 150_000, 400_000))
    limit += random.Random(seed).randrange(200)
    command = [sys.executable, "-c", CHILD, str(path), str(limit), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    state, written, frames, dropped = json.loads(done.stdout)
    found: list[int] = []
    later = sorted(tmp_path.glob(f"x-*{suffix}"), key=lambda one: int(one.stem[2:]))
    for each in [path, *later] if path.exists() else later:
        numbers, complaint = read(each)
        assert complaint == ""
        assert each.stat().st_size <= limit
        found += numbers
        if each.stat().st_size:
            with python_can.load().LogReader(str(each)) as reader:
                assert sum(1 for _ in reader) == len(numbers)
                assert suffix != ".blf" or reader.object_count == len(numbers)
    assert found == list(range(written)), (state, limit)
    assert written + dropped == frames
    assert state.startswith("failed") or len(found) == frames
