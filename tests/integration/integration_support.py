"""What integration tests share: fleet files on free ports, process ids, and the truth of the laboratory."""

import os
import signal
import socket
import uuid
from dataclasses import dataclass
from pathlib import Path

from bus import channels
from bus.messages import LaboratoryVehicle
from deploy.launcher import Launcher
from ground_station.fleet import Fleet

NAMES = ("h1", "h2", "h3")


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
    control: str = 'controller = "paper"\nhorizon = 30',
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
