"""In lockstep a fleet flies the same flight on every run."""

import os
import signal
from collections.abc import Callable, Collection
from itertools import chain
from pathlib import Path

import pytest
from integration_support import fleet_text

from rcopterx.bus.clock import NANO
from rcopterx.bus.session import RawMessage
from rcopterx.fleet.reading import at_speed, parse_fleet
from rcopterx.flights.flights import Flight, flights_in
from rcopterx.flights.mcap_reading import messages_of
from rcopterx.flights.mcap_writing import LoggedMessage
from rcopterx.ground_station.republishing import fleet_of
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx_studies.replay.arbiter_replay import RecordedArbiters, replay_arbiter
from rcopterx_studies.replay.digest import FlightDigest, digest_of
from rcopterx_studies.search.one_process import in_one_process

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(240)]


@pytest.fixture
def flown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., FlightDigest]:
    """Fly a fleet of its own, and return the digest of the flight log."""
    monkeypatch.setenv("RCOPTERX_FLIGHTS", str(tmp_path))
    run = tmp_path / "run"
    run.mkdir()
    monkeypatch.setenv("RCOPTERX_RUN", os.path.relpath(run))

    def fly(
        flight: Callable[[Fleet], None], without: Collection[str] = (), repeated: bool = False
    ) -> FlightDigest:
        path = tmp_path / "lab.toml"
        path.write_text(fleet_text())
        with launched(path, without=without, lockstep=True) as fleet:
            flight(fleet)
            fleet.land()
        found = flights_in(tmp_path)[-1]
        digest = digest_of(chain.from_iterable(map(messages_of, found.parts)))
        if repeated:
            repeat_arbiters(found)
        for part in found.parts:
            part.unlink()
        return digest

    return fly


def repeat_arbiters(flight: Flight) -> None:
    """Arbiters that make the recorded calls again write the recorded frames."""
    fleet = fleet_of(flight.parts)
    for vehicle in fleet.vehicles:
        recorded = RecordedArbiters(vehicle, fleet, chain.from_iterable(map(messages_of, flight.parts)))
        result = replay_arbiter(recorded, fleet)
        assert result.first is None
        assert result.frames == result.identical > 300
        assert result.missing_inputs == 0


def missed(fleet: Fleet) -> list[str]:
    """Vehicles whose agents have missed control periods."""
    states = [vehicle.state for vehicle in fleet]
    return [
        state.name for state in states if state.agent is not None and state.agent.diagnostics.missed_ticks
    ]


def formation(fleet: Fleet) -> None:
    fleet.take_off()
    fleet["h1"].go_to((0.3, 0.2, 1.2))
    fleet.wait(1.0)
    assert not missed(fleet)


def faults(fleet: Fleet) -> None:
    """Processes of every kind are killed, the transmitter gateway stops, and a vehicle joins."""
    fleet.take_off()
    participant = fleet.session.participant
    assert participant is not None
    participant.kill("agent-h2")
    fleet.wait(1.5)
    participant.stop("transmitters", 0.1)
    fleet.wait(1.0)
    fleet.join("h3")
    assert not missed(fleet)
    for process in ("tracker", "agent-h1", "transmitters"):
        participant.kill(process)
        fleet.wait(1.0)
    assert all(vehicle.state.phase == "flying" for vehicle in fleet)


@pytest.mark.campaign
def test_flights_of_one_seed_are_identical(flown: Callable[..., FlightDigest]) -> None:
    assert flown(formation) == flown(formation)


def in_this_process(flight: Callable[[Fleet], None], without: Collection[str] = ()) -> FlightDigest:
    file = parse_fleet(fleet_text())
    messages: list[LoggedMessage] = []

    def store(message: RawMessage) -> None:
        topic = f"{message.unit}/{message.topic}"
        time_ns = round(message.arrived_s * NANO)
        messages.append(LoggedMessage(topic, message.payload, time_ns, message.number))

    def script(fleet: Fleet) -> None:
        fleet.wait_ready()
        flight(fleet)
        fleet.land()

    with in_one_process(at_speed(file, None, lockstep=True), store, without) as process:
        process.run(script)
    assert not process.turns.failures
    return digest_of(messages)


def test_flights_of_processes_and_in_one_process_are_identical_also_with_faults(
    flown: Callable[..., FlightDigest],
) -> None:
    assert flown(faults, without=["h3"], repeated=True) == in_this_process(faults, without=["h3"])


def router_killed(fleet: Fleet) -> None:
    """The router is killed in flight; messages are lost with it."""
    fleet.take_off()
    assert fleet.launcher is not None
    router = fleet.launcher.supervisor.pid("router")
    assert router is not None
    os.kill(router, signal.SIGKILL)
    fleet.wait(2.0)
    fleet["h1"].go_to((0.3, 0.2, 1.2))
    fleet.wait_for_arrival(["h1"])
    fleet.wait_for_formation()
    assert all(vehicle.state.phase == "flying" for vehicle in fleet)


def test_a_flight_goes_on_after_the_death_of_the_router(flown: Callable[..., FlightDigest]) -> None:
    flown(router_killed)
