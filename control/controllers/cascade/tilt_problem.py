"""The cascade's horizontal problem for vehicles with a tilt model (docs/formulas.md).

The lateral model is predicted whole: bar, disc, coupling of the axes, servo, and the wind as it fades.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from rcopterx.control.controllers.cascade.clearance import SLOTS
from rcopterx.control.controllers.cascade.terms import Bounds, HorizontalTask
from rcopterx.control.controllers.chains.active_set import ChainSolution
from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.control.controllers.chains.lateral_qp import LateralQP
from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.control.models.lateral import demand_matrix, lateral_system
from rcopterx.native.lateral_problem import lateral_problem
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    GRAVITY_M_S2,
    YAW,
    Array,
    heading_matrix,
)


class TiltProblem:
    """Horizontal problem along a planned heading.

    Parameters
    ----------
    model
        The vehicle; it has a tilt model.
    parameters
        Sizes and weights of the horizontal axes.
    separation_weight
        Weight of the squared excess over a separation constraint.
    max_iterations
        Interior-point steps before the best point is taken.
    feed_forward
        Demands are weighed against those that fly the reference instead of against none.
    compensate
        Predict with the estimated wind.
    """

    def __init__(
        self,
        model: Model,
        parameters: ChainParameters,
        separation_weight: float,
        max_iterations: int,
        feed_forward: bool,
        compensate: bool,
    ) -> None:
        self._model = model
        self._parameters = parameters
        self._system = lateral_system(model, parameters.period_s)
        self._compensate = compensate
        self._free = LateralQP(parameters, self._system, max_iterations)
        # Only periods in which somebody comes near pay for the rows that keep clear.
        crowded = replace(parameters, clearances=SLOTS, clearance_weight=separation_weight)
        self._crowded = LateralQP(crowded, self._system, max_iterations)
        self._last = self._free
        """The one that solved last; the other one has nothing to begin from."""
        drag, lead = 0.5 * float(model.k[:2].sum()), self._mean_delay_s() / parameters.period_s
        stages, states = parameters.stages, self._system.size
        self._first, self._target = np.empty(states), ChainTarget.empty(stages, 6, states)
        self._fixed = model.b[:2].copy(), drag, lead, feed_forward

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._free.forget()
        self._crowded.forget()

    def solve(self, task: HorizontalTask, bounds: Bounds, share: Bounds) -> ChainSolution:
        """Solve for the sticks of the horizon (`HorizontalProblem` in `terms`).

        The disturbance of the task counts only where the estimator does not tell the wind.
        """
        estimate, target = task.estimate, self._target
        tilt = self.tilt_of(estimate, task.disturbance)
        qp = self._free if task.clear is None else self._crowded
        chain = qp.chain
        lateral_problem(
            estimate.motion,
            tilt.core,
            tilt.servo,
            tilt.wind_m_s2,
            tilt.trim,
            task.reference,
            task.steady[:, 1],
            bounds,
            share,
            *self._fixed,
            self._first,
            chain.turn,
            chain.demand_turn,
            *target,
        )
        qp.turned()
        if qp is not self._last:
            self._last.forget()
            self._last = qp
        if task.clear is not None:
            self._crowded.set_clearances(task.clear.directions)
            target = task.clear.add_rows(task.steady[: len(target.rows), 0], target)
        return qp.solve(self._first, tilt.trim, target, task.budget)

    def tilt_of(self, estimate: Estimate, disturbance: Array) -> TiltEstimate:
        """Tilt to predict with; from actuator and disturbance where the estimator does not estimate it."""
        if estimate.has_tilt:
            return estimate.tilt if self._compensate else estimate.tilt._replace(wind_m_s2=np.zeros(2))
        yaw_rad = float(estimate.motion[YAW])
        demand = demand_matrix(self._model, yaw_rad) @ estimate.actuator[:2]
        core = np.zeros(self._system.core.stop - self._system.core.start)
        core[:2] = demand / GRAVITY_M_S2
        wind_m_s2 = heading_matrix(yaw_rad) @ disturbance[:2]
        return TiltEstimate(core, estimate.actuator[:2], wind_m_s2, np.zeros(2))

    @property
    def settled(self) -> bool:
        """Whether nobody was near and no bound was active when it solved last."""
        return self._free.settled

    def settled_problem(self, bounds: Bounds, share: Bounds) -> tuple[Any, ...]:
        """What `rcopterx.native.within_bounds` knows of the problem."""
        return (bounds, share, *self._fixed), *self._free.settled_problem

    def _mean_delay_s(self) -> float:
        """Mean delay from demand to acceleration before the bar follows."""
        tilt = self._model.tilt
        assert tilt is not None
        return tilt.servo_lag_s + 2.0 * tilt.damping_ratio / tilt.frequency_rad_s
