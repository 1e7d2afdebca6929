"""The horizontal problem, of vehicles with lags and of those with a tilt model (docs/formulas.md).

With lags, along a planned heading psi_k, the motion is exactly linear, time-varying: positions in the
inertial frame, velocities and actuators in the body frame, which turns by psi_{k+1} - psi_k in a period.

    p+ = p + T R(psi_mid) v,    v+ = F_k v + T (b a + disturbance)
    F_k = [[1 + T k_x, turn], [-turn, 1 + T k_y]]

With a tilt model, stabilizer bar, rotor, servo and wind are states. In the inertial frame the prediction
(`rcopterx.control.models.lateral`) and the cost are the same at every stage and every heading, so that the
factor of the solver stays as long as no bound is active. The planned heading turns only the rows that are
bounded in the body frame, velocities and sticks, and the cost where the weights of both axes differ.
"""

from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.compiling.compiled import ANY_MATRIX, FLAG, MATRIX, NUMBER, VECTOR, compiled, part, record
from rcopterx.control.controllers.cascade.axis import TASK, CascadeTask, LagProblem, beyond, state_following
from rcopterx.control.controllers.cascade.weights import HORIZONTAL, CascadeWeights
from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.control.models.lags import LAG_DYNAMICS, LagDynamics
from rcopterx.control.models.lateral import CORE_FROM, lateral_system
from rcopterx.control.models.prediction import in_body
from rcopterx.control.references.columns import X_ACCELERATION, X_RATE
from rcopterx.control.solver.problem import HARD, PROBLEM, OptimalControlProblem, Solution, repeated
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, XD_BODY, YAW, YD_BODY, Array, heading_matrix


class LateralProblem(Protocol):
    """The horizontal problem of a control step."""

    same_cost: bool  # whether A, B, P and the rows with weights stay the same

    def reset(self) -> None:
        """Begin with a reference at rest."""

    def along(self, heading: Array, task: CascadeTask) -> OptimalControlProblem:
        """State the problem along a planned heading, shape (N + 2,); positions are inertial."""

    def velocity_at_end(self, plan: Solution, heading: Array) -> Array:
        """Return the velocity after the last stage, inertial frame, shape (2,)."""

    def sticks(self, plan: Solution, task: CascadeTask) -> Array:
        """Return the pitch and roll sticks of a plan, shape (N, 2)."""


class LateralLags(LagProblem):
    """Formulation for the axes x and y, with one lag per stick."""

    same_cost = False  # A changes with every heading plan

    def reset(self) -> None:
        """See `LateralProblem`; nothing is carried over."""

    def along(self, heading: Array, task: CascadeTask) -> OptimalControlProblem:
        """See `LateralProblem`."""
        p, feed_forward = self._problem, self._feed_forward
        R = heading_matrix(0.5 * float(heading[-2] + heading[-1]))
        p.P[:] = self._P_0
        p.P[:2] = R @ p.P[:2]
        p.P[:, :2] = p.P[:, :2] @ R.T
        velocity, change = np.empty((2, len(task.reference), 2))
        turn(p, self._dynamics, task.reference, heading, velocity, change)
        state_following(p, task, self._dynamics, 0, velocity, change if feed_forward else 0.0 * change)
        return p

    def velocity_at_end(self, plan: Solution, heading: Array) -> Array:
        """See `LateralProblem`."""
        middle_rad = 0.5 * float(heading[-2] + heading[-1])
        return np.asarray(heading_matrix(middle_rad) @ plan.x[-1, 2:4])

    def sticks(self, plan: Solution, task: CascadeTask) -> Array:  # noqa: ARG002 - the plan's inputs are sticks
        """See `LateralProblem`."""
        return plan.u


@compiled(PROBLEM, LAG_DYNAMICS, ANY_MATRIX, VECTOR, MATRIX, MATRIX)
def turn(
    p: OptimalControlProblem,
    dynamics: LagDynamics,
    reference: Array,
    heading: Array,
    velocity: Array,
    change: Array,
) -> None:
    """Set the dynamics along a planned heading, and velocities and changes of the reference, body frame."""
    N, T, decay = len(p.r), dynamics.period_s, dynamics.decay
    velocities = reference[:, X_RATE : X_RATE + 2]
    accelerations = reference[:, X_ACCELERATION : X_ACCELERATION + 2]
    for k in range(N + 1):
        vx, vy, turn_rad = velocities[k, 0], velocities[k, 1], heading[k + 1] - heading[k]
        following = min(k + 1, N)
        middle_rad = 0.5 * (heading[k] + heading[k + 1])
        following_rad = 0.5 * (heading[following] + heading[following + 1])
        forward, left = in_body(middle_rad, vx, vy)
        after = in_body(following_rad, vx + T * accelerations[k, 0], vy + T * accelerations[k, 1])
        velocity[k, 0], velocity[k, 1] = forward, left
        change[k, 0] = after[0] - decay[0] * forward - turn_rad * left
        change[k, 1] = after[1] - decay[1] * left + turn_rad * forward
        if k < N:
            p.A[k, 0, 2], p.A[k, 0, 3] = in_body(middle_rad, T, 0.0)
            p.A[k, 1, 2], p.A[k, 1, 3] = in_body(middle_rad, 0.0, T)
            p.A[k, 2, 3], p.A[k, 3, 2] = turn_rad, -turn_rad


VELOCITY: Final = 2
DEMAND: Final = 4
BODY_VELOCITY: Final = 6
STICK: Final = 8
ROWS: Final = 10
"""Positions are the first two rows, these begin here. Rows up to the demands have weights; positions and the
last four have bounds. Positions and velocities are also the first four states."""


class Steering(NamedTuple):
    """How pitch and roll sticks act on a vehicle with a tilt model."""

    gain: Array  # b of both sticks, shape (2,)
    drag: float  # acceleration per velocity [1/s]
    flapping: float  # that by the tilt of flapping rotors, before the bar follows
    creep: float  # share of the way to the mast by which the bar follows it in a period; 0 without a bar
    upper_share: float  # part of the thrust that follows the bar instead of the body
    coupling_rad: float  # by which an acceleration is turned against the demand that causes it
    lead: float  # stages by which demands precede the accelerations that they cause


STEERING: Final[Any] = record(Steering, VECTOR, *6 * [NUMBER])


class LateralTilt:
    """Formulation with a tilt model for N = `stages` planned inputs.

    With `feed_forward` demands and the state at the end are referred to those that fly the reference, while
    the stabilizer bar follows the mast. Where weights of the body's axes differ, so that the cost turns with
    the heading, `same_cost` is False. The arrays of a problem are used again for the next one.
    """

    def __init__(
        self, model: Model, period_s: float, weights: CascadeWeights, stages: int, feed_forward: bool
    ) -> None:
        self._feed_forward = feed_forward
        system, tilt = lateral_system(model, period_s), model.tilt
        assert tilt is not None
        dampings = model.uncertainty.tilt_damping or (tilt.damping_ratio, tilt.damping_ratio)
        # The model may be less damped than the mean of the vehicles that it stands for.
        lag_s = tilt.servo_lag_s + sum(dampings) / tilt.frequency_rad_s
        creep = 0.0 if tilt.bar_time_constant_s is None else period_s / tilt.bar_time_constant_s
        drag, flapping = float(model.k[HORIZONTAL].mean()), -tilt.flapping_drag_per_s
        self._steering = steering = Steering(
            model.b[HORIZONTAL], drag, flapping, creep, tilt.upper_share, tilt.coupling_rad, lag_s / period_s
        )
        self._bar = np.zeros(2)
        A, B = system.transition, system.demand
        W = np.zeros(ROWS)
        effort = weights.effort[HORIZONTAL] / steering.gain**2
        W[:BODY_VELOCITY] = *weights.position[HORIZONTAL], *weights.velocity[HORIZONTAL], *effort
        self.same_cost = bool(np.allclose(W[2:6:2], W[3:6:2], rtol=1e-6))
        # The terminal cost prefers no direction: it takes the means of x and y.
        position, velocity, demand = W[:6].reshape(3, 2).mean(axis=1)
        Q = np.diag(np.repeat((position, velocity, *np.zeros(system.size // 2 - 2)), 2))
        P = solve_discrete_are(A, B, Q, demand * np.eye(2))
        C, D, s = np.eye(ROWS, system.size), np.eye(ROWS, 2, -DEMAND), np.zeros(ROWS)
        C[DEMAND:] = 0.0
        s[[0, 1, BODY_VELOCITY, BODY_VELOCITY + 1]] = weights.soft
        s[STICK:] = HARD
        self._problem = repeated(stages, A, B, C, D, W, s, P)
        self._problem.s[0, :STICK] = 0.0

    def reset(self) -> None:
        """Begin with a reference at rest."""
        self._bar[:] = 0.0

    def along(self, heading: Array, task: CascadeTask) -> OptimalControlProblem:
        """See `LateralProblem`; sticks among its rows have the trim added."""
        p = self._problem
        state_tilting(p, task, self._steering, self._bar, heading, self._feed_forward)
        return p

    def velocity_at_end(self, plan: Solution, heading: Array) -> Array:  # noqa: ARG002 - it is a state
        """See `LateralProblem`."""
        return plan.x[-1, VELOCITY : VELOCITY + 2]

    def sticks(self, plan: Solution, task: CascadeTask) -> Array:
        """See `LateralProblem`."""
        return plan.y[:, STICK:ROWS] - task.estimate.tilt.trim


@part
def demands(reference: Array, axis: int, steering: Steering, bar: Array) -> tuple[Array, float, float]:
    """Return the demands that fly a reference along an axis, and the tilts of body and bar at its end.

    Demands have the shape (N + 1,) and do not contain the coupling of the axes. `bar` is the tilt of the bar
    at the first stage in both axes; it is advanced by a period.
    """
    found, along, by_bar = np.empty(len(reference)), 0.0, GRAVITY_M_S2 * bar[axis]
    velocities = reference[:, X_RATE : X_RATE + 2]
    accelerations = reference[:, X_ACCELERATION : X_ACCELERATION + 2]
    for k in range(len(reference)):
        if k > 0:
            by_bar += steering.creep * (along - by_bar)
        if k == 1:
            bar[axis] = by_bar / GRAVITY_M_S2
        velocity = velocities[k, axis]
        along = accelerations[k, axis] - steering.drag * velocity
        found[k] = along - by_bar - steering.flapping * velocity
    share = steering.upper_share
    return found, (along - share * by_bar) / (1.0 - share) / GRAVITY_M_S2, by_bar / GRAVITY_M_S2


@part
def state_axis(p: OptimalControlProblem, task: CascadeTask, axis: int) -> None:
    """State references and bounds of an inertial axis, and of the body's axis and the stick of its number."""
    limits, trim, rate, stick = task.limits, task.estimate.tilt.trim[axis], BODY_VELOCITY + axis, STICK + axis
    slowest, fastest = limits.velocity[0, axis], limits.velocity[1, axis]
    below, above = beyond(task.estimate.motion[XD_BODY + axis], slowest, fastest)
    for k in range(len(p.r)):
        p.r[k, axis], p.r[k, VELOCITY + axis] = task.reference[k, axis], task.reference[k, X_RATE + axis]
        p.low[k, axis], p.high[k, axis] = limits.position[0, axis], limits.position[1, axis]
        p.low[k, rate] = slowest + task.recovery[k] * below
        p.high[k, rate] = fastest + task.recovery[k] * above
        p.low[k, stick] = limits.input_min[axis] + trim
        p.high[k, stick] = limits.input_max[axis] + trim


@part
def turn_rows(p: OptimalControlProblem, steering: Steering, heading: Array, feed_forward: bool) -> None:
    """Turn velocities and sticks of the body with a heading; cut demands to the bounds of the sticks."""
    gain, demand = steering.gain, p.r[:, DEMAND:BODY_VELOCITY]
    low, high = p.low[:, STICK:ROWS], p.high[:, STICK:ROWS]
    for k in range(len(p.r)):
        middle_rad = 0.5 * (heading[k] + heading[k + 1])
        for axis in range(2):
            x, y = 1.0 - axis, float(axis)
            forward, left = in_body(heading[k], x, y)
            pitch, roll = in_body(middle_rad, x, y)
            p.C[k, BODY_VELOCITY, VELOCITY + axis], p.C[k, BODY_VELOCITY + 1, VELOCITY + axis] = forward, left
            p.D[k, STICK, axis], p.D[k, STICK + 1, axis] = pitch / gain[0], roll / gain[1]
        if feed_forward:
            pitch, roll = in_body(middle_rad + steering.coupling_rad, demand[k, 0], demand[k, 1])
            pitch = gain[0] * min(max(pitch / gain[0], low[k, 0]), high[k, 0])
            roll = gain[1] * min(max(roll / gain[1], low[k, 1]), high[k, 1])
            demand[k, 0], demand[k, 1] = in_body(-middle_rad, pitch, roll)


@compiled(PROBLEM, TASK, STEERING, VECTOR, VECTOR, FLAG)
def state_tilting(
    p: OptimalControlProblem,
    task: CascadeTask,
    steering: Steering,
    bar: Array,
    heading: Array,
    feed_forward: bool,
) -> None:
    """State the problem along a planned heading."""
    motion, tilt, reference = task.estimate.motion, task.estimate.tilt, task.reference
    N, gain, servo = len(p.r), steering.gain, CORE_FROM + len(tilt.core)
    wind = p.x_0[servo + 2 : servo + 4]
    # The bar, where there is one, is the last part of the core.
    tilt_at_end, bar_at_end = p.x_end[CORE_FROM : CORE_FROM + 2], p.x_end[servo - 2 : servo]
    velocity_at_end, servo_at_end = p.x_end[VELOCITY : VELOCITY + 2], p.x_end[servo : servo + 2]
    for axis in range(2):
        needed, tilt_end, bar_end = demands(reference, axis, steering, bar)
        state_axis(p, task, axis)
        p.x_0[axis], wind[axis] = motion[axis], tilt.wind_m_s2[axis]
        p.x_end[axis], velocity_at_end[axis] = reference[N, axis], reference[N, X_RATE + axis]
        if feed_forward:
            for k in range(N):
                at = min(k + steering.lead, float(N))
                before = min(int(at), N - 1)
                p.r[k, DEMAND + axis] = needed[before] + (at - before) * (needed[before + 1] - needed[before])
            tilt_at_end[axis], servo_at_end[axis] = tilt_end, needed[N]
            if steering.creep:
                bar_at_end[axis] = bar_end
    turn_rows(p, steering, heading, feed_forward)
    servo_at_end[0], servo_at_end[1] = in_body(steering.coupling_rad, servo_at_end[0], servo_at_end[1])
    heading_rad = motion[YAW]
    velocity = in_body(-heading_rad, motion[XD_BODY], motion[YD_BODY])
    tilting = in_body(-heading_rad, gain[0] * tilt.servo[0], gain[1] * tilt.servo[1])
    for axis in range(2):
        p.x_0[VELOCITY + axis], p.x_0[servo + axis] = velocity[axis], tilting[axis]
    for i in range(len(tilt.core)):
        p.x_0[CORE_FROM + i] = tilt.core[i]


def with_tilt(model: Model, estimate: Estimate, disturbance: Array, compensate: bool) -> Estimate:
    """Return an estimate whose tilt the prediction starts from.

    Where the estimator estimates no tilt, it follows from actuator and disturbance, shape (4,). The wind is
    zero where the prediction does not `compensate` for it.
    """
    if estimate.has_tilt:
        if compensate:
            return estimate
        return estimate._replace(tilt=estimate.tilt._replace(wind_m_s2=np.zeros(2)))
    turn, servo = heading_matrix(estimate.motion[YAW]), estimate.actuator[:2]
    assert model.tilt is not None
    core = np.zeros(model.tilt.dynamics().size)
    core[:2] = turn @ (model.b[HORIZONTAL] * servo) / GRAVITY_M_S2
    return estimate._replace(tilt=TiltEstimate(core, servo, turn @ disturbance[:2], np.zeros(2)))
