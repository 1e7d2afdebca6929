"""Promises of the default solver: optimal plans, hard sticks, and a usable plan when it has to stop."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import one_stage_on, random_problem

from rcopterx.control.solver.osqp import OsqpSolver
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Plan
from rcopterx.control.solver.riccati import RiccatiSolver

seeds = st.integers(0, 10_000)


def follows_dynamics(p: OptimalControlProblem, plan: Plan) -> bool:
    after = np.einsum("kij,kj->ki", p.A, plan.x[:-1]) + np.einsum("kij,kj->ki", p.B, plan.u) + p.c
    rows = np.einsum("kij,kj->ki", p.C, plan.x[:-1]) + np.einsum("kij,kj->ki", p.D, plan.u)
    same = np.allclose(plan.x[1:], after, atol=1e-9) and np.allclose(plan.y, rows, atol=1e-9)
    return bool(same and np.array_equal(plan.x[0], p.x_0))


@given(seeds, st.integers(2, 60))
def test_every_hard_problem_is_solved_to_optimality_from_a_cold_start(seed: int, stages: int) -> None:
    p = random_problem(stages, seed)
    plan = RiccatiSolver(60).solve(p)
    assert plan.optimal
    assert plan.primal_residual < 1e-4
    assert plan.dual_residual < 1.0  # against derivatives of up to 1e4
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
    heavier = p._replace(W=10.0 * p.W)
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
    assert plan.primal_residual < 1e-4
    assert plan.dual_residual < 1.0  # against derivatives of up to 1e4
