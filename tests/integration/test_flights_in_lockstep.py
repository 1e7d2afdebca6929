"""In lockstep a fleet flies the same flight on every run."""

import os
from pathlib import Path

import pytest
from integration_support import fleet_text, free_port

from rcopterx.flights.digest import FlightDigest, digest_of
from rcopterx.flights.flights import flights_in
from rcopterx.ground_station.scripting.launched import launched

pytestmark = [pytest.mark.integration, pytest.mark.timeout(240)]


def test_flights_of_one_seed_are_identical(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_FLIGHTS", str(tmp_path))
    assert flown(tmp_path, monkeypatch) == flown(tmp_path, monkeypatch)


def flown(directory: Path, monkeypatch: pytest.MonkeyPatch) -> FlightDigest:
    """Fly in formation and return the digest of the flight log."""
    run = directory / "run"
    run.mkdir(exist_ok=True)
    monkeypatch.setenv("RCOPTERX_RUN", os.path.relpath(run))
    path = directory / "lab.toml"
    path.write_text(fleet_text(free_port(), {"main": ("127.0.0.1", free_port())}))
    with launched(path, lockstep=True) as fleet:
        fleet.take_off()
        fleet["h1"].go_to((0.3, 0.2, 1.2))
        fleet.wait_for_arrival(["h1"])
        fleet.wait_for_formation()
        assert all(
            vehicle.state.agent.diagnostics.missed_ticks == 0 for vehicle in fleet if vehicle.state.agent
        )
        fleet.land()
    flight = flights_in(directory)[-1]
    found = digest_of(flight.parts)
    for part in flight.parts:
        part.unlink()
    return found
