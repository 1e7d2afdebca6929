"""How precisely helicopters can hover at all: horizontal errors that no causal controller falls below.

Near hover a helicopter is linear, and turbulence and noise are Gaussian. Then no controller that moves the
sticks as much is better than a Kalman filter with a linear-quadratic regulator. It knows vehicle and weather
exactly, and has period, delay and measurements of the rig. Resolution of servos, slew rates and missed frames
only add to errors and are left out; the wait for a radio frame counts by its mean.
"""

import math
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import block_diag, solve_discrete_lyapunov
from scipy.optimize import brentq

from rcopterx.control.models.linear import noise_over, regulator, steady_filter, zero_order_hold
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.helicopter import helicopter_of
from rcopterx.simulator.helicopter_dynamics import (
    Controls,
    airframe_of,
    derivative,
    level_state,
    swash_target,
)
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.vehicles.state import GRAVITY_M_S2, Array
from rcopterx_studies.experiments.formation import FOLLOWERS, LEADER
from rcopterx_studies.experiments.knowledge import COAXIAL
from rcopterx_studies.experiments.record import rms
from rcopterx_studies.experiments.rig import PERIOD_S, Progress
from rcopterx_studies.experiments.runner import Cases, Experiment, Options, median_and_worst

STICKS: Final = (0.15, 1.0)
"""Root mean square of pitch and roll sticks that bounds allow: about that of exactly known vehicles in
flight, and the most that the stops allow."""
HEIGHT_M: Final = 1.0
MOVING: Final = ("x", "y", "vx", "vy", "qx", "qy", "p", "q", "bar_x", "bar_y", "swash_x", "swash_y")
"""States that leave their values in hover, to first order, while height and heading rest."""
TILT: Final = slice(4, 6)
_DIFFERENCE: Final = 1e-5
_EFFORTS: Final = (-12.0, 0.0)  # decadic logarithms of the least and largest cost of a squared stick [m^2]


class Hovering(NamedTuple):
    """Best estimate of a helicopter and its air: x+ = a x + b sticks + news, each period; place c x.

    It is the estimate for the time at which the next sticks act. `news` is the covariance of what new
    measurements add to it, `unknown` that of its error; with n states and m sticks shapes are those of a
    linear system.
    """

    a: Array
    b: Array
    c: Array
    news: Array
    unknown: Array


class Regulated(NamedTuple):
    """What a regulator reaches, and its feedback of the estimate, shape (m, n)."""

    error_m: float  # rms of the norm
    stick: float  # rms of each stick, over all sticks
    feedback: Array


def continuous(vehicle: HelicopterParameters) -> Array:
    """Return the derivatives of the rates of `MOVING` by these, both sticks and the air's accelerations."""
    airframe, size = airframe_of(vehicle), len(MOVING)
    hovering = level_state((0.0, 0.0, HEIGHT_M), 0.0, vehicle.hover_speeds_rad_s)
    thrust = GRAVITY_M_S2 / vehicle.thrust_gain_m_s2

    def rate(moved: Array) -> Array:
        state = hovering._replace(**dict(zip(MOVING, moved.tolist(), strict=False)))
        pitch, roll, air_x, air_y = moved[size:].tolist()
        controls = Controls(*swash_target(vehicle, pitch, roll), True, thrust, 0.0)
        after = derivative(airframe, state, controls, 1.0, (air_x, air_y, 0.0, 0.0, 0.0, 0.0))
        return np.array([getattr(after, name) for name in MOVING])

    columns = [rate(move) - rate(-move) for move in _DIFFERENCE * np.eye(size + 4)]
    return np.array(columns).T / (2.0 * _DIFFERENCE)


def hovering(vehicle: HelicopterParameters, conditions: Conditions) -> Hovering:
    """Return a helicopter in the weather of some conditions, with the best estimate of its state."""
    linear, size = continuous(vehicle), len(MOVING)
    inward = -1.0 / conditions.turbulence_correlation_s
    dynamics = np.block([[linear[:, :size], linear[:, -2:]], [np.zeros((2, size)), inward * np.eye(2)]])
    sticks = np.vstack((linear[:, size:-2], np.zeros((2, 2))))
    a, b = zero_order_hold(dynamics, sticks, PERIOD_S)
    density = np.zeros(size + 2)
    density[size:] = -2.0 * inward * np.square(conditions.turbulence_rms[:2])
    process = noise_over(dynamics, density, PERIOD_S)
    c, measured = np.eye(2, size + 2), np.zeros((4, size + 2))
    measured[:2], measured[2:, TILT] = c, 2.0 * np.eye(2)  # a tilt is twice its part of the quaternion
    noise = np.repeat(np.square((conditions.position_noise_m, conditions.angle_noise_rad)), 2)
    predicted, gain = steady_filter(a, measured, process, np.diag(noise))
    news = predicted @ measured.T @ gain.T
    for _ in range(round(COAXIAL.delay_s / PERIOD_S) - 1):
        news, predicted = a @ news @ a.T, a @ predicted @ a.T + process
    return Hovering(a, b, c, a @ news @ a.T, predicted)


def regulated(system: Hovering, effort: float) -> Regulated:
    """Return what the regulator for a cost of effort reaches."""
    a, b, c = system.a, system.b, system.c
    feedback = regulator(a, b, c.T @ c, effort * np.eye(b.shape[1]))
    moving = solve_discrete_lyapunov(a - b @ feedback, system.news)
    error = np.sqrt(np.trace(c @ (moving + system.unknown) @ c.T))
    stick = np.sqrt(np.mean(np.diag(feedback @ moving @ feedback.T)))
    return Regulated(float(error), float(stick), feedback)


def best(system: Hovering, stick: float) -> Regulated:
    """Return what the best regulator reaches whose sticks have this root mean square."""

    def excess(effort: float) -> float:
        return math.log(regulated(system, 10.0**effort).stick / stick)

    return regulated(system, 10.0 ** brentq(excess, *_EFFORTS, xtol=1e-3))


def following(follower: Hovering, leader: Hovering, feedback: Array) -> Hovering:
    """Return a follower whose place counts from a leader with a feedback of its own; both are measured."""
    return Hovering(
        block_diag(follower.a, leader.a - leader.b @ feedback),
        np.vstack((follower.b, np.zeros_like(leader.b))),
        np.hstack((follower.c, -leader.c)),
        block_diag(follower.news, leader.news),
        block_diag(follower.unknown, leader.unknown),
    )


def drawn(name: str, conditions: Conditions, seed: int) -> Hovering:
    """Return a vehicle of the conditions."""
    return hovering(helicopter_of(name, conditions, seed), conditions)


def hover_mm(stick: float, conditions: Conditions, seed: int, progress: Progress | None = None) -> float:  # noqa: ARG001 - needs no time
    """Bound of the error of a vehicle in hover, rms per horizontal axis."""
    return 1e3 * best(drawn(LEADER, conditions, seed), stick).error_m / math.sqrt(2.0)


def formation_mm(stick: float, conditions: Conditions, seed: int, progress: Progress | None = None) -> float:  # noqa: ARG001 - needs no time
    """Bound of the horizontal error of two followers against the true place of a leader at its own bound."""
    leader = drawn(LEADER, conditions, seed)
    feedback = best(leader, stick).feedback
    pairs = [following(drawn(name, conditions, seed), leader, feedback) for name in FOLLOWERS]
    return 1e3 * rms(np.array([best(pair, stick).error_m for pair in pairs]))


def cases(_: Options) -> Cases[float]:
    """Both bounds for every allowance of sticks."""
    return {
        f"{name} / sticks {stick:g}": partial(bound, stick)
        for name, bound in (("hover", hover_mm), ("formation", formation_mm))
        for stick in STICKS
    }


EXPERIMENT: Final = Experiment(
    "bound",
    "Errors in hover that no controller falls below, computed",
    {"helicopters": 50},
    cases,
    lambda _, bounds_mm: median_and_worst(list(bounds_mm.values())),  # of the vehicles or fleets by seed
    helicopters_only=True,
)
