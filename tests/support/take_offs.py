"""Take-offs without processes: pilots and arbiters as a fleet file makes them, and vehicles of the simulator.

The poses that agents and arbiters get are those of `views`, by subject; the height is the true one.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.pilot import Pilot
from rcopterx.control.interfaces import Measurement
from rcopterx.deploy.roles.agent import pilot_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.vehicle_models import limits_of
from rcopterx.simulator.conditions import PRESETS
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import (
    FLYING,
    NAMES,
    Action,
    ActionRequest,
    CommandInput,
    LinkState,
    PoseInput,
)

SLEW = (20.0, 20.0, 4.0, 8.0)
CONTROL_S = 0.02
View = Callable[[], BodyPose | None]

FILE = """
name = "takeoffs"
[hosts.main]
router_port = 27462
[volume]
min_m = [-1.5, -1.5, 0.0]
max_m = [1.5, 1.5, 2.0]
[tracker]
address = "127.0.0.1:28462"
[simulator]
rate_hz = 50
"""


class TakeOffs:
    """Vehicles on the floor, 1 m apart, in virtual time.

    `types` by vehicle; `rate_hz` is that of the poses, a multiple of 50.
    """

    def __init__(
        self, types: dict[str, str], conditions: str = "helicopter", seed: int = 1, rate_hz: int = 50,
        position_noise_m: float = 0.0003, measured_tilt: bool = True,
    ) -> None:  # fmt: skip
        text = FILE + "".join(
            f'[vehicles.{name}]\ntype = "{kind}"\nsubject = "{name}"\n'
            f'transmitter = {{ port = "radio-{name}" }}\n'
            f"control = {{ estimator_settings = {{ measured_tilt = {str(measured_tilt).lower()} }} }}\n"
            for name, kind in types.items()
        )
        fleet = parse_fleet(text)
        self.names = list(types)
        self.frame_s = 1.0 / rate_hz
        self.frame = 0
        parts = {name: pilot_of(fleet, name) for name in types}
        self.pilots: dict[str, Pilot] = {name: pilot for name, (_, pilot) in parts.items()}
        models = {name: settings.model for name, (settings, _) in parts.items()}
        starts = {name: BodyPose((-0.5 + number, 0.1 * number, 0.0)) for number, name in enumerate(types)}
        self.laboratory = Laboratory(
            models, starts, replace(PRESETS[conditions], position_noise_m=position_noise_m), seed
        )
        self.plants = self.laboratory.plants
        self.arbiters: dict[str, Arbiter] = {}
        for name in types:
            hover = models[name].hover_thrust
            self.arbiters[name] = arbiter = Arbiter(name, limits_of(fleet, name), hover, SLEW)
            arbiter.link(LinkState.READY)
            arbiter.bid(1, 0.0, take_over=False)
        self.measured_tilt = measured_tilt
        self.views: dict[str, View] = {name: partial(self._seen, name) for name in types}
        self.commands: dict[str, Callable[[], tuple[float, ...]]] = {}
        """Inputs of another program instead of those of the pilot."""
        self.radios = {name: name for name in types}
        """Which vehicle each radio moves."""
        self.highest_m = dict.fromkeys(types, 0.0)
        self.hardest_m_s = dict.fromkeys(types, 0.0)
        self._applied: dict[str, list[tuple[str, int, np.ndarray]]] = {name: [] for name in types}
        self._sequence = 0

    def _seen(self, name: str) -> BodyPose:
        pose = self.laboratory.measured_pose(name)
        return pose if self.measured_tilt else BodyPose(pose.position_m, pose.yaw_rad)

    @property
    def now_s(self) -> float:
        return self.frame * self.frame_s

    def arm(self, *names: str) -> None:
        """Arm vehicles after the time with low thrust that it needs."""
        self.run(1.5)
        for name in names or self.names:
            answer = self.arbiters[name].request(ActionRequest(Action.ARM, "operator"), self.now_s)
            assert answer.accepted, answer.reason
        self.run(0.1)

    def take_off(self, *names: str, height_m: float = 1.0) -> None:
        """Arm and begin to take off."""
        self.arm(*names)
        for name in names or self.names:
            assert self.pilots[name].take_off(height_m) is None

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.frame_s)):
            self._advance()

    def lifting_share(self, name: str) -> float:
        """Thrust that lifts a vehicle, which stands, as a share of the hover thrust; infinite for none."""
        plant, hover = self.plants[name], self.pilots[name].model.hover_thrust
        for percent in range(60, round(100.0 / hover)):
            plant.set_input((0.0, 0.0, 0.01 * percent * hover, 0.0))
            plant.advance(0.4)
            if not plant.on_floor:
                return 0.01 * percent
        return math.inf

    def until_flying(self, name: str, limit_s: float) -> float:
        """Run until a vehicle is 0.3 m high; return the time it took, infinite for never."""
        for number in range(round(limit_s / self.frame_s)):
            self._advance()
            if self.plants[name].position_m[2] > 0.3:
                return number * self.frame_s
        return math.inf

    def _advance(self) -> None:
        self.frame += 1
        steps = max(1, round(self.frame_s / 0.005))
        for _ in range(steps):
            self.laboratory.advance(self.frame_s / steps)
            for name, plant in self.plants.items():
                self.highest_m[name] = max(self.highest_m[name], plant.position_m[2])
                self.hardest_m_s[name] = max(self.hardest_m_s[name], plant.touchdown_speed_m_s or 0.0)
        poses = {name: self.views[name]() for name in self.names}
        for arbiter in self.arbiters.values():
            for name, pose in poses.items():
                explained_m = self.arbiters[name].lift_off.explained_m
                arbiter.pose(self._pose_input(name, pose), self.now_s, explained_m)
        controls = self.frame % round(CONTROL_S / self.frame_s) == 0
        for name in self.names:
            self._observe(name, poses[name])
            if controls:
                self._command(name)
            output = self.arbiters[name].step(self.now_s)
            plant = self.plants[self.radios[name]]
            if output.state in FLYING:
                plant.set_input(output.u)
            elif plant.motors_running:
                plant.stop_motors()
            sequence = 0 if output.cause is None else output.cause.sequence
            self._applied[name].append((NAMES[output.state], sequence, np.array(output.u)))

    def _pose_input(self, name: str, pose: BodyPose | None) -> PoseInput:
        if pose is None:
            return PoseInput(name, 1, self.frame, None, self.frame_s)
        tilt_rad = math.acos(math.cos(pose.pitch_rad) * math.cos(pose.roll_rad))
        return PoseInput(name, 1, self.frame, pose.position_m, self.frame_s, pose.yaw_rad, 0.0, tilt_rad)

    def _observe(self, name: str, pose: BodyPose | None) -> None:
        pilot = self.pilots[name]
        for state, sequence, value in self._applied[name]:
            pilot.note_applied(state, sequence, value)
        self._applied[name].clear()
        seen = None if pose is None else Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
        pilot.observe(StampedMeasurement(1, self.frame, self.frame_s, seen))

    def _command(self, name: str) -> None:
        pilot = self.pilots[name]
        if not pilot.ready:
            return
        control = pilot.control({})
        self._sequence += 1
        pilot.sequence = self._sequence
        value, planned = control.input, control.next_inputs
        if name in self.commands:
            value, planned = np.array(self.commands[name]()), np.zeros((0, 4))
        u, next_u = tuple(map(float, value)), [tuple(map(float, row)) for row in planned]
        command = CommandInput(
            1, 1, self._sequence, self.frame, u, next_u, CONTROL_S, self.pilots[name].given_up
        )
        self.arbiters[name].command(command, self.now_s)
