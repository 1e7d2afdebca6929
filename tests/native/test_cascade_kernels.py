"""Kernels that put the cascade's problems together: references by simulation, plans by differences."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.cascade import (
    heading_moved,
    horizontal_problem,
    steady_problem,
    turning,
)
from rcopterx.native.lateral_problem import lateral_problem
from rcopterx.native.plans import join_plans, turned_by_thrust
from rcopterx.vehicles.state import Array, heading_matrix

STAGES = 7
PERIOD_S = 0.02
WIDE = np.array((np.full(6, -1e9), np.full(6, 1e9)))
WHOLE = np.array(((-np.inf, -np.inf), (np.inf, np.inf)))
seeds = st.integers(0, 2**32 - 1)


class Problem:
    """A random chain of two axes, a reference and a heading plan."""

    def __init__(self, seed: int, lagged: bool) -> None:
        random = self.random = np.random.default_rng(seed)
        self.lagged = lagged
        self.decay, self.push = random.uniform(0.9, 1.0, 2), random.uniform(0.5, 2.0, 2)
        self.pole, self.feedback = random.uniform(0.2, 0.9, 2), random.normal(size=2)
        self.dynamics = self.push, self.pole, self.feedback, lagged
        self.samples = random.normal(size=(STAGES, 12))
        self.heading = np.cumsum(random.normal(0.0, 0.1, STAGES + 2))
        self.rows, self.terminal = np.full((STAGES, 6), np.nan), np.full(6 if lagged else 4, np.nan)
        self.low, self.high = np.empty((2, 1, 6))

    def steady(
        self, velocity: Array, bounds: Array, balance: Array, share: Array, feed_forward: bool = True
    ) -> bool:
        random, self.gain = self.random, np.array((2.0, -0.5))
        motion, actuator = random.normal(size=8), random.normal(size=4)
        motion[6:] = velocity
        disturbance = np.concatenate((random.normal(size=2), balance * self.gain))
        disturbance[2] += 9.0
        target = self.rows, self.terminal, self.low, self.high
        chain = 9.0, self.decay, PERIOD_S, feed_forward, *self.dynamics, self.gain
        far, aim, load = np.full(12, 1e9), np.empty((STAGES, 12)), np.empty(2)
        first = np.empty((3 if self.lagged else 2, 2))
        reference = self.samples, bounds, share, -far, far, 1e9
        begin = aim, first, load
        within = steady_problem(motion, actuator, disturbance, *reference, *chain, *begin, *target)
        assert (aim == self.samples).all()
        state = np.concatenate((motion, actuator)).reshape(3, 4)[:, 2:]
        assert (first == state[: len(first)]).all()
        assert load == pytest.approx(balance * self.gain)
        return within

    def flown(self, velocity: Array, after: Array, turns: Array) -> Array:
        """Velocities after each stage when the sticks of the rows are flown."""
        decay, push, pole, feedback = self.decay, self.push, self.pole, self.feedback
        actuator, reached = (after[0] - (decay * velocity[0] + _turned(turns[0], velocity[0]))) / push, []
        for stage in range(STAGES - 1):
            stick = self.rows[stage, 4:]
            here = actuator if self.lagged else stick
            reached.append(decay * velocity[stage] + _turned(turns[stage], velocity[stage]) + push * here)
            actuator = pole * actuator + (1.0 - pole) * (stick - feedback * velocity[stage])
        return np.array(reached)


def _turned(turn: float, velocity: Array) -> Array:
    return turn * np.array((velocity[1], -velocity[0]))


@given(seeds, st.booleans())
def test_sticks_of_the_vertical_and_of_yaw_fly_their_reference(seed: int, lagged: bool) -> None:
    problem = Problem(seed, lagged)
    assert problem.steady(np.zeros(2), WIDE, np.zeros(2), WHOLE)
    samples = problem.samples
    assert (problem.rows[:, :4] == samples[:, [2, 3, 6, 7]]).all()
    assert (problem.rows[-1, 4:] == 0.0).all()
    assert (problem.terminal[:4] == problem.rows[-1, :4]).all()
    after = samples[:, 6:8] + PERIOD_S * samples[:, 10:]
    reached = problem.flown(samples[:, 6:8], after, np.zeros(STAGES))
    assert reached == pytest.approx(after[:-1], abs=1e-9)


@given(seeds, st.booleans())
def test_sticks_along_a_heading_fly_their_reference_in_the_body_frame(seed: int, lagged: bool) -> None:
    problem = Problem(seed, lagged)
    heading, samples = problem.heading, problem.samples
    target = problem.rows, problem.terminal, problem.low, problem.high
    chain = problem.decay, PERIOD_S, True, *problem.dynamics, np.ones(2)
    motion, actuator, first = np.arange(8.0), np.arange(8.0, 12.0), np.empty((3 if lagged else 2, 2))
    reference = samples, heading, WIDE, WHOLE
    horizontal_problem(motion, actuator, np.zeros(2), *reference, *chain, first, *target)
    assert first.tolist() == [[0.0, 1.0], [4.0, 5.0], [8.0, 9.0]][: len(first)]
    to_body = [heading_matrix(0.5 * (one + other)).T for one, other in pairwise(heading)]
    velocity = np.array([to_body[stage] @ samples[stage, 4:6] for stage in range(STAGES)])
    next_velocity = samples[:, 4:6] + PERIOD_S * samples[:, 8:10]
    after = np.array([to_body[stage + 1] @ next_velocity[stage] for stage in range(STAGES)])
    assert (problem.rows[:, :2] == samples[:, :2]).all()
    assert problem.rows[:, 2:4] == pytest.approx(velocity)
    assert problem.flown(velocity, after, np.diff(heading)) == pytest.approx(after[:-1], abs=1e-9)


@given(seeds)
def test_without_feed_forward_only_what_damps_is_balanced(seed: int) -> None:
    problem = Problem(seed, lagged=True)
    problem.steady(np.zeros(2), WIDE, np.zeros(2), WHOLE, feed_forward=False)
    feedback = problem.feedback * problem.samples[:-1, 6:8]
    assert problem.rows[:-1, 4:] == pytest.approx(feedback)


@given(seeds)
def test_inputs_are_cut_to_what_balance_and_share_leave(seed: int) -> None:
    problem = Problem(seed, lagged=True)
    bounds = np.array((np.full(6, -1.0), np.full(6, 1.0)))
    balance = np.array((0.3, -0.9))
    share = np.array(((-0.5, 0.5), (0.5, 0.9)))
    problem.steady(np.zeros(2), bounds, balance, share)
    # Of the second one's -1.9 to 0.1 nothing lies between 0.5 and 0.9, so the whole range counts.
    assert problem.low[0] == pytest.approx([-1.0, -1.0, -1.0, -1.0, -0.5, -1.9])
    assert problem.high[0] == pytest.approx([1.0, 1.0, 1.0, 1.0, 0.5, 0.1])
    assert (problem.rows[:, 4:] >= problem.low[0, 4:]).all()
    assert (problem.rows[:, 4:] <= problem.high[0, 4:]).all()


@pytest.mark.parametrize(
    ("velocity", "within"), [((1.0, -1.0), True), ((1.1, 0.0), False), ((0.0, -1.1), False)]
)
def test_a_measured_velocity_beyond_its_bounds_is_told(velocity: tuple[float, float], within: bool) -> None:
    bounds = np.array((np.full(6, -1.0), np.full(6, 1.0)))
    problem = Problem(1, lagged=True)
    assert problem.steady(np.array(velocity), bounds, np.zeros(2), WHOLE) == within


def test_matrices_turn_with_the_heading() -> None:
    decay, heading = np.array((0.9, 0.8)), np.linspace(0.0, 0.3, STAGES)
    turn, transition = np.empty((STAGES - 1, 2, 2)), np.empty((STAGES - 2, 2, 2))
    turning(heading, decay, turn, transition)
    assert turn[1] == pytest.approx(heading_matrix(0.075))
    assert transition[1] == pytest.approx(np.array(((0.9, 0.05), (-0.05, 0.8))))


def test_a_heading_plan_moves_by_its_headings_or_by_its_turns() -> None:
    known = np.linspace(0.0, 0.3, STAGES)

    def moved(planned: Array) -> bool:
        return heading_moved(planned, known, 1e-3, 1e-4)

    assert not moved(known + 0.9e-3)
    assert not moved(np.linspace(0.0, 0.3005, STAGES))
    assert moved(known + 1.1e-3)
    assert moved(known + 2e-4 * (np.arange(STAGES) == 3))


@given(seeds, st.integers(1, 2))
def test_a_joint_plan_has_the_differences_of_its_positions(seed: int, beyond: int) -> None:
    random = np.random.default_rng(seed)
    horizontal, steady = random.normal(size=(2, STAGES + beyond, 2))
    sticks, others = random.normal(size=(2, STAGES - 1, 2))
    inputs, samples = np.empty((STAGES - 1, 4)), np.empty((STAGES, 12))
    limits = np.full(4, -0.5), np.full(4, 0.8)
    actuator = np.array((9.0, 9.0, 0.2, 9.0))
    join_plans(horizontal, steady, sticks, others, actuator, 0.4, 0.7, *limits, PERIOD_S, inputs, samples)
    flat = np.hstack((horizontal, steady))
    velocity = np.diff(flat, axis=0) / PERIOD_S
    acceleration = np.diff(velocity, axis=0) / PERIOD_S
    assert (samples[:, :4] == flat[:STAGES]).all()
    assert (samples[:, 4:8] == velocity[:STAGES]).all()
    last = len(acceleration) - 1
    assert (samples[:, 8:] == acceleration[np.minimum(np.arange(STAGES), last)]).all()
    joined = np.hstack((sticks, others))
    joined[:, 3] -= turned_by_thrust(0.4, 0.7, 0.2, others[:, 0])
    assert (inputs == np.clip(joined, -0.5, 0.8)).all()


def test_thrust_turns_by_as_much_as_its_actuator_is_behind() -> None:
    turned = turned_by_thrust(2.0, 0.75, 0.1, np.array((0.5, 0.5, 0.3)))
    assert turned == pytest.approx([2 * 0.4, 2 * 0.3, 2 * (0.3 - 0.275)])


def test_the_horizontal_problem_of_a_tilting_vehicle_is_inertial_but_for_its_sticks() -> None:
    motion = np.array((1.0, 2.0, 9.0, 0.5 * np.pi, 0.3, -0.2, 9.0, 9.0))
    first = np.empty(12)
    core, wind = np.arange(4.0), np.array((7.0, 8.0))
    random, gain, trim = np.random.default_rng(0), np.array((2.0, -3.0)), np.array((0.1, 0.0))
    samples, heading = random.normal(size=(STAGES, 12)), random.normal(size=STAGES)
    turn, middle_turn = np.empty((STAGES, 2, 2)), np.empty((STAGES - 1, 2, 2))
    rows, terminal, (low, high) = np.empty((STAGES, 6)), np.empty(12), np.empty((2, 1, 6))
    bounds = np.array((np.full(6, -9.0), np.full(6, 9.0)))
    lateral_problem(
        motion, core, np.array((0.1, 0.2)), wind, trim, samples, heading, bounds, WHOLE, gain, 0.5, 0.0, True,
        first, turn, middle_turn, rows, terminal, low, high,
    )  # fmt: skip
    assert (rows[:, :2] == samples[:, :2]).all()
    assert terminal.tolist() == [*samples[-1, :2], *samples[-1, 4:6], *8 * [0.0]]
    middle = [0.5 * (one + other) for one, other in pairwise(heading)]
    for stage, sample in enumerate(samples):
        assert turn[stage] == pytest.approx(heading_matrix(heading[stage]))
        assert rows[stage, 2:4] == pytest.approx(turn[stage].T @ sample[4:6])
        if stage < STAGES - 1:
            assert middle_turn[stage] == pytest.approx(heading_matrix(middle[stage]))
            stick = middle_turn[stage].T @ (sample[8:10] - 0.5 * sample[4:6]) / gain
            assert rows[stage, 4:] == pytest.approx(stick)
    assert low[0].tolist() == [*4 * [-9.0], -8.9, -9.0]
    assert high[0].tolist() == [*4 * [9.0], 9.1, 9.0]
    assert first == pytest.approx([1.0, 2.0, 0.2, 0.3, 0.0, 1.0, 2.0, 3.0, 0.6, 0.2, 7.0, 8.0])
