"""What a process asks of the operating system before it joins the bus.

The scheduling class has to be set before `zenoh.open`, whose threads inherit it (zenoh_bus.md section 5.4).
"""

import gc
import os
import sys

SWITCH_INTERVAL_S = 0.0005


def request_realtime(priority: int) -> bool:
    """Move this process into the real-time class.

    Parameters
    ----------
    priority
        SCHED_FIFO priority 1..99; 0 leaves the process as it is.

    Returns
    -------
    bool
        True if the process runs in the real-time class now. Without the right (CAP_SYS_NICE or an rtprio
        limit) the answer is False and the status of the process says so.
    """
    if priority == 0 or not hasattr(os, "sched_setscheduler"):
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return False
    return True


def settle() -> None:
    """Call after start-up: short thread switches, and no garbage collection of what start-up created."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    gc.disable()
