"""Another controller, estimator or setting takes over in flight: without a bump, or with a clear refusal."""

import re
import threading
from itertools import permutations
from pathlib import Path

import pytest
from support.hovering import PERIOD_S, HoveringFlight

from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.bus.requests import Tune
from rcopterx.vehicles.phases import Event

BUMP = 0.3
"""Largest step of any input at a switch, of a range from -1 to 1; gusts alone make steps of 0.1."""
CONTROLLERS = ("cascade", "paper", "lqr", "pid")
ESTIMATORS = ("extended_kalman", "kalman", "finite_difference")


@pytest.mark.parametrize(("before", "after"), list(permutations(CONTROLLERS, 2)))
def test_another_controller_takes_over_without_a_bump(before: str, after: str) -> None:
    flight = HoveringFlight(before)
    flight.fly(75)
    outcome = flight.change(controller=after)
    assert isinstance(outcome, str)
    assert outcome.startswith(after)
    flight.fly(1)
    assert flight.bump() < BUMP
    flight.fly(100)
    assert flight.error_m() < 0.25
    assert flight.tuning.configuration.controller == after


@pytest.mark.parametrize(("before", "after"), list(permutations(ESTIMATORS, 2)))
def test_another_estimator_takes_over_without_a_bump(before: str, after: str) -> None:
    flight = HoveringFlight("cascade", before)
    flight.fly(75)
    assert isinstance(flight.change(estimator=after), str)
    flight.fly(1)
    assert flight.bump() < BUMP
    flight.fly(100)
    assert flight.error_m() < 0.25


@pytest.mark.parametrize("horizon", [10, 80])
def test_another_horizon_takes_over_without_a_bump(horizon: int) -> None:
    flight = HoveringFlight("cascade")
    flight.fly(75)
    assert isinstance(flight.change(controller_settings={"horizon": horizon}), str)
    flight.fly(1)
    assert flight.bump() < BUMP
    assert len(flight.flown[-1].plan.samples) == horizon
    flight.fly(100)
    assert flight.error_m() < 0.1


def test_another_model_takes_over_without_a_bump() -> None:
    flight = HoveringFlight("cascade")
    flight.fly(75)
    b_x, b_y, b_z, b_psi = flight.pilot.model.input_gain
    gains = (1.2 * b_x, 1.2 * b_y, 1.1 * b_z, b_psi)
    certain = {"gain_factor": (1.3, 1.3, 1.3)}
    assert isinstance(flight.change(model={"input_gain": gains, "uncertainty": certain}), str)
    flight.fly(1)
    assert flight.bump() < BUMP
    assert flight.pilot.model.input_gain == gains
    assert flight.pilot.model.uncertainty.gain_factor == certain["gain_factor"]
    flight.fly(100)
    assert flight.error_m() < 0.25


def test_settings_change_the_controller_of_an_identified_model() -> None:
    flight = HoveringFlight("cascade")
    flight.fly(25)
    identified = {"delay_s": 0.07}
    assert isinstance(flight.change(model=identified), str)
    assert isinstance(flight.change(controller_settings={"horizon": 30}), str)
    assert flight.pilot.model.delay_s == 0.07
    assert flight.tuning.configuration.model == identified


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        ({"delay_s": -0.1}, "delay_s"),
        ({"delay_s": "long"}, "delay_s"),
        ({"state_min": (0.0,) * 7}, "state_min: not among the identified parameters"),
        ({"tilt": {"frequency_rad_s": 12.0, "damping_ratio": 0.1}}, "tilt: its structure cannot change"),
    ],
)
def test_a_model_that_the_vehicle_cannot_have_is_refused(model: dict[str, object], reason: str) -> None:
    flight = HoveringFlight("cascade")
    flight.fly(25)
    outcome = flight.change(model=model)
    assert isinstance(outcome, ValueError)
    assert reason in str(outcome)
    assert not flight.tuning.configuration.model
    flight.fly(1)
    assert flight.bump() < BUMP


def test_weights_add_up_over_changes_and_another_controller_takes_only_the_horizon_over() -> None:
    configuration = Configuration("cascade", "kalman", {"horizon": 20}, {"position_gate_m": 0.1})
    changed = configuration.changed(Tune(controller_settings={"input_weights": (1, 1, 1, 1)}))
    changed = changed.changed(Tune(controller_settings={"soft_weight": 1e4}))
    assert changed.controller_settings == {
        "horizon": 20, "input_weights": (1, 1, 1, 1), "soft_weight": 1e4,
    }  # fmt: skip
    assert changed.changed(Tune(controller="pid")).controller_settings == {"horizon": 20}
    assert changed.changed(Tune(estimator="extended_kalman")).estimator_settings == {}
    assert changed.changed(Tune(estimator="kalman")).estimator_settings == {"position_gate_m": 0.1}


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"input_weights": (1.0, 1.0, 0.0, 1.0)}, r"> 0"),
        ({"state_weights": (1.0,)}, "length >= 8"),
        ({"horizon": 1}, ">= 2"),
        ({"horizon": 100000}, "<= 200"),
        ({"colour": 3}, "unknown setting 'colour'; allowed are"),
        ({"input_max": (3.0, 1.0, 1.0, 1.0)}, "leaves the vehicle's range"),
    ],
)
def test_what_is_not_allowed_is_refused_with_what_is_and_the_flight_goes_on(
    settings: dict[str, object], reason: str
) -> None:
    flight = HoveringFlight("cascade")
    flight.fly(25)
    controller = flight.pilot.controller
    outcome = flight.change(controller_settings=settings)
    assert isinstance(outcome, ValueError)
    assert reason in str(outcome)
    assert flight.pilot.controller is controller
    assert flight.tuning.configuration.controller_settings == {"horizon": 20}
    flight.fly(1)
    assert flight.bump() < BUMP


def test_unknown_controllers_are_refused_by_name() -> None:
    flight = HoveringFlight("cascade")
    outcome = flight.change(controller="autopilot")
    assert isinstance(outcome, ValueError)
    assert "no controller is called 'autopilot'; allowed are cascade" in str(outcome)


def test_on_the_floor_a_change_takes_over_before_the_take_off() -> None:
    flight = HoveringFlight("cascade")
    flight.pilot.guidance.on_event(Event.DISARM, flight.pilot.estimate, flight.pilot.clock.time_s)
    assert isinstance(flight.change(controller="lqr"), str)
    flight.fly(1)
    assert not flight.flown[-1].input.any()


def test_the_loop_is_woken_when_a_change_is_ready() -> None:
    flight, woken = HoveringFlight("cascade"), threading.Event()
    tuning = Tuning(flight.tuning.configuration, flight.pilot, PERIOD_S, woken.set)
    for weight, kind in ((2.0, str), (-1.0, ValueError)):
        woken.clear()
        tuning.begin(tuning.configuration.changed(Tune(controller_settings={"soft_weight": weight})))
        assert woken.wait(20.0)
        assert isinstance(tuning.finish(), kind)


def test_a_controller_that_fails_in_its_own_way_is_refused_and_the_next_change_prepared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = HoveringFlight("cascade")

    def broken(*_: object) -> None:
        raise TypeError("no such model")

    with monkeypatch.context() as patch:
        patch.setattr(Configuration, "controller_for", broken)
        outcome = flight.change(controller="lqr")
    assert isinstance(outcome, ValueError)
    place = rf"\({Path(__file__).name}, line {broken.__code__.co_firstlineno + 1}\)"
    assert re.fullmatch(
        f"lqr, extended_kalman cannot be built: TypeError: no such model {place}", str(outcome)
    )
    assert isinstance(flight.change(controller="lqr"), str)
