"""The horizontal problem against an independent solver, and its promises."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from support.chains import PERIOD_S, coaxial_lateral

from rcopterx.control.controllers.chains.active_set import Budget
from rcopterx.control.controllers.chains.chain import ChainTarget
from rcopterx.control.controllers.chains.lateral_qp import LateralQP
from rcopterx.control.models.lateral import POSITION, VELOCITY, LateralSystem
from rcopterx.vehicles.state import heading_matrix
from rcopterx.vehicles.types import COAXIAL

osqp = pytest.importorskip("osqp")
STAGES = 20
SYSTEM = LateralSystem(COAXIAL, PERIOD_S)
PARAMETERS = coaxial_lateral(STAGES)
LOWER, UPPER = np.array([-1.2, -1.2, -1, -1.3, -1, -1]), np.array([1.2, 1.2, 1, 1.3, 1, 1])


def headings(yaw_rad: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    turn = np.array([heading_matrix(yaw_rad + rate * PERIOD_S * i) for i in range(STAGES)])
    middle = np.array([heading_matrix(yaw_rad + rate * PERIOD_S * (i + 0.5)) for i in range(STAGES - 1)])
    return turn, middle


def resting(lower: np.ndarray = LOWER, upper: np.ndarray = UPPER) -> ChainTarget:
    return ChainTarget(np.zeros((STAGES, 6)), np.zeros(SYSTEM.size), lower[None], upper[None])


def workspace(turn: np.ndarray, middle: np.ndarray) -> LateralQP:
    qp = LateralQP(PARAMETERS, SYSTEM, 60)
    qp.chain.turn[:], qp.chain.demand_turn[:] = turn, middle
    return qp


def independent(first: np.ndarray, turn: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Sticks of the same problem in states, sticks and slacks, by OSQP at tight tolerance."""
    n, gain = SYSTEM.size, COAXIAL.b[:2]
    qp = LateralQP(PARAMETERS, SYSTEM, 60)
    effort = float((PARAMETERS.input_weights / gain**2).mean())
    block = n + 2 + 4
    size = STAGES * block
    cost, rows, low, high = sparse.lil_matrix((size, size)), [], [], []

    def constrain(row: sparse.lil_matrix, lower: float, upper: float) -> None:
        rows.append(row)
        low.append(lower)
        high.append(upper)

    for stage in range(STAGES):
        at = stage * block
        if 0 < stage < STAGES - 1:
            cost[at + np.arange(2), at + np.arange(2)] = 100.0
            cost[at + 2 + np.arange(2), at + 2 + np.arange(2)] = 1.0
        if stage < STAGES - 1:
            cost[at + n : at + n + 2, at + n : at + n + 2] = effort * np.diag(gain**2)
        cost[at + n + 2 + np.arange(4), at + n + 2 + np.arange(4)] = PARAMETERS.soft_weight
    last = (STAGES - 1) * block
    cost[last : last + n, last : last + n] = qp.chain.terminal_cost
    for index in range(n):
        row = sparse.lil_matrix((1, size))
        row[0, index] = 1.0
        constrain(row, first[index], first[index])
    for stage in range(STAGES - 1):
        at, then = stage * block, (stage + 1) * block
        push = SYSTEM.demand @ middle[stage] * gain
        for index in range(n):
            row = sparse.lil_matrix((1, size))
            row[0, at : at + n] = SYSTEM.transition[index]
            row[0, at + n : at + n + 2] = push[index]
            row[0, then + index] = -1.0
            constrain(row, 0.0, 0.0)
        for axis in range(2):
            row = sparse.lil_matrix((1, size))
            row[0, at + n + axis] = 1.0
            constrain(row, LOWER[4 + axis], UPPER[4 + axis])
    for stage in range(1, STAGES):
        at = stage * block
        for axis in range(2):
            row = sparse.lil_matrix((1, size))
            row[0, at + axis] = 1.0
            row[0, at + n + 2 + axis] = 1.0
            constrain(row, LOWER[axis], UPPER[axis])
            row = sparse.lil_matrix((1, size))
            row[0, at + 2 : at + 4] = turn[stage][:, axis]
            row[0, at + n + 4 + axis] = 1.0
            constrain(row, LOWER[2 + axis], UPPER[2 + axis])
    solver = osqp.OSQP()
    solver.setup(
        sparse.triu(cost, format="csc"), np.zeros(size), sparse.vstack(rows, format="csc"), np.array(low),
        np.array(high), verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=200000, polishing=True,
    )  # fmt: skip
    found = solver.solve(raise_error=True).x.reshape(STAGES, block)
    return np.asarray(found[:-1, n : n + 2])


def start(position: tuple[float, float], velocity: tuple[float, float]) -> np.ndarray:
    state = np.zeros(SYSTEM.size)
    state[POSITION], state[VELOCITY] = position, velocity
    return state


@pytest.mark.parametrize("rate", [0.0, 2.0])
@pytest.mark.parametrize(
    ("position", "velocity"),
    [((0.05, -0.03), (0.0, 0.1)), ((1.0, -0.8), (0.0, 0.0)), ((-0.3, 0.4), (1.1, -1.2))],
    ids=["small", "sticks at their limits", "velocity out of bounds"],
)
def test_the_solution_is_that_of_an_independent_solver(
    position: tuple[float, float], velocity: tuple[float, float], rate: float
) -> None:
    turn, middle = headings(0.7, rate)
    first = start(position, velocity)
    found = workspace(turn, middle).solve(first, np.zeros(2), resting())
    assert found.solved
    assert found.inputs == pytest.approx(independent(first, turn, middle), abs=2e-3)


def test_without_bounds_the_first_stick_is_the_regulator() -> None:
    turn, middle = headings(0.0, 0.0)
    first = start((0.02, 0.01), (0.03, -0.02))
    qp = workspace(turn, middle)
    far = np.full(6, 1e6)
    found = qp.solve(first, np.zeros(2), resting(-far, far))
    assert found.inputs[0] * COAXIAL.b[:2] == pytest.approx(-qp.chain.gain @ first, rel=1e-3, abs=1e-5)


def test_sticks_keep_their_bounds_and_positions_follow_from_them() -> None:
    turn, middle = headings(-1.0, 1.0)
    first = start((0.9, 0.9), (0.0, 0.0))
    found = workspace(turn, middle).solve(first, np.zeros(2), resting())
    assert np.abs(found.inputs).max() <= 1.0 + 1e-4
    state = first
    for stage in range(STAGES - 1):
        assert found.flat[stage] == pytest.approx(state[POSITION], abs=1e-9)
        demand = middle[stage] @ (found.inputs[stage] * COAXIAL.b[:2])
        state = SYSTEM.transition @ state + SYSTEM.demand @ demand
    assert len(found.flat) == STAGES + 2


def test_the_trim_is_taken_off_the_sticks() -> None:
    turn, middle = headings(0.3, 0.0)
    first, trim = start((0.05, 0.0), (0.0, 0.0)), np.array([0.1, -0.05])
    plain = workspace(turn, middle).solve(first, np.zeros(2), resting())
    trimmed = workspace(turn, middle).solve(first, trim, resting())
    assert trimmed.inputs == pytest.approx(plain.inputs - trim, abs=1e-9)


def test_rows_that_keep_clear_push_the_positions_away() -> None:
    turn, middle = headings(0.0, 0.0)
    qp = LateralQP(replace(PARAMETERS, clearances=1, clearance_weight=5e5), SYSTEM, 60)
    qp.chain.turn[:], qp.chain.demand_turn[:] = turn, middle
    directions = np.tile([[[1.0, 0.0]]], (STAGES, 1, 1))
    qp.set_clearances(directions)
    target = ChainTarget(
        np.zeros((STAGES, 7)),
        np.zeros(SYSTEM.size),
        np.append(LOWER, 0.2)[None],
        np.append(UPPER, 20.0)[None],
    )
    found = qp.solve(start((0.25, 0.0), (0.0, 0.0)), np.zeros(2), target)
    assert found.flat[1:STAGES, 0].min() > 0.19


def cost_of(qp: LateralQP, first: np.ndarray, sticks: np.ndarray, aim: ChainTarget) -> float:
    """Cost of sticks by simulation, level headings: tracking, effort, excess, terminal cost."""
    gain, state, total = COAXIAL.b[:2], first, 0.0
    effort = float((PARAMETERS.input_weights / gain**2).mean()) * gain**2
    for stage in range(STAGES):
        there = np.concatenate((state[POSITION], state[VELOCITY]))
        if 0 < stage < STAGES - 1:
            total += float(np.repeat((100.0, 1.0), 2) @ (there - aim.rows[stage, :4]) ** 2)
        if stage:
            beyond = np.maximum(there - aim.upper[0, :4], 0.0) + np.maximum(aim.lower[0, :4] - there, 0.0)
            total += PARAMETERS.soft_weight * float(beyond @ beyond)
        if stage < STAGES - 1:
            total += float(effort @ sticks[stage] ** 2)
            state = SYSTEM.transition @ state + SYSTEM.demand @ (gain * sticks[stage])
    error = state - aim.terminal
    return 0.5 * (total + float(error @ qp.chain.terminal_cost @ error))


@settings(deadline=None, max_examples=60)
@given(
    st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)),
    st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)),
    st.integers(0, 40),
    st.booleans(),
)
def test_a_solve_that_is_stopped_at_any_moment_is_no_worse_than_the_previous_plan(
    before: tuple[float, float], after: tuple[float, float], stop: int, warm: bool
) -> None:
    first = start((0.4, -0.6), (0.8, -0.9))
    qp = workspace(*headings(0.0, 0.0))
    aim = resting()
    aim.rows[:, :2] = aim.terminal[POSITION] = before
    planned = qp.solve(first, np.zeros(2), aim).inputs
    if not warm:
        qp.forget()
    aim.rows[:, :2] = aim.terminal[POSITION] = after
    asked = count()
    found = qp.solve(first, np.zeros(2), aim, Budget(lambda: next(asked) >= stop, lambda: planned))
    assert (np.abs(found.inputs) <= 1.0 + 1e-5).all()
    best, known = (cost_of(qp, first, u, aim) for u in (found.inputs, np.clip(planned, -1.0, 1.0)))
    assert best <= known * (1.0 + 1e-6) + 1e-9
    assert found.solved or next(asked) > stop
