"""The priority of a process that records: above ordinary programs where the system permits it."""

from __future__ import annotations

import contextlib
import os

# Nice value. The kernel then gives a thread nine times the share of an ordinary one: a recorder that needs a seventh of
# a core keeps up beside a dozen busy programs on two cores. No real-time class: what spins there stops the machine.
RECORDING = -10


def raise_priority() -> None:
    """Raise it for this thread and those that it starts, where permitted (root, CAP_SYS_NICE, RLIMIT_NICE).

    Without the permission, and on systems without nice values, nothing happens.
    """
    with contextlib.suppress(AttributeError, OSError):
        if os.getpriority(os.PRIO_PROCESS, 0) > RECORDING:
            os.setpriority(os.PRIO_PROCESS, 0, RECORDING)
        # Linux shares the cores among sessions first (sched(7), autogroup); whose session is another's changes nothing
        # there. The recorder's own one, as under systemd or ssh, gets the same nice value.
        if os.getsid(0) == os.getpid():
            with open("/proc/self/autogroup", "r+", encoding="ascii") as group:
                group.write(str(RECORDING))
