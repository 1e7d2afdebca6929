"""Vehicles learn their models in ordinary flight, all of a formation together, and fly on with these."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from integration_support import NAMES, Flying, Truth, fleet_text
from support.vehicle_types import COAXIAL

from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.bus import channels
from rcopterx.control.identification.result import HEIGHT, HORIZONTAL
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.vehicles.model import IDENTIFIED

# `make test` flies fleets that learn in tests/studies/experiments/test_fleets.py, without processes.
pytestmark = [pytest.mark.campaign, pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(240)]

Launch = Callable[..., Flying]
PLACES_M = ((0.4, 0.0, 1.2), (0.4, 0.3, 1.0), (-0.1, 0.3, 1.3), (0.0, -0.2, 1.0))
OFFSETS_M = {"h2": (-0.4, 0.5, 0.0), "h3": (-0.4, -0.5, 0.0)}
STEP_S = 5.0


def text(learning: str = "true") -> str:
    file = fleet_text(simulator='conditions = "helicopters"\nseed = 1')
    return f"learning = {learning}\n{file}"


def fly_round(flying: Flying) -> float:
    """Fly to every place; return the true formation error of both followers, rms [m]."""
    sampler = FlightSampler(flying.fleet.session, only=(channels.LABORATORY,))
    sampler.start()
    for place in PLACES_M:
        flying.fleet["h1"].go_to(place)
        flying.fleet.wait(STEP_S)
    squares = []
    for message, _ in sampler.stop().messages(channels.LABORATORY, channels.SIMULATOR_UNIT):
        at = {name: message.vehicles[name].position_m for name in NAMES}
        for name, offset in OFFSETS_M.items():
            wanted = [a + b for a, b in zip(at["h1"], offset, strict=True)]
            squares.append(math.dist(at[name], wanted) ** 2)
    return math.sqrt(sum(squares) / len(squares))


def test_a_formation_learns_within_a_minute_and_flies_better_since(
    launch: Launch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_FLIGHTS", str(tmp_path / "flights"))
    flying = launch(text())
    truth = Truth(flying)
    flying.fleet.take_off(height_m=1.0, timeout_s=40)
    truth.start_watch()
    before_m = fly_round(flying)
    for _ in range(2):
        fly_round(flying)
    states = {name: flying.fleet.state_of(name) for name in NAMES}
    assert all(state.learned for state in states.values()), {n: s.learned for n, s in states.items()}
    assert fly_round(flying) < 0.75 * before_m
    for name, state in states.items():
        assert state.agent is not None
        values = state.agent.diagnostics
        assert {HORIZONTAL, HEIGHT} <= set(values.learned)
        flown = Configuration.reported(values).flown_model(COAXIAL)
        assert flown.uncertainty.axes[0] == IDENTIFIED.axes[0]
        kept = json.loads((tmp_path / "flights" / "learned" / "lab" / f"{name}.json").read_text())
        assert kept["parts"] == list(values.learned)
    truth.assert_none_touched_down()
