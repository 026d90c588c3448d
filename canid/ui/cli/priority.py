"""Scheduling priority of a recording process: above ordinary programs where the system permits it."""

from __future__ import annotations

import contextlib
import os

from canid.values.processes import limits

# A thread at this nice value gets nine times the share of an ordinary one: a recorder that needs a seventh of a core
# keeps up with a dozen busy programs on two cores. No real-time class: a busy loop there stops the machine.
RECORDING_NICE = -10


def raise_priority() -> None:
    """Raise the priority of this thread and those that it starts, where permitted (root, CAP_SYS_NICE, RLIMIT_NICE).

    Without the permission, and on systems without nice values, nothing happens.
    """
    with contextlib.suppress(AttributeError, OSError):
        if os.getpriority(os.PRIO_PROCESS, 0) > RECORDING_NICE:
            os.setpriority(os.PRIO_PROCESS, 0, RECORDING_NICE)
        # Linux divides the cores among sessions first (sched(7), autogroup). A session leader, as under systemd or ssh,
        # sets the nice value of its session as well; in the session of another process nothing is changed.
        if os.getsid(0) == os.getpid():
            limits.kernel_setting("/proc/self/autogroup", str(RECORDING_NICE))
