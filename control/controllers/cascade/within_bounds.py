"""Control steps of the cascade in which no bound is active, which most steps of a flight are."""

from typing import Any

import numpy as np

from rcopterx.control.controllers.cascade.terms import Bounds
from rcopterx.control.controllers.cascade.tilt_problem import TiltProblem
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.control.interfaces import Estimate
from rcopterx.native.within_bounds import step_within_bounds
from rcopterx.vehicles.state import Array

Planned = tuple[Array, Array, int]
"""Inputs, samples of the plan, and Newton steps."""


class StepWithinBounds:
    """Goes from one solution without active bounds to the next one by a single kernel.

    Whatever else a step may need, a factor, other bounds, more time, is up to the general way, which begins
    where this one left off: a step that meets a bound leaves the problems as they were.

    Parameters
    ----------
    steady, vehicle
        Workspace of the vertical and of yaw, and what `rcopterx.native.cascade.steady_problem` knows of the
        vehicle.
    horizontal, bounds, share
        The horizontal problem, and its bounds as in its `solve`.
    joining
        What `rcopterx.native.plans.join_plans` knows of the vehicle.
    """

    def __init__(
        self,
        steady: ChainQP,
        vehicle: tuple[Any, ...],
        horizontal: TiltProblem,
        bounds: Bounds,
        share: Bounds,
        joining: tuple[Any, ...],
    ) -> None:
        self._steady, self._horizontal = steady, horizontal
        self._fixed = (
            (vehicle, *steady.settled_problem),
            horizontal.settled_problem(bounds, share),
            joining,
        )

    def attempt(self, estimate: Estimate, disturbance: Array, samples: Array) -> Planned | None:
        """Plan a step; None if that takes more than this.

        Parameters
        ----------
        estimate, disturbance
            Present estimate, and the disturbance to predict with, shape (4,).
        samples
            The reference, shape (N, 12).
        """
        if not (self._steady.settled and self._horizontal.settled):
            return None
        tilt = self._horizontal.tilt_of(estimate, disturbance)
        planned = np.empty(samples.shape)
        inputs = np.empty((len(samples) - 1, 4))
        steps = step_within_bounds(
            estimate.motion,
            estimate.actuator,
            disturbance,
            tilt.core,
            tilt.servo,
            tilt.wind_m_s2,
            tilt.trim,
            samples,
            *self._fixed,
            inputs,
            planned,
        )
        return (inputs, planned, steps) if steps else None
