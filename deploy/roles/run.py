"""Runs one role of a fleet in this process; imports quickly, as an agent that crashes must be back soon."""

import ctypes
import importlib
import logging
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Final

from setproctitle import setproctitle, setthreadtitle

from rcopterx.bus.processes import AGENT, ROLES, TRANSMITTERS
from rcopterx.bus.session import BusUnreachableError
from rcopterx.deploy.hosts.run_directory import run_directory, states_directory
from rcopterx.deploy.processes.process_log import set_up
from rcopterx.fleet.schema import FleetError, FleetFile, check_known
from rcopterx.places import is_locked

_LOG = logging.getLogger(__name__)
EXIT_USAGE = 2
EXIT_UNREACHABLE = 3
PR_SET_PDEATHSIG: Final = 1
CHECK_S: Final = 0.05  # between two looks at the locks of the gateways, which nothing announces
ENDED_S: Final = 1.0  # gateways have ended when none has run for this long, as one may be replaced


def end_with_parent() -> None:
    """Receive SIGTERM when the launcher dies; gateways then bring their vehicles down."""
    if (parent := os.environ.get("RCOPTERX_PARENT")) is not None:
        end_with(int(parent))


def end_with(parent: int) -> None:
    """Receive SIGTERM when the parent process with this id dies."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGTERM)


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
    """Wait until no gateway, which needs poses and the bus to land, has the pages; its longest shutdown."""
    # A router starts without this module.
    from rcopterx.fleet.vehicle_models import longest_shutdown_s

    ended_s = time.monotonic()
    limit_s = ended_s + fleet.clock.real_s(longest_shutdown_s(fleet, host)) + ENDED_S
    while (now_s := time.monotonic()) < limit_s and now_s < ended_s + ENDED_S:
        if any(map(is_locked, pages)):
            ended_s = now_s
        time.sleep(CHECK_S)


def run_role(
    role: str, unit: str, fleet: FleetFile, host: str | None = None, *, take_over: bool = False
) -> None:
    """Run one role until it receives SIGTERM.

    `unit`: host of a router, recorder, simulator or tracker; gateway name of transmitters; vehicle of an
    agent. `host`: host of an agent; by default that of the fleet file. `take_over`: whether an agent shall
    take over from one that flies its vehicle. Raises `FleetError`: unit or a field is wrong for this role;
    `BusUnreachableError`: no router answers; `OSError`: an address or a device cannot be used.
    """
    check_unit(fleet, role, unit)
    begin_role(role, unit)
    if role == AGENT:
        from rcopterx.deploy.roles.agent import fly, ready_pilot

        fly(*ready_pilot(fleet, unit, host), take_over=take_over)
    else:
        runner(role)(fleet, unit)


def begin_role(role: str, unit: str) -> None:
    """Name this process, and log that a role starts in it."""
    name_process(role, unit)
    _LOG.info("%s %s: started, process %d", role, unit, os.getpid())


def name_process(*words: str) -> None:
    """Show this process in `ps` and `top` under this name, for instance `rcopterx agent h2`."""
    setproctitle(f"rcopterx {' '.join(words)}")
    # `top` shows the kernel's name of a process, of at most 15 letters.
    setthreadtitle(" ".join(words))


def check_unit(fleet: FleetFile, role: str, unit: str) -> None:
    """Refuse unknown roles and units that the file does not name; `FleetError` names what is allowed."""
    check_known("role", "role", role, ROLES)
    units: dict[str, Mapping[str, object]] = {
        "host": fleet.hosts,
        "gateway": fleet.gateways,
        "vehicle": fleet.vehicles,
    }
    check_known(role, "unit", unit, units[ROLES[role].unit])


def runner(role: str) -> Callable[[FleetFile, str], None]:
    """Return `run` of a role other than `agent`; no other is imported: restarts in flight must be fast."""
    run: Callable[[FleetFile, str], None] = importlib.import_module(f"rcopterx.deploy.roles.{role}").run
    if role == TRANSMITTERS:
        return run

    def run_beyond_launcher(fleet: FleetFile, host: str) -> None:
        outlive_launcher(fleet, host)
        run(fleet, host)

    return run_beyond_launcher


def run_reporting(run: Callable[[], None]) -> None:
    """Run a role; turn errors that the user can correct into a log line and an exit code."""
    set_up()
    try:
        run()
    except FleetError as error:
        _LOG.error(error)
        sys.exit(EXIT_USAGE)
    except (BusUnreachableError, OSError) as error:
        _LOG.error(error)
        sys.exit(EXIT_UNREACHABLE)
