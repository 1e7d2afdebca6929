"""The coaxial helicopter with stabilizer bar (docs/helicopter.md) as a plant: servos, markers, state."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import COUNT, NUMBER, compiled, record, together
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.disturbance import (
    GYRO,
    HELD_NOISE,
    PARAMETERS,
    ColouredNoise,
    HeldNoise,
    random_stream,
    value_at,
)
from rcopterx.simulator.helicopter_dynamics import (
    AIRFRAME,
    CONTROLS,
    STATE,
    Airframe,
    Controls,
    HelicopterState,
    airframe_of,
    commanded_speeds,
    level_state,
    rotor_thrusts,
    step,
    swash_target,
)
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import CALM, BodyPose, Plant
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tuples import Four, Three

DRIFT_S: Final = 60.0  # correlation time of the drift of a gyro
_DRAWN: Final = MappingProxyType(
    {"drawn_helicopter": HelicopterParameters.drawn, "drawn_coax": HelicopterParameters.drawn_coax}
)
STILL_AIR: Final[HeldNoise] = np.zeros((1, 4)), 0, math.inf


def helicopter_of(name: str, conditions: Conditions, seed: int) -> HelicopterParameters:
    """Parameters of a vehicle: the middle of the family, or one drawn by name and seed (conditions)."""
    draw = _DRAWN.get(conditions.coaxial_plant)
    vehicle = HelicopterParameters.nominal() if draw is None else draw(random_stream(seed, name, PARAMETERS))
    return replace(vehicle, yaw_hold_per_s=conditions.gyro_hold_per_s)


class Surroundings(NamedTuple):
    """Battery, faults, downwash and flight volume."""

    battery_endurance_s: float
    battery_sag: float
    load: float  # consumption from the battery as a fraction of that of hovering
    thrust_factor: float  # thrust that faults leave, as a fraction
    downwash_m_s2: float
    tilting_rad_s2: tuple[float, float]  # of the tilt towards inertial x and y, by slopes of downwash
    volume_min_m: Three
    volume_max_m: Three


_THREE: Final = together(*3 * [NUMBER])
_SURROUNDINGS: Final = record(Surroundings, *5 * [NUMBER], together(NUMBER, NUMBER), _THREE, _THREE)


@compiled(AIRFRAME, STATE, CONTROLS, NUMBER, NUMBER)
def stand(
    airframe: Airframe, state: HelicopterState, controls: Controls, thrust_factor: float, step_s: float
) -> tuple[HelicopterState, float]:
    """One step on the floor, where only rotors and swash plate move; returns the state and the thrust."""
    after = step(airframe, state, controls, thrust_factor, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), step_s)
    upper, lower = rotor_thrusts(airframe, after.speed_upper, after.speed_lower, 0.0)
    standing = HelicopterState(
        state.x, state.y, state.z, 0.0, 0.0, 0.0, state.qw, state.qx, state.qy, state.qz, 0.0, 0.0, 0.0,
        after.speed_upper, after.speed_lower, 0.0, 0.0, 1.0, after.swash_x, after.swash_y, 0.0,
    )  # fmt: skip
    return standing, upper + lower


@compiled(
    AIRFRAME, together(STATE, NUMBER, NUMBER, NUMBER), CONTROLS, _SURROUNDINGS, HELD_NOISE, NUMBER, COUNT
)
def fly(
    airframe: Airframe,
    start: tuple[HelicopterState, float, float, float],
    controls: Controls,
    around: Surroundings,
    turbulence: HeldNoise,
    step_s: float,
    count: int,
) -> tuple[int, tuple[HelicopterState, float, float, float], bool, bool]:
    """Fly `count` steps, or until the floor, from state, unwrapped heading, time and hover seconds used.

    Returns the number of steps, the same at their end, whether it landed, and whether it left the volume.
    """
    state, yaw_rad, time_s, used_s = start
    landed, left_volume = False, False
    low, high = around.volume_min_m, around.volume_max_m
    steps = 0
    while steps < count and not landed:
        used_s += step_s * around.load
        battery = 1.0 - around.battery_sag * min(used_s / around.battery_endurance_s, 1.0)
        x, y, z, yaw = value_at(turbulence, time_s + step_s / 2)
        tilt_x, tilt_y = around.tilting_rad_s2
        air = (x, y, z - around.downwash_m_s2, yaw, tilt_x, tilt_y)
        state = step(airframe, state, controls, battery * around.thrust_factor, air, step_s)
        heading = math.atan2(
            2 * (state.qx * state.qy + state.qw * state.qz), 1 - 2 * (state.qy**2 + state.qz**2)
        )
        yaw_rad = heading + math.tau * round((yaw_rad - heading) / math.tau)
        landed = state.z <= 0.0 and state.vz < 0.0
        inside = (
            low[0] <= state.x <= high[0] and low[1] <= state.y <= high[1] and low[2] <= state.z <= high[2]
        )
        left_volume = left_volume or not inside
        time_s += step_s
        steps += 1
    return steps, (state, yaw_rad, time_s, used_s), landed, left_volume


class Servo:
    """Resolution and dead band of a servo; commands at most `step` from its position leave it there."""

    def __init__(self, step: float) -> None:
        self._step = step
        self._position = 0.0

    def move(self, command: float) -> float:
        """Position that the servo goes to after a command."""
        if self._step == 0.0:
            return command
        if abs(command - self._position) > self._step * (1 + 1e-9):
            self._position = round(command / self._step) * self._step
        return self._position


class Helicopter(Plant):
    """A coaxial helicopter with stabilizer bar (docs/helicopter.md).

    Public besides the members of every plant: `parameters` (the true ones) and `state`, of
    `helicopter_dynamics`. Of the model it uses the transport delay, and the thrust stick to start with.
    """

    def __init__(
        self, name: str, model: Model, conditions: Conditions, seed: int, start: BodyPose,
        parameters: HelicopterParameters,
    ) -> None:  # fmt: skip
        self.parameters = parameters
        self._airframe = airframe_of(parameters)
        self.state = level_state((0.0, 0.0, 0.0), 0.0, (0.0, 0.0))
        self._tilt_per_slope = parameters.tilt_per_slope
        self._servos = Servo(parameters.servo_step), Servo(parameters.servo_step)
        self._markers = BodyPose(
            (0.0, 0.0, 0.0), 0.0, parameters.marker_pitch_rad, parameters.marker_roll_rad
        ).quaternion_xyzw
        drift = conditions.gyro_drift_rad_s / parameters.yaw_rate_gain_rad_s
        self._drift = ColouredNoise((drift,), DRIFT_S, 1.0, random_stream(seed, name, GYRO))
        own_s = model.delay_s if parameters.delay_s is None else parameters.delay_s
        super().__init__(name, replace(model, delay_s=own_s), conditions, seed, start)

    @property
    def motion(self) -> tuple[float, ...]:
        """True motion state in the order of `rcopterx.vehicles.state`, eight numbers, yaw unwrapped."""
        s = self.state
        cosine, sine = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        r21, r22 = 2 * (s.qy * s.qz + s.qw * s.qx), 1 - 2 * (s.qx * s.qx + s.qy * s.qy)
        yaw_rate = (s.q * r21 + s.r * r22) / max(r21 * r21 + r22 * r22, 1e-6)
        forward, left = cosine * s.vx + sine * s.vy, cosine * s.vy - sine * s.vx
        return (s.x, s.y, s.z, self._yaw_rad, forward, left, s.vz, yaw_rate)

    @property
    def pose(self) -> BodyPose:
        """True pose of the body, yaw unwrapped."""
        s = self.state
        return self._pose((s.x, s.y, s.z), s.qw, s.qx, s.qy, s.qz)

    @property
    def marker_pose(self) -> BodyPose:
        """Pose of the markers, which do not sit straight on the body, yaw unwrapped."""
        state = self.state
        w, x, y, z = state.qw, state.qx, state.qy, state.qz
        i, j, k, s = self._markers
        return self._pose(
            (state.x, state.y, state.z),
            w * s - x * i - y * j - z * k,
            w * i + x * s + y * k - z * j,
            w * j + y * s + z * i - x * k,
            w * k + z * s + x * j - y * i,
        )

    def _pose(self, position_m: Three, w: float, x: float, y: float, z: float) -> BodyPose:
        yaw = math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
        return BodyPose(
            position_m,
            self._yaw_rad + math.remainder(yaw - self._yaw_rad, math.tau),
            math.asin(max(-1.0, min(1.0, 2 * (w * y - x * z)))),
            math.atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )

    def _settle(self) -> None:
        controls, upper, lower = self._controls, 0.0, 0.0
        if controls.running:
            upper, lower = commanded_speeds(
                self._airframe, controls.thrust, controls.yaw, 0.0, self._thrust_factor
            )
        self.state = self.state._replace(
            speed_upper=upper, speed_lower=lower, swash_x=controls.swash_x, swash_y=controls.swash_y
        )

    def _stop(self, position_m: Three, yaw_rad: float) -> None:
        state, self._yaw_rad = self.state, yaw_rad
        level = level_state(position_m, yaw_rad, (state.speed_upper, state.speed_lower))
        self.state = level._replace(swash_x=state.swash_x, swash_y=state.swash_y)

    def _command(self, sticks: Four | None) -> None:
        pitch, roll, thrust, yaw = sticks or CALM
        trim_pitch, trim_roll, trim_thrust, trim_yaw = self.parameters.trim
        swash = swash_target(
            self.parameters, self._servos[0].move(pitch) + trim_pitch, self._servos[1].move(roll) + trim_roll
        )
        (drift,) = self._drift.at(self.time_s)
        self._controls = Controls(*swash, sticks is not None, thrust + trim_thrust, yaw + trim_yaw + drift)

    def _stand(self, step_s: float) -> float:
        self.state, thrust_n = stand(self._airframe, self.state, self._controls, self._thrust_factor, step_s)
        return thrust_n / self.parameters.mass_kg

    def _fly_on(self, count: int, step_s: float) -> int:
        conditions, wake = self._conditions, self.wake
        battery = conditions.battery_endurance_s, conditions.battery_sag
        tilting = self._tilt_per_slope * wake.slope_x_per_s2, self._tilt_per_slope * wake.slope_y_per_s2
        volume = conditions.volume_min_m, conditions.volume_max_m
        left = self.faults.thrust_factor
        around = Surroundings(*battery, self.load, left, wake.down_m_s2, tilting, *volume)
        turbulence = STILL_AIR
        if self._weather is not None:
            turbulence = self._weather.between(self.time_s, self.time_s + count * step_s)
        start = self.state, self._yaw_rad, self.time_s, self._hover_seconds_used
        steps, end, landed, left_volume = fly(
            self._airframe, start, self._controls, around, turbulence, step_s, count
        )
        self.state, self._yaw_rad, self.time_s, used_s = end
        self._use_battery(used_s - self._hover_seconds_used)
        self.left_volume = self.left_volume or left_volume
        if landed:
            self._touch_down(-self.state.vz)
        return steps
