"""Rights that a process gives up for good before it reads what strangers wrote: it computes, reads files and answers.

`confine` asks the kernel for three things, each by itself, since a container or an old kernel may refuse any of them: no new
privileges (prctl(2)), no writing, executing, TCP and signals (landlock(7), by the kernel's own version of it), and a filter
of system calls (`system_calls`). Descriptors that are open stay as they are: the pipes to the parent, a scratch file.
Run as `python -m canid.processes.confinement`, it says what this computer offers.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from contextlib import suppress
from typing import NamedTuple

from canid.processes import system_calls

# prctl(2)
_PR_SET_NO_NEW_PRIVS = 38
# landlock_create_ruleset(2), landlock_restrict_self(2): the same numbers on every machine
_CREATE_RULESET, _RESTRICT_SELF = 444, 446
_ASK_VERSION = 1
# linux/landlock.h, by version: the first bits of access to files, the rights to bind and connect, what is limited to the
# process itself (abstract sockets and signals)
_FILE_BITS = {1: 13, 2: 14, 3: 15, 5: 16}
_TCP_SINCE, _TCP = 4, 0b11
_SCOPE_SINCE, _SCOPE = 6, 0b11
# reading is left: of files and of folders
_READING = 1 << 2 | 1 << 3


class Confinement(NamedTuple):
    """What a process has given up, as far as the kernel took it."""

    no_new_privileges: bool
    landlock: int  # the kernel's version; 0: not applied
    system_calls: bool

    @property
    def complete(self) -> bool:
        """Whether nothing is missing: no file is written, nothing sent or started."""
        return self.no_new_privileges and self.landlock >= _TCP_SINCE and self.system_calls

    def describe(self) -> str:
        """One line for the user.

        >>> Confinement(True, 7, True).describe()
        'files of strangers are parsed without rights to write, send or start anything (Landlock 7, seccomp)'
        >>> Confinement(False, 0, False).describe()
        'files of strangers are parsed with limits of memory and time only: this system has neither Landlock nor seccomp'
        """
        has = [f"Landlock {self.landlock}"] if self.landlock else []
        has += ["seccomp"] if self.system_calls else []
        without = "files of strangers are parsed without rights to write, send or start anything"
        if self.system_calls:
            return f"{without} ({', '.join(has)})"
        if has:
            tcp = "" if self.landlock >= _TCP_SINCE else "; it may send"
            return f"files of strangers are parsed without rights to write or execute ({has[0]}; no seccomp{tcp})"
        return (
            "files of strangers are parsed with limits of memory and time only: this system has neither "
            "Landlock nor seccomp"
        )


def confine() -> Confinement:
    r"""Give up, for this process and all its threads, what parsing does not need.

    To be called once, when everything is imported and before the first byte of a stranger; Landlock binds the calling thread
    and those that it starts, so that is to be the only one. Raises nothing.

    Example:
        >>> import subprocess, sys
        >>> code = "from canid.processes.confinement import confine; confine(); print(open('/dev/null', 'r').read() == '')"
        >>> subprocess.run([sys.executable, "-c", code], capture_output=True).stdout
        b'True\n'
    """
    if sys.platform != "linux":
        return Confinement(False, 0, False)
    with suppress(OSError, AttributeError):
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(_PR_SET_NO_NEW_PRIVS, *map(ctypes.c_ulong, (1, 0, 0, 0))) == 0:
            return Confinement(True, _landlock(libc), _filter(libc))
    return Confinement(False, 0, False)


def offered() -> Confinement:
    """What `confine` achieves on this computer: a child tries it.

    Example:
        >>> offered().no_new_privileges or sys.platform != "linux"
        True
    """
    from canid.processes.child import Child, NoAnswerError
    from canid.processes.child_process import command

    try:
        with Child(command("canid.processes.confinement", "--answer"), answers=()) as child:
            return Confinement(*child.receive())
    except (OSError, NoAnswerError):
        return Confinement(False, 0, False)


def _landlock(libc: ctypes.CDLL) -> int:
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
        # a set of rules that allows nothing of what it handles
        return version if libc.syscall(_RESTRICT_SELF, ruleset, 0) == 0 else 0
    finally:
        os.close(ruleset)


def _filter(libc: ctypes.CDLL) -> bool:
    machine = system_calls.machine()
    if not machine:
        return False
    program = system_calls.filter_program(machine)
    code = ctypes.create_string_buffer(program, len(program))
    # struct sock_fprog: the number of instructions, their place
    described = struct.pack("@HP", len(program) // 8, ctypes.addressof(code))
    operation, flags = system_calls.filter_arguments()
    return bool(libc.syscall(system_calls.seccomp_number(machine), operation, flags, described) == 0)


def main(arguments: list[str]) -> int:
    """Say what is offered; `--answer`: confine this process and answer its parent."""
    if arguments == ["--answer"]:
        from canid.processes.serve import connect

        parent = connect(plain=True)
        parent.answer(tuple(confine()))
        return 0
    sys.stdout.write(offered().describe() + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
