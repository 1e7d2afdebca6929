"""The chain's solver against an independent one, and its dynamics."""

from dataclasses import dataclass, replace
from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from rcopterx.control.controllers.cascade.terms import HeadingCost, riccati_cost
from rcopterx.control.controllers.chains.active_set import Budget
from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.vehicles.state import Array

osqp = pytest.importorskip("osqp")
PERIOD_S = 0.02


@dataclass
class Case:
    """A horizontal chain that turns while it flies."""

    parameters: ChainParameters
    turn: Array
    transition: Array
    terminal_cost: Array
    lower: Array
    upper: Array

    @property
    def levels(self) -> int:
        return self.parameters.levels

    def target(self, disturbance: Array) -> ChainTarget:
        """Rest at the origin, inputs and bounds with the disturbance's balance added."""
        p = self.parameters
        rows, terminal = np.zeros((p.stages, 6)), np.zeros(2 * self.levels)
        balance = np.concatenate((np.zeros(4), disturbance / p.gain))
        return ChainTarget(rows, terminal, (self.lower + balance)[None], (self.upper + balance)[None])

    def workspace(self) -> ChainQP:
        qp = ChainQP(self.parameters, 60)
        qp.set_matrices(self.turn, self.transition, self.terminal_cost)
        return qp

    def matrices(self, stage: int) -> tuple[Array, Array]:
        """A and B of one stage in the order position, velocity[, actuator]."""
        p, t = self.parameters, PERIOD_S
        a, b = np.eye(2 * self.levels), np.zeros((2 * self.levels, 2))
        a[:2, 2:4] = t * self.turn[stage]
        a[2:4, 2:4] = self.transition[stage]
        if p.pole is None:
            b[2:] = np.diag(t * p.gain)
        else:
            a[2:4, 4:] = np.diag(t * p.gain)
            a[4:, 2:4] = -np.diag((1 - p.pole) * p.rate_feedback)
            a[4:, 4:] = np.diag(p.pole)
            b[4:] = np.diag(1 - p.pole)
        return a, b


def case(stages: int, lag: bool, yaw_rate: float = 1.5, rate_feedback: float = 0.05) -> Case:
    pole = np.exp(-PERIOD_S / np.array([0.06, 0.05])) if lag else None
    parameters = ChainParameters(
        stages,
        PERIOD_S,
        np.array([2.0, 2.1]),
        pole,
        np.full(2, rate_feedback),
        np.full(2, 800.0),
        np.ones(2),
        np.full(2, 1.5),
        1e4,
        (True, True),
    )
    levels = parameters.levels
    angle = yaw_rate * PERIOD_S * (np.arange(stages + levels - 2) + 0.5)
    turn = np.array([[[np.cos(w), -np.sin(w)], [np.sin(w), np.cos(w)]] for w in angle])
    decay = np.array([0.99, 0.992])
    step = PERIOD_S * yaw_rate
    transition = np.tile([[decay[0], step], [-step, decay[1]]], (stages + levels - 3, 1, 1))
    cost = HeadingCost(parameters, decay).at(float(angle[stages - 1]))
    lower, upper = np.array([-1.2, -1.2, -1, -1.3, -1, -1]), np.array([1.2, 1.2, 1, 1.3, 1, 1])
    return Case(parameters, turn, transition, cost, lower, upper)


def independent(problem: Case, first: Array, disturbance: Array, rows: Array, terminal: Array) -> Array:
    """Inputs of the same problem in states and inputs, with slacks, by OSQP at tight tolerance."""
    p, nx = problem.parameters, 2 * problem.levels
    n, block = p.stages, nx + 2 + 4
    cost_diagonal = np.concatenate(
        (p.position_weights, p.velocity_weights, np.zeros(nx - 4), p.input_weights, np.full(4, p.soft_weight))
    )
    hessian = sparse.lil_matrix(sparse.diags(np.tile(cost_diagonal, n)))
    gradient = np.zeros(n * block)
    equal: list[tuple[Array, Array]] = []
    boxes: list[tuple[Array, float, float]] = []
    for i in range(n):
        at = i * block
        gradient[at : at + 4] = -cost_diagonal[:4] * rows[i, :4]
        gradient[at + nx : at + nx + 2] = -p.input_weights * rows[i, 4:]
        if i == n - 1:
            hessian[at : at + nx, at : at + nx] = problem.terminal_cost
            gradient[at : at + nx] = -problem.terminal_cost @ terminal
            gradient[at + nx : at + nx + 2] = 0.0
        else:
            a, b = problem.matrices(i)
            line = np.zeros((nx, n * block))
            line[:, at : at + nx], line[:, at + nx : at + nx + 2] = a, b
            line[:, at + block : at + block + nx] = -np.eye(nx)
            push = np.zeros(nx)
            push[2:4] = PERIOD_S * disturbance
            equal.append((line, -push))
            for axis in range(2):
                row = np.zeros(n * block)
                row[at + nx + axis] = 1.0
                boxes.append((row, problem.lower[4 + axis], problem.upper[4 + axis]))
        for axis in range(4 if i else 0):
            row = np.zeros(n * block)
            row[at + axis], row[at + nx + 2 + axis] = 1.0, -1.0
            boxes.append((row, problem.lower[axis], problem.upper[axis]))
    start = np.zeros((nx, n * block))
    start[:, :nx] = np.eye(nx)
    matrix = np.vstack([start, *(line for line, _ in equal), *(row for row, _, _ in boxes)])
    fixed = np.concatenate([first.ravel(), *(right for _, right in equal)])
    lower = np.concatenate([fixed, [low for _, low, _ in boxes]])
    upper = np.concatenate([fixed, [high for _, _, high in boxes]])
    solver = osqp.OSQP()
    solver.setup(
        sparse.csc_matrix(hessian), gradient, sparse.csc_matrix(matrix), lower, upper,
        eps_abs=1e-8, eps_rel=1e-8, max_iter=200_000, verbose=False, polishing=True,
    )  # fmt: skip
    result = solver.solve(raise_error=True)
    inputs: Array = result.x.reshape(n, block)[:-1, nx : nx + 2]
    return inputs


@pytest.mark.parametrize("lag", [True, False])
@pytest.mark.parametrize("distance_m", [0.01, 0.2, 0.7, 1.1, 1.5])
def test_solution_is_the_one_an_independent_solver_finds(lag: bool, distance_m: float) -> None:
    """Inside the bounds, on input bounds, on speed bounds, and from outside the box."""
    problem = case(16, lag)
    first = np.array([[distance_m, -0.6 * distance_m], [0.3, -0.4], [0.2, 0.1]])[: problem.levels]
    disturbance = np.array([0.1, -0.2])
    rows, terminal = np.zeros((16, 6)), np.zeros(2 * problem.levels)
    terminal[4:] = (-disturbance / problem.parameters.gain)[: len(terminal) - 4]
    rows[:, 4:] = -disturbance / problem.parameters.gain
    found = problem.workspace().solve(first, disturbance, problem.target(disturbance))
    expected = independent(problem, first, disturbance, rows, terminal)
    assert found.solved
    assert found.inputs == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("lag", [True, False])
def test_rows_that_keep_clear_say_the_same_as_bounds_along_the_axes(lag: bool) -> None:
    """A row along an axis against a bound of that axis, at every stage that is free."""
    problem = case(16, lag)
    first = np.array([[0.4, -0.6], [0.3, -0.4], [0.2, 0.1]])[: problem.levels]
    aim = problem.target(np.zeros(2))
    aim.lower[0, 0] = 0.3
    bounded = problem.workspace().solve(first, np.zeros(2), aim)
    parameters = replace(problem.parameters, clearances=2, clearance_weight=problem.parameters.soft_weight)
    qp = ChainQP(parameters, 60)
    qp.set_matrices(problem.turn, problem.transition, problem.terminal_cost)
    directions = np.zeros((16, 2, 2))
    directions[:, 1, 0] = -1.0
    qp.set_clearances(directions)
    wide = problem.target(np.zeros(2))
    rows = np.hstack((wide.rows, np.zeros((16, 2))))
    lower = np.tile(np.append(wide.lower[0], [0.0, -20.0]), (16, 1))
    upper = np.tile(np.append(wide.upper[0], [0.0, -0.3]), (16, 1))
    found = qp.solve(first, np.zeros(2), ChainTarget(rows, wide.terminal, lower, upper))
    assert found.solved
    assert bounded.solved
    assert found.inputs == pytest.approx(bounded.inputs, abs=1e-3)
    assert found.flat[:16, 0].min() > 0.29


@pytest.mark.parametrize("lag", [True, False])
def test_plan_obeys_the_dynamics(lag: bool) -> None:
    problem = case(30, lag)
    first = np.array([[0.5, 0.2], [0.1, 0.3], [0.1, -0.1]])[: problem.levels]
    disturbance = np.array([0.1, -0.2])
    found = problem.workspace().solve(first, disturbance, problem.target(disturbance))
    state = first.ravel()
    for stage in range(29):
        assert found.flat[stage] == pytest.approx(state[:2], abs=1e-6)
        a, b = problem.matrices(stage)
        state = a @ state + b @ found.inputs[stage]
        state[2:4] += PERIOD_S * disturbance
    assert found.flat[29] == pytest.approx(state[:2], abs=1e-6)


def test_unfinished_iterations_still_give_a_plan_that_obeys_the_dynamics() -> None:
    problem = case(30, lag=True)
    qp = ChainQP(problem.parameters, 1)
    qp.set_matrices(problem.turn, problem.transition, problem.terminal_cost)
    first = np.array([[1.1, -1.0], [0.9, -1.2], [0.2, 0.1]])
    found = qp.solve(first, np.zeros(2), problem.target(np.zeros(2)))
    assert not found.solved
    assert (np.abs(found.inputs) <= 1.0).all()
    state = first.ravel()
    for stage in range(29):
        a, b = problem.matrices(stage)
        state = a @ state + b @ found.inputs[stage]
        assert found.flat[stage + 1] == pytest.approx(state[:2], abs=1e-6)


def test_next_step_starts_from_the_shifted_solution() -> None:
    """Flying the plan itself, the active bounds are those of before: no fresh start is needed."""
    problem = case(40, lag=True)
    qp = problem.workspace()
    state = np.array([0.8, -0.5, 0.0, 0.0, 0.0, 0.0])
    iterations = []
    for _ in range(10):
        found = qp.solve(state.reshape(3, 2), np.zeros(2), problem.target(np.zeros(2)))
        assert found.solved
        iterations.append(found.iterations)
        a, b = problem.matrices(0)
        state = a @ state + b @ found.inputs[0]
    assert max(iterations[1:]) < iterations[0]


@pytest.mark.parametrize(("before_m", "after_m"), [(60.0, 3.0), (3.0, 1.2), (20.0, 0.5)])
def test_multipliers_of_a_farther_set_point_do_not_bend_the_solution_of_a_nearer_one(
    before_m: float, after_m: float
) -> None:
    """The same inputs saturate in both, but they press on their bounds with other forces."""
    problem = case(40, lag=True, yaw_rate=0.0)

    def target(distance_m: float) -> ChainTarget:
        aim = problem.target(np.zeros(2))
        aim.rows[:, :2] = aim.terminal[:2] = (distance_m, -0.7 * distance_m)
        aim.lower[0, :2], aim.upper[0, :2] = -100.0, 100.0
        return aim

    rest, disturbance = np.zeros((3, 2)), np.zeros(2)
    qp = problem.workspace()
    qp.solve(rest, disturbance, target(before_m))
    found = qp.solve(rest, disturbance, target(after_m))
    from_scratch = problem.workspace().solve(rest, disturbance, target(after_m))
    assert found.solved
    assert found.inputs == pytest.approx(from_scratch.inputs, abs=1e-3)


def test_cruise_along_a_speed_bound_is_solved_as_from_scratch() -> None:
    """Nearly all stages lie on the bound, and noise makes the guess of the active ones wrong."""
    problem = case(40, lag=True, yaw_rate=0.0, rate_feedback=0.0)
    far = problem.target(np.zeros(2))
    far.rows[:, :2] = far.terminal[:2] = (6.0, -4.0)
    far.lower[0, :2], far.upper[0, :2] = -10.0, 10.0
    qp = problem.workspace()
    random = np.random.default_rng(3)
    state = np.zeros(6)
    counts = []
    for step in range(120):
        measured = (state + random.normal(0.0, [0, 0, 2e-3, 2e-3, 0, 0])).reshape(3, 2)
        found = qp.solve(measured, np.zeros(2), far)
        counts.append(found.iterations)
        if step % 4 == 0:
            from_scratch = problem.workspace().solve(measured, np.zeros(2), far)
            assert found.inputs == pytest.approx(from_scratch.inputs, abs=1e-4)
        a, b = problem.matrices(0)
        state = a @ state + b @ found.inputs[0]
    assert state[2] > 0.9 * far.upper[0, 2]
    assert np.mean(counts[1:]) < 4.0


@pytest.mark.parametrize("yaw", [0.3, -2.0, 7.0])
def test_turned_terminal_cost_solves_the_riccati_equation_of_the_heading(yaw: float) -> None:
    problem = case(10, lag=True)
    decay = np.array([0.99, 0.992])
    direct = riccati_cost(problem.parameters, decay, yaw)
    assert HeadingCost(problem.parameters, decay).at(yaw) == pytest.approx(direct, rel=1e-6, abs=1e-6)


def cost_of(problem: Case, first: Array, inputs: Array, aim: ChainTarget) -> float:
    """Cost of inputs by simulation: tracking, effort, excess over the bounds, terminal cost."""
    p, state, total = problem.parameters, first.ravel(), 0.0
    for stage in range(p.stages):
        there = state[:4]
        if 0 < stage < p.stages - 1:
            weights = np.concatenate((p.position_weights, p.velocity_weights))
            total += float(weights @ (there - aim.rows[stage, :4]) ** 2)
        if stage:
            beyond = np.maximum(there - aim.upper[0, :4], 0.0) + np.maximum(aim.lower[0, :4] - there, 0.0)
            total += p.soft_weight * float(beyond @ beyond)
        if stage < p.stages - 1:
            total += float(p.input_weights @ (inputs[stage] - aim.rows[stage, 4:]) ** 2)
            a, b = problem.matrices(stage)
            state = a @ state + b @ inputs[stage]
    error = state - aim.terminal
    return 0.5 * (total + float(error @ problem.terminal_cost @ error))


@settings(deadline=None, max_examples=50)
@given(
    st.booleans(),
    st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)),
    st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)),
    st.integers(0, 40),
    st.booleans(),
)
def test_a_solve_that_is_stopped_at_any_moment_is_no_worse_than_the_previous_plan(
    lag: bool, before: tuple[float, float], after: tuple[float, float], stop: int, warm: bool
) -> None:
    problem = case(16, lag)
    first = np.array([[0.4, -0.6], [0.3, -0.4], [0.2, 0.1]])[: problem.levels]
    aim = problem.target(np.zeros(2))
    aim.rows[:, :2] = aim.terminal[:2] = before
    qp = problem.workspace()
    planned = qp.solve(first, np.zeros(2), aim).inputs
    if not warm:
        qp.forget()
    aim.rows[:, :2] = aim.terminal[:2] = after
    asked = count()
    found = qp.solve(first, np.zeros(2), aim, Budget(lambda: next(asked) >= stop, lambda: planned))
    assert (np.abs(found.inputs) <= 1.0 + 1e-5).all()
    best, known = (cost_of(problem, first, u, aim) for u in (found.inputs, np.clip(planned, -1.0, 1.0)))
    assert best <= known * (1.0 + 1e-6) + 1e-9
    assert found.solved or next(asked) > stop
