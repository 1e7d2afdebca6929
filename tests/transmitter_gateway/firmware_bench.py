"""A transmitter and the emulated firmware of its vehicle, without sockets and in virtual time."""

import math
from collections import Counter

from rcopterx.radios.battery import NO_LIMITS, BatteryLimits
from rcopterx.radios.calibration import ArmingChannel, Calibration
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.set_points import SetPointRadio
from rcopterx.simulator.vehicle_udp import UdpVehicle
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, CommandInput, PoseInput, State
from rcopterx.transmitter_gateway.port import Port, WriteOutcome
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.transmitter import Transmitter


class Air(Port):
    """A port whose datagrams reach the vehicle at once."""

    def __init__(self, vehicle: UdpVehicle, protocol: SetPointRadio) -> None:
        self.path, self.problem, self.counters = "air", "closed", Counter()
        self._vehicle, self._protocol = vehicle, protocol
        self.answers: list[bytes] = []
        self.full: str | None = None

    @property
    def overload(self) -> str | None:
        return self.full

    @property
    def is_open(self) -> bool:
        return self.problem is None

    @property
    def next_attempt_s(self) -> float:
        return math.inf if self.is_open else -math.inf

    def fileno(self) -> int | None:
        return None

    def service(self, now_s: float) -> bool:
        opened, self.problem = not self.is_open, None
        return opened

    def _write(self, frame: bytes, now_s: float) -> WriteOutcome:
        for packet in self._protocol.separated(frame):
            self.answers += self._vehicle.receive(packet, now_s)
        return WriteOutcome.WRITTEN

    def read_available(self, now_s: float) -> bytes:
        answers, self.answers = self.answers, []
        return self._protocol.joined(answers)

    def close(self) -> None:
        self.problem = "closed"


class FirmwareBench:
    """A vehicle that is seen at 0.8 m, and a command of 0.1 pitch and some thrust in each period."""

    def __init__(
        self,
        vehicle: UdpVehicle,
        protocol: SetPointRadio,
        low_s: float = 0.1,
        battery: BatteryLimits = NO_LIMITS,
    ) -> None:
        self.firmware, self._low_s, self._battery = vehicle, low_s, battery
        self.connect(protocol)
        self.now_s = 0.0
        self.height_m = 0.8
        self.sequence = 0
        self.lease = self.transmitter.bid(1, 0.0, take_over=False)

    def connect(self, protocol: SetPointRadio) -> None:
        """Connect a new gateway."""
        self.air = Air(self.firmware, protocol)
        calibration = Calibration(arming=ArmingChannel(4, low_s=self._low_s))
        self.transmitter = Transmitter(
            TransmitterSettings("c1", "air", protocol, calibration, ArbiterLimits(), self._battery), self.air
        )

    @property
    def motors_run(self) -> bool:
        raise NotImplementedError

    @property
    def state(self) -> State:
        return self.transmitter.arbiter.state

    @property
    def module(self) -> str:
        return self.transmitter.link(self.now_s).text

    def live(self) -> None:
        """Do what the firmware does by itself."""
        self.firmware.advance(self.now_s)
        self.air.answers += self.firmware.reports(self.now_s)

    def run(self, seconds: float, thrust: float | None = 0.6, *, seen: bool = True) -> list[bool]:
        """Fly for some time; return for every period whether the motors run."""
        running = []
        for _ in range(round(seconds / 0.02)):
            self.now_s += 0.02
            self.sequence += 1
            if seen:
                pose = PoseInput("c1", 1, self.sequence, (0.0, 0.0, self.height_m), 0.02, 0.0)
                self.transmitter.on_pose(pose, self.now_s)
            if thrust is not None:
                u = (0.1, 0.0, thrust, 0.0)
                command = CommandInput(self.lease, 1, self.sequence, self.sequence, u)
                self.transmitter.on_command(command, self.now_s)
            self.transmitter.on_readable(self.now_s)
            self.transmitter.tick(self.now_s)
            self.live()
            running.append(self.motors_run)
        return running

    def request(self, action: Action) -> bool:
        return self.transmitter.request(ActionRequest(action, "operator"), self.now_s).accepted
