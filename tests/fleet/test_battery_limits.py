"""Promises of the voltages of batteries: those of the file go before those of the type."""

import pytest

from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_models import battery_of
from rcopterx.radios.battery import NO_LIMITS, BatteryLimits


def fleet(battery: str, kind: str = "crazyflie") -> FleetFile:
    return parse_fleet(
        f"""
name = "lab"
[tracker]
address = "127.0.0.1:801"
[vehicles.h1]
type = "{kind}"
subject = "heli1"
transmitter = {{ port = "radio://0/80/2M/E7E7E7E701" }}
battery = {{ {battery} }}
"""
    )


@pytest.mark.parametrize(
    ("battery", "expected"),
    [
        ("", BatteryLimits(3.2, 3.0, 4.2, 420.0)),
        ("warn_v = 3.35", BatteryLimits(3.35, 3.0, 4.2, 420.0)),
        ("land_v = 0", BatteryLimits(3.2, 0.0, 4.2, 420.0)),
        ("warn_v = 7.2, land_v = 6.8", BatteryLimits(7.2, 6.8, None, 420.0)),
        ("hover_s = 300", BatteryLimits(3.2, 3.0, 4.2, 300.0)),
        ("warn_v = 7.2, land_v = 6.8, full_v = 8.4", BatteryLimits(7.2, 6.8, 8.4, 420.0)),
    ],
)
def test_voltages_of_the_file_go_before_those_of_the_type(battery: str, expected: BatteryLimits) -> None:
    assert battery_of(fleet(battery), "h1") == expected


def test_a_type_whose_radio_reports_no_voltage_has_no_limits() -> None:
    assert battery_of(fleet("", "coaxial"), "h1") == NO_LIMITS


@pytest.mark.parametrize(
    ("battery", "words"),
    [
        ("land_v = 3.5", "vehicles.h1.battery.warn_v: 3.2 must be at least land_v = 3.5"),
        ("full_v = 3.1", "vehicles.h1.battery.full_v: 3.1 must be above warn_v and land_v"),
        ("warn_v = -1", "warn_v"),
    ],
)
def test_voltages_that_contradict_each_other_are_refused(battery: str, words: str) -> None:
    with pytest.raises(FleetError, match=words):
        battery_of(fleet(battery), "h1")
