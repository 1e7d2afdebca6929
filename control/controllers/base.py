"""What the controllers of this package have in common: references and inputs within reasonable limits.

A `BaseController` clips the reference, calls its control law, clips the inputs to their limits, and keeps the
last plan. The `StepGuard` of the agent handles laws that fail.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final

import numpy as np
from msgspec.structs import replace

from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import ControlStep, Estimate, never
from rcopterx.control.references.columns import YAW
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

EARLY_STOP: Final = "early_stop"  # counted for steps whose solver stopped before its tolerances were met

REFERENCE_YAW_CAP_RAD: Final = 60.0  # largest turn of a reference from the present heading


class BaseController(ABC):
    """A `Controller` around a control law; plans have `horizon` stages within `limits`."""

    def __init__(self, model: Model, period_s: float, horizon: int, limits: Limits) -> None:
        self._model = model
        self.period_s = period_s  # control period T_s
        self.horizon = horizon  # number of stages N of references it expects and plans it returns
        self._limits = limits
        position, velocity = np.diff(limits.position, axis=0)[0], np.diff(limits.velocity, axis=0)[0]
        reach = np.concatenate((position, 10 * velocity, np.full(4, 100.0)))
        low, high = np.hstack((limits.position, np.zeros((2, 8))))
        self._reference_min, self._reference_max = low - reach, high + reach
        self._last_plan: Trajectory | None = None

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle, without anything of an earlier flight."""
        self._last_plan = None
        self._start(estimate, self._usable_input(last_input))

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,  # noqa: ARG002 - changes of the input cost nothing here
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        """Compute one control step (`rcopterx.control.interfaces.Controller.step`)."""
        if len(reference.samples) != self.horizon or abs(reference.period_s - self.period_s) > 1e-9:
            reference = reference.resampled(0.0, self.period_s, self.horizon)
        low, high, yaw_rad = self._reference_min, self._reference_max, estimate.motion[YAW]
        low[YAW], high[YAW] = yaw_rad - REFERENCE_YAW_CAP_RAD, yaw_rad + REFERENCE_YAW_CAP_RAD
        reference = Trajectory(np.clip(reference.samples, low, high), self.period_s)
        step = self._compute(estimate, reference, expired)
        self._last_plan = step.plan
        return replace(step, inputs=np.clip(step.inputs, self._limits.input_min, self._limits.input_max))

    @abstractmethod
    def _start(self, estimate: Estimate, last_input: Array) -> None:
        """Set integral states and warm starts for a bumpless first step."""

    @abstractmethod
    def _compute(self, estimate: Estimate, reference: Trajectory, expired: Callable[[], bool]) -> ControlStep:
        """Compute inputs and plan from a reference of N stages, in time before `expired` is true."""

    def _usable_input(self, last_input: Array) -> Array:
        if not np.isfinite(last_input).all():
            return self._model.hover_input
        return np.clip(last_input, self._model.u_min, self._model.u_max)
