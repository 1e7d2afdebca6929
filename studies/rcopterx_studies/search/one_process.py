"""A fleet in the simulated laboratory, all of whose processes take turns in this one.

Agents, gateways, simulator and services of the launcher are the objects of the real processes, and the
scheduler is that of lockstep: a flight has the bits of the flight of processes in lockstep. Only the
transport differs: a bus in memory in place of routers. Serial lines and the Tracker's stream are real.
"""

import os
from collections import deque
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from rcopterx.agents.process import Agent
from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.heartbeat import own_heartbeat
from rcopterx.bus.lockstep.page import create_page, opened_page, remove_page
from rcopterx.bus.processes import CHECKPOINT, HOST_SERVICE, SCRIPT, SIMULATOR, TRACKER
from rcopterx.bus.requests import IdentifyReply
from rcopterx.bus.session import RawMessage, Session
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.wakeup import Wakeup
from rcopterx.deploy.hosts.capacity import HostCapacity
from rcopterx.deploy.hosts.checkpoint import CheckpointService
from rcopterx.deploy.hosts.guarding import Guard
from rcopterx.deploy.hosts.host_service import HostService
from rcopterx.deploy.hosts.run_directory import VARIABLE, lockstep_path, run_directory
from rcopterx.deploy.hosts.vehicle_states import begin_states, remove_states
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import agent_process, processes_of
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.agent import pilot_of
from rcopterx.deploy.roles.simulator import simulator_settings
from rcopterx.deploy.roles.tracker import tracker_settings
from rcopterx.deploy.roles.transmitters import gateway_settings
from rcopterx.fleet.reading import digest_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.simulator.process import Simulator
from rcopterx.transmitter_gateway.kill_keys import KillKeys
from rcopterx.transmitter_gateway.process import Gateway
from rcopterx.transmitter_gateway.radios import Radios
from rcopterx.vicon_gateway.client import DataStreamClient
from rcopterx.vicon_gateway.process import TrackerGateway
from rcopterx_studies.search.turns import Process, Turns


class OneProcess:
    """The processes of a fleet in lockstep, by name in `turns`; `FleetError` if it cannot be simulated."""

    def __init__(
        self,
        file: FleetFile,
        directory: Path,  # its run directory
        store: Callable[[RawMessage], None],  # gets every message on its bus
        without: Collection[str] = (),  # vehicles that can join later
    ) -> None:
        self._file, (self._host,) = file, file.hosts
        self._directory, self._store = directory, store
        self._simulator = simulator_settings(file, directory)
        self._done = False
        processes: dict[str, Process] = {
            SIMULATOR: self._simulate,
            HOST_SERVICE: self._serve_host,
            CHECKPOINT: self._keep_intents,
            TRACKER: self._track,
            **{name: partial(self._transmit, name) for name in file.gateways if file.served_by(name)},
            **{agent_process(name): partial(self._control, name) for name in file.vehicles},
        }
        specs = [spec for spec in processes_of(file, self._host) if spec.name in processes]
        # It starts nothing: the scheduler starts what is missing.
        self.supervisor = Supervisor(specs, directory / "snapshot", directory / "log", ForkServer())
        for vehicle in without:
            self.supervisor.children[agent_process(vehicle)].wanted = False
        self.turns = Turns(lockstep_path(directory), processes)

    def run(self, script: Callable[[Fleet], None]) -> None:
        """Start the processes, run a script that takes turns with them, and end them; raises what it does."""
        turns, children = self.turns, self.supervisor.children
        errors: list[BaseException] = []
        turns.processes[SCRIPT] = partial(self._follow, script, errors)
        absent = {name for name, child in children.items() if not child.wanted}
        begin_states(self._file.vehicles, self._directory)
        create_page(turns.page, [name for name in turns.processes if name not in absent])
        try:
            with turns.in_place():
                self._answer_identity()
                with Session(bus_address(self._file, self._host)) as session:
                    session.tap(self._store)
                    runs = turns.start(SIMULATOR)
                    while runs and not self._done:
                        runs = turns.resume(SIMULATOR)
        finally:
            remove_page(turns.page)
            opened_page.cache_clear()
            remove_states(self._file.vehicles, self._directory)
        for error in errors:
            raise error

    def _answer_identity(self) -> None:
        """Answer as the router of the fleet does."""
        name, vehicles = self._file.name, tuple(self._file.vehicles)
        identity = IdentifyReply(
            accepted=True, fleet=name, host=self._host, digest=digest_of(self._file), vehicles=vehicles
        )
        key = channels.request_key(name, self._host, "identify")
        router = self.turns.bus.open(bus_address(self._file, self._host))
        router.declare_queryable(key, lambda query: query.reply(query.key_expr, encode(identity)))

    def _follow(self, script: Callable[[Fleet], None], errors: list[BaseException]) -> None:
        try:
            with closing(Fleet(self._file, self._host, process=SCRIPT)) as fleet:
                script(fleet)
        except Exception as error:  # noqa: BLE001 - it is raised in the caller's greenlet
            errors.append(error)
        finally:
            self._done = True

    def _simulate(self) -> None:
        settings = self._simulator
        with (
            Session(settings.bus, interrupted=lambda: self._done) as session,
            closing(Simulator(settings, session)) as simulator,
        ):
            while not self._done:
                simulator.run_once()

    def _track(self) -> None:
        settings = tracker_settings(self._file)
        clock = settings.bus.clock
        with Session(settings.bus) as session, ExitStack() as stack:
            client = DataStreamClient(
                settings.host, settings.port, clock=session.clock, speed=clock.speed, at_once=True
            )
            stack.callback(client.close)
            gateway = stack.enter_context(closing(TrackerGateway(settings, client, session, realtime=False)))
            while True:
                gateway.step()

    def _transmit(self, name: str) -> None:
        settings = gateway_settings(self._file, name, self._directory)
        with (
            open(os.devnull) as no_terminal,
            closing(Wakeup(settings.bus.clock)) as wakeup,
            Session(settings.bus, wakeup) as session,
            closing(
                Radios(
                    settings, wakeup, KillKeys(no_terminal.fileno()), set(), own_heartbeat(), session.clock
                )
            ) as radios,
        ):
            gateway = Gateway(settings, session, radios, realtime=False)
            while True:
                gateway.wait()
                gateway.step()

    def _control(self, name: str) -> None:
        settings, pilot = pilot_of(self._file, name)
        with Session(settings.bus) as session:
            agent = Agent(settings, pilot, StepBus(session), realtime=False)
            session.finish_first(agent.wait_for_work)
            while not agent.lost:
                agent.turn(session)

    def _keep_intents(self) -> None:
        children = self.supervisor.children
        service = CheckpointService(
            bus_address(self._file, self._host),
            list(self._file.vehicles),
            lambda vehicle: children[agent_process(vehicle)].quick_deaths,
            Guard(self._host, {}),
        )
        with closing(service):
            service.serve()

    def _serve_host(self) -> None:
        service = HostService(
            bus_address(self._file, self._host),
            self.supervisor,
            HostCapacity(self.supervisor, None),
            deque(),
            list(self._file.vehicles),
            self._directory / "log",
        )
        with closing(service):
            service.serve()


@contextmanager
def in_one_process(
    file: FleetFile, store: Callable[[RawMessage], None], without: Collection[str] = ()
) -> Iterator[OneProcess]:
    """Give a fleet in lockstep a run directory of its own, and prepare its processes."""
    with TemporaryDirectory(prefix="rcopterx-") as place, patch.dict(os.environ, {VARIABLE: place}):
        yield OneProcess(file, run_directory(file.name, file.bus.namespace), store, without)
