"""Vehicles survive that processes get no processor for up to 0.6 s, again and again; in lockstep."""

import random
from pathlib import Path

import pytest
from integration_support import free_port

from rcopterx.fleet.reading import fleet_path
from rcopterx.flights.flights import flights_in
from rcopterx.ground_station.report.logged_flight import records_of
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx_studies.faults.observation import WATCHED, seen_of

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.campaign, pytest.mark.timeout(900)]

NAMES = [f"h{number}" for number in range(1, 7)]
GROUNDED = [f"h{number}" for number in range(7, 11)]
SECONDS = 60.0
SHORTEST_S, LONGEST_S = 0.05, 0.6
PAUSE_S = (0.15, 1.2)


def starve(fleet: Fleet, seed: int) -> None:
    """Stop some or all processes for a moment, until the time is over."""
    participant = fleet.session.participant
    assert participant is not None
    chance = random.Random(seed)
    processes = [*(f"agent-{name}" for name in NAMES), "transmitters", "tracker"]
    end_s = fleet.session.clock() + SECONDS
    while fleet.session.clock() < end_s:
        everything = chance.random() < 0.5
        stopped = processes if everything else chance.sample(processes, chance.randint(1, 3))
        longest_s = chance.uniform(SHORTEST_S, LONGEST_S)
        for process in stopped:
            participant.stop(process, longest_s * (1.0 if chance.random() < 0.8 else chance.random()))
        fleet.wait(longest_s + chance.uniform(*PAUSE_S))


@pytest.mark.parametrize("seed", [21, 22])
def test_no_vehicle_falls_while_processes_are_starved(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_FLIGHTS", str(tmp_path))
    path = tmp_path / "lab.toml"
    path.write_text(fleet_path("ten").read_text().replace("127.0.0.1:18801", f"127.0.0.1:{free_port()}"))
    with launched(path, without=GROUNDED, lockstep=True) as fleet:
        fleet.take_off()
        starve(fleet, seed)
    flight = flights_in(tmp_path)[-1]
    recording = Recording(records_of(flight.parts, WATCHED))
    seen = seen_of(recording, dict.fromkeys(NAMES, (0.0, 0.0, 0.0)))
    touchdowns_m_s = {name: seen[name].touchdown_m_s for name in NAMES}
    assert all(speed is not None and speed < 1.0 for speed in touchdowns_m_s.values()), touchdowns_m_s
