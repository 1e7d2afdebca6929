"""Promises of flights of emulated autopilots: they turn as slowly as measured, hover and land."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import pytest
from support.firmware_flight import FirmwareFlight

from rcopterx.control.identification.fit import identify
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest
from rcopterx.vehicles.model import fitted_parameters

FORMER = {
    mode: f"{{ input_gain = [5.66, 5.66, {lift}, 34.9], damping = [-0.35, -0.35, -0.2, -10.0],"
    " lag_s = [0.16, 0.16, 0.05, 0.05],"
    " uncertainty = { gain_factor = [1.35, 1.35, 1.3], delay_s = [0.03, 0.03, 0.045] } }"
    for mode, lift in (("offboard", 19.62), ("guided_nogps", 26.5))
}
"""Yaw numbers with which both firmwares swung, and the uncertainty of that type."""
MODES = {"offboard": 0.21, "guided_nogps": 0.38}  # lag of the heading [s]: PX4, ArduCopter
TYPES = {"offboard": "mavlink_quadrotor", "guided_nogps": "ardupilot_quadrotor"}
STEP_RAD_S, AFTER_S = 1.75, 0.6


@pytest.fixture(params=MODES)
def flight(request: pytest.FixtureRequest) -> Iterator[FirmwareFlight]:
    flown = FirmwareFlight(TYPES[request.param])
    flown.hover()
    yield flown
    flown.close()


@pytest.mark.parametrize(("mode", "lag_s"), MODES.items())
def test_the_heading_lags_behind_a_step_of_the_yaw_rate_as_measured(mode: str, lag_s: float) -> None:
    flight = FirmwareFlight(TYPES[mode], conditions="ideal")
    flight.hover()
    before_rad = flight.plant.pose.yaw_rad
    flight.stick_yaw = STEP_RAD_S / math.radians(200.0)
    flight.run(AFTER_S)
    turned_rad = flight.plant.pose.yaw_rad - before_rad
    flight.close()
    assert AFTER_S - turned_rad / STEP_RAD_S == pytest.approx(lag_s, abs=0.03)


def test_the_default_type_hovers_within_15_mm_without_a_limit_cycle(flight: FirmwareFlight) -> None:
    flight.run(30.0)
    assert flight.hover_rms_m < 0.015
    assert flight.heading_rms_rad < math.radians(3.0)


@pytest.mark.parametrize("seed", [5, pytest.param(6, marks=pytest.mark.campaign)])
def test_a_slow_heading_that_the_proof_of_the_signs_has_turned_away_does_not_go_on_swinging(
    seed: int,
) -> None:
    flight = FirmwareFlight("ardupilot_quadrotor", seed=seed)
    flight.hover()
    flight.run(10.0)
    flight.close()
    assert flight.heading_rms_rad < math.radians(3.0)


@pytest.mark.parametrize("mode", MODES)
def test_yaw_numbers_of_a_quick_vehicle_swing_as_both_firmwares_did(mode: str) -> None:
    flight = FirmwareFlight(TYPES[mode], model=FORMER[mode])
    flight.hover()
    flight.run(20.0)
    flight.yaw_rad.clear()
    flight.run(10.0)
    flight.close()
    assert flight.heading_rms_rad > math.radians(10.0), "15 to 18 degrees were measured"


@pytest.mark.campaign
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", range(10))
def test_twenty_landings_end_disarmed(mode: str, seed: int) -> None:
    flight = FirmwareFlight(TYPES[mode], seed=seed)
    flight.hover()
    flight.land()
    link = flight.transmitter.link(flight.now_s)
    assert flight.plant.on_floor
    assert not flight.plant.motors_running
    assert link.armed is False
    assert link.text.startswith("ready")
    flight.close()


def test_an_autopilot_that_loses_its_position_in_a_mode_that_needs_one_lands_gently_and_disarms(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = FirmwareFlight("ardupilot_quadrotor", '{ mode = "guided", external_pose = true }')
    flight.hover()
    monkeypatch.setattr(flight.transmitter.protocol, "pose_seen", lambda *pose, standing: None)
    flight.run(20.0)
    plant, (x_m, y_m, _) = flight.plant, flight.plant.position_m
    assert plant.on_floor
    assert not plant.motors_running
    assert plant.touchdown_speed_m_s is not None
    assert plant.touchdown_speed_m_s < 1.0
    assert math.hypot(x_m, y_m) < 1.5
    assert flight.transmitter.link(flight.now_s).armed is False
    flight.transmitter.request(ActionRequest(Action.ARM, "operator"), flight.now_s)
    flight.run(3.0)
    assert not plant.motors_running
    assert "Need Position Estimate" in flight.transmitter.link(flight.now_s).text
    flight.close()


def inline(parameters: Mapping[str, Any]) -> str:
    """A table of a fleet file on one line; None is left out."""
    rows = []
    for name, value in parameters.items():
        text = (
            inline(value)
            if isinstance(value, Mapping)
            else list(value)
            if isinstance(value, tuple)
            else value
        )
        rows += [] if value is None else [f"{name} = {text}"]
    return "{ " + ", ".join(rows) + " }"


@pytest.mark.campaign
@pytest.mark.timeout(600)
@pytest.mark.parametrize("mode", MODES)
def test_an_identification_keeps_full_sticks_and_finds_a_model_that_flies(mode: str) -> None:
    flight = FirmwareFlight(TYPES[mode])
    flight.hover()
    found, true = identify(flight.excited(60.0), flight.pilot.model), flight.body
    flight.close()
    assert found.problems == ()
    assert found.model.input_gain[:3] == pytest.approx(true.input_gain[:3], rel=0.1)
    rates = [model.input_gain[3] / -model.damping[3] for model in (found.model, true)]
    assert rates[0] == pytest.approx(rates[1], rel=0.1)
    flown = FirmwareFlight(TYPES[mode], model=inline(fitted_parameters(found.model)))
    flown.hover()
    flown.run(20.0)
    flown.close()
    assert flown.hover_rms_m < 0.015
    assert flown.heading_rms_rad < math.radians(3.0)
