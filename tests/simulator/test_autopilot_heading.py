"""Promises of emulated autopilots: they turn as slowly as measured, and their type hovers all the same."""

import math
from collections.abc import Iterator

import pytest
from support.firmware_flight import FirmwareFlight

FORMER = (
    "{ input_gain = [5.66, 5.66, 19.62, 34.9], damping = [-0.35, -0.35, -0.2, -10.0],"
    " lag_s = [0.16, 0.16, 0.05, 0.05] }"
)
MODES = {"offboard": 0.21, "guided_nogps": 0.38}  # lag of the heading [s]: PX4, ArduCopter
STEP_RAD_S, AFTER_S = 1.75, 0.6


@pytest.fixture(params=MODES)
def flight(request: pytest.FixtureRequest) -> Iterator[FirmwareFlight]:
    flown = FirmwareFlight("mavlink_quadrotor", f'{{ mode = "{request.param}" }}')
    flown.hover()
    yield flown
    flown.close()


@pytest.mark.parametrize(("mode", "lag_s"), MODES.items())
def test_the_heading_lags_behind_a_step_of_the_yaw_rate_as_measured(mode: str, lag_s: float) -> None:
    flight = FirmwareFlight("mavlink_quadrotor", f'{{ mode = "{mode}" }}', conditions="ideal")
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


@pytest.mark.parametrize("mode", MODES)
def test_yaw_numbers_of_a_quick_vehicle_swing_as_both_firmwares_did(mode: str) -> None:
    flight = FirmwareFlight("mavlink_quadrotor", f'{{ mode = "{mode}" }}', FORMER)
    flight.hover()
    flight.run(20.0)
    flight.close()
    assert flight.heading_rms_rad > math.radians(8.0), "15 to 18 degrees were measured"
