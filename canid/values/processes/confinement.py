"""Rights that a process gives up for good before it reads what strangers wrote: it computes, reads files and answers.

`confine` asks the kernel for three things, each by itself, since a container or an old kernel may refuse any of them: no new
privileges (prctl(2)), no writing, executing, TCP and signals (landlock(7), by the kernel's own version of it), and a filter
of system calls (`system_calls`). What a process needs for its work it keeps (`Kept`), and what it starts is confined as it
is. Descriptors that are open stay as they are: the pipes to the parent, a scratch file.
Run as `python -m canid.values.processes.confinement`, it says what this computer offers.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

from canid.values.processes import interpreter_files, system_calls
from canid.values.processes.kept_rights import NOTHING, Kept

# prctl(2)
_PR_SET_NO_NEW_PRIVS = 38
# landlock_create_ruleset(2), landlock_add_rule(2), landlock_restrict_self(2): the same numbers on every machine
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_ASK_VERSION, _PATH_BENEATH = 1, 1
# linux/landlock.h, by version: the first bits of access to files, the rights to bind and connect, what is limited to the
# process itself (abstract sockets and signals)
_FILE_BITS = {1: 13, 2: 14, 3: 15, 5: 16}
_TCP_SINCE, _TCP = 4, 0b11
_SCOPE_SINCE, _SCOPE = 6, 0b11
# reading is left: of files and of folders
_READING = 1 << 2 | 1 << 3
_EXECUTE, _WRITE_FILE, _TRUNCATE = 1 << 0, 1 << 1, 1 << 14
# below a folder: files are written and cut, files and folders made and removed; no links, devices, sockets or pipes
_WRITE_BELOW = _WRITE_FILE | _TRUNCATE | 1 << 4 | 1 << 5 | 1 << 7 | 1 << 8


class Confinement(NamedTuple):
    """What a process has given up, as far as the kernel took it."""

    no_new_privileges: bool
    landlock: int  # the kernel's version; 0: not applied
    system_calls: bool

    @property
    def complete(self) -> bool:
        """Whether nothing is missing to a process that keeps nothing: no file is written, nothing sent or started."""
        return self.no_new_privileges and self.landlock >= _TCP_SINCE and self.system_calls

    def missing(self, kept: Kept = NOTHING) -> list[str]:
        """What this system does not refuse to a process that keeps some rights.

        Example:
            >>> Confinement(True, 5, True).missing(), Confinement(True, 5, True).missing(Kept(children=True))
            ([], ['signal others'])
        """
        return [right for right, refused in self._rights(kept).items() if not refused]

    def describe(self, what: str = "files of strangers are parsed", kept: Kept = NOTHING) -> str:
        """One line for the user.

        Args:
            what: is done by such a process.
            kept: what it keeps.

        Example:
            >>> Confinement(True, 7, True).describe()
            'files of strangers are parsed without rights to write, send or start anything (Landlock 7, seccomp)'
            >>> Confinement(True, 1, False).describe()
            'files of strangers are parsed without rights to write or start anything (Landlock 1); it may send'
            >>> Confinement(False, 0, False).describe()
            'files of strangers are parsed with limits of memory and time only: this system has neither Landlock nor seccomp'
        """
        has = [f"Landlock {self.landlock}"] if self.landlock else []
        has += ["seccomp"] if self.system_calls else []
        if not has:
            return f"{what} with limits of memory and time only: this system has neither Landlock nor seccomp"
        missing = self.missing(kept)
        refused = [right for right in self._rights(kept) if right not in missing]
        more = f"; it may {_or(missing)}" if missing else ""
        return f"{what} without rights to {_or(refused)} ({', '.join(has)}){more}"

    def _rights(self, kept: Kept) -> dict[str, bool]:
        """What is to be refused, in words, and whether this system does."""
        files, calls = self.landlock > 0, self.system_calls
        write = "write outside a folder of its own" if kept.folders else "write"
        start = "start anything with other rights" if kept.children else "start anything"
        rights = {
            write: files or (calls and not kept.writes),
            "connect" if kept.connections else "send": calls or self.landlock >= _TCP_SINCE,
            start: self.no_new_privileges if kept.children else files or calls,
        }
        # without children that is part of starting nothing
        return rights | ({"signal others": self.landlock >= _SCOPE_SINCE} if kept.children else {})


def confine(kept: Kept = NOTHING) -> Confinement:
    r"""Give up, for this process, its threads and what it starts, all that its work does not need.

    To be called once, when everything is imported and before the first byte of a stranger; Landlock binds the calling thread
    and those that it starts, so that is to be the only one. Raises nothing.

    Args:
        kept: what it needs.

    Example:
        >>> import subprocess, sys
        >>> code = "from canid.values.processes.confinement import confine; confine(); print(open('/dev/null').read() == '')"
        >>> subprocess.run([sys.executable, "-c", code], capture_output=True).stdout
        b'True\n'
    """
    if sys.platform != "linux":
        return Confinement(False, 0, False)
    with suppress(OSError, AttributeError):
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(_PR_SET_NO_NEW_PRIVS, *map(ctypes.c_ulong, (1, 0, 0, 0))) == 0:
            return Confinement(True, _landlock(libc, kept), _filter(libc, kept))
    return Confinement(False, 0, False)


def offered() -> Confinement:
    """What `confine` achieves on this computer: a child tries it.

    Example:
        >>> offered().no_new_privileges or sys.platform != "linux"
        True
    """
    from canid.values.processes.child import Child, NoAnswerError
    from canid.values.processes.child_process import command

    try:
        with Child(command("canid.values.processes.confinement", "--answer"), answers=()) as child:
            return Confinement(*child.receive())
    except (OSError, NoAnswerError):
        return Confinement(False, 0, False)


def _landlock(libc: ctypes.CDLL, kept: Kept = NOTHING) -> int:
    version = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _ASK_VERSION)
    if version < 1:
        return 0
    bits = _FILE_BITS[max(since for since in _FILE_BITS if since <= version)]
    rules = [((1 << bits) - 1) & ~_READING]
    rules += [_TCP] if version >= _TCP_SINCE else []
    rules += [_SCOPE] if version >= _SCOPE_SINCE else []
    attributes = struct.pack(f"={len(rules)}Q", *rules)
    ruleset = libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    if ruleset < 0:
        return 0
    try:
        # what is handled and not allowed is refused
        for path, allowed in _allowed(kept):
            _allow(libc, ruleset, path, allowed & rules[0])
        return version if libc.syscall(_RESTRICT_SELF, ruleset, 0) == 0 else 0
    finally:
        os.close(ruleset)


def _allowed(kept: Kept) -> Iterator[tuple[str, int]]:
    """Paths, and the accesses that are left to them."""
    for folder in kept.folders:
        yield folder, _WRITE_BELOW
    if kept.children:
        # the standard error of children
        yield os.devnull, _WRITE_FILE
        for path in interpreter_files.executed():
            yield path, _EXECUTE


def _allow(libc: ctypes.CDLL, ruleset: int, path: str, allowed: int) -> None:
    # a path that is not there needs no right
    with suppress(OSError):
        fd = os.open(path, os.O_PATH | os.O_CLOEXEC)
        try:
            # struct landlock_path_beneath_attr, packed
            attributes = struct.pack("=Qi", allowed, fd)
            libc.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, attributes, 0)
        finally:
            os.close(fd)


def _or(words: list[str]) -> str:
    """Words as a sentence lists them.

    >>> _or(["write", "send", "start"]), _or(["send"])
    ('write, send or start', 'send')
    """
    return " or ".join([*([", ".join(words[:-1])] if words[1:] else []), *words[-1:]])


def _filter(libc: ctypes.CDLL, kept: Kept = NOTHING) -> bool:
    machine = system_calls.machine()
    if not machine:
        return False
    program = system_calls.filter_program(machine, kept)
    code = ctypes.create_string_buffer(program, len(program))
    # struct sock_fprog: the number of instructions, their place
    described = struct.pack("@HP", len(program) // 8, ctypes.addressof(code))
    operation, flags = system_calls.filter_arguments()
    return bool(libc.syscall(system_calls.seccomp_number(machine), operation, flags, described) == 0)


# what `main` says: of each kind of process what it does, and what it keeps
_PROCESSES = (
    ("files of strangers are parsed", NOTHING),
    ("logs of a fleet are analysed", Kept(("scratch",), children=True)),
    ("a live page is served", Kept(connections=True)),
)


def main(arguments: list[str]) -> int:
    """Say what is offered; `--answer`: confine this process and answer its parent."""
    if arguments == ["--answer"]:
        from canid.values.processes.serve import connect

        parent = connect(plain=True)
        parent.answer(tuple(confine()))
        return 0
    confinement = offered()
    sys.stdout.write("".join(f"{confinement.describe(what, kept)}\n" for what, kept in _PROCESSES))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
