"""Starts the part of a fleet that belongs to one host, after checking that it can be started."""

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, suppress
from functools import partial
from typing import Final, TypeVar

from msgspec.structs import replace

from rcopterx.agents.tuning.configuration import DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR
from rcopterx.bus.clock import Clock
from rcopterx.bus.processes import RECORDER, ROLES, ROUTER, SERVICES, SIMULATOR
from rcopterx.bus.realtime import request_realtime, share_interpreter
from rcopterx.bus.session import BusUnreachableError
from rcopterx.compiling.cache import compile_all
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.deploy.fleet_check import check_in_process
from rcopterx.deploy.hosts.capacity import CapacityMeasurement, HostCapacity
from rcopterx.deploy.hosts.checkpoint import CheckpointService
from rcopterx.deploy.hosts.guarding import Guard
from rcopterx.deploy.hosts.host_service import HostService
from rcopterx.deploy.hosts.resources import check_certificate, check_resources, check_without
from rcopterx.deploy.hosts.run_directory import (
    VARIABLE,
    Begun,
    flight_path,
    log_directory,
    run_directory,
    snapshot_path,
    write_flight,
)
from rcopterx.deploy.hosts.vehicle_states import begin_states, remove_states
from rcopterx.deploy.processes.attempts import Attempts, Step
from rcopterx.deploy.processes.forking import URGENT_NICE, ForkServer
from rcopterx.deploy.processes.process_log import LauncherLog
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec, agent_process, processes_of
from rcopterx.deploy.roles.addresses import bus_address, clock_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.deploy.spares.spares import SPARES, Spares, spare_command
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.reading import write_snapshot
from rcopterx.fleet.schema import FleetError, FleetFile, WatchdogConfig
from rcopterx.flights.flights import new_flight_name

T = TypeVar("T")

WATCH_S: Final = 0.02  # between two checks of all processes for progress
EVENTS_KEPT: Final = 200


def call_in_realtime(priority: int, function: Callable[[], T]) -> T:
    """Call a function in a thread of the real-time class at a priority, 0 for none, if that is permitted."""
    with ThreadPoolExecutor(1, initializer=request_realtime, initargs=(priority,)) as pool:
        return pool.submit(function).result()


def stretched(limits: WatchdogConfig, clock: Clock) -> WatchdogConfig:
    """Return limits of a watchdog in real time, never shorter than the fleet's: processes need real time."""
    flight_s, floor_s = (max(limit_s, clock.real_s(limit_s)) for limit_s in (limits.flight_s, limits.floor_s))
    return replace(limits, flight_s=flight_s, floor_s=floor_s)


def home_of(fleet: FleetFile, host: str) -> list[str]:
    """Return the vehicles whose agents run on a host from the start."""
    return [name for name in fleet.agents_on(host) if fleet.vehicles[name].host == host]


def modules_of(fleet: FleetFile, specs: Iterable[ProcessSpec]) -> list[str]:
    """Modules that the fork server imports in advance for these processes; plug-ins are left to them."""
    modules = ["rcopterx.deploy.roles.run"]
    for spec in specs:
        modules.append(f"rcopterx.deploy.roles.{spec.role}")
        # What these import at their start only in some fleets.
        if spec.role == "router" and len(fleet.hosts) > 1:
            modules.append("rcopterx.bus.links")
        if spec.role == "router" and fleet.security.certificates is not None:
            modules.append("rcopterx.deploy.certificates.seats")
        if spec.role == "tracker" and fleet.tracker.brand != "vicon":
            modules.append("rcopterx.vicon_gateway.brands")
        if spec.role == "transmitters":
            # Libraries of some take half a second.
            modules += [type(protocol_of(fleet, name)).__module__ for name in fleet.served_by(spec.unit)]
        if spec.role == "agent":
            control = fleet.vehicles[spec.unit].control
            classes = (
                *map(CONTROLLERS.built_in.get, (DEFAULT_CONTROLLER, control.controller)),
                *map(ESTIMATORS.built_in.get, (DEFAULT_ESTIMATOR, control.estimator)),
            )
            modules += [path.partition(":")[0] for path in classes if path is not None]
    return list(dict.fromkeys(modules))


class Launcher(AbstractContextManager["Launcher"]):
    """A host's processes under supervision, in a thread of their own.

    Raises `FleetError`: something in the file is wrong, an address is in use, no vehicle that takes part has
    its device; no process of the fleet was started.
    """

    def __init__(
        self,
        fleet: FleetFile,  # the fleet file, loaded: later changes of the file have no effect
        host: str,  # which host this is
        without: Collection[str] = (),  # vehicles that do not take part at first; they can join later
        *,
        watchdog: bool = True,  # False never kills processes that make no progress: for debugging
        record: bool = False,  # whether this host, if it is the one that records, writes a flight log
        idle: bool = False,  # whether only the router runs until the rest is requested: the daemon of a host
        script: str = "",  # in lockstep the name of a program that takes turns, too
    ) -> None:
        self._fleet, self._host, self._idle, self._script = fleet, host, idle, script
        clock = clock_of(fleet)
        self._time = clock.lockstep_time()
        self.directory = directory = run_directory(fleet.name, fleet.bus.namespace)
        # Processes that start when the place has become full find each other where this one began.
        os.environ[VARIABLE] = str(directory.parent)
        snapshot = snapshot_path(host, directory)
        specs = [spec for spec in processes_of(fleet, host) if record or spec.role != RECORDER]
        check_without(fleet, without)
        # Before any process starts: watchdogs would take one that waits for kernels for one that hangs.
        compile_all()
        check_certificate(fleet, host)
        missing = check_resources(fleet, host, directory, without)
        forks = ForkServer(modules_of(fleet, specs), Priority.SUPERVISOR.of(fleet), speed=clock.speed)
        try:
            check_in_process(fleet, directory, forks)
        except BaseException:
            forks.close()
            raise
        home = home_of(fleet, host)
        guests = [name for name in fleet.agents_on(host) if name not in home]
        limits = stretched(fleet.watchdog, fleet.clock)
        self.supervisor = Supervisor(
            specs,
            snapshot,
            directory / "log",
            forks,
            # Agents of another host may all have to be started at once.
            spares=None if self._time else self._spares(specs, forks, SPARES + len(guests)),
            watchdog=replace(limits, enabled=limits.enabled and watchdog and self._time is None),
            lived_s=None if self._time is None else self._time.lived_s,
        )
        absent = {agent_process(name) for name in (*without, *guests)}
        for name, child in self.supervisor.children.items():
            child.wanted = child.spec.role == ROUTER if idle else name not in absent

        def measurement() -> CapacityMeasurement:
            period_s = fleet.clock.real_s(fleet.vehicles[home[0]].control.period_s)
            return CapacityMeasurement(snapshot, home[0], period_s, forks, self.supervisor.roles)

        self._capacity = HostCapacity(self.supervisor, measurement if home and self._time is None else None)
        self._prepare_pilots = partial(forks.prepare_pilots, snapshot, host, fleet.agents_on(host))
        self.events: deque[str] = deque(missing, maxlen=EVENTS_KEPT)
        self._unpublished: deque[str] = deque(missing, maxlen=EVENTS_KEPT)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)
        self._checkpoint: CheckpointService | None = None
        self._host_service: HostService | None = None

    def _spares(self, specs: Sequence[ProcessSpec], forks: ForkServer, count: int) -> Spares:
        jobs = [(spec.role, spec.unit) for spec in specs if ROLES[spec.role].spare]
        command = spare_command(snapshot_path(self._host, self.directory), self._host, jobs)
        log, priority = self.directory / "log" / "spare.log", Priority.GATEWAY.of(self._fleet)
        return Spares(forks, jobs, command, log, count, priority)

    def __enter__(self) -> "Launcher":
        vehicles = self._fleet.transmitters_on(self._host)
        if self._time is not None:
            # Their times are those of another flight.
            remove_states(vehicles, self.directory)
        try:
            begin_states(vehicles, self.directory)
        except FleetError:
            self.supervisor.stop_all()
            raise
        wanted = (child.spec for child in self.supervisor.children.values() if child.wanted)
        in_lockstep = (spec.name for spec in wanted if ROLES[spec.role].in_lockstep)
        if self._time is not None:
            self._time.begin([SIMULATOR, *in_lockstep, *SERVICES, *filter(None, [self._script])])
        write_snapshot(self._fleet, snapshot_path(self._host, self.directory))
        # The supervisor runs in the interpreter of this program and waits for its other threads.
        share_interpreter()
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, URGENT_NICE)
        self._begin_flight()
        self._thread.start()
        try:
            self._serve()
        except BusUnreachableError:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _serve(self) -> None:
        fleet, host, supervisor = self._fleet, self._host, self.supervisor
        address, vehicles = bus_address(fleet, host), fleet.agents_on(host)
        turns = {one: fleet.agent_hosts(one).index(host) for one in vehicles if fleet.vehicles[one].spares}

        def quick_deaths(vehicle: str) -> int:
            return supervisor.children[agent_process(vehicle)].quick_deaths

        # An agent that restarts in flight waits for its answer.
        self._checkpoint = call_in_realtime(
            Priority.GATEWAY.of(fleet),
            CheckpointService(address, list(vehicles), quick_deaths, Guard(host, turns)).start,
        )
        begin = self._begin_flight if self._idle else None
        home, logs = home_of(fleet, host), self.directory / "log"
        self._host_service = HostService(
            address, supervisor, self._capacity, self._unpublished, home, logs, begin
        ).start()

    def _begin_flight(self) -> None:
        """Name the flight log that recorders write from now on."""
        name = new_flight_name(self._fleet.name, time.time(), log_directory(self._fleet))
        write_flight(flight_path(self._host, self.directory), Begun.now(name, clock_of(self._fleet)))

    def _run(self) -> None:
        log, attempt = LauncherLog(self.directory / "log"), Attempts()
        request_realtime(Priority.SUPERVISOR.of(self._fleet), children=False)

        def do(name: str, step: Step) -> None:
            if lines := attempt(name, step):
                log.append(lines)
                self.events.extend(lines)
                self._unpublished.extend(lines)

        # This thread starts and stops all processes: they receive SIGTERM when it ends.
        do("preparing pilots", self._prepare_pilots)
        do("starting processes", self.supervisor.start_all)
        while not self._stopping.is_set():
            do("replacing lost agents", self._replace_lost_agents)
            do("supervision", partial(self.supervisor.watch, WATCH_S))
            if self._time is not None:
                self._time.note_lost_routers(self.supervisor.children[ROUTER].restarts)
            do("measuring the capacity", self._measure)
        self._capacity.close()
        self.supervisor.stop_all()
        log.close()

    def _replace_lost_agents(self) -> list[str]:
        """Start agents here for vehicles without commands; return a line for each."""
        lines = []
        checkpoint, service = self._checkpoint, self._host_service
        if checkpoint is not None and service is not None and service.started:
            for vehicle, reason in checkpoint.lost_agents().items():
                child = self.supervisor.children[agent_process(vehicle)]
                if not child.wanted:
                    child.wanted = True
                    lines.append(f"{vehicle}: {reason}; its agent runs here now")
        return lines

    def _measure(self) -> list[str]:
        service = self._host_service
        return [] if service is None else self._capacity.step(service.agents_are_late)

    def stop(self) -> None:
        """Stop every process; gateways bring down what still flies."""
        for service in filter(None, (self._host_service, self._checkpoint)):
            service.close()
        self._host_service = self._checkpoint = None
        self._stopping.set()
        if self._time is not None:
            self._time.want_none()
        self._thread.join()
        if self._time is not None:
            self._time.end()
        remove_states(self._fleet.transmitters_on(self._host), self.directory)
