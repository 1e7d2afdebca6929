"""One linear-quadratic sweep with extra weights e on the rows, from which all of the solver is built.

`factorize` runs the Riccati recursion backwards, `solve` the vector recursion backwards and the dynamics
forwards. Both add the quadratic term 1/2 e (y - target)^2 of every row to the cost. A row whose e is infinite
is fixed to its target: it must be hard, a row of inputs alone.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import BLOCKS, MATRIX, compiled, part, record
from rcopterx.control.solver.problem import PROBLEM, TRAJECTORIES, OptimalControlProblem, Trajectories
from rcopterx.vehicles.state import Array


class Factor(NamedTuple):
    """Result of the Riccati recursion."""

    K: Array  # feedback of the inputs on the state, shape (N, nu, nx)
    S: Array  # inverse of the Hessian by the inputs of a stage, shape (N, nu, nu)
    P: Array  # Hessian of the cost to go, shape (N + 1, nx, nx)
    fixed: Array  # part of the inputs by which fixed rows reach their targets, shape (N, nu)
    drift: Array  # derivative of the cost to go that it causes, shape (N, nx)

    @classmethod
    def empty(cls, stages: int, nx: int, nu: int) -> "Factor":
        """Return room for a factor."""
        of_stages = (nu, nx), (nu, nu), (nu,), (nx,)
        K, S, fixed, drift = (np.zeros((stages, *shape)) for shape in of_stages)
        return cls(K, S, np.zeros((stages + 1, nx, nx)), fixed, drift)


REACHED: Final = 1e-5  # a row this near to a bound has reached it
FACTOR: Final[Any] = record(Factor, *3 * [BLOCKS], *2 * [MATRIX])


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


@part
def fix_row(S: Array, fixed: Array, d: Array, target: float) -> None:
    """Fix the row d u to a target: take its direction out of the inverse S of the Hessian."""
    nu = len(d)
    along, curvature, missing = np.zeros(nu), 0.0, target
    for i in range(nu):
        for j in range(nu):
            along[i] += S[i, j] * d[j]
        curvature += d[i] * along[i]
        missing -= d[i] * fixed[i]
    for i in range(nu):
        fixed[i] += along[i] * missing / curvature
        for j in range(nu):
            S[i, j] -= along[i] * along[j] / curvature


@compiled(PROBLEM, MATRIX, MATRIX, FACTOR)
def factorize(p: OptimalControlProblem, e: Array, target: Array, f: Factor) -> None:
    """Run the Riccati recursion with row weights W + e; all arguments of rows have the shape (N, ny)."""
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
            weight = p.W[k, row] + (0.0 if math.isinf(e[k, row]) else e[k, row])
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
        f.fixed[k] = 0.0
        f.drift[k] = 0.0
        for row in range(e.shape[1]):
            if math.isinf(e[k, row]):
                fix_row(f.S[k], f.fixed[k], p.D[k, row], target[k, row])
        for i in range(nu):
            for j in range(nx):
                gain = 0.0
                for m in range(nu):
                    gain -= f.S[k, i, m] * Hux[m, j]
                f.K[k, i, j] = gain
        for m in range(nu):
            for i in range(nx):
                f.drift[k, i] += Hux[m, i] * f.fixed[k, m]
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
            linear = -p.W[k, row] * p.r[k, row]
            if not math.isinf(e[k, row]):
                linear -= e[k, row] * target[k, row]
            if linear != 0.0:
                for i in range(nx):
                    gradient[i] += p.C[k, row, i] * linear
                for i in range(nu):
                    h[i] += p.D[k, row, i] * linear
        for i in range(nx):
            ahead[i] = gradient[i] + f.drift[k, i]
            for m in range(nu):
                ahead[i] += f.K[k, m, i] * h[m]
        for i in range(nu):
            plan.u[k, i] = f.fixed[k, i]
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


@part
def along_row(p: OptimalControlProblem, k: int, row: int, derivative: Array) -> float:
    """Return the derivative by a row of inputs, those by the inputs given."""
    along = square = 0.0
    for i in range(len(derivative)):
        along += p.D[k, row, i] * derivative[i]
        square += p.D[k, row, i] ** 2
    return along / square


@part
def differentiate(p: OptimalControlProblem, plan: Trajectories, force: Array, derivative: Array) -> None:
    """Set the derivatives of a cost by the inputs, shape (N, nu), given those by the rows, shape (N, ny)."""
    stages, nx, nu = p.B.shape
    ahead, before = np.zeros(nx), np.empty(nx)
    for i in range(nx):
        for j in range(nx):
            ahead[i] += p.P[i, j] * (plan.x[stages, j] - p.x_end[j])
    for k in range(stages - 1, -1, -1):
        before[:] = 0.0
        derivative[k] = 0.0
        for m in range(nx):
            for i in range(nx):
                before[i] += p.A[k, m, i] * ahead[m]
            for i in range(nu):
                derivative[k, i] += p.B[k, m, i] * ahead[m]
        for row in range(force.shape[1]):
            if force[k, row] != 0.0:
                for i in range(nx):
                    before[i] += p.C[k, row, i] * force[k, row]
                for i in range(nu):
                    derivative[k, i] += p.D[k, row, i] * force[k, row]
        set_vector(ahead, before)


@compiled(PROBLEM)
def curvature(p: OptimalControlProblem) -> float:
    """Return the mean second derivative of the cost by an input of the last stage, without bounds.

    Tolerances of solvers are relative to it, so that the unit of the cost does not matter.
    """
    last, nx, nu = p.B.shape
    total = 0.0
    for i in range(nu):
        for row in range(p.D.shape[1]):
            total += p.W[last - 1, row] * p.D[last - 1, row, i] ** 2
        for m in range(nx):
            for j in range(nx):
                total += p.B[last - 1, m, i] * p.P[m, j] * p.B[last - 1, j, i]
    return float(total / nu)


@compiled(PROBLEM, TRAJECTORIES)
def quality(p: OptimalControlProblem, plan: Trajectories) -> tuple[float, float, float]:
    """Return cost, largest excess over a hard bound, and largest derivative by an input over the curvature.

    Hard bounds that are reached balance the part of the derivative along their rows that would leave them.
    Both are infinite where a number is not finite, a lower bound is above the upper one, or the cost has no
    minimum.
    """
    stages, nx, nu = p.B.shape
    cost = primal = dual = 0.0
    ordered = True
    force, derivative = np.empty(plan.y.shape), np.empty((stages, nu))
    for i in range(nx):
        for j in range(nx):
            end = (plan.x[stages, i] - p.x_end[i]) * (plan.x[stages, j] - p.x_end[j])
            cost += 0.5 * p.P[i, j] * end
    for k in range(stages):
        for row in range(plan.y.shape[1]):
            error, beyond = plan.y[k, row] - p.r[k, row], excess(p, k, row, plan.y[k, row])
            force[k, row] = p.W[k, row] * error
            cost += 0.5 * p.W[k, row] * error**2
            ordered = ordered and (p.s[k, row] == 0.0 or p.low[k, row] <= p.high[k, row])
            if math.isinf(p.s[k, row]):
                primal = max(primal, abs(beyond))
            else:
                force[k, row] += p.s[k, row] * beyond
                cost += 0.5 * p.s[k, row] * beyond**2
    differentiate(p, plan, force, derivative)
    for k in range(stages):
        for row in range(plan.y.shape[1]):
            if not math.isinf(p.s[k, row]):
                continue
            along, value = along_row(p, k, row, derivative[k]), plan.y[k, row]
            leaves_high = along < 0.0 and value > p.high[k, row] - REACHED
            leaves_low = along > 0.0 and value < p.low[k, row] + REACHED
            if leaves_high or leaves_low:
                for i in range(nu):
                    derivative[k, i] -= along * p.D[k, row, i]
        for i in range(nu):
            dual = max(dual, abs(derivative[k, i]))
    unit = curvature(p)
    if not (ordered and unit > 0.0 and math.isfinite(cost)):
        return cost, math.inf, math.inf
    return cost, primal, dual / unit
