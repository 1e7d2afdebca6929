"""Endpoints at which processes of a fleet find the bus."""

from pathlib import Path

import pytest
from support.fleets import PAIR

from rcopterx.deploy.roles.addresses import bus_address, router_endpoints
from rcopterx.fleet.reading import parse_fleet


@pytest.fixture(autouse=True)
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    return tmp_path


def test_router_of_a_fleet_of_one_computer_has_no_tcp_port(run: Path) -> None:
    (endpoint,) = bus_address(parse_fleet(PAIR), "main").endpoints
    assert endpoint.startswith(f"unixsock-stream/{run}/")


def test_router_with_a_port_listens_at_it_and_at_its_socket() -> None:
    local, remote = router_endpoints(parse_fleet(f"{PAIR}[hosts.main]\nrouter_port = 7448"), "main")
    assert local.startswith("unixsock-stream/")
    assert remote == "tcp/127.0.0.1:7448"


def test_router_whose_socket_would_have_too_long_a_path_listens_on_loopback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / ("long" * 40)))
    assert router_endpoints(parse_fleet(PAIR), "main") == ["tcp/127.0.0.1:7447"]
