"""Plans of a point mass: close to targets, within limits, and on the right side of planes."""

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.solver.problem import HARD, repeated
from rcopterx.control.solver.riccati import RiccatiSolver
from rcopterx.vehicles.state import Array
from rcopterx_studies.schemes.tracked import SchemePath

SOFT: Final = 1e4
"""Weight of the squared excess over planes and speeds, against weights of positions of about one."""
FAR: Final = 1e3  # upper bounds of rows that have none: the solver's interior point needs finite ones
_I: Final = np.eye(3)


class Plane(NamedTuple):
    """A half-space in which the position is to be at one stage: normal . position >= level."""

    stage: int
    normal: Array
    level: float


class WayPlanner:
    """Solves one planning problem after another.

    minimise sum_k position_weight / 2 |p_k - target_k|^2 + effort_weight / 2 |a_k|^2
    """

    def __init__(
        self,
        # number K and duration of the stages
        stages: int,
        stage_s: float,
        reach: Array,  # largest acceleration of each axis, shape (3,)
        speed: Array,  # largest speed of each axis, shape (3,), a soft bound
        position_weight: float,
        effort_weight: float,
        planes: int = 0,  # largest number of planes at one stage
        # cost of the end: that of the infinite horizon (`cost_to_go`), that of a stage (`stage`), or that of
        # the infinite horizon and a large one of velocities, so that paths end at rest (`rest`)
        end: Literal["cost_to_go", "stage", "rest"] = "cost_to_go",
    ) -> None:
        h, zero = stage_s, np.zeros((3, 3))
        A, B = np.block([[_I, h * _I], [zero, _I]]), np.vstack((h**2 / 2 * _I, h * _I))
        Q = np.array(np.kron(np.diag((position_weight, 0.0)), _I), dtype=np.float64)
        P = Q
        if end != "stage":
            P = np.array(solve_discrete_are(A, B, Q, effort_weight * _I), dtype=np.float64)
        if end == "rest":
            P[3:, 3:] += SOFT * position_weight * _I
        C, D = np.vstack((np.eye(6), np.zeros((3 + planes, 6)))), np.zeros((9 + planes, 3))
        D[6:9] = _I
        W = np.repeat((position_weight, 0.0, effort_weight, 0.0), (3, 3, 3, planes))
        s = np.repeat((0.0, SOFT * position_weight, HARD, 0.0), (3, 3, 3, planes))
        self._problem = repeated(stages, A, B, C, D, W, s, P)
        self._problem.s[0, 3:6] = 0.0
        for bound, sign in ((self._problem.low, -1.0), (self._problem.high, 1.0)):
            bound[:, 3:6], bound[:, 6:9] = sign * speed, sign * reach
        self._rests = end == "rest"
        self._stage_s, self._plane_weight = stage_s, SOFT * position_weight
        self._solver = RiccatiSolver()

    def plan(
        self, position: Array, velocity: Array, targets: Array, planes: Sequence[Plane] = ()
    ) -> SchemePath:
        """Plan from a state towards the targets of the stages 0 to K, shape (K + 1, 3)."""
        p = self._problem
        p.x_0[:3], p.x_0[3:] = position, velocity
        p.r[:, :3], p.x_end[:3] = targets[:-1], targets[-1]
        p.x_end[3:] = 0.0 if self._rests else (targets[-1] - targets[-2]) / self._stage_s
        p.C[:, 9:], p.s[:, 9:] = 0.0, 0.0
        used = [0] * len(p.r)
        for stage, normal, level in planes:
            row = 9 + used[stage]
            if row < p.C.shape[1]:
                p.C[stage, row, :3], p.low[stage, row] = normal, level
                p.high[stage, row] = level + FAR
                p.s[stage, row] = self._plane_weight
                used[stage] += 1
        return SchemePath(position, velocity, self._solver.solve(p).u, self._stage_s)
