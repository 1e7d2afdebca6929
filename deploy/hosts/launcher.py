"""Starts the part of a fleet that belongs to one host, after checking that it can be started."""

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, suppress
from functools import partial
from typing import Final, TypeVar

from msgspec.structs import replace

from rcopterx.bus.clock import Clock
from rcopterx.bus.lockstep.page import create_page, opened_page, remove_page
from rcopterx.bus.processes import AGENT, RECORDER, ROLES, ROUTER, SERVICES, SIMULATOR
from rcopterx.bus.realtime import request_realtime, share_interpreter
from rcopterx.bus.session import BusUnreachableError
from rcopterx.compiling.cache import compile_all
from rcopterx.deploy.fleet_check import check_in_process
from rcopterx.deploy.hosts.capacity import CapacityMeasurement, may_be_crowded
from rcopterx.deploy.hosts.guarding import Guard
from rcopterx.deploy.hosts.membership import MembershipService
from rcopterx.deploy.hosts.recall import RecallService
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
from rcopterx.deploy.processes.attempts import Attempts
from rcopterx.deploy.processes.forking import URGENT_NICE, ForkServer
from rcopterx.deploy.processes.preloading import modules_of
from rcopterx.deploy.processes.process_log import LauncherLog
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec, agent_process, processes_of
from rcopterx.deploy.roles.addresses import bus_address, clock_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.deploy.spares.spares import SPARES, Spares, spare_command
from rcopterx.fleet.reading import write_snapshot
from rcopterx.fleet.schema import FleetError, FleetFile, WatchdogConfig
from rcopterx.flights.flights import new_flight_name

T = TypeVar("T")

WATCH_S: Final = 0.02  # between two checks of all processes for progress
MEASURE_S: Final = 0.1  # between two steps of the measurement of how many vehicles this computer flies
FLOOR_S: Final = 0.25  # between two searches for vehicles on the floor whose host has died
EVENTS_KEPT: Final = 200


def call_in_realtime(priority: int, function: Callable[[], T]) -> T:
    """Call a function in a thread of the real-time class at a priority, 0 for none, if that is permitted."""
    with ThreadPoolExecutor(1, initializer=request_realtime, initargs=(priority,)) as pool:
        return pool.submit(function).result()


def stretched(limits: WatchdogConfig, clock: Clock) -> WatchdogConfig:
    """Return limits of a watchdog in real time, never shorter than the fleet's: processes need real time."""
    flight_s, floor_s = (max(limit_s, clock.real_s(limit_s)) for limit_s in (limits.flight_s, limits.floor_s))
    return replace(limits, flight_s=flight_s, floor_s=floor_s)


def spare_turns(fleet: FleetFile, host: str) -> dict[str, int]:
    """Return the place of a host among those that may run the agent of each vehicle that has spare hosts."""
    vehicles = [name for name in fleet.agents_on(host) if fleet.vehicles[name].spares]
    return {name: fleet.agent_hosts(name).index(host) for name in vehicles}


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
        self._clock = clock_of(fleet)
        self.directory = directory = run_directory(fleet.name, fleet.bus.namespace)
        # Processes that start when the place has become full find each other where this one began.
        os.environ[VARIABLE] = str(directory.parent)
        specs = [spec for spec in processes_of(fleet, host) if record or spec.role != RECORDER]
        check_without(fleet, without)
        # Before any process starts: watchdogs would take one that waits for kernels for one that hangs.
        compile_all()
        check_certificate(fleet, host)
        missing = check_resources(fleet, host, directory, without)
        priority = Priority.SUPERVISOR.of(fleet)
        self._forks = ForkServer(modules_of(fleet, specs), priority, speed=self._clock.speed)
        try:
            check_in_process(fleet, directory, self._forks)
        except BaseException:
            self._forks.close()
            raise
        self._snapshot = snapshot_path(host, directory)
        self._logs = directory / "log"
        self._home = [name for name in fleet.agents_on(host) if fleet.vehicles[name].host == host]
        guests = [name for name in fleet.agents_on(host) if name not in self._home]
        limits = stretched(fleet.watchdog, fleet.clock)
        # A process that waits for its turn does not hang.
        limits = replace(limits, enabled=limits.enabled and watchdog and not self._clock.lockstep)
        self.supervisor = Supervisor(
            specs,
            self._snapshot,
            self._logs,
            self._forks,
            # Agents of another host may all have to be started at once. In lockstep time waits for them.
            spares=None if self._clock.lockstep else self._make_spares(specs, SPARES + len(guests)),
            watchdog=limits,
            lived_s=None if self._clock.page is None else self._lived_s,
        )
        absent = {agent_process(name) for name in (*without, *guests)}
        for name, child in self.supervisor.children.items():
            child.wanted = child.spec.role == ROUTER if idle else name not in absent
        self.events: deque[str] = deque(missing, maxlen=EVENTS_KEPT)
        self._unpublished: deque[str] = deque(missing, maxlen=EVENTS_KEPT)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)
        self._guard = Guard(host, spare_turns(fleet, host))
        self._floor_due_s = self._measure_due_s = 0.0
        self._recall: RecallService | None = None
        self._membership: MembershipService | None = None
        self._capacity = self._measurement() if self._home and not self._clock.lockstep else None
        self._not_measured = ""  # why the capacity could not be measured the last time

    def _lived_s(self, process: str) -> float:
        assert self._clock.page is not None
        return opened_page(self._clock.page).lived_s(process)

    def _measurement(self) -> CapacityMeasurement:
        vehicle = self._home[0]
        period_s = self._fleet.clock.real_s(self._fleet.vehicles[vehicle].control.period_s)
        return CapacityMeasurement(self._snapshot, vehicle, period_s, self._forks, self._roles)

    def _make_spares(self, specs: Sequence[ProcessSpec], count: int) -> Spares:
        jobs = [(spec.role, spec.unit) for spec in specs if ROLES[spec.role].spare]
        command = spare_command(self._snapshot, self._host, jobs)
        priority = Priority.GATEWAY.of(self._fleet)
        return Spares(self._forks, jobs, command, self._logs / "spare.log", count, priority)

    def __enter__(self) -> "Launcher":
        if self._clock.lockstep:
            # Their times are those of another flight.
            remove_states(self._fleet.transmitters_on(self._host), self.directory)
        try:
            begin_states(self._fleet.transmitters_on(self._host), self.directory)
        except FleetError:
            self._forks.close()
            raise
        if self._clock.page is not None:
            children = self.supervisor.children.values()
            awaited = (each.spec for each in children if each.wanted)
            in_lockstep = (spec.name for spec in awaited if ROLES[spec.role].in_lockstep)
            others = (*SERVICES, *filter(None, [self._script]))
            create_page(self._clock.page, [SIMULATOR, *in_lockstep, *others])
        write_snapshot(self._fleet, self._snapshot)
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
        address = bus_address(fleet, host)
        # An agent that restarts in flight waits for its answer.
        self._recall = call_in_realtime(
            Priority.GATEWAY.of(fleet),
            lambda: RecallService(
                address,
                list(fleet.agents_on(host)),
                lambda vehicle: supervisor.children[agent_process(vehicle)].quick_deaths,
                self._guard.vehicles,
            ),
        )
        begin = self._begin_flight if self._idle else None
        self._membership = MembershipService(
            address, host, supervisor, self._unpublished, self._home, self._logs, begin
        )

    def _begin_flight(self) -> None:
        """Name the flight log that recorders write from now on."""
        name = new_flight_name(self._fleet.name, time.time(), log_directory(self._fleet))
        flight = Begun.now(name, self._clock)
        write_flight(flight_path(self._host, self.directory), flight)

    def _run(self) -> None:
        self._log = LauncherLog(self._logs)
        request_realtime(Priority.SUPERVISOR.of(self._fleet), children=False)
        # This thread starts and stops all processes: they receive SIGTERM when it ends.
        attempt = Attempts()
        self._report(attempt("preparing pilots", self._prepare_pilots))
        self._report(attempt("starting processes", self.supervisor.start_all))
        while not self._stopping.is_set():
            self._report(attempt("replacing lost agents", self._replace_lost_agents))
            self._report(attempt("supervision", partial(self.supervisor.watch, WATCH_S)))
            if self._clock.page is not None:
                # Time passes without the messages that were lost with a router.
                restarts = self.supervisor.children[ROUTER].restarts
                opened_page(self._clock.page).lost_routers = restarts
            self._report(attempt("measuring the capacity", self._measure))
        if self._capacity is not None:
            self._capacity.close()
        self.supervisor.stop_all()
        self._log.close()

    def _prepare_pilots(self) -> list[str]:
        """Let the fork server build the pilots of this host; agents build for themselves what it cannot."""
        vehicles = self._fleet.agents_on(self._host)
        if vehicles:
            self._forks.prepare_pilots(self._snapshot, self._host, vehicles)
        return []

    def _replace_lost_agents(self) -> list[str]:
        """Start agents here for vehicles without commands; return a line for each."""
        recall, membership, guard = self._recall, self._membership, self._guard
        if recall is None or membership is None or not membership.started:
            return []
        now_s, vehicles = self._clock.now(), guard.vehicles
        orphans = guard.find_orphans(now_s, recall.frames())
        lost = dict.fromkeys(orphans, "no agent commands it in flight")
        if vehicles and now_s >= self._floor_due_s:
            self._floor_due_s = now_s + FLOOR_S
            on_floor = recall.on_floor()
            for vehicle in guard.find_orphans_on_floor(now_s, on_floor):
                lost[vehicle] = f"host {on_floor[vehicle].runner.host}, where its agent ran, is silent"
        lines = []
        for vehicle, reason in lost.items():
            child = self.supervisor.children[agent_process(vehicle)]
            if not child.wanted:
                child.wanted = True
                lines.append(f"{vehicle}: {reason}; its agent runs here now")
        return lines

    def _roles(self) -> dict[int, str]:
        children = self.supervisor.children.values()
        return {child.process.pid: child.spec.role for child in children if child.process is not None}

    def _measure(self) -> list[str]:
        """Measure how many vehicles this computer flies; return a line if that fails for a new reason."""
        membership = self._membership
        if self._capacity is None or membership is None or time.monotonic() < self._measure_due_s:
            return []
        self._measure_due_s = time.monotonic() + MEASURE_S
        flying = self.supervisor.flying
        ready = self.supervisor.spares.ready() > 0 and not flying
        result = self._capacity.step(ready, membership.agents_are_late)
        children = self.supervisor.children.values()
        agents = sum(child.wanted and child.spec.role == AGENT for child in children)
        if isinstance(result, tuple):
            membership.flies = result
        membership.measuring = not (membership.flies or flying) and may_be_crowded(agents)
        if membership.measuring and self._capacity.done:
            self._capacity = self._measurement()
        if not isinstance(result, str) or result == self._not_measured:
            return []
        self._not_measured = result
        return [result]

    def _report(self, lines: list[str]) -> None:
        """Log lines, and keep them for the program that started the fleet and for the bus."""
        if not lines:
            return
        self._log.append(lines)
        self.events.extend(lines)
        self._unpublished.extend(lines)

    def stop(self) -> None:
        """Stop every process; gateways bring down what still flies."""
        for service in filter(None, (self._membership, self._recall)):
            service.close()
        self._membership = self._recall = None
        self._stopping.set()
        if self._clock.page is not None:
            opened_page(self._clock.page).want_none()
        self._thread.join()
        if self._clock.page is not None:
            remove_page(self._clock.page)
        remove_states(self._fleet.transmitters_on(self._host), self.directory)
