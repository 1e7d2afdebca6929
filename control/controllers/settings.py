"""Settings every controller shares.

A controller's settings are a frozen `msgspec.Struct`; a fleet file's table or a request's body becomes one
through `rcopterx.control.plugins`, which names the field and what is allowed when something is wrong.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec
import numpy as np

from rcopterx.control.plugins import SettingsError
from rcopterx.control.solver.problem import Solver
from rcopterx.control.solver.riccati import RiccatiSolver
from rcopterx.vehicles.model import Model, Seven
from rcopterx.vehicles.state import INPUT_SIZE, Array
from rcopterx.vehicles.tuples import Four

PositiveFloat = Annotated[float, msgspec.Meta(gt=0.0)]
Horizon = Annotated[int, msgspec.Meta(ge=2, le=200)]
TimeLimit = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]

FourWeights = tuple[PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat]

EightWeights = Annotated[tuple[PositiveFloat, ...], msgspec.Meta(min_length=8, max_length=8)]
ElevenWeights = Annotated[tuple[PositiveFloat, ...], msgspec.Meta(min_length=11, max_length=11)]

INPUT_NAMES = ("pitch", "roll", "thrust", "yaw")
BOUNDED_STATE_NAMES = ("x", "y", "z", "xd_B", "yd_B", "zd_B", "psid")


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds a controller plans with."""

    # hard limits of the inputs, shape (4,)
    input_min: Array
    input_max: Array
    # bounds of x, y, z, xd_B, yd_B, zd_B, psid, shape (7,)
    state_min: Array
    state_max: Array


class ControllerSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Settings common to all controllers; a limit left out is the vehicle's own."""

    horizon: Horizon = 50
    """Number of stages N."""
    input_min: Four | None = None
    """Lowest pitch, roll, thrust and yaw."""
    input_max: Four | None = None
    """Highest ones."""
    state_min: Seven | None = None
    """Lowest x, y, z, xd_B, yd_B, zd_B, psid."""
    state_max: Seven | None = None
    """Highest ones."""

    def limits(self, model: Model) -> Limits:
        """Return the bounds to plan with for a vehicle, whose own limits are the widest inputs allowed.

        Raises `SettingsError`: an interval is empty, leaves the vehicle's input range, or excludes hovering.
        """
        limits = Limits(
            np.array(self.input_min or model.input_min, dtype=float),
            np.array(self.input_max or model.input_max, dtype=float),
            np.array(self.state_min or model.state_min, dtype=float),
            np.array(self.state_max or model.state_max, dtype=float),
        )
        _check_intervals("input", INPUT_NAMES, limits.input_min, limits.input_max)
        _check_intervals("state", BOUNDED_STATE_NAMES, limits.state_min, limits.state_max)
        for i in range(INPUT_SIZE):
            low, high = limits.input_min[i], limits.input_max[i]
            field = f"input_min/input_max of {INPUT_NAMES[i]}: [{low:g}, {high:g}]"
            if low < model.input_min[i] or high > model.input_max[i]:
                own = f"[{model.input_min[i]:g}, {model.input_max[i]:g}]"
                raise SettingsError(f"{field} leaves the vehicle's range {own}")
            if not low < model.hover_input[i] < high:
                raise SettingsError(
                    f"{field} must contain {model.hover_input[i]:.3f}, which keeps it at rest"
                )
        return limits


class MpcSettings(ControllerSettings, frozen=True, kw_only=True):
    """Settings of controllers that solve optimal control problems."""

    solver: Literal["riccati", "osqp"] = "riccati"
    """Solver of the optimal control problems."""
    max_iterations: Annotated[int, msgspec.Meta(ge=1, le=200)] = 40
    """Interior-point iterations of `riccati` in each problem before its best plan is used."""
    time_limit_s: TimeLimit = 0.012
    """Longest time of `osqp` for each problem; `riccati` ends with the time of the control step."""

    def new_solver(self) -> Solver:
        """Return a new solver."""
        if self.solver == "riccati":
            return RiccatiSolver(self.max_iterations)
        from rcopterx.control.solver.osqp import OsqpSolver  # needs a library that the default does not load

        return OsqpSolver(time_limit_s=self.time_limit_s)


def _check_intervals(kind: str, names: Iterable[str], lower: Array, upper: Array) -> None:
    for name, low, high in zip(names, lower, upper, strict=True):
        if not low < high:
            raise SettingsError(f"{kind}_min of {name} must be below {kind}_max, got {low:g} and {high:g}")
