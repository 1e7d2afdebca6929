"""What integration tests share: fleet files on free ports, process ids, and the truth of the laboratory."""

import math
import os
import signal
import socket
import time
import uuid
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bus import channels
from bus.messages import LaboratoryVehicle
from deploy.launcher import Launcher
from ground_station.fleet import Fleet

NAMES = ("h1", "h2", "h3")
GENTLE_M_S = 1.7
SLOW_M_S = 0.15
THROTTLE_LOW_US = 1100


def free_port(address: str = "127.0.0.1") -> int:
    with socket.socket() as probe:
        probe.bind((address, 0))
        return int(probe.getsockname()[1])


@dataclass
class Flying:
    """A fleet that is up: its launchers by host and the scripting interface."""

    path: Path
    fleet: Fleet
    launchers: dict[str, Launcher]

    def launcher_of(self, process: str) -> Launcher:
        return next(
            launcher for launcher in self.launchers.values() if process in launcher.supervisor.children
        )

    def pid(self, process: str) -> int:
        pid = self.launcher_of(process).supervisor.pid(process)
        assert pid is not None, f"{process} does not run"
        return pid

    def wait_for_spare(self, process: str) -> None:
        """Wait until a warm process could replace this one."""
        supervisor = self.launcher_of(process).supervisor
        self.fleet.wait_until(lambda: supervisor.spare_ready, 20, "no spare process")

    def kill(self, process: str) -> int:
        """SIGKILL a process of the fleet; returns the pid it had."""
        pid = self.pid(process)
        os.kill(pid, signal.SIGKILL)
        return pid

    def started_s(self, process: str) -> float:
        """When the process that runs now was started [monotonic s]."""
        return self.launcher_of(process).supervisor.children[process].started_s

    def restarts(self, process: str) -> int:
        return self.launcher_of(process).supervisor.children[process].restarts


def fleet_text(
    tracker_port: int,
    hosts: dict[str, tuple[str, int]],
    *,
    simulator: str = "",
    vehicles: str | None = None,
    safety: str = "",
    control: str = 'controller = "cascade"\nhorizon = 30',
    gateway_host: str = "main",
    agent_host: str = "main",
) -> str:
    """Fleet file of the trio on its own ports."""
    if vehicles is None:
        vehicles = "\n".join(
            f"""
[vehicles.h{number}]
subject = "heli{number}"
host = "{agent_host}"
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


class Truth:
    """True states of the simulated laboratory.

    Touchdowns are counted from `start_watch` on, so that a hop while lifting off is not one.
    """

    def __init__(self, flying: Flying) -> None:
        self._inbox = flying.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT)
        self._touchdowns: dict[str, int] = {}
        self._slow_since_s = time.monotonic()

    def __call__(self, name: str) -> LaboratoryVehicle | None:
        received = self._inbox.latest()
        return None if received is None else received.message.vehicles.get(name)

    def start_watch(self) -> None:
        """From now on nobody may touch the floor."""
        for name in NAMES:
            vehicle = self(name)
            assert vehicle is not None
            self._touchdowns[name] = vehicle.touchdowns

    def assert_nobody_touched_down(self) -> None:
        for name in NAMES:
            vehicle = self(name)
            assert vehicle is not None
            assert not vehicle.on_floor, name
            assert vehicle.touchdowns == self._touchdowns[name], name

    def rested(self) -> bool:
        """Whether all have been slow for a second: the arbiters have learnt what a hover needs."""
        vehicles = [self(name) for name in NAMES]
        if any(v is None or math.hypot(*v.velocity_m_s) > SLOW_M_S for v in vehicles):
            self._slow_since_s = time.monotonic()
        return time.monotonic() > self._slow_since_s + 1.0

    def height_m(self, name: str) -> float:
        vehicle = self(name)
        return -1.0 if vehicle is None else vehicle.position_m[2]


def transmitter_state(flying: Flying, name: str) -> str:
    status = flying.fleet.state_of(name).transmitter
    return "unknown" if status is None else status.state


def land_gently(flying: Flying, truth: Truth) -> None:
    """Land the trio by request; everybody touches down softly and its transmitter knows."""
    flying.fleet.land()
    for name in NAMES:
        vehicle = truth(name)
        assert vehicle is not None
        assert vehicle.on_floor
        assert vehicle.touchdown_speed_m_s < 1.0
        assert transmitter_state(flying, name) in ("disarmed", "armed")


class RadioLog:
    """Frames that reached the radio modules, with the time of their arrival."""

    def __init__(self, flying: Flying) -> None:
        self._inbox = flying.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=4096)
        self._frames: dict[str, list[tuple[float, float]]] = {name: [] for name in NAMES}

    def frames(self, name: str) -> list[tuple[float, float]]:
        """Arrival time [s] and throttle [us] of all frames so far."""
        for received in self._inbox.drain():
            for unit, vehicle in received.message.vehicles.items():
                self._frames[unit] += [(frame[0], frame[1]) for frame in vehicle.radio]
        return self._frames[name]

    def throttles(self, name: str, from_s: float, until_s: float = math.inf) -> list[float]:
        """Pulse widths [us] in a time [monotonic s]."""
        return [throttle for at_s, throttle in self.frames(name) if from_s <= at_s < until_s]


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
