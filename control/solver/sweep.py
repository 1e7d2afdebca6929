"""One linear-quadratic sweep with extra weights e on the rows, from which all of the solver is built.

`factorize` runs the Riccati recursion backwards, `solve` the vector recursion backwards and the dynamics
forwards. Both add the quadratic term 1/2 e (y - target)^2 of every row to the cost.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import BLOCKS, MATRIX, compiled, part, record
from rcopterx.control.solver.problem import HARD, PROBLEM, TRAJECTORIES, OptimalControlProblem, Trajectories
from rcopterx.vehicles.state import Array


class Factor(NamedTuple):
    """Result of the Riccati recursion."""

    K: Array  # feedback of the inputs on the state, shape (N, nu, nx)
    S: Array  # inverse of the Hessian by the inputs of a stage, shape (N, nu, nu)
    P: Array  # Hessian of the cost to go, shape (N + 1, nx, nx)


FACTOR: Final[Any] = record(Factor, BLOCKS, BLOCKS, BLOCKS)


@part
def invert(H: Array, inverse: Array) -> None:
    """Set the inverse of a symmetric positive definite matrix, by Cholesky factorization in place."""
    size = len(H)
    for j in range(size):
        for k in range(j):
            for i in range(j, size):
                H[i, j] -= H[i, k] * H[j, k]
        root = math.sqrt(H[j, j])
        for i in range(j, size):
            H[i, j] /= root
    for column in range(size):
        for i in range(size):
            value = 1.0 if i == column else 0.0
            for k in range(i):
                value -= H[i, k] * inverse[k, column]
            inverse[i, column] = value / H[i, i]
        for i in range(size - 1, -1, -1):
            value = inverse[i, column]
            for k in range(i + 1, size):
                value -= H[k, i] * inverse[k, column]
            inverse[i, column] = value / H[i, i]


@compiled(PROBLEM, MATRIX, FACTOR)
def factorize(p: OptimalControlProblem, e: Array, f: Factor) -> None:
    """Run the Riccati recursion with row weights W + e, shape (N, ny)."""
    stages, nx, nu = p.B.shape
    PA, PB = np.empty((nx, nx)), np.empty((nx, nu))
    Hux, Huu = np.empty((nu, nx)), np.empty((nu, nu))
    for i in range(nx):
        for j in range(nx):
            f.P[stages, i, j] = p.P[i, j]
    for k in range(stages - 1, -1, -1):
        PA[:] = 0.0
        PB[:] = 0.0
        Hux[:] = 0.0
        Huu[:] = 0.0
        f.P[k] = 0.0
        for i in range(nx):
            for m in range(nx):
                cost = f.P[k + 1, i, m]
                for j in range(nx):
                    PA[i, j] += cost * p.A[k, m, j]
                for j in range(nu):
                    PB[i, j] += cost * p.B[k, m, j]
        for m in range(nx):
            for i in range(nx):
                for j in range(nx):
                    f.P[k, i, j] += p.A[k, m, i] * PA[m, j]
            for i in range(nu):
                for j in range(nx):
                    Hux[i, j] += p.B[k, m, i] * PA[m, j]
                for j in range(nu):
                    Huu[i, j] += p.B[k, m, i] * PB[m, j]
        for row in range(e.shape[1]):
            weight = p.W[k, row] + e[k, row]
            if weight == 0.0:
                continue
            for i in range(nx):
                for j in range(nx):
                    f.P[k, i, j] += weight * p.C[k, row, i] * p.C[k, row, j]
            for i in range(nu):
                for j in range(nx):
                    Hux[i, j] += weight * p.D[k, row, i] * p.C[k, row, j]
                for j in range(nu):
                    Huu[i, j] += weight * p.D[k, row, i] * p.D[k, row, j]
        invert(Huu, f.S[k])
        for i in range(nu):
            for j in range(nx):
                gain = 0.0
                for m in range(nu):
                    gain -= f.S[k, i, m] * Hux[m, j]
                f.K[k, i, j] = gain
        for m in range(nu):
            for i in range(nx):
                for j in range(nx):
                    f.P[k, i, j] += Hux[m, i] * f.K[k, m, j]


@part
def set_vector(values: Array, to: Array) -> None:
    """Copy without the checks of shapes in `values[:] = to`, which take seconds to compile."""
    for i in range(len(to)):
        values[i] = to[i]


@part
def follow(p: OptimalControlProblem, k: int, plan: Trajectories) -> None:
    """Set the rows of stage k and the state after it from its state and input."""
    nx, nu = p.B.shape[1:]
    for i in range(nx):
        value = p.c[k, i]
        for j in range(nu):
            value += p.B[k, i, j] * plan.u[k, j]
        for j in range(nx):
            value += p.A[k, i, j] * plan.x[k, j]
        plan.x[k + 1, i] = value
    for row in range(plan.y.shape[1]):
        value = 0.0
        for j in range(nu):
            value += p.D[k, row, j] * plan.u[k, j]
        for j in range(nx):
            value += p.C[k, row, j] * plan.x[k, j]
        plan.y[k, row] = value


@compiled(PROBLEM, MATRIX, MATRIX, FACTOR, TRAJECTORIES)
def solve(p: OptimalControlProblem, e: Array, target: Array, f: Factor, plan: Trajectories) -> None:
    """Minimise with the factor of `e`, the weights of the distances to `target`; both of shape (N, ny)."""
    stages, nx, nu = p.B.shape
    ahead, gradient, h = np.zeros(nx), np.empty(nx), np.empty(nu)
    for i in range(nx):
        for j in range(nx):
            ahead[i] -= p.P[i, j] * p.x_end[j]
    for k in range(stages - 1, -1, -1):
        for i in range(nx):
            for j in range(nx):
                ahead[i] += f.P[k + 1, i, j] * p.c[k, j]
        gradient[:] = 0.0
        h[:] = 0.0
        for m in range(nx):
            for i in range(nx):
                gradient[i] += p.A[k, m, i] * ahead[m]
            for i in range(nu):
                h[i] += p.B[k, m, i] * ahead[m]
        for row in range(e.shape[1]):
            linear = -(p.W[k, row] * p.r[k, row] + e[k, row] * target[k, row])
            if linear != 0.0:
                for i in range(nx):
                    gradient[i] += p.C[k, row, i] * linear
                for i in range(nu):
                    h[i] += p.D[k, row, i] * linear
        set_vector(ahead, gradient)
        for m in range(nu):
            for i in range(nx):
                ahead[i] += f.K[k, m, i] * h[m]
        for i in range(nu):
            plan.u[k, i] = 0.0
            for m in range(nu):
                plan.u[k, i] -= f.S[k, i, m] * h[m]
    set_vector(plan.x[0], p.x_0)
    for k in range(stages):
        for i in range(nu):
            for j in range(nx):
                plan.u[k, i] += f.K[k, i, j] * plan.x[k, j]
        follow(p, k, plan)


@compiled(PROBLEM, TRAJECTORIES)
def roll_out(p: OptimalControlProblem, plan: Trajectories) -> None:
    """Set states and rows to those that the inputs of a plan lead to."""
    set_vector(plan.x[0], p.x_0)
    for k in range(len(p.B)):
        follow(p, k, plan)


@part
def excess(p: OptimalControlProblem, k: int, row: int, value: float) -> float:
    """Signed distance of a row to its bounds; 0 within them and for rows without bounds."""
    if p.s[k, row] == 0.0:
        return 0.0
    beyond: float = max(value - p.high[k, row], 0.0) + min(value - p.low[k, row], 0.0)
    return beyond


@compiled(PROBLEM, TRAJECTORIES)
def quality(p: OptimalControlProblem, plan: Trajectories) -> tuple[float, float, float]:
    """Return cost, largest excess over a hard bound, and largest derivative of the cost by an input."""
    stages, nx, nu = p.B.shape
    cost = primal = dual = 0.0
    ahead, before = np.zeros(nx), np.empty(nx)
    for i in range(nx):
        for j in range(nx):
            ahead[i] += p.P[i, j] * (plan.x[stages, j] - p.x_end[j])
        cost += 0.5 * ahead[i] * (plan.x[stages, i] - p.x_end[i])
    for k in range(stages - 1, -1, -1):
        before[:] = 0.0
        derivative = np.zeros(nu)
        for m in range(nx):
            for i in range(nx):
                before[i] += p.A[k, m, i] * ahead[m]
            for i in range(nu):
                derivative[i] += p.B[k, m, i] * ahead[m]
        for row in range(plan.y.shape[1]):
            error, beyond = plan.y[k, row] - p.r[k, row], excess(p, k, row, plan.y[k, row])
            cost += 0.5 * (p.W[k, row] * error**2 + p.s[k, row] * beyond**2)
            force = p.W[k, row] * error + p.s[k, row] * beyond
            if force != 0.0:
                for i in range(nx):
                    before[i] += p.C[k, row, i] * force
                for i in range(nu):
                    derivative[i] += p.D[k, row, i] * force
            if p.s[k, row] == HARD:
                primal = max(primal, abs(beyond))
        for i in range(nu):
            dual = max(dual, abs(derivative[i]))
        set_vector(ahead, before)
    return cost, primal, dual
