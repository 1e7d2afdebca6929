"""Ways home of random situations: all vehicles arrive in time, clear of each other."""

import math
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import rcopterx.fleet
from rcopterx.bus.messages import Zone
from rcopterx.control.references.paths import path_problem
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.formation.homing import ABOVE_M, LONGEST_S, above, free_places, ways_to
from rcopterx.formation.placement import Room, entered

SHIPPED = Path(rcopterx.fleet.__file__).parent / "fleets"
ROOM = Room((-1.1, -1.1, 0.1), (1.1, 1.1, 1.9))
HALF_AXES_M = (0.4, 0.6)
MOST = 10
NEAREST_M = 0.3
SPACING_M = 0.32  # of vehicles in the air
STANDING_M = 0.4
HOME_S = 30.0
HOLDING_S, LANDING_S = 4.0, 6.0  # before and after the ways
EACH_TIME, CAMPAIGN = 25, 10_000


@dataclass(frozen=True)
class Situation:
    """Vehicles in the air and on the floor; some of them stand where others took off."""

    present: dict[str, np.ndarray]
    homes_m: dict[str, np.ndarray]
    standing_m: list[np.ndarray]


def scattered(rng: np.random.Generator, count: int, low: float, high: float, apart_m: float) -> np.ndarray:
    """Random places in the room between two heights, some distance apart."""
    places: list[np.ndarray] = []
    tries = 0
    while len(places) < count:
        place = rng.uniform((*ROOM.min_m[:2], low), (*ROOM.max_m[:2], high))
        if all(math.dist(place, other) >= apart_m for other in places):
            places.append(place)
        tries += 1
        if tries > 2000:
            places, tries = [], 0
    return np.array(places).reshape(-1, 3)


def situation(seed: int) -> Situation:
    """Up to ten vehicles; each third situation has standing ones, of which some took a home."""
    rng = np.random.default_rng(seed)
    flying = int(rng.integers(1, MOST + 1))
    standing = int(rng.integers(0, MOST + 1 - flying)) if seed % 3 == 0 else 0
    floor_m = scattered(rng, flying + standing, 0.0, 0.0, STANDING_M)
    homes_m = rng.permutation(floor_m)[:flying] if seed % 2 else floor_m[:flying]
    air_m = scattered(rng, flying, 0.3, ROOM.max_m[2], SPACING_M)
    names = [f"h{number}" for number in range(1, flying + 1)]
    yaws_rad = rng.uniform(-3.0, 3.0, flying)
    present = {
        name: np.append(*at) for name, at in zip(names, zip(air_m, yaws_rad, strict=True), strict=True)
    }
    return Situation(present, dict(zip(names, homes_m, strict=True)), list(floor_m[flying:]))


def flown(seed: int) -> tuple[float, float]:
    """The time until all are home, and the smallest distance on the way [m]."""
    this = situation(seed)
    ends_m = free_places(this.homes_m, this.standing_m, ROOM, HALF_AXES_M[0])
    assert ends_m.keys() == this.homes_m.keys()
    ways = ways_to(above(ends_m, this.present, ROOM), this.present, this.standing_m, ROOM, HALF_AXES_M)
    assert ways.keys() == this.present.keys(), seed
    at_s = np.arange(0.0, LONGEST_S, 0.02)
    tracks = [way.sample(at_s)[:, :3] for way in ways.values()]
    for name, way in ways.items():
        assert np.all(np.abs(way.knots[[0, -1], 5:]) == 0.0)
        assert way.knots[0, 1:5] == pytest.approx(this.present[name])
        assert way.knots[-1, 1:4] == pytest.approx(ends_m[name] + (0.0, 0.0, ABOVE_M))
    tracks += [np.repeat(place[None], len(at_s), axis=0) for place in this.standing_m]
    gaps_m = [float(np.linalg.norm(a - b, axis=1).min()) for a, b in combinations(tracks, 2)]
    lasts_s = max(way.duration_s for way in ways.values())
    return HOLDING_S + lasts_s + LANDING_S, min(gaps_m, default=math.inf)


@pytest.mark.parametrize(
    "seeds",
    [
        range(EACH_TIME),
        pytest.param(range(EACH_TIME, CAMPAIGN), marks=[pytest.mark.campaign, pytest.mark.timeout(2 * 3600)]),
    ],
    ids=len,
)
def test_all_vehicles_come_home_in_time_and_clear_of_each_other(seeds: range) -> None:
    found = np.array([flown(seed) for seed in seeds])
    print(
        f"{len(found)} situations: all home after {np.median(found[:, 0]):.1f} s in the middle, "
        f"{found[:, 0].max():.1f} s at most; nearest {found[:, 1].min():.3f} m"
    )
    assert found[:, 0].max() <= HOME_S
    assert found[:, 1].min() >= NEAREST_M


def test_a_vehicle_whose_place_is_taken_gets_the_nearest_free_one() -> None:
    homes_m = {name: np.array((0.5, 0.5, 0.0)) for name in ("h1", "h2")}
    places = free_places(homes_m, [np.array((-0.5, 0.0, 0.0))], ROOM, 0.4)
    assert places["h1"] == pytest.approx(homes_m["h1"])
    assert 0.4 <= math.dist(places["h2"], homes_m["h1"]) < 0.5


def test_without_a_free_place_a_vehicle_is_left_out() -> None:
    home_m = np.array((0.0, 0.0, 0.0))
    assert free_places({"h1": home_m}, [home_m], ROOM, 3.0) == {}


@pytest.mark.parametrize("fleet", sorted(path.stem for path in SHIPPED.glob("*.toml")))
def test_vehicles_of_every_shipped_fleet_can_fly_the_ways(fleet: str) -> None:
    file = load_fleet(SHIPPED / f"{fleet}.toml")
    low_m, high_m = file.volume.min_m, file.volume.max_m
    for name in {vehicle.type: name for name, vehicle in file.vehicles.items()}.values():
        model, home_m, room = model_of(file, name), np.zeros(3), Room(low_m, high_m)
        for start_m in ((0.9, -0.9, 1.8), (0.0, 0.0, 1.8), (-0.9, 0.0, 0.6)):
            present = {name: np.append(start_m, 0.7)}
            aims = above({name: home_m}, present, room)
            (way,) = ways_to(aims, present, [], room, HALF_AXES_M).values()
            assert path_problem(way, model, way.duration_s) is None, name


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_ways_lead_round_a_zone_and_end_beside_it(shape: str) -> None:
    zone = Zone(min_m=(-0.2, -0.2, 0.0), max_m=(0.2, 0.2, 2.0), shape=shape)
    room = replace(ROOM, zones={"pillar": zone})
    present = {"h1": np.array([0.8, 0.0, 1.0, 0.0]), "h2": np.array([-0.8, 0.1, 0.6, 0.0])}
    homes_m = {
        "h1": np.array([-0.8, 0.0, 0.0]),
        "h2": np.array([0.1, 0.1, 0.0]),
    }  # the second one is in the zone
    ends_m = free_places(homes_m, [], room, HALF_AXES_M[0])
    assert math.dist(ends_m["h1"], homes_m["h1"]) == 0.0
    assert 0.2 < math.dist(ends_m["h2"], homes_m["h2"]) < 0.7
    ways = ways_to(above(ends_m, present, room), present, [], room, HALF_AXES_M)
    assert ways.keys() == present.keys()
    for name, way in ways.items():
        track = way.sample(np.arange(0.0, way.duration_s, 0.02))[:, :3]
        assert entered(zone, np.vstack((track, ends_m[name]))) is None, name
