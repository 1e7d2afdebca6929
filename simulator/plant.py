"""One simulated vehicle: the continuous nonlinear model (1) between its sticks and its pose.

Plain floats instead of small arrays: one substep costs a few microseconds, so that ten vehicles fly in real
time on a few per cent of a core and experiments run hundreds of times faster than real time.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from simulator.conditions import Conditions, Four, Three
from simulator.disturbance import PARAMETERS, TURBULENCE, ColouredNoise, random_stream
from vehicles.model import Model
from vehicles.quadrotor import QUADROTOR, thrust_acceleration, tilt_limit_rad
from vehicles.state import Array

_NOTHING: Four = (0.0, 0.0, 0.0, 0.0)
_TIME_TOLERANCE_S = 1e-9


@dataclass(frozen=True, slots=True)
class Pose:
    """Position of a vehicle's origin in the inertial frame, and its attitude.

    Attributes
    ----------
    position_m
        x, y, z.
    yaw_rad, pitch_rad, roll_rad
        Rotations about z, then body y, then body x. As z points up, positive pitch is nose down.
    """

    position_m: Three
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @property
    def quaternion_xyzw(self) -> Four:
        """Rotation from the body to the inertial frame as a unit quaternion, vector part first."""
        cy, sy = math.cos(self.yaw_rad / 2), math.sin(self.yaw_rad / 2)
        cp, sp = math.cos(self.pitch_rad / 2), math.sin(self.pitch_rad / 2)
        cr, sr = math.cos(self.roll_rad / 2), math.sin(self.roll_rad / 2)
        return (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )


def specimen(model: Model, conditions: Conditions, generator: np.random.Generator) -> tuple[Model, Four]:
    """Draw the true parameters of one vehicle of a type.

    Parameters
    ----------
    model
        Nominal parameters.
    conditions
        Mismatch fractions, trim offset, and whether there are lags at all.
    generator
        Source of randomness; the same amount is drawn whatever is switched on.

    Returns
    -------
    tuple
        The model with true b, k and lags, and the trim offset of each input.
    """
    b, k, lag, trim = generator.uniform(-1.0, 1.0, (4, 4))
    lag_s = model.lag_s * (1 + conditions.lag_mismatch * lag)
    true = replace(
        model,
        input_gain=_four(model.b * (1 + conditions.parameter_mismatch * b)),
        damping=_four(model.k * (1 + conditions.parameter_mismatch * k)),
        lag_s=_four(lag_s) if conditions.actuator_lag else _NOTHING,
    )
    return true, _four(conditions.trim_offset * trim)


class Plant:
    """A vehicle that flies: actuators, rigid-body motion, weather, battery and floor.

    Public besides its methods: `model` and `trim` (the true parameters), `turbulence` (acting accelerations,
    inertial x, y, z and yaw), `on_floor`, `touchdowns`, `touchdown_speed_m_s` (of the last one, None before),
    `motors_running`, and `left_volume` (ever since the start or the last `place`).

    It starts standing with motors stopped if the start pose is on the floor (z = 0), else hovering at rest.
    On the floor it neither slides nor yaws; it leaves when its thrust exceeds its weight.

    Parameters
    ----------
    name
        Selects the vehicle's streams of randomness.
    model
        Nominal parameters; the true ones are drawn around them.
    conditions
        How real the laboratory is.
    seed
        Seed of the laboratory.
    start
        Pose at time 0; z not negative.

    Raises
    ------
    ValueError
        If the start pose is not finite or below the floor.
    """

    def __init__(self, name: str, model: Model, conditions: Conditions, seed: int, start: Pose) -> None:
        self._name = name
        self._conditions = conditions
        self._nominal = model
        self.model, self.trim = specimen(model, conditions, random_stream(seed, name, PARAMETERS))
        self._tilt_limit_rad = tilt_limit_rad(self.model) if model.kind == QUADROTOR.kind else 0.0
        turbulence = random_stream(seed, name, TURBULENCE)
        self._weather = (
            ColouredNoise(
                conditions.turbulence_rms,
                conditions.turbulence_correlation_s,
                conditions.substep_s,
                turbulence,
            )
            if any(conditions.turbulence_rms)
            else None
        )
        delay_s = conditions.transport_delay_s
        self._delay_s = model.delay_s if delay_s is None else delay_s
        self._time_s = 0.0
        self._hover_seconds_used = 0.0
        self._lag_rates = _four([1 / lag if lag > 0 else math.inf for lag in self.model.lag_s])
        self._set_step(conditions.substep_s)
        self.place(start)

    def place(self, pose: Pose) -> None:
        """Put the vehicle somewhere at rest, as by hand: battery, weather and time go on.

        Parameters
        ----------
        pose
            Where to; position and yaw count. On the floor the motors stop, above it the vehicle hovers.

        Raises
        ------
        ValueError
            If the pose is not finite or below the floor.
        """
        x, y, z = pose.position_m
        if not all(map(math.isfinite, (x, y, z, pose.yaw_rad))) or z < 0:
            raise ValueError(f"{self._name}: cannot be placed at {pose}: allowed are finite numbers, z >= 0")
        self._motion = (x, y, z, pose.yaw_rad, 0.0, 0.0, 0.0, 0.0)
        self.on_floor = z == 0.0
        self.turbulence: tuple[float, ...] = _NOTHING
        self.touchdowns = 0
        self.touchdown_speed_m_s: float | None = None
        self.left_volume = False
        self.motors_running = not self.on_floor
        self._pending: deque[tuple[float, Four | None]] = deque()
        self._target: Four = _NOTHING
        if not self.on_floor:
            self._apply(_four(self._nominal.hover_input))
        self._actuator = self._target
        self._sag = self.thrust_factor

    @property
    def time_s(self) -> float:
        """Time flown since the start."""
        return self._time_s

    @property
    def motion(self) -> tuple[float, ...]:
        """True motion state in the order of `vehicles.state`, eight numbers, yaw unwrapped."""
        return self._motion

    @property
    def pose(self) -> Pose:
        """True pose, yaw unwrapped."""
        x, y, z, yaw = self._motion[:4]
        pitch, roll = self._attitude(self._actuator)
        return Pose((x, y, z), yaw, pitch, roll)

    @property
    def thrust_factor(self) -> float:
        """Thrust gain that the battery has left, as a fraction of the full battery's."""
        used = min(self._hover_seconds_used / self._conditions.battery_endurance_s, 1.0)
        return 1.0 - self._conditions.battery_sag * used

    def set_input(self, inputs: Sequence[float] | Array) -> None:
        """Give the sticks new positions; they take effect after the transport delay. Motors run.

        Parameters
        ----------
        inputs
            Pitch, roll, thrust, yaw, normalised.

        Raises
        ------
        ValueError
            If these are not four finite numbers.
        """
        four = _four(inputs)
        if not all(map(math.isfinite, four)):
            raise ValueError(f"{self._name}: input {four} is not finite")
        self._pending.append((self._time_s + self._delay_s, four))

    def stop_motors(self) -> None:
        """Cut the motors (throttle pulse at its low end) after the transport delay."""
        self._pending.append((self._time_s + self._delay_s, None))

    def advance(self, duration_s: float) -> None:
        """Fly on.

        Parameters
        ----------
        duration_s
            How long, not negative.

        Raises
        ------
        ValueError
            If the duration is negative or not finite.
        """
        if not 0.0 <= duration_s < math.inf:
            raise ValueError(f"{self._name}: cannot advance by {duration_s} s")
        end_s = self._time_s + duration_s
        while True:
            while self._pending and self._pending[0][0] <= self._time_s + _TIME_TOLERANCE_S:
                self._apply(self._pending.popleft()[1])
            until_s = min(end_s, self._pending[0][0]) if self._pending else end_s
            if until_s <= self._time_s:
                return
            steps = max(1, math.ceil((until_s - self._time_s) / self._conditions.substep_s - 1e-6))
            step_s = round((until_s - self._time_s) / steps, 12)
            if step_s != self._step_s:
                self._set_step(step_s)
            for _ in range(steps):
                self._substep(self._time_s, step_s)
                self._time_s += step_s
            self._time_s = until_s

    def _apply(self, inputs: Four | None) -> None:
        self.motors_running = inputs is not None
        if inputs is None:
            self._target = _NOTHING
            return
        pitch, roll, thrust, yaw = (u + offset for u, offset in zip(inputs, self.trim, strict=True))
        self._target = (pitch, roll, max(thrust, 0.0), yaw)

    def _set_step(self, step_s: float) -> None:
        """Compute the exact poles of the actuator lags over half a step and a whole step."""
        self._step_s = step_s
        p, r, t, y = self._lag_rates
        half_s = 0.5 * step_s
        p, r, t, y = (
            math.exp(-half_s * p),
            math.exp(-half_s * r),
            math.exp(-half_s * t),
            math.exp(-half_s * y),
        )
        self._half = p, r, t, y
        self._full = p * p, r * r, t * t, y * y

    def _attitude(self, actuator: Four) -> tuple[float, float]:
        if self._tilt_limit_rad == 0.0 or self.on_floor:
            return 0.0, 0.0
        return self._tilt_limit_rad * actuator[0], -self._tilt_limit_rad * actuator[1]

    def _acceleration(self, velocity: Four, actuator: Four, weather: Four) -> Four:
        """Time derivative of body velocity and yaw rate, equation (1); weather in the heading frame."""
        xd, yd, zd, yaw_rate = velocity
        b_x, b_y, b_z, b_yaw = self.model.input_gain
        k_x, k_y, k_z, k_yaw = self.model.damping
        thrust = b_z * self._sag * actuator[2]
        if self._tilt_limit_rad:
            forward, left, up = thrust_acceleration(*self._attitude(actuator), thrust)
        else:
            forward, left, up = b_x * actuator[0], b_y * actuator[1], thrust
        return (
            forward + k_x * xd + yaw_rate * yd + weather[0],
            left + k_y * yd - yaw_rate * xd + weather[1],
            up + k_z * zd - self.model.gravity_m_s2 + weather[2],
            b_yaw * actuator[3] + k_yaw * yaw_rate + weather[3],
        )

    def _substep(self, time_s: float, step_s: float) -> None:
        """Explicit midpoint rule for the motion under the exact response of the actuators."""
        half, full = self._half, self._full
        p, r, t, y = self._actuator
        up, ur, ut, uy = self._target
        middle = (
            up + (p - up) * half[0],
            ur + (r - ur) * half[1],
            ut + (t - ut) * half[2],
            uy + (y - uy) * half[3],
        )
        start = self._actuator
        self._actuator = (
            up + (p - up) * full[0],
            ur + (r - ur) * full[1],
            ut + (t - ut) * full[2],
            uy + (y - uy) * full[3],
        )
        self._hover_seconds_used += step_s * middle[2] / self._nominal.hover_thrust
        if self._conditions.battery_sag:
            self._sag = self.thrust_factor
        if self.on_floor:
            if self._tilt_limit_rad:
                self._actuator = (0.0, 0.0, *self._actuator[2:])  # the floor keeps it level
            if self.model.input_gain[2] * self._sag * middle[2] <= self.model.gravity_m_s2:
                return
            self.on_floor = False
        self._move(time_s, step_s, start, middle)

    def _move(self, time_s: float, step_s: float, start: Four, middle: Four) -> None:
        x, y, z, yaw, xd, yd, zd, yaw_rate = self._motion
        half_s = step_s / 2
        heading = yaw + half_s * yaw_rate
        c, s = math.cos(heading), math.sin(heading)
        weather = _NOTHING
        if self._weather is not None:
            self.turbulence = self._weather.at(time_s + half_s)
            wx, wy, wz, w_yaw = self.turbulence
            weather = (c * wx + s * wy, c * wy - s * wx, wz, w_yaw)
        d_xd, d_yd, d_zd, d_rate = self._acceleration((xd, yd, zd, yaw_rate), start, weather)
        xd_m, yd_m, zd_m, rate_m = (
            xd + half_s * d_xd,
            yd + half_s * d_yd,
            zd + half_s * d_zd,
            yaw_rate + half_s * d_rate,
        )
        d_xd, d_yd, d_zd, d_rate = self._acceleration((xd_m, yd_m, zd_m, rate_m), middle, weather)
        self._motion = (
            x + step_s * (c * xd_m - s * yd_m),
            y + step_s * (s * xd_m + c * yd_m),
            z + step_s * zd_m,
            yaw + step_s * rate_m,
            xd + step_s * d_xd,
            yd + step_s * d_yd,
            zd + step_s * d_zd,
            yaw_rate + step_s * d_rate,
        )
        self._meet_room()

    def _meet_room(self) -> None:
        """Land if the floor is reached, flag the flight volume."""
        x, y, z, yaw, _, _, zd, _ = self._motion
        if z <= 0.0 and zd < 0.0:
            self.on_floor = True
            self.touchdowns += 1
            self.touchdown_speed_m_s = -zd
            self._motion = (x, y, 0.0, yaw, 0.0, 0.0, 0.0, 0.0)
        low, high = self._conditions.volume_min_m, self._conditions.volume_max_m
        inside = low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]
        if not inside:
            self.left_volume = True


def _four(numbers: Sequence[float] | Array) -> Four:
    if len(numbers) != 4:
        raise ValueError(f"{len(numbers)} inputs given, a vehicle has 4: pitch, roll, thrust, yaw")
    pitch, roll, thrust, yaw = map(float, numbers)
    return pitch, roll, thrust, yaw
