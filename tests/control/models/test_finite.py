"""One number that is not finite suffices to reject an estimate."""

import numpy as np
import pytest
from support.records import replace

from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.control.models.prediction import is_finite

TILT = TiltEstimate(np.zeros(4), np.zeros(2), np.zeros(2), np.zeros(2))
WITHOUT_TILT = Estimate(np.zeros(8), np.zeros(4), np.zeros(4))
ESTIMATE = replace(WITHOUT_TILT, tilt=TILT)


def spoiled(values: np.ndarray, number: float) -> np.ndarray:
    return np.append(values[:-1], number)


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", ["motion", "actuator", "disturbance"])
def test_one_number_of_the_motion_suffices(part: str, number: float) -> None:
    for estimate in (ESTIMATE, WITHOUT_TILT):
        assert is_finite(estimate)
        assert not is_finite(replace(estimate, **{part: spoiled(getattr(estimate, part), number)}))


@pytest.mark.parametrize("part", ["core", "servo", "wind_m_s2", "trim"])
def test_one_number_of_the_tilt_suffices(part: str) -> None:
    tilt = replace(TILT, **{part: spoiled(getattr(TILT, part), np.nan)})
    assert not is_finite(replace(ESTIMATE, tilt=tilt))
