"""The guard lowers the bandwidth of a vehicle that oscillates, step by step, and of no other one."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.hovering import PERIOD_S, HoveringFlight

from rcopterx.agents.flight.oscillation import Loop
from rcopterx.agents.pilot import ControlOutput
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.agents.tuning.guard import (
    BANDWIDTH_LOWERED,
    DRIFTED,
    EFFORT_FACTORS,
    LARGEST,
    OSCILLATION,
    SHORTEST_STEP_S,
    STEP,
    OscillationGuard,
    without_guard,
)
from rcopterx.bus.requests import Tune
from rcopterx.control.estimators.extended_kalman import LEVER_ARM_FOUND, ExtendedKalmanEstimator
from rcopterx.control.identification.excitation import Excitation
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import U_THRUST, YAW


class Watched:
    """A guard that is shown what a test wants it to see."""

    def __init__(self, controller: str = "cascade") -> None:
        self.flight = HoveringFlight(controller)
        self.flight.fly(5)
        self.guard = OscillationGuard(self.flight.pilot, self.flight.tuning)
        self.time_s = 0.0

    def swing(self, seconds: float, amplitude: float = 1.0, own: bool = True, stick_index: int = 0) -> None:
        flown, motion = self.flight.flown[-1], self.flight.pilot.estimate.motion
        for _ in range(round(seconds / PERIOD_S)):
            stick = flown.input.copy()
            stick[stick_index] += amplitude * math.sin(math.tau * 2.0 * self.time_s)
            self.guard.watch(
                ControlOutput(stick, flown.next_inputs, flown.plan, 0.02, motion[: YAW + 1].copy()), own
            )
            self.flight.tuning.wait()
            self.flight.tuning.finish()
            self.time_s += PERIOD_S

    @property
    def factor(self) -> float:
        return self.flight.tuning.configuration.effort_factors[Loop.HORIZONTAL]


def test_as_long_as_it_oscillates_the_weights_rise_step_by_step() -> None:
    watched, factors = Watched(), []
    for _ in range(8):
        watched.swing(0.5)
        factors.append(watched.factor)
    assert factors[1] == 1.0
    assert factors == sorted(factors)
    assert max(b / a for a, b in pairwise(factors)) <= STEP**2
    assert watched.flight.pilot.events[BANDWIDTH_LOWERED] == round(math.log(factors[-1], STEP))
    assert SHORTEST_STEP_S >= 0.2


@pytest.mark.parametrize(("stick", "loop"), [(1, Loop.HORIZONTAL), (2, Loop.HEIGHT), (3, Loop.YAW)])
def test_only_the_loop_that_oscillates_is_lowered(stick: int, loop: Loop) -> None:
    watched = Watched()
    watched.swing(1.6, 0.4 if loop is not Loop.HORIZONTAL else 1.0, stick_index=stick)
    factors = watched.flight.tuning.configuration.effort_factors
    assert factors[loop] > 1.0
    assert {factor for other, factor in zip(Loop, factors, strict=True) if other is not loop} == {1.0}


def test_an_oscillation_is_one_about_the_hover_of_the_present_model() -> None:
    watched = Watched()
    old = watched.flight.pilot.model
    model = replace(old, gravity_m_s2=1.5 * old.gravity_m_s2)
    watched.flight.pilot.use_model(
        model,
        watched.flight.tuning.configuration.controller_for(model, PERIOD_S),
        watched.flight.tuning.configuration.estimator_for(model, PERIOD_S),
    )
    watched.flight.flown[-1].input[:] = model.hover_input
    watched.swing(1.6, 0.8 * float(model.stick_room[U_THRUST]), stick_index=U_THRUST)
    assert watched.flight.pilot.events[OSCILLATION] > 0


def test_what_oscillated_is_told_until_somebody_tunes_the_vehicle() -> None:
    watched = Watched()
    assert watched.guard.remark == ""
    watched.swing(1.8, amplitude=0.9, stick_index=1)
    lowered = "bandwidth lowered: roll stick oscillated at 2.0 Hz by 0.8"
    assert watched.guard.remark.startswith(lowered)
    watched.swing(3.0, amplitude=0.1)
    assert watched.guard.remark.startswith(lowered)
    watched.flight.tuning.begin(without_guard(watched.flight.tuning.configuration))
    watched.flight.tuning.wait()
    watched.flight.tuning.finish()
    assert watched.guard.remark == ""


def test_when_the_oscillation_ends_the_bandwidth_stays_lowered() -> None:
    watched = Watched()
    watched.swing(1.6)
    lowered = watched.factor
    assert lowered > 1.0
    watched.swing(3.0, amplitude=0.2)
    assert watched.factor == lowered
    # the flight goes on with it
    watched.flight.fly(50)
    assert watched.flight.error_m() < 0.1


def test_once_the_filter_finds_the_lever_arm_that_it_flew_without_the_bandwidth_returns() -> None:
    watched = Watched()
    pilot, configuration = watched.flight.pilot, watched.flight.tuning.configuration
    estimator = configuration.estimator_for(pilot.model, PERIOD_S)
    assert isinstance(estimator, ExtendedKalmanEstimator)
    pilot.estimator.use(estimator, started=False)
    watched.flight.fly(5)
    watched.swing(1.8)
    assert watched.factor > 1.0
    estimator.events[LEVER_ARM_FOUND] += 1
    watched.swing(0.1, amplitude=0.1)
    assert watched.factor == 1.0
    watched.swing(2.5)
    assert watched.factor > 1.0


def test_swings_before_the_filter_found_the_lever_arm_do_not_count() -> None:
    lowered = []
    for found in (False, True):
        watched = Watched()
        pilot, configuration = watched.flight.pilot, watched.flight.tuning.configuration
        estimator = configuration.estimator_for(pilot.model, PERIOD_S)
        pilot.estimator.use(estimator, started=False)
        watched.flight.fly(5)
        watched.swing(1.2)
        assert watched.factor == 1.0
        estimator.events[LEVER_ARM_FOUND] += found
        watched.swing(0.8)
        lowered.append(watched.factor > 1.0)
    assert lowered == [True, False]


def test_there_is_a_largest_factor_and_the_flight_goes_on() -> None:
    watched = Watched()
    watched.swing(8.0)
    assert watched.factor == LARGEST
    assert watched.flight.pilot.events[OSCILLATION] > watched.flight.pilot.events[BANDWIDTH_LOWERED]
    watched.flight.fly(50)
    assert watched.flight.error_m() < 0.2


def drifted(factor: float, seconds: float, off_m: float) -> Watched:
    """A vehicle that flew beside its reference, with calm sticks and lowered bandwidth."""
    watched = Watched()
    watched.flight.tuning.configuration = watched.flight.tuning.configuration.changed(
        Tune(controller_settings={EFFORT_FACTORS: (factor, 1.0, 1.0)})
    )
    watched.flight.pilot.estimate.motion[0] += off_m
    flown, place = watched.flight.flown[-1], watched.flight.pilot.estimate.motion[: YAW + 1].copy()
    place[0] -= off_m
    for _ in range(round(seconds / PERIOD_S)):
        watched.guard.watch(ControlOutput(flown.input, flown.next_inputs, flown.plan, 0.02, place))
    return watched


@pytest.mark.parametrize("off_m", [0.11, 0.5])
def test_a_vehicle_that_still_drifts_with_the_lowest_bandwidth_lands_after_10_s_and_reports_why(
    off_m: float,
) -> None:
    assert drifted(LARGEST, 9.9, off_m).flight.pilot.guidance.phase is Phase.FLYING
    watched = drifted(LARGEST, 10.1, off_m)
    assert watched.flight.pilot.guidance.phase is Phase.LANDING
    assert watched.flight.pilot.events[DRIFTED] == 1
    assert watched.guard.remark == f"it lands: {off_m:.2f} m off its place with the lowest bandwidth"


def test_why_it_lands_is_shown_until_somebody_tunes_the_vehicle() -> None:
    watched = drifted(LARGEST, 10.1, 0.2)
    reason = watched.guard.remark
    watched.swing(1.6, 0.4, stick_index=2)
    assert watched.flight.pilot.events[BANDWIDTH_LOWERED] > 0
    assert watched.guard.remark == reason
    watched.flight.tuning.begin(without_guard(watched.flight.tuning.configuration))
    watched.flight.tuning.wait()
    watched.flight.tuning.finish()
    watched.swing(1.8)
    assert watched.guard.remark.startswith("bandwidth lowered: ")


def test_a_vehicle_that_holds_its_place_or_has_bandwidth_left_does_not_land() -> None:
    assert drifted(LARGEST, 30.0, 0.09).flight.pilot.guidance.phase is Phase.FLYING
    assert drifted(LARGEST / STEP, 30.0, 0.3).flight.pilot.guidance.phase is Phase.FLYING


@pytest.mark.parametrize("controller", ["pid", "lqr", "paper"])
def test_of_a_controller_that_cannot_lower_it_the_oscillation_is_only_told(controller: str) -> None:
    watched = Watched(controller)
    flown = watched.flight.pilot.controller
    watched.swing(4.0)
    assert watched.flight.pilot.events[OSCILLATION] > 0
    assert watched.flight.pilot.events[BANDWIDTH_LOWERED] == 0
    assert watched.flight.pilot.controller is flown


def test_a_program_outside_keeps_its_bandwidth() -> None:
    watched = Watched()
    watched.swing(4.0, own=False)
    assert watched.flight.pilot.events[OSCILLATION] > 0
    assert watched.factor == 1.0


def test_on_the_floor_nothing_counts() -> None:
    watched = Watched()
    flown = watched.flight.flown[-1]
    for k in range(200):
        stick = np.array([math.sin(0.25 * k), 0.0, 0.0, 0.0])
        watched.guard.watch(ControlOutput(stick, flown.next_inputs, flown.plan, 0.02, None))
    assert OSCILLATION not in watched.flight.pilot.events


def test_without_the_guard_a_configuration_keeps_everything_else() -> None:
    before = Configuration("cascade", "kalman", {"horizon": 20}, {"position_gate_m": 0.1})
    lowered = before.changed(Tune(controller_settings={"effort_factors": (1.0, 1.0, 27.0)}))
    assert lowered.effort_factors == (1.0, 1.0, 27.0)
    assert before.effort_factors == (1.0, 1.0, 1.0)
    assert without_guard(lowered) == before


def test_sines_of_an_identification_are_no_oscillation() -> None:
    watched = Watched()
    exciter, place_m = watched.flight.pilot.exciter, watched.flight.pilot.estimate.motion[:YAW]
    exciter.begin(Excitation((0.1, 0.1, 0.02, 0.05), 30.0), place_m, 0.3, 0.0)
    watched.swing(3.0)
    assert watched.factor == 1.0
    exciter.end("over")
    watched.swing(3.0)
    assert watched.factor > 1.0


def test_a_small_oscillation_counts_while_the_reference_rests() -> None:
    watched = Watched()
    watched.swing(5.0, amplitude=0.35)
    assert watched.factor > 1.0
