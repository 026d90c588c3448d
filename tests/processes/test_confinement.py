"""A confined process computes, reads files and answers; it writes, sends and starts nothing."""

from __future__ import annotations

import errno
import os
import platform
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from canid.values.processes import system_calls
from canid.values.processes.child import EXIT_S, Child, EndedError
from canid.values.processes.confinement import Confinement, offered
from canid.values.processes.kept_rights import Kept

PATIENCE_S = 60.0
# {}: what is applied
ANSWERS = """
import ctypes, faulthandler, os, resource, signal, socket, subprocess, sys, threading
from canid.values.processes import confinement, limits
from canid.values.processes.serve import connect
parent = connect(plain=True)
libc = ctypes.CDLL(None, use_errno=True)
{}
def tried(text):
    try:
        return eval(text)
    except OSError as error:
        return ("refused", error.errno)
def threaded(text):
    found = []
    thread = threading.Thread(target=lambda: found.append(tried(text)))
    thread.start()
    thread.join()
    return found[0]
def connected(port):
    made = socket.socket()
    made.connect(("127.0.0.1", port))
    return "connected"
def busy():
    limits.limit_cpu(0.2)
    while True:
        pass
def memory():
    limits.limit_more_data(50_000_000)
    try:
        return len(bytearray(200_000_000))
    except MemoryError:
        return "no memory"
    finally:
        limits.limit_data(None)
for message in parent.messages():
    parent.answer(eval(message))
"""
WHOLE = "confinement.confine()"
PARTS = {
    "landlock": "libc.prctl(38, 1, 0, 0, 0), confinement._landlock(libc)",
    "seccomp": "libc.prctl(38, 1, 0, 0, 0), confinement._filter(libc)",
}
needs_all = pytest.mark.skipif(not offered().complete, reason="this kernel or container refuses to confine")


def child_with(applied: str) -> Child:
    return Child([sys.executable, "-c", ANSWERS.replace("{}", applied)], answers=())


@pytest.fixture
def child() -> Iterator[Child]:
    with child_with(WHOLE) as made:
        yield made


@pytest.fixture
def listening() -> Iterator[int]:
    """A port of loopback that takes connections."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def is_refused(answer: object) -> bool:
    return answer in (("refused", errno.EPERM), ("refused", errno.EACCES))


@needs_all
def test_nothing_is_written(child: Child, tmp_path: Path) -> None:
    """No file is made, opened for writing, cut, renamed, removed or given another mode, by Python or libc, by no thread."""
    kept = tmp_path / "kept"
    kept.write_text("kept", encoding="ascii")
    new = str(tmp_path / "new")
    for attempt in (
        f"open({new!r}, 'w')",
        f"open({str(kept)!r}, 'a')",
        f"open({str(kept)!r}, 'r+')",
        f"os.open({str(tmp_path)!r}, os.O_TMPFILE | os.O_RDWR)",
        f"os.truncate({str(kept)!r}, 0)",
        f"os.rename({str(kept)!r}, {new!r})",
        f"os.unlink({str(kept)!r})",
        f"os.link({str(kept)!r}, {new!r})",
        f"os.symlink('x', {new!r})",
        f"os.mkdir({new!r})",
        f"os.mkfifo({new!r})",
        f"os.chmod({str(kept)!r}, 0o777)",
        f"os.utime({str(kept)!r}, (0, 0))",
        f"os.setxattr({str(kept)!r}, 'user.x', b'')",
        "open('/proc/self/oom_score_adj', 'w')",
    ):
        assert is_refused(child.ask(f"tried({attempt!r})")), attempt
        assert is_refused(child.ask(f"threaded({attempt!r})")), attempt
    assert child.ask(
        f"libc.creat({os.fsencode(new)!r}, 0o600), libc.open({os.fsencode(new)!r}, 0o101, 0o600)"
    ) == (-1, -1)
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    assert kept.read_text(encoding="ascii") == "kept"
    assert kept.stat().st_mtime > 1e9


@needs_all
def test_nothing_is_sent(child: Child, listening: int, tmp_path: Path) -> None:
    """No socket is made, of any family; nothing is connected."""
    assert is_refused(child.ask(f"tried('connected({listening})')"))
    for family in ("AF_INET", "AF_INET6", "AF_UNIX", "AF_NETLINK"):
        for kind in ("SOCK_STREAM", "SOCK_DGRAM", "SOCK_RAW"):
            assert is_refused(child.ask(f"tried('socket.socket(socket.{family}, socket.{kind})')")), (
                family,
                kind,
            )
    assert is_refused(child.ask("tried('socket.socketpair()')"))


# sockets of its own, before it is confined: one that listens, one that has a connection
SOCKETS = """
listener = socket.create_server(("127.0.0.1", 0))
near = socket.create_connection(listener.getsockname())
far, _ = listener.accept()
from canid.values.processes.kept_rights import Kept
confinement.confine(Kept(connections=True))
def shut_down():
    listener.shutdown(socket.SHUT_RD)
def sent(sock, flags, port):
    return sock.sendto(b"secret", flags, ("127.0.0.1", port))
"""


@needs_all
def test_one_that_keeps_its_connections_makes_no_other(listening: int) -> None:
    """It answers who has connected; a listener that it shuts down, which may connect by sending, is refused."""
    with child_with(SOCKETS) as child:
        assert child.ask("far.send(b'answer'), near.recv(9)") == (6, b"answer")
        assert child.ask("near.close(), far.recv(9)") == (None, b"")
        child.ask("shut_down()")
        for sock in ("listener", "far"):
            for flags in ("socket.MSG_FASTOPEN", "socket.MSG_FASTOPEN | socket.MSG_DONTWAIT"):
                assert is_refused(child.ask(f"tried('sent({sock}, {flags}, {listening})')")), (sock, flags)
            assert is_refused(
                child.ask(
                    f"tried(\"{sock}.sendmsg([b'a'], [], socket.MSG_FASTOPEN, ('127.0.0.1', {listening}))\")"
                )
            )
            assert is_refused(child.ask(f"tried(\"{sock}.connect(('127.0.0.1', {listening}))\")"))
        assert is_refused(child.ask("tried('socket.socket()')"))
        assert is_refused(child.ask("tried('os.fork()')"))


@needs_all
def test_nothing_is_started_or_signalled(child: Child) -> None:
    """No process is forked or executed, and none of another session gets a signal or other limits."""
    for attempt in (
        "os.fork()",
        "subprocess.run(['true'])",
        "os.posix_spawn('/bin/true', ['true'], {})",
        "os.execv('/bin/true', ['true'])",
        f"os.kill({os.getpid()}, 0)",
        f"os.killpg({os.getpgrp()}, 0)",
        f"os.pidfd_open({os.getpid()})",
        f"resource.prlimit({os.getpid()}, resource.RLIMIT_NOFILE)",
    ):
        assert is_refused(child.ask(f"tried({attempt!r})")), attempt
    assert child.ask("os.system('true')") != 0


@needs_all
def test_what_parsing_needs_is_left(child: Child, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are read by relative and absolute names, modules are imported, threads run, memory has its limits."""
    (tmp_path / "a").write_text("text", encoding="ascii")
    assert child.ask(f"open({str(tmp_path / 'a')!r}).read()") == "text"
    monkeypatch.chdir(tmp_path)
    with child_with(WHOLE) as other:
        assert other.ask("open('a').read()") == "text"
    assert child.ask("__import__('colorsys').__name__") == "colorsys"
    assert child.ask("threaded('1 + 1')") == 2
    assert child.ask("len(os.listdir('/'))") > 0
    assert child.ask("memory()") == "no memory"
    assert child.ask("len(bytearray(200_000_000))") == 200_000_000
    assert child.ask("faulthandler.enable()") is None


@needs_all
@pytest.mark.parametrize(
    ("message", "code"),
    [("busy()", -signal.SIGPROF), ("os._exit(7)", 7), ("os.abort()", -signal.SIGABRT)],
)
def test_it_ends_as_any_child(child: Child, message: str, code: int) -> None:
    """By its limit of processor time, by itself, by an abort that faulthandler reports."""
    with pytest.raises(EndedError):
        child.ask(message)
    assert child.end(PATIENCE_S) == code


@needs_all
def test_it_is_ended_by_its_parent(child: Child) -> None:
    """A child that hangs is killed."""
    assert child.ask("1") == 1
    child.kill()
    assert child.end(EXIT_S) == -signal.SIGKILL


@pytest.mark.parametrize("part", PARTS)
def test_each_part_holds_alone(part: str, tmp_path: Path, listening: int) -> None:
    """Where the kernel has one of the two only, files and TCP are refused all the same; processes by the filter."""
    rights = offered()
    if not (rights.landlock >= 4 if part == "landlock" else rights.system_calls):
        pytest.skip(f"no {part} here")
    new = str(tmp_path / "x")
    with child_with(PARTS[part]) as child:
        for attempt in (
            f"open({new!r}, 'w')",
            f"os.mkdir({new!r})",
            f"connected({listening})",
            "os.execv('/bin/true', ['true'])",
        ):
            assert is_refused(child.ask(f"tried({attempt!r})")), attempt
        assert list(tmp_path.iterdir()) == []


def answer_of(program: bytes, arch: int, number: int, *arguments: int) -> int:
    """What a filter answers to a call: an interpreter of the few instructions that it may have (linux/filter.h)."""
    data = struct.pack("<IIQ6Q", number, arch, 0, *arguments, *[0] * (6 - len(arguments)))
    code = list(struct.iter_unpack("<HBBI", program))
    at = value = 0
    while True:
        what, if_so, if_not, k = code[at]
        at += 1
        if what == 0x20:
            value = struct.unpack_from("<I", data, k)[0]
        elif what == 0x06:
            return int(k)
        else:
            so = {0x15: value == k, 0x35: value >= k, 0x45: value & k != 0}[what]
            at += if_so if so else if_not


# audit number, and of each machine: execve, socket, unlinkat, openat, read, clone, clone3, prlimit64
MACHINES = {
    "x86_64": (0xC000003E, 59, 41, 263, 257, 0, 56, 435, 302),
    "aarch64": (0xC00000B7, 221, 198, 35, 56, 63, 220, 435, 261),
}


@pytest.mark.parametrize("machine", MACHINES)
def test_the_filter_of_each_machine(machine: str) -> None:
    """Refused, allowed or said to be absent, by number and arguments; a call of another machine's interface is refused."""
    program = system_calls.filter_program(machine)
    arch, execve, socket_, unlinkat, openat, read, clone, clone3, prlimit = MACHINES[machine]
    allow, refuse, absent = 0x7FFF0000, 0x50000 | errno.EPERM, 0x50000 | errno.ENOSYS
    for number in (execve, socket_, unlinkat):
        assert answer_of(program, arch, number) == refuse
    assert answer_of(program, arch, read) == allow
    assert answer_of(program, arch, clone3) == absent
    # flags of open(2) and clone(2): asm-generic/fcntl.h, linux/sched.h
    for flags, answer in (
        (0, allow),
        (0o2000000, allow),
        (1, refuse),
        (2, refuse),
        (0o100, refuse),
        (0o1000, refuse),
    ):
        assert answer_of(program, arch, openat, 0, 0, flags) == answer
    assert answer_of(program, arch, clone, 0x3D0F00) == allow
    assert answer_of(program, arch, clone, 17) == refuse
    assert answer_of(program, arch, prlimit, 0) == allow
    assert answer_of(program, arch, prlimit, 7) == refuse
    for other in (0x40000003, 0, *(values[0] for name, values in MACHINES.items() if name != machine)):
        assert answer_of(program, other, read) == refuse
    assert answer_of(program, arch, 0x40000000 | read) == refuse


# numbers in the order in which they are named below
KEPT_CALLS = {
    "x86_64": (59, 62, 258, 288, 50, 44, 46, 42, 49, 101, 268, 56, 257),
    "aarch64": (221, 129, 34, 242, 201, 206, 211, 203, 200, 117, 53, 220, 56),
}


@pytest.mark.parametrize("machine", MACHINES)
def test_the_filter_leaves_what_is_kept_and_no_more(machine: str) -> None:
    """A right leaves its calls; new namespaces, connections by sending, modes of files and other processes stay refused."""
    arch = MACHINES[machine][0]
    (
        execve,
        kill,
        mkdirat,
        accept4,
        listen,
        sendto,
        sendmsg,
        connect,
        bind,
        ptrace,
        fchmodat,
        clone,
        openat,
    ) = KEPT_CALLS[machine]
    allow, refuse = 0x7FFF0000, 0x50000 | errno.EPERM
    every = {execve, kill, mkdirat, accept4, listen, sendto, sendmsg}
    for kept, left in (
        (Kept(), set()),
        (Kept(folders=("/tmp",)), {mkdirat}),
        (Kept(children=True), {execve, kill, mkdirat}),
        (Kept(connections=True), {accept4, listen, sendto, sendmsg}),
        (Kept(("/tmp",), children=True, connections=True), every),
    ):
        program = system_calls.filter_program(machine, kept)
        for number in every:
            assert answer_of(program, arch, number) == (allow if number in left else refuse), (kept, number)
        for number in (connect, bind, ptrace, fchmodat):
            assert answer_of(program, arch, number) == refuse, (kept, number)
        # SIGCHLD, a thread, CLONE_VM | CLONE_VFORK; of namespaces all seven (linux/sched.h)
        for flags in (17, 0x4111):
            assert answer_of(program, arch, clone, flags) == (allow if kept.children else refuse)
        assert answer_of(program, arch, clone, 0x3D0F00) == allow
        for namespace in (17, 25, 26, 27, 28, 29, 30):
            assert answer_of(program, arch, clone, 1 << namespace | 17) == refuse
        for flags in (1, 2, 0o100):
            assert answer_of(program, arch, openat, 0, 0, flags) == (allow if kept.writes else refuse)
        assert answer_of(program, arch, sendto, 3, 0, 9, 0x20000000) == refuse
        assert answer_of(program, arch, sendmsg, 3, 0, 0x20000000) == refuse
        assert answer_of(program, arch, sendto, 3, 0, 9, 0x4000) == (allow if kept.connections else refuse)


def test_the_numbers_of_this_machine_are_those_of_its_headers() -> None:
    """Every call that is refused by name is that call's number, as the system's own headers have it."""
    headers = {
        "x86_64": "/usr/include/x86_64-linux-gnu/asm/unistd_64.h",
        "aarch64": "/usr/include/asm-generic/unistd.h",
    }
    checked = 0
    for column, header in enumerate(headers.values()):
        path = Path(header)
        if not path.exists():
            continue
        known = {}
        for line in path.read_text(encoding="ascii", errors="replace").splitlines():
            words = line.split()
            if (
                len(words) >= 3
                and words[0] == "#define"
                and words[1].startswith("__NR")
                and words[2].isdigit()
            ):
                known[words[1].removeprefix("__NR_").removeprefix("__NR3264_")] = int(words[2])
        for name, numbers in (system_calls._REFUSED | system_calls._ABSENT).items():
            if name in known:
                assert numbers[column] == known[name], (name, header)
                checked += 1
            elif numbers[column] >= 0:
                # a header older than the call
                assert numbers[column] > max(known.values()), (name, header)
    if not checked:
        pytest.skip("no headers of the kernel here")


def test_where_the_kernel_refuses_it_goes_on() -> None:
    """Where prctl, Landlock and seccomp are refused, as a container may: nothing is raised, and it is known."""
    if not offered().system_calls or platform.machine() != "x86_64":
        pytest.skip("needs a filter of x86-64")
    # refuse prctl(157), seccomp(317), landlock_create_ruleset(444)
    code = """
import ctypes, struct
from canid.values.processes import confinement
libc = ctypes.CDLL(None, use_errno=True)
libc.prctl(38, 1, 0, 0, 0)
rows = [(0x20, 0, 0, 0)]
for number in (157, 317, 444):
    rows += [(0x15, 0, 1, number), (6, 0, 0, 0x50001)]
rows.append((6, 0, 0, 0x7FFF0000))
code = ctypes.create_string_buffer(b"".join(struct.pack("<HBBI", *row) for row in rows))
libc.syscall(317, 1, 0, struct.pack("@HP", len(rows), ctypes.addressof(code)))
found = confinement.confine()
print(tuple(found), found.complete, found.describe())
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.startswith(
        "(False, 0, False) False files of strangers are parsed with limits of memory and time only"
    )


def test_what_is_offered_is_a_line_for_each_kind_of_process() -> None:
    """By the command that asks it; every combination has its own words."""
    ran = subprocess.run(
        [sys.executable, "-m", "canid.values.processes.confinement"],
        capture_output=True,
        text=True,
        check=True,
    )
    first, *others = ran.stdout.splitlines()
    assert first == offered().describe()
    assert len(others) == len(set(others)) == 2
    lines = {Confinement(True, abi, calls).describe() for abi in (0, 1, 4) for calls in (False, True)}
    assert len(lines) == 6


@pytest.mark.parametrize("kept", [Kept(), Kept(("/tmp",)), Kept(children=True), Kept(connections=True)])
def test_what_is_said_to_be_refused_is_what_the_parts_refuse(kept: Kept) -> None:
    """With more parts nothing more is missing; with all of them nothing, with none everything."""
    whole, none = Confinement(True, 7, True), Confinement(False, 0, False)
    assert whole.missing(kept) == []
    assert len(none.missing(kept)) == (4 if kept.children else 3)
    for abi in range(8):
        alone = set(Confinement(True, abi, False).missing(kept))
        assert set(Confinement(True, abi, True).missing(kept)) <= alone
        assert alone <= set(Confinement(True, max(abi - 1, 0), False).missing(kept))
