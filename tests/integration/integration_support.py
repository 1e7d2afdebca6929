"""Fleet files on free ports, process ids, and true states of the laboratory, for integration tests."""

import math
import os
import signal
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from support.bus import free_port

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LaboratoryVehicle
from rcopterx.bus.lockstep.page import opened_page
from rcopterx.bus.processes import SCRIPT
from rcopterx.bus.session import RequestFailedError
from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.fleet.reading import at_speed, load_fleet
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, RefusedError
from rcopterx_studies.faults.flight_promises import NEEDED, broken_promises

NAMES = ("h1", "h2", "h3")
GENTLE_M_S = 1.7
SLOW_M_S = 0.15
REST_S = 0.5
THROTTLE_LOW_US = 1100


@dataclass
class Flying:
    """A fleet that is up: its launchers by host and the scripting interface."""

    path: Path
    fleet: Fleet
    launchers: dict[str, Launcher]
    recorder: FlightSampler
    """Records what `check_promises` checks."""

    def check_promises(self) -> None:
        """Check what always holds in what was flown since the last check."""
        broken = broken_promises(self.recorder.stop())
        self.recorder.start()
        assert not broken, "\n".join(f"{at_s:.2f} s {vehicle}: {text}" for at_s, vehicle, text in broken)

    def launcher_of(self, process: str) -> Launcher:
        return next(
            launcher for launcher in self.launchers.values() if process in launcher.supervisor.children
        )

    def pid(self, process: str) -> int:
        pid = self.launcher_of(process).supervisor.pid(process)
        assert pid is not None, f"{process} does not run"
        return pid

    def now_s(self) -> float:
        """Time of the fleet [s]."""
        return self.fleet.session.clock()

    def wait_for_spare(self, process: str) -> None:
        """Wait until a warm process could replace this one; in lockstep the fleet waits for any other."""
        if self.fleet.session.participant is not None:
            return
        supervisor = self.launcher_of(process).supervisor
        self.fleet.wait_until(lambda: supervisor.spares.ready() > 0, 60, "no spare process")

    def kill(self, process: str) -> int:
        """SIGKILL a process of the fleet; returns the pid it had."""
        pid, participant = self.pid(process), self.fleet.session.participant
        if participant is None:
            os.kill(pid, signal.SIGKILL)
        else:
            participant.kill(process)
        return pid

    def want(self, process: str, wanted: bool) -> None:
        """Have a process run from now on, or end now and not be started again."""
        self.launcher_of(process).supervisor.children[process].wanted = wanted
        if lockstep := self.fleet.session.address.clock.lockstep_time():
            lockstep.want(process, wanted)

    @contextmanager
    def stopped(self, process: str) -> Iterator[None]:
        """Stop a process meanwhile, as if the network to another host hung."""
        pid, participant = self.pid(process), self.fleet.session.participant
        if participant is not None:
            participant.stop(process, math.inf)
            yield
            participant.stop(process, 0.0)
            return
        with self.unwatched():
            os.kill(pid, signal.SIGSTOP)
            try:
                yield
            finally:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGCONT)

    def started_s(self, process: str) -> float:
        """When the process that runs now was started [s]."""
        page = self.fleet.session.address.clock.page
        if page is not None:
            opened = opened_page(page)
            return float(opened.participants[opened.index_of(process)].began_s)
        return self.launcher_of(process).supervisor.children[process].started_s

    @contextmanager
    def unwatched(self) -> Iterator[None]:
        """Let processes hang meanwhile, as if the network to another host did."""
        watched = [each.supervisor for each in self.launchers.values() if each.supervisor.watchdog_on]
        for supervisor in watched:
            supervisor.watchdog_on = False
        try:
            yield
        finally:
            for supervisor in watched:
                supervisor.watchdog_on = True

    def restarts(self, process: str) -> int:
        return self.launcher_of(process).supervisor.children[process].restarts


def fleet_text(
    tracker_port: int | None = None,
    hosts: dict[str, tuple[str, int]] | None = None,
    *,
    simulator: str = "",
    vehicles: str | None = None,
    safety: str = "",
    control: str = 'controller = "cascade"\nhorizon = 30',
    gateway_host: str = "main",
    agent_host: str = "main",
    spares: tuple[str, ...] = (),
    security: str = "",
) -> str:
    """Fleet file of the trio on its own ports, by default on free ones of this computer."""
    tracker_port, hosts = tracker_port or free_port(), hosts or {"main": ("127.0.0.1", free_port())}
    if vehicles is None:
        vehicles = "\n".join(
            f"""
[vehicles.h{number}]
subject = "heli{number}"
host = "{agent_host}"
spares = {list(spares)}
transmitter = {{ port = "radio-h{number}", model_match = {number} }}
{follow}
"""
            for number, follow in (
                (1, ""),
                (2, 'follow = [{ leader = "h1", offset_m = [-0.4, 0.5, 0.0] }]'),
                (3, 'follow = [{ leader = "h1", offset_m = [-0.4, -0.5, 0.0] }]'),
            )
        )
    host_tables = "\n".join(
        f'[hosts.{name}]\naddress = "{address}"\nrouter_port = {port}'
        for name, (address, port) in hosts.items()
    )
    return f"""
name = "lab"
{host_tables}
[security]
{security}
[bus]
namespace = "t{uuid.uuid4().hex[:8]}"
[tracker]
host = "{gateway_host}"
address = "{hosts[gateway_host][0]}:{tracker_port}"
[gateways.transmitters]
host = "{gateway_host}"
[safety]
{safety}
[simulator]
host = "{gateway_host}"
{simulator}
[defaults.control]
{control}
{vehicles}
"""


def cut(fleet: Fleet) -> None:
    """Cut all motors, as far as gateways still run, and leave the fleet."""
    with suppress(*FLIGHT_ERRORS):
        fleet.kill()
    fleet.close()


@contextmanager
def fleets(
    directory: Path, monkeypatch: pytest.MonkeyPatch, *, lockstep: bool = False
) -> Iterator[Callable[..., Flying]]:
    """Start fleets; vehicles that still fly are cut at the end, which saves the time of a landing."""
    script = SCRIPT if lockstep else ""
    with ExitStack() as stack:
        # A short path, because the router's socket lives in it.
        run = stack.enter_context(TemporaryDirectory(prefix="rcopterx-"))
        monkeypatch.setenv("RCOPTERX_RUN", run)

        def start(
            text: str | None = None, *, without: tuple[str, ...] = (), record: bool = False, **options: str
        ) -> Flying:
            if text is None:
                text = fleet_text(**options)
            path = directory / "lab.toml"
            path.write_text(text)
            file = at_speed(load_fleet(path), None, lockstep)
            launchers = {
                host: stack.enter_context(Launcher(file, host, without, record=record, script=script))
                for host in file.hosts
            }
            fleet = Fleet(file, timeout_s=30, process=script)
            flying = Flying(path, fleet, launchers, FlightSampler(fleet.session, only=NEEDED))
            flying.recorder.start()
            stack.callback(flying.check_promises)
            stack.callback(cut, fleet)
            fleet.wait_ready(timeout_s=60)
            return flying

        yield start


class Truth:
    """True states of the simulated laboratory.

    Touchdowns and rest are counted from `start_watch` on, so that a hop while lifting off is not one.
    """

    def __init__(self, flying: Flying) -> None:
        self._inbox = flying.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT)
        self._touchdowns: dict[str, int] = {}
        self._now_s = flying.now_s
        self._slow_since_s = self._now_s()

    def __call__(self, name: str) -> LaboratoryVehicle | None:
        received = self._inbox.latest()
        return None if received is None else received.message.vehicles.get(name)

    def start_watch(self) -> None:
        """Count touchdowns and rest from now on."""
        self._slow_since_s = self._now_s()
        for name in NAMES:
            vehicle = self(name)
            assert vehicle is not None
            self._touchdowns[name] = vehicle.touchdowns

    def assert_none_touched_down(self) -> None:
        for name in NAMES:
            vehicle = self(name)
            assert vehicle is not None
            assert not vehicle.on_floor, name
            assert vehicle.touchdowns == self._touchdowns[name], name

    def rested(self) -> bool:
        """Whether all have been slow for a while, so that the arbiters know the thrust of hover."""
        vehicles = [self(name) for name in NAMES]
        if any(v is None or math.hypot(*v.velocity_m_s) > SLOW_M_S for v in vehicles):
            self._slow_since_s = self._now_s()
        return self._now_s() > self._slow_since_s + REST_S

    def height_m(self, name: str) -> float:
        vehicle = self(name)
        return -1.0 if vehicle is None else vehicle.position_m[2]


def in_lockstep(node: pytest.Item | pytest.Collector) -> bool:
    """Whether tests fly in lockstep, by their marker and the option that overrides it."""
    return node.get_closest_marker("lockstep") is not None and not node.config.getoption("--real-time")


def transmitter_state(flying: Flying, name: str) -> str:
    status = flying.fleet.state_of(name).transmitter
    return "unknown" if status is None else status.state


def land_gently(flying: Flying, truth: Truth) -> None:
    """Land the trio by request; all touch down softly and their transmitters are disarmed."""
    flying.fleet.land()
    flying.fleet.wait_until(
        lambda: all(on_floor(truth, name) for name in NAMES) and all_states(flying, "disarmed"),
        30,
        "not landed",
        NAMES,
    )
    for name in NAMES:
        vehicle = truth(name)
        assert vehicle is not None
        assert vehicle.touchdown_speed_m_s < 1.0


def counter(flying: Flying, name: str, what: str) -> int:
    status = flying.fleet.state_of(name).transmitter
    return 0 if status is None else status.counters.get(what, 0)


def all_states(flying: Flying, *states: str) -> bool:
    return all(transmitter_state(flying, name) in states for name in NAMES)


def on_floor(truth: Truth, name: str) -> bool:
    vehicle = truth(name)
    return vehicle is not None and vehicle.on_floor


def landed_gently(truth: Truth, name: str) -> bool:
    vehicle = truth(name)
    return vehicle is not None and vehicle.on_floor and vehicle.touchdown_speed_m_s < GENTLE_M_S


def at(truth: Truth, name: str, position_m: tuple[float, float, float], tolerance_m: float = 0.12) -> bool:
    vehicle = truth(name)
    return vehicle is not None and np.linalg.norm(np.subtract(vehicle.position_m, position_m)) < tolerance_m


def in_formation(flying: Flying, truth: Truth, tolerance_m: float = 0.1) -> bool:
    """Whether the true places of both followers are those of the fleet file."""
    leader = truth("h1")
    for name in ("h2", "h3"):
        follower = truth(name)
        link = flying.fleet.file.vehicles[name].follow[0]
        if leader is None or follower is None:
            return False
        gap = np.subtract(follower.position_m, leader.position_m) - np.array(link.offset_m)
        if np.linalg.norm(gap) > tolerance_m:
            return False
    return True


def fly_to(flying: Flying, truth: Truth, position_m: tuple[float, float, float]) -> None:
    """Send the leader to a set point and wait for the true formation there.

    A transmitter gateway that holds the leader discards its set point, and its agent refuses one until then;
    it is repeated.
    """
    leader = flying.fleet["h1"]

    def there() -> bool:
        status = leader.state.agent
        astray = status is None or np.linalg.norm(np.subtract(status.set_point.position_m, position_m)) > 1e-3
        if astray and leader.state.phase == "flying":
            with suppress(RefusedError):
                leader.go_to(position_m)
        return at(truth, "h1", position_m)

    flying.fleet.wait_until(there, 40, f"h1 is not at {position_m}", ["h1"])
    flying.fleet.wait_until(lambda: in_formation(flying, truth), 40, "no formation", NAMES)


def fallbacks(flying: Flying, name: str, kind: str) -> int:
    """How often an agent counted something since it was started."""
    status = flying.fleet.state_of(name).agent
    return 0 if status is None else status.diagnostics.fallbacks.get(kind, 0)


def flown_by(flying: Flying, name: str) -> int | None:
    """Process that flies a vehicle now, None without one."""
    status = flying.fleet.state_of(name).agent
    flies = status is not None and status.phase == "flying" and transmitter_state(flying, name) == "armed"
    return status.diagnostics.process if status is not None and flies else None


def wait_for_successor(flying: Flying, name: str, process: int) -> None:
    """Wait until another process than this one flies a vehicle."""
    flying.fleet.wait_until(
        lambda: flown_by(flying, name) not in (None, process), 40, f"{name} is not flown again", [name]
    )


def not_killed(flying: Flying, name: str) -> bool:
    """Whether a vehicle is not killed, or can be reset now: not while its gateway starts, for instance."""
    if transmitter_state(flying, name) == "killed":
        try:
            flying.fleet[name].reset()
        except (RefusedError, RequestFailedError):
            return False
    return True


def of_types(types: Mapping[str, str], ports: Sequence[str]) -> str:
    """Fleet file of three vehicles of these types at these ports; two of them follow the first."""
    vehicles = "\n".join(
        f"""
[vehicles.{name}]
type = "{types[name]}"
subject = "subject-{name}"
transmitter = {{ port = "{port}" }}
{"" if name == "h1" else f'follow = [{{ leader = "h1", offset_m = [-0.4, {side}, 0.0] }}]'}
"""
        for name, port, side in zip(NAMES, ports, (0.0, 0.5, -0.5), strict=True)
    )
    return fleet_text(vehicles=vehicles)
