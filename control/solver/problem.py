"""The optimal control problem that every controller states, and the plan that solves it.

    minimise    sum_k 1/2 |y_k - r_k|^2_{W_k} + 1/2 s_k . excess(y_k)^2  +  1/2 |x_N - x_end|^2_P
    subject to  x_{k+1} = A_k x_k + B_k u_k + c_k,    x_0 given
                y_k = C_k x_k + D_k u_k,    k = 0 .. N - 1
                excess(y_k) = distance of y_k to [low_k, high_k]

Rows y are positions, velocities, inputs, and distances to other vehicles. Rows whose s is `HARD` have bounds
that hold exactly, whatever the cost; they depend on the inputs alone, and those of a stage are orthogonal.
"""

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from rcopterx.compiling.compiled import BLOCKS, MATRIX, VECTOR, record
from rcopterx.vehicles.state import Array

HARD: Final = math.inf  # weight s of a bound that holds exactly


class OptimalControlProblem(NamedTuple):
    """A problem of N stages with nx states, nu inputs and ny rows; all arrays are C-contiguous."""

    A: Array  # shape (N, nx, nx)
    B: Array  # shape (N, nx, nu)
    c: Array  # shape (N, nx)
    C: Array  # shape (N, ny, nx)
    D: Array  # shape (N, ny, nu)
    W: Array  # shape (N, ny)
    r: Array  # shape (N, ny)
    low: Array  # shape (N, ny)
    high: Array  # shape (N, ny)
    s: Array  # shape (N, ny): 0 for rows without bounds; bounds of all others are finite when it is solved
    P: Array  # shape (nx, nx)
    x_end: Array  # shape (nx,)
    x_0: Array  # shape (nx,)


class Trajectories(NamedTuple):
    """States, inputs and rows that satisfy the dynamics."""

    x: Array  # shape (N + 1, nx)
    u: Array  # shape (N, nu)
    y: Array  # shape (N, ny)


class Solution(NamedTuple):
    """Solution of a problem, with its quality."""

    x: Array  # shape (N + 1, nx)
    u: Array  # shape (N, nu)
    y: Array  # shape (N, ny)
    active: Array  # shape (N, ny): 1 where the upper bound is active, -1 where the lower one is, 0 elsewhere
    iterations: int  # number of sweeps, or iterations of OSQP
    # whether no hard bound is exceeded, and no input could be better; if not, the plan is the best one known
    optimal: bool


PROBLEM: Final[Any] = record(
    OptimalControlProblem,
    *[BLOCKS, BLOCKS, MATRIX],
    *[BLOCKS, BLOCKS],
    *[MATRIX, MATRIX, MATRIX, MATRIX, MATRIX],
    *[MATRIX, VECTOR, VECTOR],
)
"""Type of a problem as an argument of kernels."""
TRAJECTORIES: Final[Any] = record(Trajectories, *3 * [MATRIX])


def repeated(
    stages: int, A: Array, B: Array, C: Array, D: Array, W: Array, s: Array, P: Array
) -> OptimalControlProblem:
    """Return a problem whose stages are the same; everything else is zero, and there are no bounds yet."""
    nx, ny = len(A), len(C)
    c, r = np.zeros((stages, nx)), np.zeros((stages, ny))
    low, high = np.full((stages, ny), -np.inf), np.full((stages, ny), np.inf)
    A, B, C, D = (np.tile(matrix, (stages, 1, 1)) for matrix in (A, B, C, D))
    W, s = np.tile(W, (stages, 1)), np.tile(s, (stages, 1))
    x_end, x_0 = np.zeros((2, nx))
    return OptimalControlProblem(A, B, c, C, D, W, r, low, high, s, np.array(P, order="C"), x_end, x_0)


class Solver(Protocol):
    """Solves one problem after another, warm-started by the last one."""

    def reset(self) -> None:
        """Start the next solve cold."""

    def solve(self, p: OptimalControlProblem, same_cost: bool, expired: Callable[[], bool]) -> Solution:
        """Solve a problem, one stage after the last one.

        `same_cost`: whether A, B, P and the rows with weights are those of the last solve.
        `expired`: deadline, after which the best plan known is returned.
        """
