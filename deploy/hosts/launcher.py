"""Starts the part of a fleet that belongs to one host, after making sure that it can be started."""

import errno
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from rcopterx.bus.realtime import request_realtime
from rcopterx.bus.session import BusUnreachableError
from rcopterx.compiling.cache import compile_all
from rcopterx.deploy.certificates.files import directory_of
from rcopterx.deploy.certificates.names import host_name
from rcopterx.deploy.checking import check_apart
from rcopterx.deploy.hosts.capacity import AGENT, CapacityMeasurement, may_be_crowded
from rcopterx.deploy.hosts.guarding import FloorGuard, Guard
from rcopterx.deploy.hosts.membership import MembershipService
from rcopterx.deploy.hosts.recall import RecallService
from rcopterx.deploy.hosts.run_directory import flight_path, run_directory, serial_path, snapshot_path
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.preloading import modules_of
from rcopterx.deploy.processes.process_log import append
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import RECORDER, ROUTER, agent_process, processes_of
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.deploy.roles.tracker import check_motion_capture, tracker_address
from rcopterx.deploy.watchdog.watchdog import WatchdogLimits
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.snapshot import write_snapshot
from rcopterx.flights.flights import flight_name

T = TypeVar("T")

WATCH_S = 0.02
"""Between two looks at the progress of all processes."""
MEASURE_LOOK_S = 0.1
"""Between two looks at the measurement of how many vehicles this computer flies."""
FLOOR_LOOK_S = 0.25
"""Between two looks for vehicles on the floor whose host has died."""
EVENTS_KEPT = 200


def check_resources(fleet: FleetFile, host: str, directory: Path, without: Collection[str] = ()) -> list[str]:
    """Make sure that addresses are free and serial devices are there.

    A fleet also flies when the device of one of its vehicles is missing; that vehicle joins once it is there.

    Parameters
    ----------
    fleet, host, directory
        The fleet, this host, and the fleet's run directory.
    without
        Vehicles that need no device.

    Returns
    -------
    list of str
        A line for every vehicle whose device is missing while others have theirs.

    Raises
    ------
    FleetError
        Names the field and the address or device.
    """
    place = fleet.hosts[host]
    check_free(place.address, place.router_port, f"hosts.{host}.router_port")
    if host == fleet.tracker.host:
        check_motion_capture(fleet)
    if fleet.simulator is not None:
        if fleet.simulator.host == host:
            check_free(*tracker_address(fleet), "tracker.address")
        return []
    missing = []
    needed = [
        name
        for name, vehicle in fleet.vehicles.items()
        if fleet.gateways[vehicle.transmitter.gateway].host == host and name not in without
    ]
    for name in needed:
        device = serial_path(fleet.vehicles[name].transmitter.port, directory)
        where = f"vehicles.{name}.transmitter.port"
        if not device.exists():
            missing.append(f"{where}: there is no device {device}")
        elif not os.access(device, os.R_OK | os.W_OK):
            raise FleetError(
                f"{where}: no permission for {device}; install the rules of rcopterx udev-rules, or join the "
                "group of the device (sudo usermod -aG dialout $USER) and log in again"
            )
    if missing and len(missing) == len(needed):
        raise FleetError("; ".join(missing))
    return [f"{line}; the others fly without it" for line in missing]


def _check_absent(fleet: FleetFile, without: Collection[str]) -> None:
    for name in without:
        if name not in fleet.vehicles:
            raise FleetError(f"--without: unknown vehicle {name!r}, known are {', '.join(fleet.vehicles)}")
    if len(set(without)) == len(fleet.vehicles):
        raise FleetError("--without: at least one vehicle must take part")


def check_free(address: str, port: int, where: str) -> None:
    """Make sure that nobody listens at an address.

    Raises
    ------
    FleetError
        Names the field of the fleet file.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            busy = "; is the fleet already up? Stop it, or give another port"
            hint = busy if error.errno == errno.EADDRINUSE else ""
            raise FleetError(f"{where}: {address}:{port} cannot be used: {error.strerror}{hint}") from None


def check_certificate(fleet: FleetFile, host: str) -> None:
    """Make sure that this host can show who it is, in a fleet with certificates.

    Raises
    ------
    FleetError
        Says what is wrong with its certificate.
    """
    directory = directory_of(fleet)
    if directory is None:
        return
    # The library takes its time to import, and fleets on one computer do without.
    from rcopterx.deploy.certificates.inspection import problem

    wrong = problem(directory, host_name(host), datetime.now(UTC))
    if wrong is not None:
        raise FleetError(f"security.certificates: {wrong}; rcopterx certs makes certificates")


def made_in_realtime(priority: int, make: Callable[[], T]) -> T:
    """Make something whose threads run in the real-time class if that is permitted; this one stays as it is.

    Parameters
    ----------
    priority
        SCHED_FIFO priority; 0 for none.
    make
        Called in a thread of its own, whose class the threads that it starts inherit.
    """

    def begin() -> T:
        request_realtime(priority)
        return make()

    with ThreadPoolExecutor(max_workers=1) as pool:
        return pool.submit(begin).result()


def watchdog_limits(fleet: FleetFile) -> WatchdogLimits | None:
    """For how long processes of a fleet may make no progress; None for as long as they like."""
    watchdog = fleet.watchdog
    if not watchdog.enabled:
        return None
    return WatchdogLimits(watchdog.flight_s, watchdog.floor_s, watchdog.start_s)


class Launcher(AbstractContextManager["Launcher"]):
    """A host's processes under supervision, in a thread of their own.

    Parameters
    ----------
    fleet
        The fleet file, loaded: changes that are made to the file later do not matter.
    host
        Which host this is.
    without
        Vehicles that do not take part at first; they can join later.
    watchdog
        False lets processes be, however long they make no progress: for debugging.
    record
        Whether this host, if it is the one that records, writes a flight log.
    idle
        Whether only the router runs until somebody asks for the rest: the daemon of a host.

    Raises
    ------
    FleetError
        Something in the file is wrong, an address is in use, no vehicle that takes part has its device;
        no process of the fleet was started.
    """

    def __init__(
        self,
        fleet: FleetFile,
        host: str,
        without: Collection[str] = (),
        *,
        watchdog: bool = True,
        record: bool = False,
        idle: bool = False,
    ) -> None:
        directory = run_directory(fleet.name, fleet.bus.namespace)
        specs = [spec for spec in processes_of(fleet, host) if record or spec.role != RECORDER]
        _check_absent(fleet, without)
        # Where processes would wait for it, watchdogs would take it for a failure.
        compile_all()
        check_certificate(fleet, host)
        missing = check_resources(fleet, host, directory, without)
        forks = ForkServer(modules_of(fleet, specs), Priority.SUPERVISOR.of(fleet))
        with ExitStack() as unless_sound:
            unless_sound.callback(forks.close)
            check_apart(fleet, directory, forks)
            unless_sound.pop_all()
        self.directory = directory
        absent = {agent_process(name) for name in without}
        guests = [name for name in fleet.agents_on(host) if fleet.vehicles[name].host != host]
        absent |= {agent_process(name) for name in guests}
        if idle:
            absent = {spec.name for spec in specs if spec.role != ROUTER}
        self._idle = idle
        self._snapshot = snapshot_path(host, directory)
        limits = watchdog_limits(fleet) if watchdog else None
        self.supervisor = Supervisor(
            specs,
            self._snapshot,
            directory / "log",
            forks,
            without=absent,
            watchdog=limits,
            priority=Priority.GATEWAY.of(fleet),
            host=host,
            guarded=len(guests),
        )
        self.events: deque[str] = deque(missing, maxlen=EVENTS_KEPT)
        self._news: deque[str] = deque(missing, maxlen=EVENTS_KEPT)
        self._fleet = fleet
        self._host = host
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)
        turns = {
            name: fleet.agent_hosts(name).index(host)
            for name in fleet.agents_on(host)
            if fleet.vehicles[name].spares
        }
        self._guard, self._floor_guard = Guard(turns), FloorGuard(host, turns)
        self._floor_due_s = self._measure_due_s = 0.0
        self._recall: RecallService | None = None
        self._membership: MembershipService | None = None
        self._home = [name for name in fleet.agents_on(host) if fleet.vehicles[name].host == host]
        self._capacity: CapacityMeasurement | None = None
        if self._home:
            vehicle = self._home[0]
            period_s = fleet.vehicles[vehicle].control.period_s
            self._capacity = CapacityMeasurement(self._snapshot, vehicle, period_s, forks, self._roles)

    def __enter__(self) -> "Launcher":
        write_snapshot(self._fleet, self._snapshot)
        self._begin_flight()
        self._thread.start()
        vehicles = self._fleet.vehicles.items()
        agents = list(self._fleet.agents_on(self._host))
        transmitters = [
            name
            for name, vehicle in vehicles
            if self._fleet.gateways[vehicle.transmitter.gateway].host == self._host
        ]
        try:
            address = bus_address(self._fleet, self._host)
            deaths = self.supervisor.quick_deaths
            # A gateway that takes over writes nothing until it is answered, and receivers stop their rotors.
            self._recall = made_in_realtime(
                Priority.GATEWAY.of(self._fleet),
                lambda: RecallService(
                    address,
                    agents,
                    transmitters,
                    lambda vehicle: deaths(agent_process(vehicle)),
                    self._guard.vehicles,
                ),
            )
            begin = self._begin_flight if self._idle else None
            log = self.directory / "log"
            self._membership = MembershipService(
                address, self._host, self.supervisor, self._news, self._home, log, begin
            )
        except BusUnreachableError:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _begin_flight(self) -> None:
        """Name the flight log that recorders write from now on."""
        flight = flight_name(self._fleet.name, time.time())
        flight_path(self._host, self.directory).write_text(flight, encoding="utf-8")

    def _run(self) -> None:
        request_realtime(Priority.SUPERVISOR.of(self._fleet), children=False)
        # Children are told when the thread that started them ends, so this one starts and stops them all.
        self._tell(self.supervisor.start_all())
        while not self._stopping.is_set():
            self._tell([*self._replace_lost_agents(), *self.supervisor.watch(WATCH_S), *self._measure()])
        if self._capacity is not None:
            self._capacity.close()
        self.supervisor.stop_all()

    def _replace_lost_agents(self) -> list[str]:
        """Let agents run here whose vehicles nobody commands any more; a line for each."""
        recall, membership = self._recall, self._membership
        if recall is None or membership is None or not membership.started:
            return []
        now_s, vehicles = time.monotonic(), self._guard.vehicles
        lost = dict.fromkeys(self._guard.look(now_s, recall.frames(vehicles)), "nobody commands it in flight")
        if vehicles and now_s >= self._floor_due_s:
            self._floor_due_s = now_s + FLOOR_LOOK_S
            on_floor = recall.on_floor(vehicles)
            for vehicle in self._floor_guard.look(now_s, on_floor):
                lost[vehicle] = f"host {on_floor[vehicle].runner.host}, where its agent ran, is silent"
        lines = []
        for vehicle, reason in lost.items():
            child = self.supervisor.children[agent_process(vehicle)]
            if not child.wanted:
                child.wanted = True
                lines.append(f"{vehicle}: {reason}; its agent runs here now")
        return lines

    def _roles(self) -> dict[int, str]:
        """Roles of the processes that run now, by their ids."""
        children = self.supervisor.children.values()
        return {child.process.pid: child.spec.role for child in children if child.process is not None}

    def _measure(self) -> list[str]:
        """Find out how many vehicles this computer flies; a line if that cannot be."""
        membership = self._membership
        if self._capacity is None or membership is None or time.monotonic() < self._measure_due_s:
            return []
        self._measure_due_s = time.monotonic() + MEASURE_LOOK_S
        flying = self.supervisor.flying
        told = self._capacity.look(self.supervisor.spare_ready and not flying)
        children = self.supervisor.children.values()
        agents = sum(child.wanted and child.spec.role == AGENT for child in children)
        membership.measuring = not self._capacity.done and not flying and may_be_crowded(agents)
        if isinstance(told, str):
            return [told]
        if told is not None:
            membership.flies = told
        return []

    def _tell(self, lines: list[str]) -> None:
        """For whoever started the fleet, and for everybody on the bus."""
        if not lines:
            return
        append(self.directory / "log" / "launcher.log", lines)
        self.events.extend(lines)
        self._news.extend(lines)

    def stop(self) -> None:
        """Stop every process; gateways bring down what still flies."""
        if self._membership is not None:
            self._membership.close()
            self._membership = None
        if self._recall is not None:
            self._recall.close()
            self._recall = None
        self._stopping.set()
        self._thread.join()
