"""Vehicles whose origin is not their centre of gravity hover as precisely as others."""

import pytest
from support.conditions import HELICOPTERS

from rcopterx_studies.experiments.lever_arm import hover


@pytest.mark.parametrize("arm_mm", [-40, 40])
def test_a_vehicle_that_nobody_identified_hovers_with_a_lever_arm(arm_mm: int) -> None:
    assert hover("default", arm_mm, False, HELICOPTERS, 4) < 25.0
