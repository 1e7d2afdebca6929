"""A small quadrotor of four propellers under a flight controller, as a rigid body.

Mass, inertia, arms, largest thrust, propeller torque and motor lag are those that the package `drone-models`
identified of a brushless Crazyflie (`cf21B_500`).
"""

import math
import random
from dataclasses import dataclass, field

G_M_S2 = 9.80665
MASS_KG = 0.04338
ARM_M = 0.035355 / math.sqrt(2.0)
"""Distance of a propeller from the body's axes."""
INERTIA_KG_M2 = (2.5e-5, 2.8e-5, 4.9e-5)
FULL_THRUST_N = 0.2
"""Of one propeller."""
TORQUE_M = 0.005939
"""Torque of a propeller over its thrust."""
MOTOR_LAG_S = 0.066
FULL_SPEED_RAD_S = 2230.0
ROTOR_INERTIA_KG_M2 = 3.893e-8
"""The reaction to the acceleration of a rotor also turns the body."""
DRAG_PER_S = 0.35
QUADRATIC_SHARE = 0.6
"""Thrust over command: this share of it grows with the square."""
# Of the motors in the order of the firmware's packet: front right, rear left, front left, rear right.
FORWARD_M = (ARM_M, -ARM_M, ARM_M, -ARM_M)
LEFT_M = (-ARM_M, ARM_M, ARM_M, -ARM_M)
REACTION = (-1.0, -1.0, 1.0, 1.0)

Three = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass
class Weather:
    """Accelerations by turbulent air, correlated over half a second."""

    rms_m_s2: float
    random: random.Random
    now: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])

    def advance(self, step_s: float) -> Three:
        """Advance by a short step."""
        kept = math.exp(-step_s / 0.5)
        new = self.rms_m_s2 * math.sqrt(1.0 - kept**2)
        self.now = [kept * a + new * self.random.gauss(0.0, 1.0) for a in self.now]
        x, y, z = self.now
        return x, y, z


class Airframe:
    """A vehicle: position and velocity are inertial, z up; rates are in body axes, forward, left, up.

    It stands on the floor with its motors off at first.
    """

    def __init__(self, position_m: Three, weather: Weather) -> None:
        self.position_m = position_m
        self.velocity_m_s: Three = (0.0, 0.0, 0.0)
        self.attitude_wxyz: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self.rates_rad_s: Three = (0.0, 0.0, 0.0)
        self.force_m_s2: Three = (0.0, 0.0, G_M_S2)
        """Specific force in body axes, as an accelerometer measures it."""
        self.thrusts_n = [0.0] * 4
        self._accelerations = [0.0] * 4
        self.on_floor = True
        self.touchdown_m_s: list[float] = []
        self.battery = 1.0
        self._weather = weather

    def step(self, step_s: float, motors: tuple[float, ...]) -> None:
        """Advance by a step of a millisecond or so."""
        lag = 1.0 - math.exp(-step_s / MOTOR_LAG_S)
        for index, command in enumerate(motors):
            command = min(max(command, 0.0), 1.0)
            wanted = self.battery * FULL_THRUST_N * command * (1.0 - QUADRATIC_SHARE * (1.0 - command))
            before = self._speed_rad_s(index)
            self.thrusts_n[index] += lag * (wanted - self.thrusts_n[index])
            self._accelerations[index] = (self._speed_rad_s(index) - before) / step_s
        lift_m_s2 = sum(self.thrusts_n) / MASS_KG
        air = self._weather.advance(step_s)
        if self.on_floor:
            if lift_m_s2 <= G_M_S2:
                return
            self.on_floor = False
        self._turn(step_s)
        up = self._to_inertial((0.0, 0.0, lift_m_s2))
        drag = [-DRAG_PER_S * v for v in self.velocity_m_s]
        pushed = [u + d + a for u, d, a in zip(up, drag, air, strict=True)]
        vx, vy, vz = (v + step_s * a for v, a in zip(self.velocity_m_s, pushed, strict=True))
        vz -= step_s * G_M_S2
        x, y, z = (p + step_s * v for p, v in zip(self.position_m, (vx, vy, vz), strict=True))
        self.velocity_m_s, self.position_m = (vx, vy, vz), (x, y, z)
        self.force_m_s2 = self._to_body((pushed[0], pushed[1], pushed[2]))
        if z <= 0.0 and vz < 0.0:
            self._touch_down(-vz)

    def _speed_rad_s(self, index: int) -> float:
        return FULL_SPEED_RAD_S * math.sqrt(self.thrusts_n[index] / FULL_THRUST_N)

    def _touch_down(self, speed_m_s: float) -> None:
        x, y, _ = self.position_m
        yaw = self.yaw_rad
        self.touchdown_m_s.append(speed_m_s)
        self.on_floor, self.position_m = True, (x, y, 0.0)
        self.velocity_m_s = self.rates_rad_s = (0.0, 0.0, 0.0)
        self.attitude_wxyz = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
        self.force_m_s2 = (0.0, 0.0, G_M_S2)

    def _turn(self, step_s: float) -> None:
        torques = (
            sum(left * thrust for left, thrust in zip(LEFT_M, self.thrusts_n, strict=True)),
            -sum(forward * thrust for forward, thrust in zip(FORWARD_M, self.thrusts_n, strict=True)),
            sum(
                sign * (TORQUE_M * thrust + ROTOR_INERTIA_KG_M2 * acceleration)
                for sign, thrust, acceleration in zip(
                    REACTION, self.thrusts_n, self._accelerations, strict=True
                )
            ),
        )
        (ix, iy, iz), (p, q, r) = INERTIA_KG_M2, self.rates_rad_s
        p += step_s * (torques[0] + (iy - iz) * q * r) / ix
        q += step_s * (torques[1] + (iz - ix) * r * p) / iy
        r += step_s * (torques[2] + (ix - iy) * p * q) / iz
        self.rates_rad_s = (p, q, r)
        w, x, y, z = self.attitude_wxyz
        h = 0.5 * step_s
        turned = (
            w - h * (x * p + y * q + z * r),
            x + h * (w * p + y * r - z * q),
            y + h * (w * q + z * p - x * r),
            z + h * (w * r + x * q - y * p),
        )
        norm = math.sqrt(sum(part * part for part in turned))
        w, x, y, z = (part / norm for part in turned)
        self.attitude_wxyz = (w, x, y, z)

    @property
    def yaw_rad(self) -> float:
        """Heading."""
        w, x, y, z = self.attitude_wxyz
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))

    def _rotation(self) -> tuple[Three, Three, Three]:
        w, x, y, z = self.attitude_wxyz
        return (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )

    def _to_inertial(self, body: Three) -> Three:
        a, b, c = (sum(r * v for r, v in zip(row, body, strict=True)) for row in self._rotation())
        return a, b, c

    def _to_body(self, inertial: Three) -> Three:
        columns = zip(*self._rotation(), strict=True)
        a, b, c = (sum(r * v for r, v in zip(column, inertial, strict=True)) for column in columns)
        return a, b, c
