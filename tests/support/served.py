"""An emulated vehicle behind a UDP port that a thread serves."""

import threading
import time
from select import select

from rcopterx.radios.udp import udp_address
from rcopterx.simulator.vehicle_udp import UdpVehicle, VehicleUdp
from support.udp import udp_paths


class Served:
    def __init__(self, vehicle: UdpVehicle) -> None:
        [self.path] = udp_paths(1)
        self._radio = VehicleUdp(udp_address(self.path), vehicle)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._ending.is_set():
            select([self._radio.fileno()], [], [], 0.02)
            self._radio.receive(time.monotonic())
            self._radio.advance(time.monotonic())

    def end(self) -> None:
        self._ending.set()
        self._thread.join()
        self._radio.unplug()
