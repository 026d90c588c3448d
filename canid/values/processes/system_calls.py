"""A filter of system calls (seccomp(2), classic BPF): what a process that only computes and reads never calls.

Landlock, where the kernel has it, refuses by what a call does; this filter, by the call's number. It also refuses where
Landlock is absent, and what Landlock does not cover: sockets other than TCP's, new processes, signals to others, modes and
owners of files. What a process keeps (`Kept`) is left to it. Numbers: asm/unistd_64.h (x86-64) and asm-generic/unistd.h
(arm64) of Linux 6.18.
"""

from __future__ import annotations

import errno
import os
import platform
import struct
import sys
from typing import NamedTuple

from canid.values.processes.kept_rights import NOTHING, Kept


class _Machine(NamedTuple):
    audit_arch: int  # linux/audit.h
    column: int  # of the numbers below
    seccomp: int  # number of seccomp(2)


_MACHINES = {"x86_64": _Machine(0xC000003E, 0, 317), "aarch64": _Machine(0xC00000B7, 1, 277)}

# name: its number on x86-64 and on arm64; −1: there is none
_REFUSED = {
    # network
    **{"socket": (41, 198), "connect": (42, 203), "accept": (43, 202), "accept4": (288, 242), "bind": (49, 200)},
    **{"listen": (50, 201), "socketpair": (53, 199), "sendto": (44, 206), "sendmsg": (46, 211)},
    **{"sendmmsg": (307, 269)},
    # processes: new ones, and those of others
    **{"fork": (57, -1), "vfork": (58, -1), "execve": (59, 221), "execveat": (322, 281), "ptrace": (101, 117)},
    **{"kill": (62, 129), "tkill": (200, 130), "rt_sigqueueinfo": (129, 138), "rt_tgsigqueueinfo": (297, 240)},
    **{"pidfd_open": (434, 434), "pidfd_send_signal": (424, 424), "pidfd_getfd": (438, 438)},
    **{"process_vm_readv": (310, 270), "process_vm_writev": (311, 271)},
    # names and attributes of files
    **{"creat": (85, -1), "mknod": (133, -1), "mknodat": (259, 33), "mkdir": (83, -1), "mkdirat": (258, 34)},
    **{"rmdir": (84, -1), "unlink": (87, -1), "unlinkat": (263, 35), "rename": (82, -1), "renameat": (264, 38)},
    **{"renameat2": (316, 276), "link": (86, -1), "linkat": (265, 37), "symlink": (88, -1), "symlinkat": (266, 36)},
    **{"truncate": (76, 45), "chmod": (90, -1), "fchmod": (91, 52), "fchmodat": (268, 53), "fchmodat2": (452, 452)},
    **{"chown": (92, -1), "fchown": (93, 55), "lchown": (94, -1), "fchownat": (260, 54), "utime": (132, -1)},
    **{"utimes": (235, -1), "utimensat": (280, 88), "futimesat": (261, -1), "setxattr": (188, 5)},
    **{"lsetxattr": (189, 6), "fsetxattr": (190, 7), "removexattr": (197, 14), "lremovexattr": (198, 15)},
    **{"fremovexattr": (199, 16), "mq_open": (240, 180), "open_by_handle_at": (304, 265)},
    # the system, and ways around a filter of numbers
    **{"mount": (165, 40), "umount2": (166, 39), "unshare": (272, 97), "setns": (308, 268), "pivot_root": (155, 41)},
    **{"chroot": (161, 51), "bpf": (321, 280), "perf_event_open": (298, 241), "userfaultfd": (323, 282)},
    **{"keyctl": (250, 219), "add_key": (248, 217), "request_key": (249, 218), "io_uring_setup": (425, 425)},
}  # fmt: skip
# what of them is left to a process that keeps a right: Landlock limits writing to folders, what is executed to Python, and
# signals to what the process has started
_WRITING = {
    *(
        "creat",
        "mkdir",
        "mkdirat",
        "rmdir",
        "unlink",
        "unlinkat",
        "rename",
        "renameat",
        "renameat2",
        "truncate",
    ),
}
_STARTING = {"fork", "vfork", "execve", "kill"}
_ANSWERING = {"accept", "accept4", "listen", "sendto", "sendmsg"}
# and the argument that holds their flags: a socket that listened and was shut down connects with MSG_FASTOPEN (tcp(7)),
# without connect(2), and Landlock does not see it (Linux 6.18)
_SENDING, _MSG_FASTOPEN = {"sendto": 3, "sendmsg": 2}, 0x20000000
# their arguments stand in memory, which a filter cannot read: without them libc calls `clone` and `openat`
_ABSENT = {"clone3": (435, 435), "openat2": (437, 437)}
# name: numbers, and the argument that holds the flags of open(2)
_OPEN = {"open": ((2, -1), 1), "openat": ((257, 56), 2)}
# a process of the same user; argument 0 names it, 0: this one
_PRLIMIT = (302, 261)
# argument 0 of clone(2) has the flags: a thread is one with CLONE_THREAD; a process may have none of CLONE_NEW*, whose
# namespaces would give it rights (linux/sched.h)
_CLONE, _CLONE_THREAD, _CLONE_NEW = (56, 220), 0x10000, 0x7E020000
# numbers of the x32 interface begin here; nothing uses it
_X32 = 0x40000000

# linux/filter.h and linux/seccomp.h
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_ALLOW, _ERRNO = 0x7FFF0000, 0x00050000
_SET_MODE_FILTER, _ALL_THREADS = 1, 1
# offsets in struct seccomp_data: the number, the architecture, the low half of an argument (little endian)
_NUMBER_AT, _ARCH_AT, _ARGUMENTS_AT = 0, 4, 16


def machine() -> str:
    """The machine whose numbers are known here; "" where they are not, as on one that is big-endian or has 32 bits.

    >>> machine() in ("", "x86_64", "aarch64")
    True
    """
    known = platform.machine() in _MACHINES and sys.byteorder == "little" and sys.maxsize > 1 << 32
    return platform.machine() if known and sys.platform == "linux" else ""


def seccomp_number(machine_name: str) -> int:
    """The number of seccomp(2) on a machine."""
    return _MACHINES[machine_name].seccomp


def filter_program(machine_name: str, kept: Kept = NOTHING) -> bytes:
    """The filter as an array of struct sock_filter.

    Args:
        machine_name: "x86_64" or "aarch64".
        kept: what it leaves.

    Example:
        >>> len(filter_program("x86_64")) % 8
        0
    """
    arch, column, _ = _MACHINES[machine_name]
    refuse, absent = _ERRNO | errno.EPERM, _ERRNO | errno.ENOSYS
    program = [
        (_LOAD, 0, 0, _ARCH_AT),
        (_EQUAL, 1, 0, arch),
        (_RETURN, 0, 0, refuse),
        (_LOAD, 0, 0, _NUMBER_AT),
        (_AT_LEAST, 0, 1, _X32),
        (_RETURN, 0, 0, refuse),
    ]
    left = _left(kept)
    refused = {name: numbers for name, numbers in _REFUSED.items() if name not in left}
    for calls, answer in ((refused, refuse), (_ABSENT, absent)):
        for numbers in calls.values():
            if numbers[column] >= 0:
                program += [(_EQUAL, 0, 1, numbers[column]), (_RETURN, 0, 0, answer)]
    writing = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
    for numbers, argument in () if kept.writes else _OPEN.values():
        if numbers[column] >= 0:
            program += _where_bits(numbers[column], argument, writing, refuse, _ALLOW)
    for name, argument in _SENDING.items():
        if name in left:
            program += _where_bits(_REFUSED[name][column], argument, _MSG_FASTOPEN, refuse, _ALLOW)
    if kept.children:
        program += _where_bits(_CLONE[column], 0, _CLONE_NEW, refuse, _ALLOW)
    else:
        program += _where_bits(_CLONE[column], 0, _CLONE_THREAD, _ALLOW, refuse)
    program += _where_bits(_PRLIMIT[column], 0, 0xFFFFFFFF, refuse, _ALLOW)
    program.append((_RETURN, 0, 0, _ALLOW))
    return b"".join(struct.pack("<HBBI", *instruction) for instruction in program)


def filter_arguments() -> tuple[int, int]:
    """The operation and flags of seccomp(2): install the filter, in all threads of the process."""
    return _SET_MODE_FILTER, _ALL_THREADS


def _left(kept: Kept) -> set[str]:
    """The calls that a process may make because of what it keeps."""
    left: set[str] = set()
    left |= _WRITING if kept.writes else set()
    left |= _STARTING if kept.children else set()
    left |= _ANSWERING if kept.connections else set()
    return left


def _where_bits(
    number: int, argument: int, bits: int, answer: int, other: int
) -> list[tuple[int, int, int, int]]:
    """Answer a call by whether its argument has any of these bits."""
    return [
        (_EQUAL, 0, 4, number),
        (_LOAD, 0, 0, _ARGUMENTS_AT + 8 * argument),
        (_ANY_BIT, 0, 1, bits),
        (_RETURN, 0, 0, answer),
        (_RETURN, 0, 0, other),
    ]
