"""Promises of the ports in fleet files: each protocol has its own kind of address."""

from pathlib import Path

import pytest

from rcopterx.deploy.fleet_check import check_fleet
from rcopterx.deploy.roles.ports import check_ports, port_of
from rcopterx.deploy.roles.simulator import simulated_port_of
from rcopterx.fleet.reading import fleet_path, load_fleet, parse_fleet
from rcopterx.fleet.schema import FleetError

FIXTURES = Path(__file__).parents[2] / "fixtures" / "text_files"
FLEET = """
name = "lab"
[vehicles.h1]
type = "{type}"
subject = "one"
transmitter = {{ port = "{port}" }}
"""


def test_a_serial_device_may_be_in_the_run_directory(tmp_path: Path) -> None:
    for port, found in (("radio-h1", str(tmp_path / "radio-h1")), ("/dev/ttyUSB0", "/dev/ttyUSB0")):
        assert port_of(parse_fleet(FLEET.format(type="quadrotor", port=port)), "h1", tmp_path) == found


def test_a_crazyflie_has_an_address(tmp_path: Path) -> None:
    for address in ("udp://127.0.0.1:19850", "radio://0/80/2M/E7E7E7E701"):
        assert port_of(parse_fleet(FLEET.format(type="crazyflie", port=address)), "h1", tmp_path) == address
    with pytest.raises(FleetError, match=r"vehicles\.h1\.transmitter\.port: .*udp://127.0.0.1:19850"):
        port_of(parse_fleet(FLEET.format(type="crazyflie", port="/dev/ttyUSB0")), "h1", tmp_path)


def test_a_simulated_crazyflie_is_at_the_address_of_its_radio(tmp_path: Path) -> None:
    def place(address: str, directory: Path) -> str:
        fleet = parse_fleet(FLEET.format(type="crazyflie", port=address) + "[simulator]\n")
        assert port_of(fleet, "h1", directory) == address
        return simulated_port_of(fleet, "h1", directory)

    places = [
        place("radio://0/80/2M/E7E7E7E701", tmp_path),
        place("radio://0/80/2M/E7E7E7E702", tmp_path),
        place("radio://0/90/2M/E7E7E7E701", tmp_path),
        place("radio://0/80/2M/E7E7E7E701", tmp_path / "other"),
    ]
    assert len(set(places)) == len(places)
    assert place("radio://1/80/2M/E7E7E7E701", tmp_path) == places[0], "any Crazyradio reaches a vehicle"
    assert place("udp://127.0.0.1:19850", tmp_path) == "udp://127.0.0.1:19850"


def test_a_vehicle_with_mavlink_is_at_a_udp_port_or_at_a_serial_device(tmp_path: Path) -> None:
    text = FLEET.replace("{type}", "mavlink_quadrotor")
    for port, found in (
        ("udp://192.168.0.21:14550", "udp://192.168.0.21:14550"),
        ("/dev/ttyUSB0", "/dev/ttyUSB0"),
        ("telemetry", str(tmp_path / "telemetry")),
    ):
        assert port_of(parse_fleet(text.format(port=port)), "h1", tmp_path) == found
    with pytest.raises(FleetError, match=r"'udp://14550' is no address such as udp://"):
        port_of(parse_fleet(text.format(port="udp://14550")), "h1", tmp_path)
    with pytest.raises(FleetError, match=r"simulated vehicles are at udp://"):
        port_of(parse_fleet(text.format(port="/dev/ttyUSB0") + "[simulator]\n"), "h1", tmp_path)


@pytest.mark.parametrize(
    ("port", "other"),
    [
        ("radio://0/80/2M/E7E7E7E701", "radio://0/80/2M/E7E7E7E701"),
        ("radio://0/80/2M/E7E7E7E701", "radio://1/080/2M/e7e7e7e701"),
        ("udp://127.0.0.1:19850", "udp://localhost:019850"),
        ("udp://cf1.lab:19850", "udp://CF1.lab:19850"),
    ],
)
def test_two_ports_of_one_vehicle_are_refused_as_they_are_written(
    port: str, other: str, tmp_path: Path
) -> None:
    text = FLEET.format(type="crazyflie", port=port)
    text += f'[vehicles.h2]\ntype = "crazyflie"\nsubject = "two"\ntransmitter = {{ port = "{other}" }}\n'
    with pytest.raises(FleetError) as caught:
        check_fleet(parse_fleet(text), tmp_path)
    expected = f"vehicles.h2.transmitter.port: '{other}' is already that of vehicles.h1"
    assert str(caught.value) == expected + ("" if port == other else f", there '{port}'")


def test_two_names_of_one_device_are_refused_with_both(tmp_path: Path) -> None:
    (tmp_path / "ttyUSB0").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "ttyUSB0")
    text = FLEET.format(type="quadrotor", port=tmp_path / "ttyUSB0")
    text += f'[vehicles.h2]\nsubject = "two"\ntransmitter = {{ port = "{tmp_path}/by-id" }}\n'
    with pytest.raises(FleetError) as caught:
        check_ports(parse_fleet(text), tmp_path)
    one, other = f"{tmp_path}/ttyUSB0", f"{tmp_path}/by-id"
    expected = f"vehicles.h2.transmitter.port: '{other}' is already that of vehicles.h1, there '{one}'"
    assert str(caught.value) == expected


def test_one_local_udp_port_of_two_vehicles_is_refused_with_both(tmp_path: Path) -> None:
    text = (FIXTURES / "two_ports.toml").read_text(encoding="utf-8")
    with pytest.raises(
        FleetError, match=r"vehicles\.h4\.transmitter\.settings\.local_port: .*24560.*vehicles\.h3"
    ):
        check_fleet(parse_fleet(text), tmp_path)
    check_fleet(parse_fleet(text.replace("24560", "24561", 1)), tmp_path)


@pytest.mark.parametrize(
    "other", ["radio://0/80/2M/E7E7E7E702", "radio://0/90/2M/E7E7E7E701", "radio://0/80/1M/E7E7E7E701"]
)
def test_vehicles_that_differ_in_channel_data_rate_or_address_are_two(other: str, tmp_path: Path) -> None:
    text = FLEET.format(type="crazyflie", port="radio://0/80/2M/E7E7E7E701")
    text += f'[vehicles.h2]\ntype = "crazyflie"\nsubject = "two"\ntransmitter = {{ port = "{other}" }}\n'
    check_ports(parse_fleet(text), tmp_path)


@pytest.mark.parametrize("name", ["crazyflies", "families", "ten_crazyflies"])
def test_fleets_of_vehicles_with_addresses_can_be_set_up(name: str, tmp_path: Path) -> None:
    check_fleet(load_fleet(fleet_path(name)), tmp_path)
