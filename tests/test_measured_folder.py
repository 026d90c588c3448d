"""No test depends on which files lie next to the repository: neither it nor a program that it starts lists that folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.fixtures import measured_logs

ROOT = Path(__file__).parents[1]
# in a process of its own: an audit hook stays
FORBIDDEN = """
import glob, os, pathlib, subprocess, sys
from tests.fixtures import measured_logs
measured_logs.forbid_listing()
data = measured_logs.MEASURED
run = lambda *words, **more: subprocess.run([sys.executable, "-I", "-c", "", *words], check=True, **more)
os.symlink(data, data.parent / "link")
{}
"""
TRIED = """
try:
    {line}
except AssertionError as error:
    print('a test lists' in str(error))
else:
    print({shown})
"""
LISTS = (
    "os.listdir(data)",
    "list(os.scandir(data / 'a'))",
    "list(data.rglob('*.blf'))",
    "glob.glob(f'{data}/*/*.blf')",
    "run(data)",
    "run('fleet', f'{data}/a', '-o', 'out')",
    "run(os.fsencode(data / 'a'))",
    "run(f'--vehicles={data}/a')",
    "run(data.parent / 'link' / 'a')",
    "run(os.path.relpath(data))",
    "run(cwd=data / 'a')",
    "subprocess.run(f'ls {data}/a | head', shell=True)",
    "os.posix_spawn(sys.executable, [sys.executable, '-c', '', str(data)], {})",
    "os.execv(sys.executable, [sys.executable, '-c', '', str(data)])",
)
READS = (
    "(data / 'a' / 'x.blf').read_bytes()",
    "run(data / 'a' / 'x.blf', cwd=data.parent)",
    "run(f'{data}/a/x.blf@60:300', f'{data}/none.blf')",
    "run('a' * 100_000)",
    "os.listdir(data.parent)",
)


def ran(tmp_path: Path, line: str) -> subprocess.CompletedProcess[str]:
    (tmp_path / "data" / "a").mkdir(parents=True)
    (tmp_path / "data" / "a" / "x.blf").write_bytes(b"")
    return subprocess.run(
        [sys.executable, "-c", FORBIDDEN.format(line)],
        cwd=ROOT,
        env={**os.environ, measured_logs.VARIABLE: str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_whatever_lists_the_folder_is_stopped(tmp_path: Path) -> None:
    """Python's ways, and programs that are given a folder of it, by any name, or begin in one."""
    done = ran(tmp_path, "\n".join(TRIED.format(line=line, shown=repr(line)) for line in LISTS))
    assert done.stdout.splitlines() == ["True"] * len(LISTS), done.stderr


def test_files_may_be_read(tmp_path: Path) -> None:
    """In the process, and by programs that are given them, be it with a part of the log after the name."""
    done = ran(tmp_path, "\n".join(READS))
    assert (done.returncode, done.stderr) == (0, "")
