"""A reference is cut to bounds as numpy does it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.bounds import cut_reference

STAGES = 5
seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.floats(-100.0, 100.0))
def test_a_reference_is_cut_to_bounds_and_its_headings_around_the_present_one(seed: int, yaw: float) -> None:
    random = np.random.default_rng(seed)
    samples = random.normal(0.0, 2.0, (STAGES, 12))
    samples[:, 3] *= 50.0
    low, high, cut = random.uniform(-2.0, -1.0, 12), random.uniform(1.0, 2.0, 12), np.empty((STAGES, 12))
    cut_reference(samples, yaw, low, high, 60.0, cut)
    low[3], high[3] = yaw - 60.0, yaw + 60.0
    assert cut == pytest.approx(np.clip(samples, low, high), abs=0.0)
