"""The machine with SocketCAN boots on any processor, and what ends before its command began is said and tried again."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

VM = Path(__file__).with_name("vm")
BOOT = VM / "boot"
needs_uml = pytest.mark.skipif(not shutil.which("linux.uml"), reason="apt-get install user-mode-linux")
# in a namespace of users, which tests/bus/alone makes for who is not root, the programs of root are nobody's
MOUNT = shutil.which("mount")
needs_owners = pytest.mark.skipif(
    MOUNT is not None and os.stat(MOUNT).st_uid != 0,
    reason="root's files are nobody's here: `mount` has no rights in the machine",
)
needs_cc = pytest.mark.skipif(not shutil.which("cc"), reason="apt-get install gcc libc6-dev")

# Writes a part of a stopped child's extended state as it was read, the whole length minus `short`, at least 576 bytes
# (without AVX-512 the whole is some 800); prints both results.
SET_A_PART = """
import ctypes, os, signal, sys
libc = ctypes.CDLL(None, use_errno=True)
libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
TRACEME, GETREGSET, SETREGSET, XSTATE = 0, 0x4204, 0x4205, 0x202
class Part(ctypes.Structure):
    _fields_ = [("base", ctypes.c_void_p), ("length", ctypes.c_size_t)]
child = os.fork()
if not child:
    libc.ptrace(TRACEME, 0, None, None)
    os.kill(os.getpid(), signal.SIGSTOP)
    os._exit(0)
os.waitpid(child, 0)
room = ctypes.create_string_buffer(1 << 20)
part = Part(ctypes.addressof(room), len(room))
if libc.ptrace(GETREGSET, child, XSTATE, ctypes.addressof(part)):
    sys.exit("no extended state here")
whole, state = part.length, room.raw[: part.length]
part = Part(ctypes.addressof(room), max(whole - int(sys.argv[1]), 576))
done = libc.ptrace(SETREGSET, child, XSTATE, ctypes.addressof(part))
again = ctypes.create_string_buffer(1 << 20)
part = Part(ctypes.addressof(again), len(again))
libc.ptrace(GETREGSET, child, XSTATE, ctypes.addressof(part))
print(done, whole, again.raw[:whole] == state)
os.kill(child, signal.SIGKILL)
"""


def booted(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """What `boot` printed, both streams in one, and its status."""
    return subprocess.run(
        [BOOT, *command],
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
        check=False,
    )


@needs_cc
@pytest.mark.skipif(os.uname().machine != "x86_64", reason="the extended state of x86")
@pytest.mark.parametrize("short", [8, 64, 1000])
def test_a_part_of_the_processors_state_can_be_set(short: int, tmp_path: Path) -> None:
    """The host's kernel refuses it, whatever the size of its state; with the library it is taken, and nothing is lost."""
    library = tmp_path / "whole_state.so"
    build = ["cc", "-O2", "-Wall", "-Werror", "-shared", "-fPIC", "-o", library, VM / "whole_state.c", "-ldl"]
    subprocess.run(build, check=True)

    def done(preloaded: str) -> list[str]:
        ran = subprocess.run(
            [sys.executable, "-c", SET_A_PART, str(short)],
            env=os.environ | {"LD_PRELOAD": preloaded},
            capture_output=True,
            text=True,
            check=False,
        )
        if "no extended state" in ran.stderr:
            pytest.skip(ran.stderr)
        return ran.stdout.split()

    assert done("")[0] == "-1"
    assert done(str(library))[::2] == ["0", "True"]


@needs_uml
@needs_owners
def test_the_status_of_the_command_is_that_of_boot() -> None:
    ran = booted("sh", "-c", "ip link add dev vcan7 type vcan && echo it has vcan; exit 7")
    assert ran.returncode == 7, ran.stdout
    assert "it has vcan" in ran.stdout
    assert "ended before" not in ran.stdout


@needs_uml
def test_a_machine_that_ends_before_its_command_is_tried_again_and_says_why() -> None:
    """The second try shows what the kernel says; the last lines name the end."""
    ran = booted("true", VM_OPTIONS="init=/bin/false")
    assert ran.returncode == 125, ran.stdout
    assert ran.stdout.count("vm: the machine ended before the command began") == 2
    assert ran.stdout.count("Kernel panic - not syncing: Attempted to kill init!") == 2
    assert re.search(r"Linux version \d", ran.stdout), "the second try says all"


@needs_uml
def test_a_machine_that_stands_still_is_given_up(tmp_path: Path) -> None:
    """A first process that waits for ever, as a kernel that hangs: no sign of life."""
    waiting = tmp_path / "waiting"
    waiting.write_text("#!/bin/sh\nsleep 1000\n", encoding="utf-8")
    waiting.chmod(0o755)
    ran = booted("true", VM_OPTIONS=f"init={waiting}", VM_SILENCE_S="4")
    assert ran.returncode == 125, ran.stdout
    assert ran.stdout.count("vm: no sign of life for") == 2


@pytest.mark.slow("waits for 45 s, longer than a busy host takes to boot")
@needs_uml
def test_a_silent_command_is_no_machine_that_stands_still() -> None:
    assert booted("sleep", "45", VM_SILENCE_S="40").returncode == 0
