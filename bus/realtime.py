"""What a process asks of the operating system before it joins the bus.

The scheduling class has to be set before `zenoh.open`, whose threads inherit it (zenoh_bus.md section 5.4).
"""

import gc
import os
import sys

SWITCH_INTERVAL_S = 0.0005


def request_realtime(priority: int, *, children: bool = True) -> bool:
    """Move this thread, and the ones it starts from now on, into the real-time class.

    Parameters
    ----------
    priority
        SCHED_FIFO priority 1..99; 0 leaves everything as it is.
    children
        Whether threads and processes that this one starts inherit that.

    Returns
    -------
    bool
        True if the process runs in the real-time class now. Without the right (CAP_SYS_NICE or an rtprio
        limit) the answer is False and the status of the process says so.
    """
    if priority == 0 or not hasattr(os, "sched_setscheduler"):
        return False
    try:
        policy = os.SCHED_FIFO if children else os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except OSError:
        return False
    return True


def settle() -> None:
    """Call after start-up: short thread switches, and no garbage collection of what start-up created."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    gc.disable()
