"""Settings every controller shares.

A controller's settings are a frozen `msgspec.Struct`; a fleet file's table or a request's body becomes one
through `rcopterx.control.plugins`, which names the field and what is allowed when something is wrong.
"""

from collections.abc import Iterable
from typing import Annotated, Literal, NamedTuple

import msgspec
import numpy as np

from rcopterx.control.plugins import SettingsError
from rcopterx.control.solver.problem import Solver
from rcopterx.control.solver.riccati import RiccatiSolver
from rcopterx.vehicles.model import Model, Seven
from rcopterx.vehicles.state import Array
from rcopterx.vehicles.tuples import Four

PositiveFloat = Annotated[float, msgspec.Meta(gt=0.0)]
Horizon = Annotated[int, msgspec.Meta(ge=2, le=200)]

FourWeights = tuple[PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat]

EightWeights = Annotated[tuple[PositiveFloat, ...], msgspec.Meta(min_length=8, max_length=8)]

INPUT_NAMES = ("pitch", "roll", "thrust", "yaw")
BOUNDED_STATE_NAMES = ("x", "y", "z", "xd_B", "yd_B", "zd_B", "psid")


class Limits(NamedTuple):
    """Bounds to plan with; those of motions are lower and upper ones of x, y, z, yaw, shape (2, 4)."""

    position: Array  # inertial frame; infinite for the heading
    velocity: Array  # body frame
    input_min: Array  # hard limits of the sticks, shape (4,)
    input_max: Array


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
        inputs = self.input_min or model.input_min, self.input_max or model.input_max
        states = self.state_min or model.state_min, self.state_max or model.state_max
        _check_intervals("input", INPUT_NAMES, *inputs)
        _check_intervals("state", BOUNDED_STATE_NAMES, *states)
        for name, low, high, least, most, hover in zip(
            INPUT_NAMES, *inputs, model.input_min, model.input_max, model.hover_input, strict=True
        ):
            field = f"input_min/input_max of {name}: [{low:g}, {high:g}]"
            if low < least or high > most:
                raise SettingsError(f"{field} leaves the vehicle's range [{least:g}, {most:g}]")
            if not low < hover < high:
                raise SettingsError(f"{field} must contain {hover:.3f}, which keeps it at rest")
        bounds = np.array(states, dtype=float)
        positions = np.column_stack((bounds[:, :3], (-np.inf, np.inf)))
        return Limits(positions, bounds[:, 3:], *np.array(inputs, dtype=float))


class MpcSettings(ControllerSettings, frozen=True, kw_only=True):
    """Settings of controllers that solve optimal control problems."""

    solver: Literal["riccati", "osqp"] = "riccati"
    """Solver of the optimal control problems."""
    max_iterations: Annotated[int, msgspec.Meta(ge=1, le=200)] = 40
    """Interior-point iterations of `riccati` in each problem before its best plan is used."""
    time_limit_s: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)] = 0.012
    """Longest time of `osqp` for each problem; `riccati` ends with the time of the control step."""

    def new_solver(self) -> Solver:
        """Return a new solver."""
        if self.solver == "riccati":
            return RiccatiSolver(self.max_iterations)
        from rcopterx.control.solver.osqp import OsqpSolver  # needs a library that the default does not load

        return OsqpSolver(time_limit_s=self.time_limit_s)


def _check_intervals(kind: str, names: Iterable[str], lower: Iterable[float], upper: Iterable[float]) -> None:
    for name, low, high in zip(names, lower, upper, strict=True):
        if not low < high:
            raise SettingsError(f"{kind}_min of {name} must be below {kind}_max, got {low:g} and {high:g}")
