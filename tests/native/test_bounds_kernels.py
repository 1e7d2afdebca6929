"""What is checked of the numbers of a control step, against the same in numpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.bounds import (
    INPUTS_BEYOND_LIMITS,
    MISSHAPEN,
    PLAN_BEYOND_REASON,
    USABLE,
    cut_reference,
    flaw_of_answer,
    sound_question,
)

STAGES = 5
CAP = np.full(16, 10.0)
seeds = st.integers(0, 2**32 - 1)
odd = st.sampled_from([0.0, 0.9, 1.1, -1.1, 30.0, np.nan, np.inf, -np.inf])


@given(seeds, st.integers(0, 23), odd, st.integers(0, 12 * STAGES - 1), odd)
def test_a_question_is_sound_where_estimate_and_reference_are(
    seed: int, at: int, number: float, place: int, other: float
) -> None:
    random = np.random.default_rng(seed)
    numbers, samples = random.normal(size=24), random.normal(size=(STAGES, 12))
    numbers[at], samples.flat[place] = number, other
    parts = np.split(numbers, (8, 12, 16, 18, 20, 22))
    known, aimed = sound_question(*parts, CAP, samples, 20.0)
    assert known == bool((np.abs(numbers[:16]) <= CAP).all() and np.isfinite(numbers).all())
    assert aimed == bool((np.abs(samples) <= 20.0).all())


def test_a_reference_without_stages_is_none() -> None:
    nothing = np.empty(0)
    parts = np.zeros(8), np.zeros(4), np.zeros(4), *4 * [nothing]
    assert sound_question(*parts, CAP, np.empty((0, 12)), 1.0) == (True, False)


@given(seeds, st.integers(0, 4 * STAGES - 1), odd, odd)
def test_an_answer_is_usable_where_plan_and_inputs_are(
    seed: int, place: int, number: float, planned: float
) -> None:
    random = np.random.default_rng(seed)
    inputs, samples = random.uniform(-1.0, 1.0, (STAGES, 4)), random.normal(size=(STAGES + 1, 12))
    inputs.flat[place], samples[-1, -1] = number, planned
    low, high, cut = np.full(4, -1.0), np.full(4, 1.0), np.empty((STAGES, 4))
    found = flaw_of_answer(samples, inputs, 20.0, low, high, 0.2, cut)
    within = USABLE if (np.abs(inputs) <= 1.2).all() else INPUTS_BEYOND_LIMITS
    assert found == (within if (np.abs(samples) <= 20.0).all() else PLAN_BEYOND_REASON)
    assert np.array_equal(cut, np.clip(inputs, low, high), equal_nan=True)


@pytest.mark.parametrize(
    ("planned", "given_"),
    [((STAGES, 12), (STAGES, 4)), ((STAGES + 1, 11), (STAGES, 4)), ((STAGES + 1, 12), (STAGES, 3)),
     ((STAGES, 12), (STAGES - 1, 4)), ((0, 12), (0, 4))],
)  # fmt: skip
def test_an_answer_has_a_row_of_inputs_between_stages(
    planned: tuple[int, int], given_: tuple[int, int]
) -> None:
    low, high, cut = np.full(4, -1.0), np.full(4, 1.0), np.empty((STAGES, 4))
    assert flaw_of_answer(np.zeros(planned), np.zeros(given_), 20.0, low, high, 0.2, cut) == MISSHAPEN


@given(seeds, st.floats(-100.0, 100.0))
def test_a_reference_is_cut_to_bounds_and_its_headings_around_the_present_one(seed: int, yaw: float) -> None:
    random = np.random.default_rng(seed)
    samples = random.normal(0.0, 2.0, (STAGES, 12))
    samples[:, 3] *= 50.0
    low, high, cut = random.uniform(-2.0, -1.0, 12), random.uniform(1.0, 2.0, 12), np.empty((STAGES, 12))
    cut_reference(samples, yaw, low, high, 60.0, cut)
    low[3], high[3] = yaw - 60.0, yaw + 60.0
    assert cut == pytest.approx(np.clip(samples, low, high), abs=0.0)
