"""The coaxial helicopter with stabilizer bar as a plant: servos, markers and state around its dynamics.

To fly one by itself, without weather and delay::

    calm = replace(IDEAL, transport_delay_s=0.0)
    plant = Helicopter("h1", COAXIAL, calm, 0, Pose((0.0, 0.0, 1.0)), HelicopterParameters.nominal())
    plant.set_input((0.1, 0.0, 0.545, 0.0))
    plant.advance(0.02)
    plant.motion, plant.pose, plant.marker_pose, plant.state, plant.parameters
"""

import math

import numpy as np
from msgspec import structs

from rcopterx.native.helicopter import STATE_SIZE, helicopter_flight
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.disturbance import PARAMETERS, TURBULENCE, ColouredNoise, random_stream
from rcopterx.simulator.helicopter_dynamics import HelicopterDynamics, State, level_state
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import CALM, Plant, Pose
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tuples import Four


def helicopter_of(name: str, conditions: Conditions, seed: int) -> HelicopterParameters:
    """Parameters of a vehicle: the middle of the family, or a vehicle drawn from it.

    Parameters
    ----------
    name
        Selects the vehicle's stream of randomness.
    conditions
        Their `coaxial_plant` says which.
    seed
        Seed of the laboratory.

    Returns
    -------
    HelicopterParameters
        The true parameters.
    """
    if conditions.coaxial_plant == "drawn_helicopter":
        return HelicopterParameters.drawn(random_stream(seed, name, PARAMETERS))
    return HelicopterParameters.nominal()


def still_air(generator: np.random.Generator) -> ColouredNoise:
    """Turbulence of nothing, for ever."""
    air = ColouredNoise(CALM, 1.0, math.inf, generator)
    air.value[:] = 0.0
    return air


class Servo:
    """Resolution and dead band of a servo: it moves to a position of its grid, once that is worth moving.

    Parameters
    ----------
    step
        Distance of its positions; commands at most this far from where it is leave it there.
    """

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

    Public besides what every plant has: `parameters` (the true ones) and `state`, of `helicopter_dynamics`.
    The model tells nothing but the transport delay and the thrust stick to start with.

    Parameters
    ----------
    name, model, conditions, seed, start
        See `Plant`.
    parameters
        The vehicle.

    Raises
    ------
    ValueError
        If the start pose is not finite or below the floor.
    """

    def __init__(
        self, name: str, model: Model, conditions: Conditions, seed: int, start: Pose,
        parameters: HelicopterParameters,
    ) -> None:  # fmt: skip
        self.parameters = parameters
        self._dynamics = HelicopterDynamics(parameters)
        self._servos = Servo(parameters.servo_step), Servo(parameters.servo_step)
        self._markers = Pose(
            (0.0, 0.0, 0.0), 0.0, parameters.marker_pitch_rad, parameters.marker_roll_rad
        ).quaternion_xyzw
        self._throttle: tuple[float, float] | None = None
        self._command(None)
        self._flown = np.zeros(STATE_SIZE)
        super().__init__(name, model, conditions, seed, start)
        self._air = self._weather or still_air(random_stream(seed, name, TURBULENCE))
        self._world = np.array(
            (
                conditions.battery_endurance_s,
                conditions.battery_sag,
                *conditions.volume_min_m,
                *conditions.volume_max_m,
                self._air.keep,
                self._air.grid_s,
            )
        )

    @property
    def motion(self) -> tuple[float, ...]:
        """True motion state in the order of `rcopterx.vehicles.state`, eight numbers, yaw unwrapped."""
        x, y, z, vx, vy, vz, w, i, j, k, _, q, r = self.state[:13]
        c, s = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        r21, r22 = 2 * (j * k + w * i), 1 - 2 * (i * i + j * j)
        yaw_rate = (q * r21 + r * r22) / max(r21 * r21 + r22 * r22, 1e-6)
        return (x, y, z, self._yaw_rad, c * vx + s * vy, c * vy - s * vx, vz, yaw_rate)

    @property
    def pose(self) -> Pose:
        """True pose of the body, yaw unwrapped."""
        w, x, y, z = self.state[6:10]
        return self._pose_with(w, x, y, z)

    @property
    def marker_pose(self) -> Pose:
        """Pose of the markers, which do not sit straight on the body, yaw unwrapped."""
        w, x, y, z = self.state[6:10]
        i, j, k, s = self._markers
        turned = self._pose_with(
            w * s - x * i - y * j - z * k,
            w * i + x * s + y * k - z * j,
            w * j + y * s + z * i - x * k,
            w * k + z * s + x * j - y * i,
        )
        up_m = self.parameters.marker_height_m
        if up_m == 0.0:
            return turned
        axis = 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
        x_m, y_m, z_m = (centre + up_m * part for centre, part in zip(turned.position_m, axis, strict=True))
        return structs.replace(turned, position_m=(x_m, y_m, z_m))

    def _pose_with(self, w: float, x: float, y: float, z: float) -> Pose:
        yaw = math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
        return Pose(
            (self.state[0], self.state[1], self.state[2]),
            self._yaw_rad + math.remainder(yaw - self._yaw_rad, math.tau),
            math.asin(max(-1.0, min(1.0, 2 * (w * y - x * z)))),
            math.atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )

    def _rest(self, pose: Pose) -> None:
        self._yaw_rad = pose.yaw_rad
        speeds = (0.0, 0.0)
        if self._throttle is not None:
            speeds = self._dynamics.commanded_speeds(*self._throttle, 0.0, self._thrust_factor)
        self._level(pose.position_m, (*speeds, *self._swash))

    def _level(self, position_m: tuple[float, float, float], actuators: Four) -> None:
        speed_upper, speed_lower, swash_x, swash_y = actuators
        upright = level_state(position_m, self._yaw_rad, (speed_upper, speed_lower))
        self.state: State = (*upright[:18], swash_x, swash_y)
        self._flown[:] = self.state

    @property
    def _actuators(self) -> Four:
        return self.state[13], self.state[14], self.state[18], self.state[19]

    def _command(self, sticks: Four | None) -> None:
        pitch, roll, thrust, yaw = sticks or CALM
        trim = self.parameters.trim
        self._throttle = None if sticks is None else (thrust + trim[2], yaw + trim[3])
        self._swash = self._dynamics.swash_target(
            self._servos[0].move(pitch) + trim[0], self._servos[1].move(roll) + trim[1]
        )

    def _stand(self, step_s: float) -> None:
        x, y = self.state[:2]
        self.state = self._dynamics.step(
            self.state, step_s, self._swash, self._throttle, self._thrust_factor, CALM
        )
        self._level((x, y, 0.0), self._actuators)

    def _fly_on(self, count: int, step_s: float) -> int:
        air, flown = self._air, self._flown
        air.provide()
        (
            done, self._time_s, self._yaw_rad, self._hover_seconds_used, self._thrust_factor, landed, outside,
            air.index, air.place,
        ) = helicopter_flight(
            self._dynamics.numbers, self._world, flown, air.value, air.renewal, air.normals, self._yaw_rad,
            self._time_s, step_s, count, self._hover_seconds_used, self._load, self.faults.thrust_factor,
            self.downwash_m_s2, air.index, air.place, self._swash, self._throttle is not None,
            self._throttle or (0.0, 0.0),
        )  # fmt: skip
        self.state = tuple(flown.tolist())
        self.turbulence = tuple(air.value.tolist())
        self.left_volume = self.left_volume or outside
        if landed:
            self._touch_down(-self.state[5])
        return done

    def _land(self) -> None:
        self._level((self.state[0], self.state[1], 0.0), self._actuators)

    def _thrust_m_s2(self) -> float:
        thrust_n = self._dynamics.thrust_n(self.state[13], self.state[14], 0.0)
        return thrust_n / self.parameters.mass_kg

    def _whereabouts(self) -> Four:
        return self.state[0], self.state[1], self.state[2], self.state[5]
