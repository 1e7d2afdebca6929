"""Promises of the launcher's host service: vehicles come and go by request, never out of the air."""

import errno
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.bus import asked
from support.statuses import flying_status
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.requests import (
    ReadLogs,
    ReadLogsReply,
    StartHost,
    StartVehicle,
    StopHost,
    StopVehicle,
    TakeVehicle,
)
from rcopterx.bus.session import BusAddress, NotServedError, Session
from rcopterx.deploy.hosts.capacity import HostCapacity
from rcopterx.deploy.hosts.host_service import HostService
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec

Join = Callable[..., Session]


class Sleeping(ProcessSpec):
    """A process that does nothing."""

    def command(self, snapshot: Path, *, take_over: bool = False) -> list[str]:
        return ["/bin/sleep", "600"]


@pytest.fixture
def supervisor(tmp_path: Path) -> Supervisor:
    specs = [ProcessSpec("router", "router", "main")]
    specs += [ProcessSpec(f"agent-{name}", "agent", name) for name in ("h1", "h2")]
    supervisor = Supervisor(specs, tmp_path / "lab.toml", tmp_path, ForkServer())
    supervisor.children["agent-h2"].wanted = False
    return supervisor


def serving(
    address: BusAddress,
    supervisor: Supervisor,
    logs: Path,
    home: Collection[str] = ("h1",),
    begin: Callable[[], None] | None = None,
    events: Collection[str] = (),
) -> HostService:
    address = replace(address, host="main")
    capacity = HostCapacity(supervisor, None)
    return HostService(address, supervisor, capacity, deque(events), home, logs, begin).start()


@pytest.fixture
def service(bus_address: BusAddress, supervisor: Supervisor, tmp_path: Path) -> Iterator[HostService]:
    service = serving(bus_address, supervisor, tmp_path, ["h1", "h2"], events=["router: started"])
    yield service
    service.close()


def status_of(session: Session, condition: Callable[[LauncherStatus], bool]) -> LauncherStatus:
    inbox = session.subscribe(channels.LAUNCHER, "main")
    statuses: list[LauncherStatus] = []

    def received_it() -> bool:
        received = inbox.latest()
        if received is not None and condition(received.message):
            statuses.append(received.message)
        return bool(statuses)

    wait_for(received_it, "there is no such status")
    return statuses[0]


def test_the_launcher_says_who_takes_part(service: HostService, join: Join) -> None:
    status = status_of(join(), lambda _: True)
    assert (status.running, status.absent) == (("h1",), ("h2",))
    assert status.restarts == {"router": 0, "agent-h1": 0, "agent-h2": 0}
    assert not status.spare_ready
    assert (status.watchdog, status.hung, status.forgiven) == (False, {}, {})
    assert status.longest_silence_s == {}


def test_the_launcher_says_while_it_measures_what_the_host_flies(
    bus_address: BusAddress, supervisor: Supervisor, tmp_path: Path, join: Join
) -> None:
    session, capacity = join(), HostCapacity(supervisor, None)
    address = replace(bus_address, host="main")
    service = HostService(address, supervisor, capacity, deque(), ["h1"], tmp_path).start()
    try:
        assert status_of(session, lambda _: True).control_every == 1
        capacity.measuring = True
        assert status_of(session, lambda status: status.measuring).flies == ()
        capacity.measuring, capacity.flies = False, (0, 1, 1, 2)
        status = status_of(session, lambda status: not status.measuring)
        assert (status.flies, status.control_every, status.crowded) == ((0, 1, 1, 2), 2, False)
    finally:
        service.close()


def test_late_commands_of_an_agent_of_this_host_are_noticed(service: HostService, join: Join) -> None:
    session = join()

    def noticed(late_share: float) -> bool:
        session.publish(channels.AGENT_STATUS, "h1", flying_status(late_share=late_share))
        return service.agents_are_late

    assert not service.agents_are_late
    wait_for(lambda: noticed(0.5), "late commands are not noticed")
    wait_for(lambda: not noticed(0.1), "commands are in time again")


def test_the_launcher_says_what_hung(service: HostService, supervisor: Supervisor, join: Join) -> None:
    supervisor.children["agent-h1"].hung = 2
    supervisor.spares_hung = 1
    assert status_of(join(), lambda status: bool(status.hung)).hung == {"agent-h1": 2, "spare": 1}


def test_vehicles_land_when_the_loop_that_replaces_processes_makes_no_turns(
    bus_address: BusAddress, join: Join, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.deploy.hosts.host_service.REPORT_PERIOD_S", 0.02)
    monkeypatch.setattr("rcopterx.deploy.hosts.host_service.LAND_AFTER_S", 0.3)
    specs = [Sleeping(name, role, name, 0) for name, role in (("radios", "transmitters"), ("h1", "agent"))]
    supervisor = Supervisor(specs, tmp_path / "lab.toml", tmp_path, ForkServer())
    supervisor.start_all()
    service = serving(bus_address, supervisor, tmp_path)
    try:
        session = join()
        assert status_of(session, lambda _: True).stalled_s == 0.0
        radios, agent = (supervisor.children[name].process for name in ("radios", "h1"))
        assert radios is not None
        assert agent is not None
        supervisor.watch(0.0)
        assert status_of(session, lambda status: status.stalled_s > 0.1)
        assert radios.wait(DEADLINE_S) == -signal.SIGTERM
        assert agent.poll() is None
    finally:
        service.close()
        supervisor.stop_all()


@pytest.fixture
def begun() -> list[str]:
    return []


@pytest.fixture
def daemon(
    bus_address: BusAddress, supervisor: Supervisor, begun: list[str], tmp_path: Path
) -> Iterator[HostService]:
    """The service of a host with a daemon, on which only the router runs at first."""
    for name, child in supervisor.children.items():
        child.wanted = name == "router"
    service = serving(bus_address, supervisor, tmp_path, ["h1", "h2"], lambda: begun.append("flight"))
    yield service
    service.close()


def wanted(supervisor: Supervisor) -> set[str]:
    return {name for name, child in supervisor.children.items() if child.wanted}


def test_a_host_is_started_and_stopped_by_request(
    daemon: HostService, supervisor: Supervisor, begun: list[str], join: Join
) -> None:
    session = join()
    reply = asked(session, "main", StartHost(without=("h2",)))
    assert (reply.accepted, reply.reason) == (True, "main is started")
    assert (wanted(supervisor), begun) == ({"router", "agent-h1"}, ["flight"])
    again = asked(session, "main", StartHost())
    assert (again.accepted, again.reason) == (True, "main runs already")
    assert (wanted(supervisor), begun) == ({"router", "agent-h1"}, ["flight"])
    assert asked(session, "main", StopHost()).accepted
    assert wanted(supervisor) == {"router"}


def test_a_host_does_not_stop_while_vehicles_are_in_the_air(
    daemon: HostService, supervisor: Supervisor, join: Join
) -> None:
    session = join()
    asked(session, "main", StartHost())
    session.publish(channels.AGENT_STATUS, "h7", flying_status())

    def refused() -> bool:
        reply = asked(session, "main", StopHost())
        return not reply.accepted and reply.reason == "h7 in the air; land first"

    wait_for(refused, "the host stops although h7, an agent of another host, flies")


def test_the_logs_of_a_host_are_read_by_request_and_not_recorded(
    service: HostService, tmp_path: Path, join: Join
) -> None:
    (tmp_path / "agent-h1.log").write_text("2026-11-22T03:00:01.000Z INFO started\n")
    session = join()
    answered = session.subscribe(channels.ANSWERED, "main", depth=8)
    reply = asked(session, "main", ReadLogs(names=("h1",)))
    assert isinstance(reply, ReadLogsReply)
    assert [(line.process, line.text) for line in reply.lines] == [("agent-h1", "INFO started")]
    asked(session, "main", StartVehicle(vehicle="h1"))
    wait_for(lambda: len(answered.drain()) == 1, "the later request is not recorded, or the first one is")


def test_a_host_without_a_daemon_is_not_started_by_request(service: HostService, join: Join) -> None:
    with pytest.raises(NotServedError):
        join().request("main", StartHost(), timeout_s=DEADLINE_S)


def test_a_host_on_a_full_disk_refuses_to_start_and_answers_later_requests(
    bus_address: BusAddress, supervisor: Supervisor, tmp_path: Path, join: Join
) -> None:
    full = True

    def begin() -> None:
        if full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "flight")

    service = serving(bus_address, supervisor, tmp_path, begin=begin)
    try:
        session = join()
        reply = asked(session, "main", StartHost())
        assert not reply.accepted
        assert "the launcher of main failed: [Errno 28] No space left on device: 'flight'" in reply.reason
        assert not service.started
        full = False
        assert asked(session, "main", StartHost()).reason == "main is started"
    finally:
        service.close()


@pytest.mark.usefixtures("service")
def test_a_disk_that_hangs_while_logs_are_read_delays_no_other_request(
    join: Join, monkeypatch: pytest.MonkeyPatch
) -> None:
    mended = threading.Event()

    def hang(*_: object) -> ReadLogsReply:
        mended.wait(DEADLINE_S)
        return ReadLogsReply(accepted=True)

    monkeypatch.setattr("rcopterx.deploy.processes.log_reading.read_page", hang)
    session, other = join(), join()
    reading = threading.Thread(target=asked, args=(other, "main", ReadLogs()))
    reading.start()
    assert asked(session, "main", StartVehicle(vehicle="h2")).reason == "h2 is started"
    assert reading.is_alive()
    mended.set()
    reading.join(DEADLINE_S)


def test_a_vehicle_takes_part_and_leaves_by_request(
    service: HostService, supervisor: Supervisor, join: Join
) -> None:
    session = join()
    reply = asked(session, "main", StartVehicle(vehicle="h2"))
    assert (reply.accepted, reply.reason) == (True, "h2 is started")
    assert supervisor.children["agent-h2"].wanted
    assert status_of(session, lambda status: not status.absent).running == ("h1", "h2")
    assert asked(session, "main", StartVehicle(vehicle="h2")).reason == "h2 takes part already"
    reply = asked(session, "main", StopVehicle(vehicle="h2"))
    assert (reply.accepted, reply.reason) == (True, "h2 leaves")
    assert not supervisor.children["agent-h2"].wanted
    status_of(session, lambda status: status.absent == ("h2",))


def test_a_vehicle_in_the_air_keeps_its_agent(
    service: HostService, supervisor: Supervisor, join: Join
) -> None:
    session = join()

    def refused() -> bool:
        session.publish(channels.AGENT_STATUS, "h1", flying_status())
        supervisor.children["agent-h1"].wanted = True
        reply = asked(session, "main", StopVehicle(vehicle="h1"))
        return reply.reason == "h1 is in the air, its phase is flying; land it first"

    wait_for(refused, "it may leave")
    assert supervisor.children["agent-h1"].wanted


@pytest.fixture
def spare_host(bus_address: BusAddress, supervisor: Supervisor, tmp_path: Path) -> Iterator[HostService]:
    """The service of a host that may run the agent of h2, which runs elsewhere by the fleet file."""
    service = serving(bus_address, supervisor, tmp_path)
    yield service
    service.close()


def test_an_agent_that_may_run_here_but_does_not_is_not_absent(spare_host: HostService, join: Join) -> None:
    status = status_of(join(), lambda _: True)
    assert (status.running, status.absent) == (("h1",), ())


def test_an_agent_is_taken_over_by_request_and_only_where_the_fleet_file_lets_it_run(
    spare_host: HostService, supervisor: Supervisor, join: Join
) -> None:
    session, child = join(), supervisor.children["agent-h2"]
    reply = asked(session, "main", TakeVehicle(vehicle="h2"))
    assert (reply.accepted, reply.reason) == (True, "the agent of h2 starts on main")
    assert (child.wanted, child.take_over) == (True, True)
    reply = asked(session, "main", TakeVehicle(vehicle="h2"))
    assert (reply.accepted, reply.reason) == (True, "the agent of h2 runs on main already")
    reply = asked(session, "main", TakeVehicle(vehicle="h7"))
    assert not reply.accepted
    assert reply.reason == "the fleet file does not let the agent of h7 run on main"


def test_an_agent_that_does_not_fly_its_vehicle_may_be_stopped_in_flight(
    spare_host: HostService, supervisor: Supervisor, join: Join
) -> None:
    session, child = join(), supervisor.children["agent-h2"]

    def stopped() -> bool:
        session.publish(channels.AGENT_STATUS, "h2", flying_status(host="second"))
        child.wanted = True
        return asked(session, "main", StopVehicle(vehicle="h2")).accepted

    wait_for(stopped, "it is not stopped")
    assert not child.wanted
