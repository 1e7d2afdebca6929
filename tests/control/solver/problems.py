"""Random problems for tests of solvers: a lightly damped tilt, half sticks, states beyond their bounds."""

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from rcopterx.control.solver.problem import HARD, OptimalControlProblem
from rcopterx.vehicles.state import Array

PERIOD_S = 0.02


def lateral_dynamics() -> tuple[Array, Array]:
    """Position, velocity, tilt, tilt rate and servo of two axes; demand as input."""
    a, b = np.zeros((5, 5)), np.zeros((5, 1))
    a[0, 1], a[1, 1], a[1, 2], a[2, 3] = 1.0, -0.5, 9.81, 1.0
    a[3, 2:5] = -132.0, -4.6, 26.0
    a[4, 4], b[4, 0] = -33.0, 33.0
    A, B = np.kron(a, np.eye(2)), np.kron(b, np.eye(2))
    step = expm(PERIOD_S * np.block([[A, B], [np.zeros((2, 12))]]))
    return step[:10, :10], step[:10, 10:]


def random_problem(stages: int, seed: int, stick: float = 0.5) -> OptimalControlProblem:
    """A problem along a random heading plan, whose sticks reach `stick`."""
    rng = np.random.default_rng(seed)
    A, B = lateral_dynamics()
    heading = rng.uniform(-3, 3) + np.cumsum(rng.uniform(-0.06, 0.06, stages))
    C, D = np.zeros((stages, 6, 10)), np.zeros((stages, 6, 2))
    for k, (c, s) in enumerate(zip(np.cos(heading), np.sin(heading), strict=True)):
        C[k, :2, :2] = np.eye(2)
        C[k, 2:4, 2:4] = D[k, 4:] = [[c, s], [-s, c]]
    weights = np.array((100.0, 100.0, 1.0, 1.0, 15.0, 15.0))
    P = solve_discrete_are(A, B, np.diag((*weights[:4], *6 * [0.0])), np.diag(weights[4:]))
    x_0 = rng.uniform(-1, 1, 10) * np.repeat((1.0, 0.6, 0.1, 0.6, 0.0), 2)
    goal = rng.uniform(-1.1, 1.1, 2)
    r, x_end, c = np.zeros((stages, 6)), np.zeros(10), np.zeros((stages, 10))
    r[:, :2] = x_end[:2] = goal
    c[:, 2:4] = rng.uniform(-0.02, 0.02, 2)
    high = np.tile((1.2, 1.2, 0.5, 0.5, stick, stick), (stages, 1))
    s = np.tile((1e4, 1e4, 1e4, 1e4, HARD, HARD), (stages, 1))
    s[0, :4] = 0.0
    tiled = np.tile(A, (stages, 1, 1)), np.tile(B, (stages, 1, 1))
    return OptimalControlProblem(
        *tiled, c, C, D, np.tile(weights, (stages, 1)), r, -high, high, s, P, x_end, x_0
    )


def one_stage_on(p: OptimalControlProblem, u: Array) -> OptimalControlProblem:
    """The same problem one period later, after an input."""
    return p._replace(x_0=p.A[0] @ p.x_0 + p.B[0] @ u + p.c[0])
