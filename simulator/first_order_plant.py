"""Vehicle of equation (1) with first-order lags; a quadrotor differs by the geometry of its tilt."""

import math
from dataclasses import replace

import numpy as np

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.disturbance import PARAMETERS, random_stream
from rcopterx.simulator.plant import CALM, BodyPose, SteppedPlant, four
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2
from rcopterx.vehicles.tilt import TiltModel
from rcopterx.vehicles.tuples import Four, Three


def tilt_limit_rad(model: Model) -> float:
    """Attitude at full pitch and roll stick, from b = g tan(tilt limit), pitch and roll averaged."""
    horizontal = (model.input_gain[0] + model.input_gain[1]) / 2
    return math.atan(horizontal / model.gravity_m_s2)


def thrust_acceleration(pitch_rad: float, roll_rad: float, thrust_m_s2: float) -> tuple[float, float, float]:
    """Forward, left, upward acceleration [m/s^2] by the tilted thrust alone; positive pitch is nose down."""
    return (
        thrust_m_s2 * math.sin(pitch_rad) * math.cos(roll_rad),
        -thrust_m_s2 * math.sin(roll_rad),
        thrust_m_s2 * math.cos(pitch_rad) * math.cos(roll_rad),
    )


class AttitudeLoop:
    """Tilt after pitch and roll sticks, by shares of its range: a servo's lag and a damped oscillator."""

    def __init__(self, tilt: TiltModel) -> None:
        self._tilt = tilt
        self.rest(CALM)

    def rest(self, sticks: Four) -> None:
        """Come to rest at these sticks."""
        self._servo, self._angle, self._rate = list(sticks[:2]), list(sticks[:2]), [0.0, 0.0]

    def step(self, sticks: Four, step_s: float, gain: float) -> tuple[float, float]:
        """Advance by one step of the plant, with a share of the sound torque; return both angles."""
        tilt, decay = self._tilt, math.exp(-step_s / self._tilt.servo_lag_s)
        for axis in (0, 1):
            self._servo[axis] = sticks[axis] + (self._servo[axis] - sticks[axis]) * decay
            pull = tilt.frequency_rad_s**2 * (self._servo[axis] - self._angle[axis])
            damping = 2 * tilt.damping_ratio * tilt.frequency_rad_s * self._rate[axis]
            self._rate[axis] += step_s * gain * (pull - damping)
            self._angle[axis] += step_s * self._rate[axis]
        return self._angle[0], self._angle[1]


def specimen(model: Model, conditions: Conditions, generator: np.random.Generator) -> tuple[Model, Four]:
    """Draw a vehicle's true b, k, lags, tilt frequency and trim, whatever the conditions switch on."""
    b, k, lag, trim = generator.uniform(-1.0, 1.0, (4, 4))
    lag_s = model.lag_s * (1 + conditions.lag_mismatch * lag)
    tilt = model.tilt if model.airframe == "attitude" and conditions.actuator_lag else None
    slower = 1 + conditions.lag_mismatch * float(lag[0])
    true = replace(
        model,
        input_gain=four(model.b * (1 + conditions.parameter_mismatch * b)),
        damping=four(model.k * (1 + conditions.parameter_mismatch * k)),
        lag_s=four(lag_s) if conditions.actuator_lag else CALM,
        tilt=None if tilt is None else replace(tilt, frequency_rad_s=tilt.frequency_rad_s / slower),
    )
    return true, four(conditions.trim_offset * trim)


class FirstOrderPlant(SteppedPlant):
    """A vehicle that obeys equation (1); `model` and `trim` are its true parameters, drawn around a model."""

    def __init__(self, name: str, model: Model, conditions: Conditions, seed: int, start: BodyPose) -> None:
        self.model, self.trim = specimen(model, conditions, random_stream(seed, name, PARAMETERS))
        self._tilt_limit_rad = tilt_limit_rad(self.model) if model.airframe == "attitude" else 0.0
        self._loop = None if self.model.tilt is None else AttitudeLoop(self.model.tilt)
        super().__init__(name, model, conditions, seed, start)

    @property
    def motion(self) -> tuple[float, ...]:
        """True motion state in the order of `rcopterx.vehicles.state`, eight numbers, yaw unwrapped."""
        return self._motion

    @property
    def pose(self) -> BodyPose:
        """True pose of the body, yaw unwrapped."""
        x, y, z, yaw = self._motion[:4]
        pitch, roll = self._attitude(self._actuator)
        return BodyPose((x, y, z), yaw, pitch, roll)

    def _stop(self, position_m: Three, yaw_rad: float) -> None:
        self._motion: tuple[float, ...] = (*position_m, yaw_rad, 0.0, 0.0, 0.0, 0.0)

    def _settle(self) -> None:
        self._actuator = self._target
        if self._loop is not None:
            self._loop.rest(self._target)

    def _command(self, sticks: Four | None) -> None:
        if sticks is None:
            self._target = CALM
            return
        pitch, roll, thrust, yaw = (u + offset for u, offset in zip(sticks, self.trim, strict=True))
        self._target = (pitch, roll, max(thrust, 0.0), yaw)

    def _lagged(self, time_s: float) -> Four:
        """Actuators after some time at the present targets, exactly."""
        pitch, roll, thrust, yaw = [
            target + (position - target) * math.exp(-time_s / lag_s) if lag_s > 0.0 else target
            for position, target, lag_s in zip(self._actuator, self._target, self.model.lag_s, strict=True)
        ]
        return pitch, roll, thrust, yaw

    def _moved(self, step_s: float) -> tuple[Four, Four]:
        """Actuators half a step later and a step later; pitch and roll of the attitude loop, if any."""
        middle, end = self._lagged(0.5 * step_s), self._lagged(step_s)
        if self._loop is not None:
            pitch, roll = self._loop.step(self._target, step_s, self.faults.attitude_gain)
            before = self._actuator
            middle = 0.5 * (before[0] + pitch), 0.5 * (before[1] + roll), *middle[2:]
            end = pitch, roll, *end[2:]
        return middle, end

    def _attitude(self, actuator: Four) -> tuple[float, float]:
        """Pitch and roll; where sticks are accelerations, the tilt that these accelerations need."""
        if self.on_floor:
            return 0.0, 0.0
        if self._tilt_limit_rad == 0.0:
            b_x, b_y = self.model.input_gain[:2]
            return math.atan(b_x * actuator[0] / GRAVITY_M_S2), -math.atan(b_y * actuator[1] / GRAVITY_M_S2)
        return self._tilt_limit_rad * actuator[0], -self._tilt_limit_rad * actuator[1]

    def _acceleration(self, velocity: Four, actuator: Four, weather: Four) -> Four:
        """Time derivative of body velocity and yaw rate, equation (1); weather in the heading frame."""
        xd, yd, zd, yaw_rate = velocity
        b_x, b_y, b_z, b_yaw = self.model.input_gain
        k_x, k_y, k_z, k_yaw = self.model.damping
        thrust = b_z * self._thrust_factor * actuator[2]
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

    def _stand(self, step_s: float) -> float:
        self._actuator = self._lagged(step_s)
        if self._tilt_limit_rad:
            self._actuator = (0.0, 0.0, *self._actuator[2:])  # the floor keeps it level
        if self._loop is not None:
            self._loop.rest(self._actuator)
        return self.model.input_gain[2] * self._thrust_factor * self._actuator[2]

    def _fly(self, step_s: float, weather: Four) -> None:
        """Explicit midpoint rule for the motion under the exact response of the actuators."""
        start = self._actuator
        middle, self._actuator = self._moved(step_s)
        x, y, z, yaw, *velocity = self._motion
        half_s = step_s / 2
        heading = yaw + half_s * velocity[3]
        c, s = math.cos(heading), math.sin(heading)
        wx, wy, wz, w_yaw = weather
        weather = (c * wx + s * wy, c * wy - s * wx, wz, w_yaw)
        change = self._acceleration(four(velocity), start, weather)
        halfway = four([v + half_s * d for v, d in zip(velocity, change, strict=True)])
        change = self._acceleration(halfway, middle, weather)
        xd, yd, zd, yaw_rate = halfway
        self._motion = (
            x + step_s * (c * xd - s * yd),
            y + step_s * (s * xd + c * yd),
            z + step_s * zd,
            yaw + step_s * yaw_rate,
            *(v + step_s * d for v, d in zip(velocity, change, strict=True)),
        )
