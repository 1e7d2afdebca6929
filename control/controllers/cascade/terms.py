"""The terms of the cascade's three problems: terminal costs, body-frame references, feed-forward.

Equations: docs/formulas.md. Horizontal quantities that depend on the heading are turned with the mid-interval
heading of the vehicle's own yaw plan, so a reference that is another vehicle's plan is reproduced exactly.
"""

from typing import Protocol

import numpy as np
from msgspec import Struct
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.cascade.clearance import Clearances
from rcopterx.control.controllers.chains.active_set import Budget, ChainSolution
from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.state import Array, heading_matrix

Bounds = Array
"""Lower and upper ones, shape (2, ..)."""


class HorizontalTask(Struct, frozen=True):
    """What the horizontal problem of a control step is given.

    Attributes
    ----------
    estimate
        Present estimate.
    disturbance
        To predict with, in the order of `Estimate.disturbance`, shape (4,).
    steady
        Planned height and yaw of the stages and at least one more, shape (.., 2).
    reference
        Samples of N stages, shape (N, 12).
    clear
        Separation constraints; None while nobody is near.
    budget
        What the solve may take, its planned inputs those of pitch and roll.
    """

    estimate: Estimate
    disturbance: Array
    steady: Array
    reference: Array
    clear: Clearances | None
    budget: Budget


class HorizontalProblem(Protocol):
    """The cascade's horizontal problem for one kind of vehicle."""

    def forget(self) -> None:
        """Start the next solve from nothing."""
        ...

    def solve(self, task: HorizontalTask, bounds: Bounds, share: Bounds) -> ChainSolution:
        """Solve for the sticks of the horizon.

        Parameters
        ----------
        task
            What is given.
        bounds
            Of position (inertial), velocity (body) and stick, shape (2, 6).
        share
            Of the sticks once the disturbance is balanced, shape (2, 2).

        Returns
        -------
        ChainSolution
            The minimiser, or the best point known.
        """
        ...


def let_come_back(target: ChainTarget, velocity: Array, remaining: Array) -> ChainTarget:
    """Let a velocity that is measured beyond its bounds come back to them slowly.

    A vehicle that flies along a bound is beyond it by noise and gusts half of the time. To be back at the
    next stage would take a stick from stop to stop, and with slew rates and delays that nobody told it would
    swing around the bound.

    Parameters
    ----------
    target
        Of a chain of m axes.
    velocity
        Measured, shape (m,).
    remaining
        Share of the excess that is allowed at each stage, shape (N,).
    """
    columns = slice(len(velocity), 2 * len(velocity))
    lowest, highest = target.lower[0, columns], target.upper[0, columns]
    below, above = np.minimum(velocity - lowest, 0.0), np.maximum(velocity - highest, 0.0)
    lower, upper = target.bounds_of_stages()
    lower[:, columns] += remaining[:, None] * below
    upper[:, columns] += remaining[:, None] * above
    return target._replace(lower=lower, upper=upper)


def riccati_cost(parameters: ChainParameters, decay: Array, yaw_rad: float = 0.0) -> Array:
    """Solution of the Riccati equation of a chain at rest.

    Parameters
    ----------
    parameters
        Dynamics and weights of the chain with m axes.
    decay
        F without turning: one plus T_s times the damping, shape (m,).
    yaw_rad
        Heading, for two axes.

    Returns
    -------
    Array
        Cost of (position, velocity[, actuator]), shape (levels m, levels m).
    """
    m, levels, period = parameters.axes, parameters.levels, parameters.period_s
    size = levels * m
    a, b = np.eye(size), np.zeros((size, m))
    a[:m, m : 2 * m] = period * (heading_matrix(yaw_rad) if m == 2 else np.eye(1))
    a[m : 2 * m, m : 2 * m] = np.diag(decay)
    if parameters.pole is None:
        b[m:] = np.diag(period * parameters.gain)
    else:
        a[m : 2 * m, 2 * m :] = np.diag(period * parameters.gain)
        a[2 * m :, m : 2 * m] = -np.diag((1 - parameters.pole) * parameters.rate_feedback)
        a[2 * m :, 2 * m :] = np.diag(parameters.pole)
        b[2 * m :] = np.diag(1 - parameters.pole)
    q = np.zeros(size)
    q[:m], q[m : 2 * m] = parameters.position_weights, parameters.velocity_weights
    return np.asarray(solve_discrete_are(a, b, np.diag(q), np.diag(parameters.input_weights)), dtype=float)


class HeadingCost:
    """Terminal cost of the horizontal chain at any heading.

    With equal weights of x and y, P(psi) = T(psi)' P(0) T(psi), T turning positions into the body frame: one
    Riccati equation at start-up. Otherwise one per heading, on a grid.

    Parameters
    ----------
    parameters
        The horizontal chain.
    decay
        One plus T_s times the damping, shape (2,).
    """

    def __init__(self, parameters: ChainParameters, decay: Array) -> None:
        self._parameters, self._decay = parameters, decay
        weights = parameters.position_weights
        self._isotropic = bool(weights[0] == weights[1])
        self._solved: dict[float, Array] = {}
        self._at_grid(0.0)

    def at(self, yaw_rad: float) -> Array:
        """P at a heading, shape (2 levels, 2 levels)."""
        if not self._isotropic:
            return self._at_grid(round(float(np.remainder(yaw_rad, 2 * np.pi)), 2))
        turn, cost = heading_matrix(yaw_rad), self._at_grid(0.0).copy()
        cost[:2] = turn @ cost[:2]
        cost[:, :2] = cost[:, :2] @ turn.T
        return cost

    def _at_grid(self, yaw_rad: float) -> Array:
        if yaw_rad not in self._solved:
            self._solved[yaw_rad] = riccati_cost(self._parameters, self._decay, yaw_rad)
        return self._solved[yaw_rad]
