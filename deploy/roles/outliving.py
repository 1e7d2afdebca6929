"""Processes that outlive their launcher: gateways that land their vehicles need poses and the bus."""

import ctypes
import os
import select
import signal
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from rcopterx.deploy.hosts.run_directory import run_directory, states_directory
from rcopterx.fleet.schema import FleetFile
from rcopterx.places import is_locked

PR_SET_PDEATHSIG: Final = 1
CHECK_S: Final = 0.05
ENDED_S: Final = 1.0  # gateways have ended when none has run for this long, as one may be replaced


def outlive_launcher(fleet: FleetFile, host: str) -> None:
    """If the launcher dies, end only after the host's gateways; replaces `end_with_parent`; main thread."""
    if (parent := os.environ.get("RCOPTERX_PARENT")) is None:
        return
    try:
        launcher = os.pidfd_open(int(parent))
    except ProcessLookupError:
        return
    states = states_directory(run_directory(fleet.name, fleet.bus.namespace))
    pages = []
    for name in fleet.transmitters_on(host):
        # Kept open: a system may remove the shared memory of a user who logs out.
        with suppress(OSError):
            pages.append(os.open(states / name, os.O_RDONLY | os.O_CLOEXEC))
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, 0)
    threading.Thread(
        target=_end_after, args=(launcher, pages, fleet, host), name="launcher watch", daemon=True
    ).start()


def _end_after(launcher: int, pages: Sequence[int], fleet: FleetFile, host: str) -> None:
    try:
        select.select([launcher], [], [])
        if pages:
            _wait_for_landing(pages, fleet, host)
    finally:
        os.kill(os.getpid(), signal.SIGTERM)


def _wait_for_landing(pages: Sequence[int], fleet: FleetFile, host: str) -> None:
    """Wait until no gateway has the pages, at most for its longest shutdown."""
    # A router starts without this module.
    from rcopterx.fleet.vehicle_models import longest_shutdown_s

    ended_s = time.monotonic()
    limit_s = ended_s + fleet.clock.real_s(longest_shutdown_s(fleet, host)) + ENDED_S
    while (now_s := time.monotonic()) < limit_s and now_s < ended_s + ENDED_S:
        if any(map(is_locked, pages)):
            ended_s = now_s
        time.sleep(CHECK_S)
