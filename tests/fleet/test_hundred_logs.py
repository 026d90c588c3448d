"""A hundred logs of which thirty are bad: seventy good rows, thirty reasons, exit 4, and a bounded worker."""

from __future__ import annotations

import gzip
import json
import os
import threading
from collections import Counter
from pathlib import Path

import pytest

from tests.fleet import short_logs
from tests.fleet.short_logs import QUICK, URBAN, fleet, fleet_here, table

GOOD = 70
# bytes; as a sparse file it takes no room, and read into memory more than a worker may have
BOMB_BYTES = 2_000_000_000


def bad(folder: Path) -> dict[str, str]:
    """Write thirty bad logs; returns name -> what their row has to say."""
    made: dict[str, str] = {}

    def add(name: str, content: bytes, status: str) -> Path:
        path = folder / "bad" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        made[name] = status
        return path

    whole = URBAN.read_bytes()
    for k in range(5):
        add(f"empty {k}.blf", b"", "empty")
        # its end is missing: what is there is used
        add(f"cut {k}.blf", whole[: 60_000 + 1000 * k], "damaged")
        add(f"picture {k}.blf", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * (k + 3), "not_a_log")
    other = "\n".join(f"({1e9 + t / 10:.6f}) can0 7{t % 10}F#0102030405060708" for t in range(400))
    for k in range(5):
        add(f"other car {k}.log", f"{other}\n(1000000050.{k}) can0 7FF#00\n".encode(), "nothing_mapped")
    for k in range(2):
        path = add(f"bomb {k}.{('blf', 'log')[k]}", b"", "not_a_log")
        os.truncate(path, BOMB_BYTES + k)
    # 500 MB of blanks in 0.5 MB
    zeros = gzip.compress(b" " * 50_000_000, 9) * 10
    add("bomb.asc.gz", zeros, "not_a_log")
    add("text.csv", b"name,age\nanna,30\n", "nothing_mapped")
    add("text.asc", b"nothing of a log\n" * 50, "not_a_log")
    for k in range(3):
        path = add(f"closed {k}.log", short_logs.log(900 + k), "permission")
        if os.geteuid() == 0:  # who may read all
            path.unlink()
            path.symlink_to("nowhere")
            made[path.name] = "missing"
        else:
            path.chmod(0)
    for k in range(2):
        add(f"growing {k}.log", short_logs.log(950 + k), "changed")
    return made


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_seventy_good_rows_thirty_reasons_exit_4(tmp_path: Path) -> None:
    """Damaged, empty, foreign, huge, forbidden and changing logs cost their own row alone, and each says why."""
    logs, out = tmp_path / "logs", tmp_path / "out"
    short_logs.write(logs, GOOD)
    expected = bad(logs)
    assert len(expected) == 30
    stop = threading.Event()

    def grow() -> None:
        while not stop.wait(0.001):
            for path in (logs / "bad").glob("growing *.log"):
                with path.open("ab") as file:
                    file.write(b"(1000000000.000000) can0 7FF#00\n")

    growing = threading.Thread(target=grow)
    growing.start()
    try:
        done = fleet(
            logs, "-o", out, *QUICK, "--timeout", "60s", "--memory", "600M", "--json", tmp_path / "fleet.json"
        )
    finally:
        stop.set()
        growing.join()
    assert done.returncode == 4, done.stderr
    assert "Traceback" not in done.stderr
    rows = table(out, "logs", "log, status, failure, reason")
    good = [row for row in rows if "/bad/" not in row[0]]
    assert [row[1:] for row in good] == [("ok", "", "")] * GOOD
    found = {Path(log).name: failure or status for log, status, failure, _ in rows if "/bad/" in log}
    assert found == expected
    reasons = [reason for log, _, _, reason in rows if "/bad/" in log]
    assert all(reason and "\n" not in reason and len(reason) < 400 for reason in reasons)
    assert table(out, "drives", "count(*), count(key)") == [(100, GOOD + 5)]
    assert table(out, "drives", "max(peak_bytes)")[0][0] < 600e6
    counts = json.loads((tmp_path / "fleet.json").read_text())
    assert (counts["logs"]["ok"], counts["logs"]["damaged"], counts["logs"]["failed"]) == (GOOD, 5, 25)
    assert len(counts["not_ok"]) == 30
    assert counts["failures"] == Counter(of for of in expected.values() if of != "damaged")


NAMES = [
    b"blank at both ends .log",
    b"quote ' and \" and $(false);.log",
    "Zo\u00eb \N{SNOWMAN} \u202e.log".encode(),
    b"\xff\xfe no text \xe9.log",
    b"new\nline.log",
    b"/".join([b"x" * 100] * 3) + b".log",
    b"-o.log",
    b"@list.log",
    b"nul\\0 \\x41 %41.log",
]


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_any_path_has_its_row(tmp_path: Path) -> None:
    """Blanks, quotes, Unicode, bytes that are no text, line feeds and 300 characters: analysed, stored, known again."""
    logs, out = tmp_path / "logs", tmp_path / "results ' \N{SNOWMAN}"
    for number, name in enumerate(NAMES):
        path = Path(os.fsdecode(os.path.join(os.fsencode(logs), name)))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(short_logs.log(number))
    done = fleet_here(logs, "-o", out, *QUICK, "--json", "-")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["logs"]["ok"] == len(NAMES)
    rows = table(out, "drives", "log, status, driver")
    assert len(rows) == len(NAMES)
    shown = {Path(log).name for log, *_ in rows}
    assert {
        "new\nline.log",
        "-o.log",
        "\\xff\\xfe no text \\xe9.log",
        "Zo\u00eb \N{SNOWMAN} \u202e.log",
    } <= shown
    again = fleet_here(logs, "-o", out, *QUICK)
    assert "0 analysed now" in again.stdout
    assert "\u202e" not in again.stdout + again.stderr


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_number_of_workers_changes_no_number(tmp_path: Path) -> None:
    """The same logs by one and by two processes: the same rows, in the same order."""
    logs = tmp_path / "logs"
    short_logs.write(logs, 4)
    numbers = "* EXCLUDE (cpu_s, wall_s, peak_bytes)"
    for folder, count in (("a", 1), ("b", 2)):
        assert fleet_here(logs, "-o", tmp_path / folder, *QUICK, "--workers", count).returncode == 0
    assert table(tmp_path / "a", "drives", numbers) == table(tmp_path / "b", "drives", numbers)
