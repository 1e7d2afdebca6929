"""The formation experiment: what is flown, and the document that comes out."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support.conditions import IDEAL, LABORATORY
from support.vehicle_types import COAXIAL_LAG

from rcopterx.commands.output import write_plot
from rcopterx_studies.experiments.events import FollowEvent, GoToEvent
from rcopterx_studies.experiments.formation import (
    EXPERIMENT,
    FOLLOWERS,
    LEADER,
    NEAR,
    SLOT_S,
    SLOTS,
    FlownFormation,
    draw_formation,
    events,
    figures,
    fly_formation,
    mirrored,
    sequence,
)
from rcopterx_studies.experiments.runner import FlightResult, Options
from rcopterx_studies.experiments.schemes import CASCADE, PAPER


def test_sequence_changes_set_points_distances_and_headings() -> None:
    changes = [change for slot in sequence() for change in slot]
    assert {name for name, _, _ in changes} == {LEADER, *FOLLOWERS}
    for names in ({LEADER}, set(FOLLOWERS)):
        own = [(position, yaw) for name, position, yaw in changes if name in names]
        assert len({position for position, _ in own}) > 4
        assert len({yaw for _, yaw in own}) >= 3


def test_sequence_keeps_every_station_inside_the_bounds() -> None:
    place = {LEADER: np.array([0.0, 0.0, 1.0])} | {name: np.array(NEAR[name]) for name in FOLLOWERS}
    for slot in sequence():
        for name, position_m, _ in slot:
            place[name] = np.array(position_m)
        for name in FOLLOWERS:
            station = place[LEADER] + place[name]
            assert (station > COAXIAL_LAG.state_min[:3]).all()
            assert (station < COAXIAL_LAG.state_max[:3]).all()
        distances = [place["h2"] - place["h3"], place["h2"], place["h3"]]
        assert min(float(np.linalg.norm(distance)) for distance in distances) > 0.3


def test_sequence_fills_five_minutes_and_its_second_half_mirrors_the_first() -> None:
    happenings = events(sequence())
    assert max(event.time_s for event in happenings) + 2 * SLOT_S == pytest.approx(300)
    assert mirrored(mirrored(SLOTS)) == SLOTS
    assert {type(event) for event in happenings} == {GoToEvent, FollowEvent}


@pytest.mark.parametrize(("scheme", "conditions"), [(PAPER, IDEAL), (CASCADE, LABORATORY)])
def test_formation_flies_the_sequence(
    scheme: object, conditions: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx_studies.experiments.formation.SLOT_S", 4.0)
    flight = fly_formation(scheme, SLOTS[:1], conditions, 2)  # type: ignore[arg-type]  # parametrized
    assert flight.tracks.shape == (120, 3, 2, 4)
    assert flight.tracks[-1, 0, 0, :3] == pytest.approx((0.3, 0.0, 1.4), abs=0.05)
    assert 0 < flight.errors_m.max() < 0.2
    assert len(flight.errors_m) == 2 * len(flight.gap_errors_m)


def flown(errors: list[float], excess: float = 0.0) -> FlownFormation:
    tracks = np.random.default_rng(0).normal(size=(20, 3, 2, 4))
    return FlownFormation(np.array(errors), np.array([0.002]), np.full(7, excess), {"hover": 1}, tracks)


def test_figures_are_those_of_all_flights_and_of_each_seed() -> None:
    alone = figures("cascade", {0: flown([0.001, 0.003])})
    assert 0 <= alone["rms_mm"] <= alone["max_mm"]
    assert set(alone["bound_excess"]) == {"position_m", "velocity_m_s", "yaw_rate_rad_s"}
    assert "per_seed" not in alone
    both = figures("cascade", {0: flown([0.001, 0.003]), 1: flown([0.002, 0.005], 0.1)})
    assert {seed: one["max_mm"] for seed, one in both["per_seed"].items()} == {"0": 3.0, "1": 5.0}
    assert both["max_mm"] == 5.0


def test_flights_are_drawn(tmp_path: Path) -> None:
    schemes = {key: {0: flown([0.001])} for key in ("paper", "cascade")}
    result = FlightResult(Options((0,)), schemes, {})
    write_plot(partial(draw_formation, result), tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000


def test_figures_of_several_seeds_are_those_of_all_samples_together() -> None:
    table = figures("cascade", {0: flown([0.003, 0.003, 0.003]), 1: flown([0.006])})
    assert table["rms_mm"] == pytest.approx(np.sqrt((3 * 9 + 36) / 4), abs=1e-3)
    assert table["max_mm"] == pytest.approx(6.0)
    assert table["fallbacks"] == {"hover": 2}


def test_the_papers_scheme_and_the_default_are_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []

    def no_flight(*_: object, **__: object) -> FlownFormation:
        return flown([1.0, 1.0])

    monkeypatch.setattr("rcopterx_studies.experiments.formation.fly_formation", no_flight)
    result = EXPERIMENT.fly(Options((7, 8)), lambda label, fraction: shown.append(f"{label} {fraction:.2f}"))
    assert set(result.document) == {"paper", "cascade"}
    assert set(result.document["paper"]["per_seed"]) == {"7", "8"}
    assert shown[-1].endswith("1.00")
