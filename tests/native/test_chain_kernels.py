"""Newton steps of both chains against the dense problem: rows by simulation, the Hessian as one matrix."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.chains import PERIOD_S, coaxial_lateral

from rcopterx.control.controllers.chains.chain import Chain, ChainTarget
from rcopterx.control.controllers.chains.lateral_chain import LateralChain
from rcopterx.control.models.lateral import POSITION, VELOCITY, LateralSystem
from rcopterx.native.bounds import move_bounds_on
from rcopterx.native.settling import AFRESH, GO_ON, SHIFTED
from rcopterx.vehicles.state import Array, heading_matrix
from rcopterx.vehicles.types import COAXIAL

STAGES = 8
SLOTS = 2
SYSTEM = LateralSystem(COAXIAL, PERIOD_S)
LATERAL = coaxial_lateral(STAGES, SLOTS)
seeds = st.integers(0, 2**32 - 1)


def lateral_chain(random: np.random.Generator) -> tuple[LateralChain, Array, Array, Array]:
    """A chain at some demands, its rows and last state per demand, and its last state."""
    chain = LateralChain(LATERAL, SYSTEM)
    angles = random.uniform(-3.0, 3.0, STAGES)
    turn, middle = (
        np.array([heading_matrix(angle) for angle in some]) for some in (angles, angles[1:] + 0.1)
    )
    directions = random.normal(size=(STAGES, SLOTS, 2))
    chain.turn[:], chain.demand_turn[:] = turn, middle
    chain.set_clearances(directions)
    first = random.normal(size=SYSTEM.size)
    chain.begin(first, np.zeros(2), shifted=False)

    def simulated(state: Array, demands: Array) -> tuple[Array, Array]:
        rows = []
        for stage in range(STAGES):
            demand = demands[2 * stage : 2 * stage + 2] if stage < STAGES - 1 else None
            stick = np.zeros(2) if demand is None else middle[stage].T @ demand / COAXIAL.b[:2]
            velocity = turn[stage].T @ state[VELOCITY]
            rows.append((*state[POSITION], *velocity, *stick, *(directions[stage] @ state[POSITION])))
            if demand is not None:
                state = SYSTEM.transition @ state + SYSTEM.demand @ demand
        return np.array(rows), state

    demands = random.normal(size=2 * (STAGES - 1))
    chain.move(demands)
    units = np.eye(len(demands))
    found = [simulated(np.zeros(SYSTEM.size), unit) for unit in units]
    rows, last = (np.stack([pair[part] for pair in found], axis=-1) for part in (0, 1))
    return chain, rows, last, simulated(first, demands)[1]


@settings(deadline=None, max_examples=60)
@given(seeds, st.integers(0, STAGES), st.floats(0.0, 6.0))
def test_step_of_the_horizontal_problem_is_that_of_the_dense_one(
    seed: int, pressed: int, size: float
) -> None:
    """With additional weights of up to 10^6 on some rows of the first stages, or on all."""
    random = np.random.default_rng(seed)
    chain, rows, last, reached = lateral_chain(random)
    added = 10.0**size * random.uniform(size=chain.weights.shape)
    added *= random.uniform(size=added.shape) < 0.3
    added[pressed:] = 0.0
    weights = chain.weights + added
    target = ChainTarget(rows[..., 0], random.normal(size=SYSTEM.size), np.zeros((1, 8)), np.zeros((1, 8)))
    pull = random.normal(size=weights.shape)
    pull[-1, 4:6] = 0.0
    factor = chain.factorize(weights)
    assert factor is not None
    hessian = np.einsum("srf,sr,srg->fg", rows, weights, rows) + last.T @ chain.terminal_cost @ last
    gradient = np.einsum("srf,sr->f", rows, pull)
    gradient += last.T @ chain.terminal_cost @ (reached - target.terminal)
    step = chain.step(factor, pull, target)
    assert step == pytest.approx(-np.linalg.solve(hessian, gradient), rel=1e-5, abs=1e-7 * np.abs(step).max())
    assert chain.change_of_values(step) == pytest.approx(rows @ step, rel=1e-9, abs=1e-9)


def flat_chain(random: np.random.Generator, lag: bool) -> Chain:
    pole = random.uniform(0.5, 0.9, 2) if lag else None
    chain = Chain(replace(LATERAL, gain=np.array([2.0, -1.5]), pole=pole, rate_feedback=np.full(2, 0.05)))
    levels = chain.parameters.levels
    turn = np.array([heading_matrix(angle) for angle in random.uniform(-1.0, 1.0, STAGES + levels - 2)])
    transition = np.eye(2) + 0.05 * random.normal(size=(len(turn) - 1, 2, 2))
    root = random.normal(size=(2 * levels, 2 * levels))
    chain.set_matrices(turn, transition, root @ root.T)
    chain.set_clearances(random.normal(size=(STAGES, SLOTS, 2)))
    chain.begin(random.normal(size=(levels, 2)), random.normal(size=2), shifted=False)
    return chain


@settings(deadline=None, max_examples=60)
@given(seeds, st.booleans())
def test_step_of_a_chain_of_integrators_goes_to_where_the_cost_has_no_slope(seed: int, lag: bool) -> None:
    random = np.random.default_rng(seed)
    chain = flat_chain(random, lag)
    weights = chain.weights + random.uniform(0.1, 10.0, chain.weights.shape)
    aim, terminal = random.normal(size=weights.shape), random.normal(size=2 * chain.parameters.levels)
    target = ChainTarget(aim, terminal, np.zeros((1, 8)), np.zeros((1, 8)))
    factor = chain.factorize(weights)
    assert factor is not None

    def cost() -> float:
        return 0.5 * float((weights * (chain.values() - aim) ** 2).sum()) + chain.terminal_cost_of(target)

    before = cost()
    step = chain.step(factor, weights * (chain.values() - aim), target)
    chain.move(step)
    least = cost()
    assert least <= before
    for _ in range(5):
        aside = random.normal(size=step.shape) * np.abs(step).max()
        chain.move(aside)
        there = cost()
        chain.move(-2.0 * aside)
        back = cost()
        chain.move(aside)
        # Of a parabola around its lowest point both sides are equally high.
        assert there == pytest.approx(back, rel=1e-6)
        assert there > least


@settings(deadline=None, max_examples=60)
@given(seeds, st.booleans(), st.floats(0.05, 2.0))
def test_what_settles_satisfies_the_optimality_conditions(seed: int, horizontal: bool, room: float) -> None:
    """Where bounds that press are the guessed ones: no step is left, and multipliers push inwards only."""
    random = np.random.default_rng(seed)
    chain = lateral_chain(random)[0] if horizontal else flat_chain(random, lag=True)
    shape = chain.weights.shape
    size = SYSTEM.size if horizontal else 6
    target = ChainTarget(np.zeros(shape), np.zeros(size), np.full((1, 8), -room), np.full((1, 8), room))
    penalty, active, factor = chain.penalty, chain.active, chain.unknown_factor(bounds=True)
    start = np.full((3, 2), np.nan), random.normal(size=2)
    if horizontal:
        start = np.full(SYSTEM.size, np.nan), start[1]
    plan = np.empty(chain.plan_shapes[0]), np.empty(chain.plan_shapes[1])
    for stale in 20 * [True, False]:
        side = active.side.copy()
        steps, solved, same, presses = chain.attempt(
            *chain.problem, *start, GO_ON, factor.numbers, factor.side, stale,
            *target, 20, *plan,
        )  # fmt: skip
        assert steps > 0
        assert (factor.side == side).all()
        known = chain.factorize(chain.weights + penalty * np.abs(side))
        assert known is not None
        assert factor.numbers == pytest.approx(known, rel=1e-12)
        assert same == bool((active.side == side).all())
        assert presses == bool(active.side.any())
        if solved or same:
            break
    if not solved:  # Newton's steps may go round in circles; the interior point is there for these
        return
    values = chain.values()
    assert (plan[0] == chain.positions()).all()
    assert plan[1] == pytest.approx(values[:-1, chain.inputs] - chain.balance(start[1]), abs=1e-12)
    assert active.values == pytest.approx(values, abs=1e-6)
    bound = np.where(active.side > 0.0, room, -room)
    soft = penalty * np.abs(active.side) * (values - bound)
    soft[:, chain.inputs] = active.multipliers
    left = chain.step(factor.numbers, chain.weights * values + soft, target)
    assert np.abs(chain.change_of_values(left)).max() < 1e-4
    beyond = chain.bounded * (np.abs(values) - room)
    assert beyond[:, chain.inputs].max() < 2e-5
    assert (active.multipliers * active.side[:, chain.inputs] >= -1e-6).all()
    assert (np.abs(active.side) == (beyond > 0.0))[:, : chain.inputs.start].all()


@settings(deadline=None, max_examples=40)
@given(seeds, st.booleans())
def test_an_attempt_without_bounds_begins_and_goes_to_where_the_cost_has_no_slope(
    seed: int, horizontal: bool
) -> None:
    """From nothing, and then from there one stage on, with a factor that is known."""
    random = np.random.default_rng(seed)
    chain = lateral_chain(random)[0] if horizontal else flat_chain(random, lag=True)
    size = SYSTEM.size if horizontal else 6
    target = ChainTarget(
        random.normal(size=chain.weights.shape),
        random.normal(size=size),
        np.full((1, 8), -1e9),
        np.full((1, 8), 1e9),
    )
    factor = chain.unknown_factor(bounds=False)
    plan = np.empty(chain.plan_shapes[0]), np.empty(chain.plan_shapes[1])
    for begin in (AFRESH, SHIFTED):
        start = random.normal(size=size).reshape((size,) if horizontal else (3, 2)), random.normal(size=2)
        outcome = chain.attempt(
            *chain.problem, *start, begin, factor.numbers, factor.side, begin == AFRESH,
            *target, 9, *plan,
        )  # fmt: skip
        assert outcome == (1, True, True, False)
        inputs = chain.values()[:-1, chain.inputs]
        assert plan[1] == pytest.approx(inputs - chain.balance(start[1]), rel=1e-9, abs=1e-9)
        left = chain.step(factor.numbers, chain.weights * (chain.values() - target.rows), target)
        assert np.abs(left).max() < 1e-7 * (1.0 + np.abs(plan[0]).max())
        chain.begin(*start, shifted=False)
        chain.roll_out(inputs)
        assert chain.positions() == pytest.approx(plan[0], rel=1e-6, abs=1e-6)


@given(seeds)
def test_bounds_move_on_by_a_stage(seed: int) -> None:
    random = np.random.default_rng(seed)
    side, bounded = random.integers(-1, 2, (STAGES, 6)).astype(float), np.ones((STAGES, 6))
    bounded[0, :4] = bounded[-1, 4:] = 0.0
    multipliers = random.normal(size=(STAGES, 2))
    moved, then = side.copy(), multipliers.copy()
    move_bounds_on(moved, then, bounded)
    expected = np.vstack((side[1:], side[-1:])) * bounded
    assert (moved == expected).all()
    assert (then == np.vstack((multipliers[1:-1], multipliers[-2:]))).all()
