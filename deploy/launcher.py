"""Starts the part of a fleet that belongs to one host, after making sure that it can be started."""

import os
import socket
import threading
from collections import deque
from contextlib import AbstractContextManager
from pathlib import Path

from bus.session import BusUnreachableError
from deploy.fleet import Fleet, FleetError
from deploy.memory import Memory
from deploy.processes import processes_of
from deploy.role_settings import bus_address, check_fleet, tracker_address
from deploy.run_directory import run_directory, serial_path
from deploy.supervisor import Supervisor

WATCH_S = 0.1
EVENTS_KEPT = 200


def check_resources(fleet: Fleet, host: str, directory: Path) -> None:
    """Make sure that addresses are free and serial devices are there.

    Raises
    ------
    FleetError
        Names the field and the address or device.
    """
    place = fleet.hosts[host]
    _check_free(place.address, place.router_port, f"hosts.{host}.router_port")
    if fleet.simulator is not None:
        if fleet.simulator.host == host:
            _check_free(*tracker_address(fleet), "tracker.address")
        return
    for name, vehicle in fleet.vehicles.items():
        if fleet.gateways[vehicle.transmitter.gateway].host != host:
            continue
        device = serial_path(vehicle.transmitter.port, directory)
        where = f"vehicles.{name}.transmitter.port"
        if not device.exists():
            raise FleetError(f"{where}: there is no device {device}")
        if not os.access(device, os.R_OK | os.W_OK):
            raise FleetError(f"{where}: no permission for {device}; is the user in group dialout?")


def _check_free(address: str, port: int, where: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            raise FleetError(
                f"{where}: {address}:{port} cannot be used: {error.strerror}; is the fleet already up?"
            ) from None


class Launcher(AbstractContextManager["Launcher"]):
    """A host's processes under supervision, in a thread of their own.

    Parameters
    ----------
    fleet, fleet_path
        The fleet file, loaded, and where it is.
    host
        Which host this is.

    Raises
    ------
    FleetError
        Something in the file is wrong, an address is in use, a device is missing; nothing was started.
    """

    def __init__(self, fleet: Fleet, fleet_path: Path, host: str) -> None:
        directory = run_directory(fleet.name, fleet.bus.namespace)
        specs = processes_of(fleet, host)
        check_fleet(fleet, directory)
        check_resources(fleet, host, directory)
        self.directory = directory
        self.supervisor = Supervisor(specs, fleet_path, directory / "log")
        self.events: deque[str] = deque(maxlen=EVENTS_KEPT)
        self._fleet = fleet
        self._host = host
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)
        self._memory: Memory | None = None

    def __enter__(self) -> "Launcher":
        self._thread.start()
        own = [name for name, vehicle in self._fleet.vehicles.items() if vehicle.host == self._host]
        try:
            self._memory = Memory(bus_address(self._fleet, self._host), own)
        except BusUnreachableError:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self) -> None:
        # Children are told when the thread that started them ends, so this one starts and stops them all.
        self.supervisor.start_all()
        while not self._stopping.is_set():
            self.events.extend(self.supervisor.watch(WATCH_S))
        self.supervisor.stop_all()

    def stop(self) -> None:
        """Stop every process; gateways bring down what still flies."""
        if self._memory is not None:
            self._memory.close()
            self._memory = None
        self._stopping.set()
        self._thread.join()
