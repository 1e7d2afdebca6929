"""Promises of the fleet on two containers: its file can be flown, and both files name the same hosts."""

import re
from pathlib import Path

from rcopterx.deploy.fleet_check import check_fleet
from rcopterx.deploy.fleet_file.reading import load_fleet

EXAMPLE = Path(__file__).parents[2] / "examples" / "two_hosts"
SERVICE = re.compile(
    r"^  (\w+):\n(?:    .*\n)*?.*--host (\w+)\n(?:    .*\n)*?.*ipv4_address: ([\d.]+)", re.MULTILINE
)


def test_the_fleet_file_can_be_flown_and_fits_the_containers(tmp_path: Path) -> None:
    fleet = load_fleet(EXAMPLE / "two_hosts.toml")
    check_fleet(fleet, tmp_path)
    compose = (EXAMPLE / "compose.yaml").read_text(encoding="utf-8")
    services = SERVICE.findall(compose)
    assert {service: address for service, _, address in services} == {
        name: host.address for name, host in fleet.hosts.items()
    }
    assert all(service == host for service, host, _ in services)
    assert {vehicle.host for vehicle in fleet.vehicles.values()} == {"control"}
