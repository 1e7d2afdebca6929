"""A wand that leads and a hand that walks through a formation, with the figures of both."""

import math
import uuid
from collections.abc import Callable
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest
from integration_support import Flying
from support.bus import free_port

from rcopterx.agents.pilot import TOO_FAST
from rcopterx.bus import channels
from rcopterx.vehicles.tuples import Three

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(400)]

EXAMPLE = Path(__file__).parents[2] / "examples" / "wand" / "wand.py"
NAMES = ("h1", "h2", "h3", "h4", "h5")
MOVED_M = 0.01
BEHIND_MM = 40.0
UNIDENTIFIED_MM = 50.0  # of vehicles that fly gently, because only their type is known
IDENTIFIED = """
[vehicles.{}.model.uncertainty]
gain_factor = [1.3, 1.3, 1.3]
delay_s = [0.015, 0.015, 0.015]
frequency_fraction = [0.1, 0.1, 0.1]
tilt_damping = [0.24, 0.38]
without_tilt = [1.3, 0.015, 0.1]
"""
DISTANCE_M = 0.35
HELD_M = 0.15

Way = tuple[Three, ...]
EIGHT_M = tuple(
    (0.9 + 0.55 * math.sin(2.0 * angle) * 0.6, 0.55 * math.sin(angle), 1.0 + 0.1 * math.sin(angle))
    for angle in np.linspace(0.0, 2.0 * math.pi, 25).tolist()
)
ROUND = np.linspace(-math.pi / 2.0, math.pi / 2.0, 9).tolist()
LOOP_M = (
    (0.9, 0.0, 1.0),
    *((0.6 + 0.3 * math.cos(angle), 0.3 + 0.3 * math.sin(angle), 1.1) for angle in ROUND[4:]),
    *((0.3 - 0.3 * math.cos(angle), -0.3 - 0.3 * math.sin(angle), 1.0) for angle in ROUND[::-1]),
    (0.9, 0.0, 1.0),
)
WALKS_M: dict[str, Way] = {
    "past the middle": ((1.7, 0.25, 1.0), (-1.7, 0.25, 1.0)),
    "at the vehicle in the middle": ((1.7, 0.0, 1.0), (-1.7, 0.0, 1.0)),
    "across, above": ((0.2, 1.7, 1.2), (0.2, -1.7, 1.2)),
    "at two vehicles": ((-0.6, 1.7, 1.0), (-0.6, -1.7, 1.0)),
    "from corner to corner": ((1.6, 1.4, 0.8), (-1.6, -1.4, 1.1)),
    "in and out again": ((1.7, 0.3, 1.0), (0.35, 0.3, 1.0), (1.7, -0.3, 1.0)),
}


class Watched:
    """A flying fleet, the example's actions, and the true places of vehicles against what moves."""

    def __init__(self, flying: Flying, example: dict[str, Any]) -> None:
        self.fleet, self.example = flying.fleet, example
        session = flying.fleet.session
        self._rooms = session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=40_000)
        self._seen = {name: session.subscribe(channels.POSE, name, depth=40_000) for name in ("wand", "hand")}

    def places_m(self) -> dict[int, dict[str, Three]]:
        """Return true places since the last call, by frame."""
        return {
            one.message.frame: {name: at.position_m for name, at in one.message.vehicles.items()}
            for one in self._rooms.drain()
        }

    def seen_m(self, subject: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return where a subject was shown since the last call, and the ways to each vehicle."""
        seen = {
            one.message.frame: one.message.position_m
            for one in self._seen[subject].drain()
            if one.message.position_m
        }
        true = self.places_m()
        frames = sorted(seen.keys() & true.keys())
        shown_m = np.array([seen[at] for at in frames])
        return shown_m, {name: np.array([true[at][name] for at in frames]) - shown_m for name in NAMES}

    def check_led(self, way_m: Way, most_mm: float = BEHIND_MM) -> None:
        """Lead along a way, and check the distance of every vehicle from its place behind the moving wand."""
        self.seen_m("wand")
        self.example["lead"](self.fleet, way_m)
        shown_m, gaps_m = self.seen_m("wand")
        moving = int(np.argmax(np.linalg.norm(shown_m - way_m[0], axis=1) > MOVED_M))
        found_mm = {}
        for name, gap_m in gaps_m.items():
            link = self.fleet.file.vehicles[name].follow
            offset_m = np.array((-0.9, 0.0, 0.0)) + (np.array(link[0].offset_m) if link else 0.0)
            error_mm = 1e3 * np.linalg.norm(gap_m[moving:] - offset_m, axis=1)
            found_mm[name] = float(np.sqrt(np.mean(error_mm**2)))
            print(f"{name}: {found_mm[name]:.1f} mm rms behind the wand, at most {error_mm.max():.0f} mm")
        assert max(found_mm.values()) <= most_mm

    def check_walk(self, words: str, way_m: Way, speed_m_s: float, apart_m: float = DISTANCE_M) -> None:
        """Walk a hand through the formation, and check that no vehicle comes near it."""
        self.seen_m("hand")
        self.example["walk"](self.fleet, way_m, speed_m_s)
        _, gaps_m = self.seen_m("hand")
        least_m = {name: float(np.linalg.norm(gap_m, axis=1).min()) for name, gap_m in gaps_m.items()}
        shown = ", ".join(f"{name} {distance_m:.2f}" for name, distance_m in least_m.items())
        print(f"{words}, {speed_m_s} m/s, m from the hand at least: {shown}")
        assert min(least_m.values()) >= apart_m
        assert {self.fleet.state_of(name).phase for name in NAMES} == {"flying"}


Flight = Callable[[Watched], None]


@pytest.fixture
def watched(fly: Callable[..., None]) -> Callable[..., None]:
    def start(flight: Flight, seed: int = 1, added: str = "") -> None:
        example = run_path(str(EXAMPLE))
        text = example["FLEET"].read_text().replace("127.0.0.1:18801", f"127.0.0.1:{free_port()}")
        text = text.replace("seed = 1\n", f"seed = {seed}\n")

        def flown(flying: Flying) -> None:
            flying.fleet.take_off(height_m=1.0)
            flight(Watched(flying, example))

        fly(flown, f'{text}\n{added}\n[bus]\nnamespace = "t{uuid.uuid4().hex[:8]}"\n')

    return start


def test_five_follow_a_wand_and_make_way_for_a_hand(watched: Callable[..., None]) -> None:
    watched(follow_lose_and_make_way)


def follow_lose_and_make_way(flight: Watched) -> None:
    fleet, example = flight.fleet, flight.example
    flight.check_led(example["LED_M"])
    flight.places_m()
    assert example["lose"](fleet) == "hold"
    assert fleet.state_of("wand").phase == "unseen"
    held_m = [places_m["h1"] for places_m in flight.places_m().values()][50:]
    assert np.ptp(np.array(held_m), axis=0).max() < HELD_M
    flight.check_walk("past the middle", example["WALK_M"], 1.0)


def test_a_vehicle_goes_above_a_hand_that_is_too_fast_and_says_so(watched: Callable[..., None]) -> None:
    watched(go_above)


def go_above(flight: Watched) -> None:
    remarks = flight.fleet.session.subscribe(channels.AGENT_STATUS, "h1", depth=100)
    flight.check_walk("at the vehicle in the middle", WALKS_M["at the vehicle in the middle"], 2.0)
    assert any(TOO_FAST in received.message.diagnostics.remarks for received in remarks.drain())
    assert flight.fleet.state_of("h1").agent.diagnostics.fallbacks["subject_too_fast"] > 0  # type: ignore[union-attr]


def test_a_vehicle_follows_a_wand_of_the_fleet_file_once_it_is_seen(watched: Callable[..., None]) -> None:
    watched(follow_once_seen, added='[[vehicles.h1.follow]]\nleader = "wand"\noffset_m = [-0.9, 0.0, 0.0]\n')


def follow_once_seen(flight: Watched) -> None:
    fleet, example = flight.fleet, flight.example
    before_m = np.array(fleet.state_of("h1").place_m)
    assert before_m[:2] == pytest.approx((-0.9, 0.0), abs=0.15)
    fleet.wait(example["move"](fleet, "wand", ((0.6, 0.2, 1.1),), 0.5) + 2.0 * example["SETTLING_S"])
    fleet.wait_for_formation()
    assert np.array(fleet.state_of("h1").place_m) == pytest.approx((-0.3, 0.2, 1.1), abs=0.1)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(2, 7))
@pytest.mark.parametrize("way", ["round corners", "eight", "loop"])
@pytest.mark.parametrize("identified", [True, False], ids=["identified", "unidentified"])
def test_five_follow_a_wand_on_other_ways_and_seeds(
    watched: Callable[..., None], identified: bool, way: str, seed: int
) -> None:
    def led(flight: Watched) -> None:
        ways_m = {"eight": EIGHT_M, "loop": LOOP_M, "round corners": flight.example["LED_M"]}
        print(f"\n{way}, seed {seed}, {'identified' if identified else 'unidentified'}")
        flight.check_led(ways_m[way], BEHIND_MM if identified else UNIDENTIFIED_MM)

    watched(led, seed, "".join(map(IDENTIFIED.format, NAMES)) if identified else "")


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize("speed_m_s", [1.0, 1.5, 2.0, 3.0])
def test_five_make_way_for_a_hand_on_other_ways(
    watched: Callable[..., None], speed_m_s: float, seed: int
) -> None:
    def walked(flight: Watched) -> None:
        apart_m = DISTANCE_M if speed_m_s < 3.0 else 0.0  # then it is faster than vehicles can make way
        for words, way_m in WALKS_M.items():
            flight.check_walk(f"seed {seed}, {words}", way_m, speed_m_s, apart_m)
            flight.example["inject"](flight.fleet, "recover")
            flight.fleet.wait(flight.example["SETTLING_S"])

    watched(walked, seed)
