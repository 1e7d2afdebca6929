"""Checks this computer before a fleet flies from it; every finding says what to do about it."""

import os
import resource
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

from rcopterx.bus.link_sockets import CONGESTION_CONTROL, congestion_control
from rcopterx.deploy.certificates.files import AUTHORITY, certificate_names, directory_of, host_name, readable
from rcopterx.deploy.hosts.resources import check_resources
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.hosts.running import running_fleets
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.tables import table_beside

CAP_SYS_NICE: Final = 23  # number of the capability to raise priorities
REMEDIES: Final = table_beside(__file__, "remedies")


class Result(NamedTuple):
    """Result of one check; a bad one says what to do about it."""

    good: bool
    text: str


def examine(fleet: FleetFile, host: str, now: datetime) -> Iterator[Result]:
    """Make all checks that need no running fleet; `host` is this computer, `now` has a time zone."""
    wanted = max(priority.of(fleet) for priority in Priority)
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    yield real_time(wanted, limit, _capabilities(), _is_granted(wanted))
    try:
        directory = run_directory(fleet.name, fleet.bus.namespace)
        yield Result(True, f"run directory {directory} is yours alone")
        if (fleet.name, host) not in {(running.fleet, running.host) for running in running_fleets()}:
            yield from devices(fleet, host, directory)
    except OSError as error:
        yield Result(False, str(error))
    yield from certificates(fleet, host, now)
    if len(fleet.hosts) > 1:
        yield links(congestion_control())


def links(control: str) -> Result:
    """Check the congestion control of the links to other hosts."""
    if control == CONGESTION_CONTROL:
        return Result(True, f"links to other hosts use {control}")
    return Result(False, REMEDIES["congestion"].format(control=control, wanted=CONGESTION_CONTROL))


def _is_granted(priority: int) -> bool:
    """Whether the kernel gives a thread a real-time priority now."""
    try:
        with ThreadPoolExecutor(1) as pool:
            pool.submit(os.sched_setscheduler, 0, os.SCHED_FIFO, os.sched_param(priority)).result()
    except OSError:
        return False
    return True


def devices(fleet: FleetFile, host: str, directory: Path) -> Iterator[Result]:
    """Check addresses and devices that the fleet needs on a host while it is not up."""
    try:
        missing = check_resources(fleet, host, directory)
    except FleetError as error:
        yield Result(False, str(error))
        return
    yield from (Result(False, line) for line in missing)
    if not missing:
        yield Result(True, "addresses are free, and all devices are there")


def real_time(priority: int, limit: int, capabilities: int, granted: bool) -> Result:
    """Check that processes may have the fleet's priorities, by `RLIMIT_RTPRIO`, capabilities and a try."""
    if priority == 0:
        return Result(True, "the fleet file asks for no real-time priority")
    if limit == resource.RLIM_INFINITY or limit >= priority or capabilities >> CAP_SYS_NICE & 1:
        if granted:
            return Result(True, f"real-time priorities up to {priority} are permitted")
        return Result(False, REMEDIES["refused"].format(priority=priority))
    wanted = max(40, priority)
    return Result(False, REMEDIES["limited"].format(priority=priority, limit=limit, wanted=wanted))


def certificates(fleet: FleetFile, host: str, now: datetime) -> Iterator[Result]:
    """Check the certificates on this computer, and whether the fleet needs any."""
    if (directory := directory_of(fleet)) is None:
        if fleet.security.insecure:
            yield Result(False, REMEDIES["insecure"])
        else:
            yield Result(True, "no certificates: only this computer reaches the fleet")
        return
    # The library imports slowly, and fleets on one computer do without.
    from rcopterx.deploy.certificates.issuing import expiry_warning, problem

    for name in certificate_names(fleet):
        if name != host_name(host) and not readable(directory, name):
            continue
        wrong = problem(directory, name, now)
        warning = wrong or expiry_warning(directory, name, now)
        yield Result(warning is None, warning or f"certificate {name} is valid")
    key = directory / f"{AUTHORITY}.key"
    if key.exists() and len(fleet.hosts) > 1:
        yield Result(True, f"{key} can issue certificates; it needs to be on one computer only")


def _capabilities() -> int:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return (1 << CAP_SYS_NICE) if os.geteuid() == 0 else 0
