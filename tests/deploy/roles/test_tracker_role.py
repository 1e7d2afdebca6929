"""Promises about the motion capture of the fleet file: each brand by few fields, mistakes by their names."""

import pytest
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.deploy.roles.tracker import brand_of, tracker_address, tracker_settings
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.vicon_gateway.brands import BrandSettings


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ("", None),
        (
            'brand = "optitrack"\naddress = "motive:1510"\nrate_hz = 120\nlatency_s = 0.005',
            BrandSettings("optitrack", {"hostname": "motive", "port_command": "1510"}, 120.0, 0.005),
        ),
        (
            'brand = "qualisys"\naddress = "qtm:22222"\nrate_hz = 100',
            BrandSettings("qualisys", {"hostname": "qtm", "port": "22222"}, 100.0, 0.0),
        ),
        (
            'brand = "vrpn"\naddress = "10.0.0.2:3883"\nrate_hz = 60',
            BrandSettings("vrpn", {"hostname": "10.0.0.2:3883"}, 60.0, 0.0),
        ),
        (
            'brand = "vicon_sdk"\nrate_hz = 50\nsettings = { enable_pointclout = "false" }',
            BrandSettings("vicon", {"hostname": "127.0.0.1:801", "enable_pointclout": "false"}, 50.0, 0.0),
        ),
        (
            'brand = "mock"\nrate_hz = 50\nsettings = { frequency = "50" }',
            BrandSettings("mock", {"frequency": "50"}, 50.0, 0.0),
        ),
    ],
)
def test_every_brand_is_set_up_as_the_library_wants_it(fields: str, expected: BrandSettings | None) -> None:
    assert brand_of(parse_fleet(f"{HARDWARE_PAIR}[tracker]\n{fields}")) == expected


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        (
            'brand = "kinect"',
            r"tracker\.brand: unknown brand 'kinect', known are vicon, vicon_sdk, optitrack",
        ),
        ('brand = "optitrack"', r"tracker\.rate_hz: is missing, brand 'optitrack' does not report"),
        ('brand = "optitrack"\nrate_hz = 120', r"tracker\.address: is missing, .* HOST:1510 as a rule"),
        ('brand = "vicon_sdk"\nrate_hz = 50\nsettings = { port = "1" }', r"tracker\.settings: .*allowed are"),
        ('brand = "mock"\nrate_hz = 50\nrecord_raw = "x"', r"tracker\.record_raw: only the stream of brand"),
        ("rate_hz = 50", r"tracker\.rate_hz: a Vicon Tracker reports it itself"),
        ('settings = { hostname = "x" }', r"tracker\.settings: are for the other brands"),
    ],
)
def test_wrong_fields_of_a_brand_are_refused(fields: str, reason: str) -> None:
    with pytest.raises(FleetError, match=reason):
        brand_of(parse_fleet(f"{HARDWARE_PAIR}[tracker]\n{fields}"))


def test_simulator_is_a_vicon_tracker() -> None:
    text = f'{PAIR}[tracker]\nrate_hz = 50\nbrand = "optitrack"'
    with pytest.raises(FleetError, match=r"tracker\.brand: 'optitrack', .* allowed are vicon, vicon_sdk"):
        brand_of(parse_fleet(text))
    assert brand_of(parse_fleet(text.replace("optitrack", "vicon_sdk"))) is not None


def test_the_tracker_gateway_maps_subjects_to_vehicles() -> None:
    fleet = parse_fleet(PAIR + '[tracker]\naddress = "vicon-pc:801"')
    settings = tracker_settings(fleet)
    assert (settings.host, settings.port) == ("vicon-pc", 801) == tracker_address(fleet)
    assert settings.subjects == {"heli1": "h1", "heli2": "h2"}
