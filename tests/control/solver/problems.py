"""Random problems for tests of solvers: a tilt with little damping and states beyond bounds; and any."""

import numpy as np
from scipy.linalg import expm, solve_discrete_are
from support.records import replace

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
    return replace(p, x_0=p.A[0] @ p.x_0 + p.B[0] @ u + p.c[0])


def any_problem(seed: int) -> OptimalControlProblem:
    """A problem of random sizes, dynamics and bounds, with a cost in any unit."""
    rng = np.random.default_rng(seed)
    N, nu = int(rng.integers(2, 61)), int(rng.integers(1, 5))
    nx = int(rng.integers(nu, 11))
    soft = int(rng.integers(1, nx + 1))
    A = np.eye(nx) + 0.1 * rng.normal(size=(nx, nx))
    A *= min(1.0, 1.05 / np.abs(np.linalg.eigvals(A)).max())
    B = rng.normal(size=(nx, nu)) * 10 ** rng.uniform(-2, 0)
    C = np.concatenate((rng.normal(size=(soft, nx)), np.zeros((nu, nx))))
    D = np.concatenate((np.zeros((soft, nu)), np.eye(nu)))
    unit = 10 ** rng.uniform(-4, 4)
    W = unit * 10 ** np.concatenate((rng.uniform(-1, 3, soft), rng.uniform(-1, 1, nu)))
    s = np.tile(np.concatenate((unit * 10 ** rng.uniform(2, 5, soft), np.full(nu, HARD))), (N, 1))
    s[0, :soft] = 0.0
    high, root = rng.uniform(0.1, 1, soft + nu), rng.normal(size=(nx, nx))
    low, r = -high * rng.uniform(0.5, 1, soft + nu), np.zeros(soft + nu)
    r[:soft] = rng.normal(size=soft)
    matrices = (np.tile(matrix, (N, 1, 1)) for matrix in (A, B))
    rows = (np.tile(values, (N, 1)) for values in (W, r, low, high))
    return OptimalControlProblem(
        *matrices,
        0.01 * rng.normal(size=(N, nx)),
        *(np.tile(matrix, (N, 1, 1)) for matrix in (C, D)),
        *rows,
        s,
        unit * 10 * (root @ root.T) / nx,
        rng.normal(size=nx),
        rng.normal(size=nx) * 10 ** rng.uniform(-1, 0.5),
    )
