"""Promises of inputs as they are sent: whole units within the limits, close to what was wanted."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from support.vehicle_types import TYPES

from rcopterx.agents.flight.timeline import INPUT_UNIT, as_sent
from rcopterx.vehicles.model import Model

models = st.sampled_from(list(TYPES.values()))
inputs = st.integers(1, 5).flatmap(lambda rows: arrays(np.float64, (rows, 4), elements=st.floats(-1.0, 1.0)))


@given(models, inputs)
def test_sent_inputs_are_whole_units_or_limits(model: Model, wanted: NDArray[np.float64]) -> None:
    wanted = np.clip(wanted, model.u_min, model.u_max)
    sent = as_sent(wanted, model)
    assert np.all((model.u_min <= sent) & (sent <= model.u_max))
    assert np.all(np.abs(sent - wanted) <= 0.5 * INPUT_UNIT)
    whole = sent / INPUT_UNIT == np.rint(sent / INPUT_UNIT)
    assert np.all(whole | (sent == model.u_min) | (sent == model.u_max))
