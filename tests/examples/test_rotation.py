"""Promises of the rotation of batteries: whom to replace and when, and ways that keep clear of the places."""

import math
from collections.abc import Iterator, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.example_programs import EXAMPLES, rotation

from rcopterx import RefusedError
from rcopterx.fleet.reading import load_fleet
from rcopterx.formation.homing import ABOVE_M

TIMES_S = st.dictionaries(st.integers(0, 9), st.floats(0.0, 600.0), min_size=1, max_size=8)
PERIODS_S = st.floats(20.0, 120.0)
CLEAR_M = 0.42  # `horizontal_m` of the fleets
STEP_S = 1.0


@given(TIMES_S, st.lists(st.sampled_from(["h7", "h8", "h9"]), unique=True), PERIODS_S)
def test_the_vehicle_with_the_least_time_is_replaced_first_and_only_by_a_charged_one(
    left_s: Mapping[int, float], charged: list[str], period_s: float
) -> None:
    change = rotation.next_change(left_s, charged, period_s)
    if change is None:
        return
    place, new = change
    assert left_s[place] == min(left_s.values())
    assert new in charged


@given(TIMES_S, PERIODS_S)
def test_nobody_is_replaced_while_all_could_be_replaced_in_time_later(
    left_s: Mapping[int, float], period_s: float
) -> None:
    in_time = all(
        each_s >= rotation.RESERVE_S + period_s * count
        for count, each_s in enumerate(sorted(left_s.values()), 1)
    )
    assert (rotation.next_change(left_s, ["h9"], period_s) is None) is in_time


@given(
    places=st.integers(2, 8),
    spares=st.integers(1, 8),
    period_s=st.floats(30.0, 60.0),
    spread=st.floats(0.9, 1.0),
)
def test_for_hours_no_place_is_empty_and_no_flight_longer_than_its_battery_permits(
    places: int, spares: int, period_s: float, spread: float
) -> None:
    """A change takes the time of a period; batteries charge while the others fly, just fast enough."""
    shortest_s = rotation.RESERVE_S + period_s * (places + 1)
    charging_s = spares * period_s - period_s
    left_s = {place: shortest_s * (spread + (1.0 - spread) * place / places) for place in range(places)}
    charged_at_s, now_s, changes = [0.0] * spares, 0.0, 0
    while now_s < 8.0 * 3600.0:
        ready = [number for number, at_s in enumerate(charged_at_s) if at_s <= now_s]
        change = rotation.next_change(left_s, ready, period_s)
        passed_s = STEP_S if change is None else period_s
        now_s += passed_s
        left_s = {place: each_s - passed_s for place, each_s in left_s.items()}
        if change is not None:
            place, number = change
            left_s[place], changes = shortest_s, changes + 1
            charged_at_s[number] = now_s + charging_s
        assert min(left_s.values()) >= 0.0, "it came down in time"
    assert changes >= 8.0 * 3600.0 / shortest_s


@pytest.mark.parametrize("places", range(2, 9))
def test_vehicles_that_come_and_go_keep_clear_of_all_places_and_of_each_other(places: int) -> None:
    ring = rotation.Ring(places)
    occupied = np.array([ring.place_m(place) for place in range(places)])
    for place in range(places):
        waits, leaves = np.array(ring.beside_m(place, 1)), np.array(ring.beside_m(place, -1))
        assert np.linalg.norm(waits - leaves) > CLEAR_M
        for share in np.linspace(0.0, 1.0, 20):
            new, old = (
                waits + share * (occupied[place] - waits),
                occupied[place] + share * (leaves - occupied[place]),
            )
            assert np.linalg.norm(new - old) > CLEAR_M
        for angle_rad in np.linspace(-math.pi, math.pi, 24):
            begin_m = 2.0 * math.cos(angle_rad), 2.0 * math.sin(angle_rad), 1.0
            flown = ring.way(begin_m, place).sample(np.arange(0.0, 60.0, 0.1))[:, :3]
            gaps_m = np.linalg.norm(flown[:, None] - occupied[None], axis=2)
            assert gaps_m.min() > CLEAR_M
            assert math.dist(flown[-1], waits) < 0.01


@pytest.mark.parametrize(("name", "places"), [("three", 3), ("six", 6)])
def test_the_charging_places_of_the_fleets_are_apart_and_outside_of_the_ring(name: str, places: int) -> None:
    fleet = load_fleet(EXAMPLES / "rotation" / f"{name}.toml")
    assert fleet.simulator is not None
    starts_m = np.array([place[:2] for place in fleet.simulator.start.values()])
    assert len(starts_m) == len(fleet.vehicles) > places
    apart_m = np.linalg.norm(starts_m[:, None] - starts_m[None], axis=2) + 9.0 * np.eye(len(starts_m))
    assert apart_m.min() > 2.0 * ABOVE_M
    ring = rotation.Ring(places)
    for place in range(places):
        assert np.linalg.norm(starts_m - ring.place_m(place)[:2], axis=1).min() > CLEAR_M
        assert all(
            abs(value) < high - 0.1
            for value, high in zip(ring.beside_m(place, 1)[:2], fleet.volume.max_m[:2], strict=True)
        )


class FakeFleet:
    """Vehicles that do at once what is requested; `asked` is what that was."""

    def __init__(self, left_s: Mapping[str, float | None]) -> None:
        self.asked: list[str] = []
        self.refuses: set[str] = set()
        self.promotes = True
        self.now_s = 0.0
        self.file = SimpleNamespace(vehicles=dict.fromkeys(left_s))
        self.session = SimpleNamespace(clock=lambda: self.now_s)
        self._states = {name: self._state(name, value) for name, value in left_s.items()}

    @staticmethod
    def _state(name: str, left_s: float | None) -> SimpleNamespace:
        """A vehicle in flight for another while, or a charged one on the floor."""
        known = None if left_s is None else (left_s, left_s)
        battery = SimpleNamespace(charged=known is None, low=False, left_s=known)
        assigned, place_m = () if name == "h1" else ("h1",), (2.0, 0.0, 0.0)
        return SimpleNamespace(
            name=name, airborne=known is not None, battery=battery, battery_text="", position_m=place_m,
            assigned=assigned,
        )  # fmt: skip

    def __iter__(self) -> Iterator[SimpleNamespace]:
        return iter([SimpleNamespace(name=name, state=state) for name, state in self._states.items()])

    def __getitem__(self, name: str) -> Any:
        def asked(verb: str) -> Any:
            return lambda *_, **__: self.asked.append(f"{verb} {name}")

        return SimpleNamespace(**{verb: asked(verb) for verb in ("fly", "lead", "go_to", "follow")})

    def state_of(self, name: str) -> SimpleNamespace:
        return self._states[name]

    def take_off(self, names: list[str], _height_m: float) -> None:
        if self.refuses & set(names):
            raise RefusedError("weak rotor")
        self.asked.append(f"take_off {names[0]}")

    def promote(self, name: str) -> None:
        if not self.promotes:
            raise RefusedError("h1 does not fly")
        self.asked.append(f"promote {name}")

    def home(self, names: list[str]) -> None:
        self.asked.append(f"home {names[0]}")
        self._states[names[0]].airborne = False

    def wait_for_formation(self, _names: list[str]) -> None:
        pass


def rotating(left_s: Mapping[str, float | None]) -> tuple[Any, FakeFleet]:
    fleet = FakeFleet(left_s)
    return rotation.Rotation(fleet, 3, say=lambda _: None), fleet


def test_a_leader_hands_over_to_the_vehicle_with_the_most_time_before_it_is_replaced() -> None:
    turning, fleet = rotating({"h1": 60.0, "h2": 200.0, "h3": 250.0, "h4": None})
    assert turning.step()
    assert fleet.asked == [
        "promote h3", "take_off h4", "fly h4", "lead h1", "go_to h1", "follow h4", "home h1"
    ]  # fmt: skip
    assert turning.in_place == ["h4", "h2", "h3"]


def test_a_spare_that_does_not_take_off_is_left_out_for_a_while_and_another_one_tried() -> None:
    turning, fleet = rotating({"h1": 250.0, "h2": 60.0, "h3": 200.0, "h4": None, "h5": None})
    fleet.refuses = {"h4"}
    assert not turning.step()
    assert turning.in_place == ["h1", "h2", "h3"]
    assert turning.step()
    assert turning.in_place == ["h1", "h5", "h3"]


def test_without_a_charged_vehicle_an_almost_empty_one_goes_home_and_its_place_is_filled_later() -> None:
    turning, fleet = rotating({"h1": 250.0, "h2": rotation.RESERVE_S - 1.0, "h3": 200.0, "h4": 0.0})
    assert not turning.step()
    assert fleet.asked == ["home h4", "home h2"], "also the one that still flies beside the places"
    assert turning.in_place == ["h1", None, "h3"]
    fleet.state_of("h4").battery.charged = True
    assert turning.step()
    assert turning.in_place == ["h1", "h4", "h3"]


def test_the_place_of_a_leader_that_has_landed_by_itself_is_filled_and_another_one_leads() -> None:
    turning, fleet = rotating({"h1": 250.0, "h2": 300.0, "h3": 200.0, "h4": None})
    fleet.state_of("h1").airborne = fleet.promotes = False
    assert turning.step()
    assert turning.in_place == ["h4", "h2", "h3"]
    assert fleet.asked[:2] == ["lead h2", "follow h3"]
