"""Bench of an arbiter and an emulated autopilot."""

from types import SimpleNamespace
from typing import Any

from firmware_bench import FirmwareBench

from rcopterx.radios.mavlink import MavlinkProtocol
from rcopterx.radios.mavlink_settings import MODES, MavlinkSettings
from rcopterx.simulator.autopilot import (
    CONSISTENT_S,
    EmulatedAutopilot,
)
from rcopterx.simulator.plant import BodyPose
from rcopterx.transmitter_gateway.inputs import Action, State

OFFBOARD = MODES["offboard"].reported


WOULD_REFUSE = "the autopilot would refuse to arm: "


class Bench(FirmwareBench):
    """The height follows the motors, and the heading is `yaw_rad`."""

    def __init__(self, **settings: Any) -> None:
        self.settings = MavlinkSettings(**settings)
        self.vehicle = EmulatedAutopilot(self.settings)
        self.yaw_rad = 0.0
        super().__init__(self.vehicle, MavlinkProtocol(self.settings), low_s=1.0)

    @property
    def pulses_us(self) -> tuple[float, ...]:
        outputs = self.vehicle.take_outputs()
        self._pulses = outputs[-1][1] if outputs else self._pulses
        return self._pulses

    @property
    def motors_run(self) -> bool:
        return self.pulses_us[0] > 1100.0

    def live(self) -> None:
        height_m = 0.8 if self.motors_run else 0.0
        body: Any = SimpleNamespace(pose=BodyPose((0.0, 0.0, height_m), self.yaw_rad))
        self.vehicle.sense(body)
        super().live()

    def fly(self) -> None:
        boots_s = 0.0 if self.settings.mode == "offboard" else CONSISTENT_S
        assert not any(self.run(max(2.5, boots_s + 1.5 - self.now_s), 0.0))
        assert self.request(Action.ARM), self.module
        self.run(3.5)
        assert self.state is State.ARMED, self.module
        assert self.motors_run
        assert (self.vehicle.armed, self.vehicle.mode) == (True, MODES[self.settings.mode].reported)
