"""A helicopter that is identified in flight hovers better than one of which only the type is known."""

from agents.identification.fit import identify
from experiments.identification import CASES, excited_flight, hover_errors, same_delay
from simulator.conditions import HELICOPTERS
from vehicles.types import COAXIAL

SEED = 2


def test_an_identified_helicopter_hovers_better_than_its_type() -> None:
    conditions = same_delay(HELICOPTERS, COAXIAL)
    tilt_measured, _ = CASES
    found = identify(excited_flight(COAXIAL, conditions, SEED, tilt_measured), COAXIAL)
    assert found.problems == ()
    before = hover_errors(COAXIAL, conditions, SEED, tilt_measured, 20.0)
    after = hover_errors(found.model, conditions, SEED, tilt_measured, 20.0)
    assert after[:2].max() < 0.012
    assert after[:2].max() < 0.7 * before[:2].max()
    assert after[2] < 0.005
