"""Equations of motion of a coaxial helicopter with stabilizer bar (docs/helicopter.md).

The arithmetic is compiled (`rcopterx.native.helicopter`); here are the parameters that it takes.

Body frame: x forward, y left, z up along the mast. Rotations are right-handed, so that positive pitch is nose
down and accelerates forward, and positive roll accelerates to the right (minus y). The upper rotor carries
the bar, the lower rotor the swash plate.
"""

import math

import numpy as np

from rcopterx.native.helicopter import (
    helicopter_rates,
    helicopter_speeds,
    helicopter_step,
    helicopter_thrust,
)
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.vehicles.state import GRAVITY_M_S2
from rcopterx.vehicles.tuples import Four

State = tuple[float, ...]
"""Position and velocity in the inertial frame (6), attitude as a unit quaternion, scalar first (4), rates of
the body p, q, r (3), speeds of the upper and lower rotor (2), axis of the bar in the inertial frame (3), tilt
of the swash plate towards body x and y (2)."""


def level_state(
    position_m: tuple[float, float, float], yaw_rad: float, speeds_rad_s: tuple[float, float]
) -> State:
    """State at rest: level, the bar upright, the swash plate neutral.

    Parameters
    ----------
    position_m, yaw_rad
        Where.
    speeds_rad_s
        Of the upper and lower rotor.

    Returns
    -------
    State
        The state.
    """
    attitude = (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))
    return (
        *map(float, position_m),
        0.0,
        0.0,
        0.0,
        *attitude,
        0.0,
        0.0,
        0.0,
        *speeds_rad_s,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
    )


class HelicopterDynamics:
    """Right-hand side of one vehicle and its integration; holds parameters, no state.

    Parameters
    ----------
    parameters
        The vehicle.

    Attributes
    ----------
    numbers
        What kernels of `rcopterx.native.helicopter` need to know of it.
    """

    def __init__(self, parameters: HelicopterParameters) -> None:
        self.parameters = vehicle = parameters
        inertia_x, inertia_y, inertia_z = vehicle.inertia_kg_m2
        self.numbers = np.array(
            (
                1 / vehicle.mass_kg,
                *vehicle.drag_per_s,
                1 / inertia_x,
                1 / inertia_y,
                1 / inertia_z,
                inertia_y - inertia_z,
                inertia_z - inertia_x,
                inertia_x - inertia_y,
                *vehicle.damping_n_m_s,
                vehicle.thrust_upper,
                vehicle.torque_upper,
                1 / vehicle.rotor_lag_upper_s,
                *vehicle.phase_upper,
                vehicle.link_upper,
                vehicle.arm_upper_m,
                2 * vehicle.spring_upper_n_m,
                vehicle.thrust_lower,
                vehicle.torque_lower,
                1 / vehicle.rotor_lag_lower_s,
                *vehicle.phase_lower,
                vehicle.link_lower,
                vehicle.arm_lower_m,
                2 * vehicle.spring_lower_n_m,
                vehicle.thrust_upper * vehicle.torque_lower + vehicle.thrust_lower * vehicle.torque_upper,
                vehicle.mass_kg * vehicle.thrust_gain_m_s2,
                inertia_z * vehicle.yaw_gyro_gain_per_s,
                vehicle.yaw_rate_gain_rad_s,
                1 / vehicle.servo_lag_s[0],
                1 / vehicle.servo_lag_s[1],
                1 / vehicle.bar_time_constant_s,
                vehicle.ground_effect,
                1 / vehicle.ground_effect_height_m,
                GRAVITY_M_S2,
            )
        )

    def commanded_speeds(
        self, thrust: float, yaw: float, yaw_rate_rad_s: float, battery: float
    ) -> tuple[float, float]:
        """Rotor speeds that the electronics ask for: thrust linear in the stick, yaw rate held by the gyro.

        Parameters
        ----------
        thrust, yaw
            Sticks.
        yaw_rate_rad_s
            What the gyro measures.
        battery
            Thrust that the battery has left, as a fraction.

        Returns
        -------
        tuple of float
            Of the upper and lower rotor [rad/s].
        """
        return helicopter_speeds(self.numbers, thrust, yaw, yaw_rate_rad_s, battery)

    def thrust_n(self, speed_upper: float, speed_lower: float, height_m: float) -> float:
        """Thrust of both rotors along their axes, ground effect included."""
        return helicopter_thrust(self.numbers, speed_upper, speed_lower, height_m)

    def swash_target(self, pitch: float, roll: float) -> tuple[float, float]:
        """Tilt of the swash plate towards body x and y that servo positions ask for, within its limit."""
        gain_x, gain_y = self.parameters.swash_gain_rad
        x, y = gain_x * pitch, gain_y * roll
        tilt, limit = math.hypot(x, y), self.parameters.swash_limit_rad
        return (x, y) if tilt <= limit else (x * limit / tilt, y * limit / tilt)

    def derivative(
        self, state: State, swash: tuple[float, float], throttle: tuple[float, float] | None, battery: float,
        weather: Four,
    ) -> State:  # fmt: skip
        """Time derivative of the state.

        Parameters
        ----------
        state
            See `State`.
        swash
            Target of the swash plate, of `swash_target`.
        throttle
            Thrust and yaw sticks; None for stopped motors.
        battery
            Thrust that the battery has left, as a fraction.
        weather
            Accelerations: inertial x, y, z [m/s^2], yaw [rad/s^2].

        Returns
        -------
        State
            Its derivative, in the same order.
        """
        running, sticks = throttle is not None, throttle or (0.0, 0.0)
        return helicopter_rates(self.numbers, state, swash, running, sticks, battery, weather)

    def step(
        self, state: State, step_s: float, swash: tuple[float, float], throttle: tuple[float, float] | None,
        battery: float, weather: Four,
    ) -> State:  # fmt: skip
        """State after one step of the explicit midpoint rule; see `derivative` for the arguments.

        At 4 ms the fast mode (at most 18 rad/s) loses 5e-5 of damping ratio and 0.1 % of frequency.
        """
        running, sticks = throttle is not None, throttle or (0.0, 0.0)
        return helicopter_step(self.numbers, state, step_s, swash, running, sticks, battery, weather)
