"""Publishes a flight log on a bus of its own, for everything that watches a fleet."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rcopterx.bus.clock import NANO
from rcopterx.bus.processes import ROUTER
from rcopterx.bus.session import BusAddress, Session
from rcopterx.deploy.hosts.resources import check_router
from rcopterx.deploy.hosts.run_directory import run_directory, snapshot_path
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.fleet.reading import at_speed, snapshot_of, write_snapshot
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.flights.flight_writing import FLEET_ATTACHMENT
from rcopterx.flights.mcap_reading import contents_of, messages_of
from rcopterx.flights.mcap_records import FlightLogError

ROUTER_S: Final = 15.0  # how long the router may take to start


def fleet_of(parts: Sequence[Path]) -> FleetFile:
    """Fleet file of a flight; raises FlightLogError if this version does not understand it."""
    snapshots = (contents_of(path).attachments.get(FLEET_ATTACHMENT) for path in parts)
    if (snapshot := next((each for each in snapshots if each is not None), None)) is None:
        raise FlightLogError(f"{parts[0]}: has no fleet file, which every flight log begins with")
    try:
        return snapshot_of(snapshot)
    except FleetError as error:
        raise FlightLogError(
            f"{parts[0]}: has no fleet file that this version understands: {error}"
        ) from None


@contextmanager
def router_up(fleet: FleetFile) -> Iterator[BusAddress]:
    """Run the router of a recorded fleet, in real time; raises FleetError if its address is in use."""
    fleet = at_speed(fleet, 1.0)
    host = next(iter(fleet.hosts))
    check_router(fleet, host)
    directory = run_directory(fleet.name, fleet.bus.namespace)
    snapshot = snapshot_path(host, directory)
    write_snapshot(fleet, snapshot)
    supervisor = Supervisor([ProcessSpec(ROUTER, ROUTER, host)], snapshot, directory / "log", ForkServer())
    supervisor.start_all()
    try:
        yield bus_address(fleet, host)
    finally:
        supervisor.stop_all()


def republish(
    parts: Sequence[Path],
    session: Session,
    speed: float,
    wait: Callable[[float], bool],
    clock: Callable[[], float] = time.monotonic,
) -> int:
    """Send a flight's messages at `speed`, until `wait` returns True; return how many were sent."""
    started_s, first_ns, sent = clock(), None, 0
    for path in parts:
        for message in messages_of(path):
            first_ns = message.time_ns if first_ns is None else first_ns
            left_s = started_s + (message.time_ns - first_ns) / NANO / speed - clock()
            if left_s > 0.0 and wait(left_s):
                return sent
            unit, _, topic = message.topic.partition("/")
            session.republish(unit, topic, message.payload)
            sent += 1
    return sent
