"""Whatever the motion capture does in flight, every helicopter flies on or lands gently."""

import math
from collections.abc import Iterator

import pytest
from integration_support import GENTLE_M_S, NAMES, Flying, Truth, counter, transmitter_state

from rcopterx.bus.host_messages import TrackerStatus
from rcopterx.simulator import faults
from rcopterx.simulator.faults import Fault, fault_text
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]

SHORT_S = 0.06
"""Shorter than the limit at which a vehicle without a pose is held."""
LONG_S = 60.0
"""Until the test mends it."""
CARRIED_M = 1.0
"""Three times the rms distance by which the draught carries a vehicle that descends unseen from 0.8 m, and
how far two that are swapped are apart (`tests/integration/test_places_of_unseen_vehicles.py`)."""


class Laboratory:
    """The fleet in the air, and what happens to it."""

    def __init__(self, flying: Flying, truth: Truth) -> None:
        self.fleet = flying.fleet
        self.truth = truth
        self._flying = flying

    def inject(self, fault: Fault) -> None:
        inject_faults(self.fleet.session, fault)

    def settled(self, name: str) -> bool:
        state = self.fleet.state_of(name)
        return state.phase in ("ground", "armed") or (state.phase, self.state(name)) == ("flying", "armed")

    def state(self, name: str) -> str:
        return transmitter_state(self._flying, name)

    def counter(self, name: str, what: str) -> int:
        return counter(self._flying, name, what)

    @property
    def tracker(self) -> TrackerStatus:
        received = self.fleet.tracker.latest()
        assert received is not None
        return received.message

    def wait_for_problem(self, words: str) -> None:
        """Wait until the fleet shows what blocks take-off."""
        self.fleet.wait_until(
            lambda: any(words in line for line in self.fleet.problems()), 30, f"{words} is not reported"
        )

    def wait_until_landed_gently(self, *names: str) -> None:
        def landed(name: str) -> bool:
            vehicle = self.truth(name)
            return vehicle is not None and vehicle.on_floor and self.state(name) in ("cut", "disarmed")

        self.fleet.wait_until(lambda: all(map(landed, names)), 30, "not landed", names)
        for name in names:
            vehicle = self.truth(name)
            assert vehicle is not None
            assert vehicle.touchdown_speed_m_s < GENTLE_M_S, name

    def place(self, name: str) -> tuple[float, ...]:
        """True position over ground [m]."""
        vehicle = self.truth(name)
        assert vehicle is not None
        return vehicle.position_m[:2]

    def distance_m(self, name: str, place: tuple[float, ...]) -> float:
        return math.dist(self.place(name), place)

    def assert_flies_on(self, *names: str) -> None:
        self.fleet.wait_until(lambda: all(map(self.settled, names)), 30, "not settled", names)
        for name in names:
            vehicle = self.truth(name)
            assert vehicle is not None
            assert not vehicle.on_floor, name
            assert not vehicle.outside, name
            assert self.fleet.state_of(name).phase == "flying"


@pytest.fixture
def laboratory(flying: Flying, truth: Truth) -> Iterator[Laboratory]:
    laboratory = Laboratory(flying, truth)
    yield laboratory
    laboratory.inject(faults.Recover())


HARMLESS: tuple[Fault, ...] = (
    faults.Close(),
    faults.Reset(),
    faults.WrongMagic(),
    faults.Burst(frames=3),
    faults.Freeze(duration_s=SHORT_S),
    faults.Silence(duration_s=SHORT_S),
    faults.EmptyPackets(duration_s=SHORT_S),
    faults.Occlude("heli2", duration_s=SHORT_S),
    faults.RemoveSubject("heli3", duration_s=SHORT_S),
    faults.SwapSubjects("heli1", "heli2", duration_s=SHORT_S),
    faults.IgnorePings(duration_s=1.2),
    faults.Dribble(duration_s=0.3),
    faults.Delay(delay_s=0.01, duration_s=0.3),
    faults.UnknownObject(duration_s=0.3),
    faults.YUp(duration_s=0.3),
    faults.AddSubject("stranger", duration_s=0.3),
    faults.SetQuality("heli1", 0.1, duration_s=0.3),
    faults.RenameRootSegment("heli1", "body", duration_s=0.3),
)


def test_short_or_harmless_faults_bring_no_vehicle_down(laboratory: Laboratory) -> None:
    for fault in HARMLESS:
        frames = laboratory.tracker.counters["frames"]
        laboratory.inject(fault)
        laboratory.fleet.wait_until(
            lambda before=frames: (
                laboratory.tracker.state == "up" and laboratory.tracker.counters["frames"] > before + 20
            ),
            30,
            f"no frames after {fault_text(fault)}",
        )
        laboratory.fleet.wait_until(
            lambda: all(laboratory.settled(name) for name in NAMES), 5, fault_text(fault), NAMES
        )
        laboratory.truth.assert_none_touched_down()
    laboratory.fleet.wait_for_formation()
    laboratory.assert_flies_on(*NAMES)


def test_formation_flies_on_when_frame_numbers_begin_anew(laboratory: Laboratory) -> None:
    before = laboratory.tracker
    descents = {name: laboratory.counter(name, "entered DESCEND") for name in NAMES}
    laboratory.inject(faults.ResetFrameId(5))
    laboratory.fleet.wait_until(lambda: laboratory.tracker.epoch > before.epoch, 30, "no new epoch")
    laboratory.fleet["h1"].go_to((0.3, 0.1, 0.9))
    laboratory.fleet.wait_for_arrival(["h1"])
    laboratory.fleet.wait_for_formation()
    laboratory.truth.assert_none_touched_down()
    assert {name: laboratory.counter(name, "entered DESCEND") for name in NAMES} == descents


@pytest.mark.parametrize(
    "fault",
    [
        faults.Freeze(duration_s=LONG_S),
        pytest.param(faults.Silence(duration_s=LONG_S), marks=pytest.mark.campaign),
    ],
    ids=fault_text,
)
def test_everybody_lands_gently_when_the_tracker_freezes(laboratory: Laboratory, fault: Fault) -> None:
    before = {name: laboratory.counter(name, "entered HOLD") for name in NAMES}
    laboratory.inject(fault)
    laboratory.wait_until_landed_gently(*NAMES)
    assert all(laboratory.counter(name, "entered HOLD") > held for name, held in before.items())
    laboratory.wait_for_problem("no pose")


def test_vehicles_that_stay_unseen_are_held_then_land_gently_and_the_others_fly_on(
    laboratory: Laboratory,
) -> None:
    before = {name: laboratory.counter(name, "entered HOLD") for name in ("h2", "h3")}
    laboratory.inject(faults.Occlude("heli2", duration_s=LONG_S))
    laboratory.inject(faults.RemoveSubject("heli3", duration_s=LONG_S))
    laboratory.wait_until_landed_gently("h2", "h3")
    assert all(laboratory.counter(name, "entered HOLD") > held for name, held in before.items())
    laboratory.assert_flies_on("h1")
    laboratory.wait_for_problem("heli3")


def test_swapped_vehicles_end_up_landed_gently_and_the_others_fly_on(
    laboratory: Laboratory,
) -> None:
    places = {name: laboratory.place(name) for name in ("h2", "h3")}
    laboratory.inject(faults.SwapSubjects("heli2", "heli3", duration_s=LONG_S))
    laboratory.wait_until_landed_gently("h2", "h3")
    for name, place in places.items():
        assert laboratory.distance_m(name, place) < CARRIED_M
    laboratory.assert_flies_on("h1")


@pytest.mark.campaign
def test_vehicle_whose_pose_stands_still_lands_gently_and_the_others_fly_on(laboratory: Laboratory) -> None:
    place = laboratory.place("h2")
    laboratory.inject(faults.FreezePose("heli2", duration_s=LONG_S))
    laboratory.wait_until_landed_gently("h2")
    assert laboratory.distance_m("h2", place) < CARRIED_M
    laboratory.assert_flies_on("h1", "h3")
