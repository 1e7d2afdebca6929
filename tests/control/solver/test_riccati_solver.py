"""Promises of the default solver: optimal plans, hard sticks, and a usable plan when it has to stop."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import any_problem, one_stage_on, random_problem
from support.records import replace

from rcopterx.control.solver.osqp import OsqpSolver
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Solution, Trajectories
from rcopterx.control.solver.riccati import RiccatiSolver
from rcopterx.control.solver.sweep import quality

seeds = st.integers(0, 10_000)


def residuals(p: OptimalControlProblem, plan: Solution) -> tuple[float, float]:
    _, primal, dual = quality(p, Trajectories(plan.x, plan.u, plan.y))
    return primal, dual


def follows_dynamics(p: OptimalControlProblem, plan: Solution) -> bool:
    after = np.einsum("kij,kj->ki", p.A, plan.x[:-1]) + np.einsum("kij,kj->ki", p.B, plan.u) + p.c
    rows = np.einsum("kij,kj->ki", p.C, plan.x[:-1]) + np.einsum("kij,kj->ki", p.D, plan.u)
    same = np.allclose(plan.x[1:], after, atol=1e-9) and np.allclose(plan.y, rows, atol=1e-9)
    return bool(same and np.array_equal(plan.x[0], p.x_0))


@given(seeds, st.integers(2, 60))
def test_every_hard_problem_is_solved_to_optimality_from_a_cold_start(seed: int, stages: int) -> None:
    p = random_problem(stages, seed)
    plan = RiccatiSolver(60).solve(p)
    assert plan.optimal
    primal, dual = residuals(p, plan)
    assert primal < 1e-6
    assert dual < 1e-3
    assert follows_dynamics(p, plan)


@pytest.mark.parametrize("seed", range(14))
def test_the_plan_is_that_of_osqp(seed: int) -> None:
    p = random_problem(20, seed)
    exact = OsqpSolver(1e-8, time_limit_s=10.0).solve(p)
    assert RiccatiSolver(60).solve(p).u == pytest.approx(exact.u, abs=2e-4)


@given(seeds)
def test_bounds_that_are_active_are_reached_and_others_are_kept(seed: int) -> None:
    p = random_problem(30, seed)
    plan = RiccatiSolver(60).solve(p)
    sticks = p.s == HARD
    upper, lower = sticks & (plan.active > 0), sticks & (plan.active < 0)
    assert plan.y[upper] == pytest.approx(p.high[upper], abs=1e-4)
    assert plan.y[lower] == pytest.approx(p.low[lower], abs=1e-4)
    assert (np.abs(plan.y[sticks]) <= p.high[sticks] + 1e-4).all()


def test_a_warm_start_takes_fewer_sweeps_and_gives_the_plan_of_a_cold_one() -> None:
    p, warm = random_problem(40, 5), RiccatiSolver()
    plan = warm.solve(p)
    sweeps = []
    for _ in range(20):
        p = one_stage_on(p, plan.u[0])
        plan, cold = warm.solve(p, same_cost=True), RiccatiSolver().solve(p)
        assert plan.u == pytest.approx(cold.u, abs=1e-6)
        sweeps.append(plan.iterations)
    assert np.mean(sweeps) < 3


def test_the_factor_of_another_cost_is_not_used() -> None:
    p, solver = random_problem(20, 3, stick=100.0), RiccatiSolver()
    solver.solve(p)
    heavier = replace(p, W=10.0 * p.W)
    assert solver.solve(heavier).u == pytest.approx(RiccatiSolver().solve(heavier).u, abs=1e-9)


def test_a_solver_that_has_to_stop_returns_sticks_within_their_bounds() -> None:
    for seed in range(20):
        p = random_problem(30, seed, stick=0.2)
        plan = RiccatiSolver().solve(p, expired=lambda: True)
        assert follows_dynamics(p, plan)
        assert (np.abs(plan.y[p.s == HARD]) <= 0.2 + 1e-5).all()


def test_a_solver_that_has_to_stop_is_at_least_as_good_as_its_last_plan() -> None:
    p, solver = random_problem(30, 11, stick=0.3), RiccatiSolver()
    plan = solver.solve(p)
    p = one_stage_on(p, plan.u[0])
    stopped = solver.solve(p, expired=lambda: True)
    optimum = RiccatiSolver().solve(p)
    assert stopped.u == pytest.approx(optimum.u, abs=0.05)


@pytest.mark.parametrize("inputs", [1, 3, 4])
def test_problems_have_any_number_of_inputs(inputs: int) -> None:
    rng, N, nx = np.random.default_rng(inputs), 15, inputs + 2
    C = np.concatenate((np.eye(nx), np.zeros((inputs, nx))))
    D = np.concatenate((np.zeros((nx, inputs)), np.eye(inputs)))
    rows = nx + inputs
    s = np.tile(np.concatenate((np.zeros(nx), np.full(inputs, HARD))), (N, 1))
    p = OptimalControlProblem(
        A=np.tile(0.9 * np.eye(nx) + 0.1 * rng.normal(size=(nx, nx)), (N, 1, 1)),
        B=np.tile(rng.normal(size=(nx, inputs)), (N, 1, 1)),
        c=0.1 * rng.normal(size=(N, nx)),
        C=np.tile(C, (N, 1, 1)),
        D=np.tile(D, (N, 1, 1)),
        W=np.ones((N, rows)),
        r=np.zeros((N, rows)),
        low=np.full((N, rows), -0.1),
        high=np.full((N, rows), 0.1),
        s=s,
        P=np.eye(nx),
        x_end=np.zeros(nx),
        x_0=rng.normal(size=nx),
    )
    plan = RiccatiSolver().solve(p)
    assert plan.optimal
    primal, dual = residuals(p, plan)
    assert primal < 1e-6
    assert dual < 1e-3


def cost(p: OptimalControlProblem, plan: Solution) -> float:
    soft = np.where(np.isinf(p.s), 0.0, p.s)
    beyond = np.maximum(plan.y - p.high, 0.0) + np.minimum(plan.y - p.low, 0.0)
    end = plan.x[-1] - p.x_end
    rows = p.W * (plan.y - p.r) ** 2 + np.where(soft > 0.0, soft * beyond**2, 0.0)
    return float(0.5 * rows.sum() + 0.5 * end @ p.P @ end)


def test_few_of_any_random_problems_are_given_up() -> None:
    given_up = [seed for seed in range(300) if not RiccatiSolver().solve(any_problem(seed)).optimal]
    assert len(given_up) < 0.05 * 300


@pytest.mark.parametrize("unit", [1e-8, 1e-3, 1e5, 1e10])
def test_the_unit_of_the_cost_does_not_matter(unit: float) -> None:
    for seed in range(20):
        p = random_problem(30, seed)
        plan = RiccatiSolver().solve(p)
        scaled = replace(p, W=unit * p.W, s=unit * p.s, P=unit * p.P)
        other = RiccatiSolver().solve(scaled)
        assert other.optimal
        assert other.u == pytest.approx(plan.u, abs=1e-6)
        assert residuals(scaled, other)[1] == pytest.approx(residuals(p, plan)[1], abs=1e-3)


def test_a_hard_problem_does_not_spoil_an_easy_one_that_follows_it() -> None:
    """Whatever the last problem left behind, the plan is as good as that of a cold start."""
    for seed in range(120):
        hard, easy = random_problem(30, seed, stick=0.05), random_problem(30, seed + 1000)
        hard = replace(hard, x_0=20.0 * hard.x_0)
        solver = RiccatiSolver()
        solver.solve(hard)
        warm, cold = solver.solve(easy), RiccatiSolver().solve(easy)
        assert warm.optimal or not cold.optimal
        assert cost(easy, warm) <= cost(easy, cold) * (1.0 + 1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("field", ["x_0", "r", "low", "A"])
def test_a_plan_of_numbers_that_are_not_finite_is_not_optimal(field: str, value: float) -> None:
    p = random_problem(20, 2)
    values = getattr(p, field).copy()
    values.ravel()[-1 if field == "low" else 0] = value
    assert not RiccatiSolver().solve(replace(p, **{field: values})).optimal


@pytest.mark.parametrize("end", [0.0, -1e3])
def test_a_plan_without_a_least_cost_is_not_optimal(end: float) -> None:
    p = random_problem(20, 2)
    W = p.W.copy()
    W[:, 4:] = 0.0
    assert not RiccatiSolver().solve(replace(p, W=0.0 * W, P=end * np.eye(10))).optimal


@pytest.mark.parametrize("row", [0, 4])
def test_a_plan_with_a_lower_bound_above_the_upper_one_is_not_optimal(row: int) -> None:
    p = random_problem(20, 2)
    low = p.low.copy()
    low[3, row] = p.high[3, row] + 0.2
    assert not RiccatiSolver().solve(replace(p, low=low)).optimal


@given(seeds, st.floats(1.0, 30.0))
def test_sticks_keep_their_bounds_however_much_a_state_exceeds_its_own(seed: int, far: float) -> None:
    p = random_problem(30, seed, stick=0.3)
    p = replace(p, x_0=far * p.x_0, s=np.where(np.isinf(p.s), p.s, 1e8 * (p.s > 0.0)))
    plan = RiccatiSolver().solve(p)
    assert (np.abs(plan.y[p.s == HARD]) <= 0.3 + 1e-9).all()
