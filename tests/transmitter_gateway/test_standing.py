"""What is plausible of the pose of a vehicle on the floor, and that nothing else can be armed."""

import random
from dataclasses import replace

import pytest
from arbiter_bench import IDLE, PERIOD_S, Bench
from hypothesis import given
from hypothesis import strategies as st
from pose_monitor_bench import BOX

from rcopterx.radios.limits import ArbiterLimits, LimitsError, StandingLimits, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import Action, PoseInput, Position, State
from rcopterx.transmitter_gateway.standing import Standing

LIMITS = ArbiterLimits(
    surveillance=SurveillanceLimits(fence=BOX, trust_repeated_poses=False), standing=StandingLimits()
)
FLOOR: Position = (0.2, -0.3, 0.02)


class Floor:
    """Poses of a vehicle on the floor, with noise."""

    def __init__(self, limits: ArbiterLimits = LIMITS, noise_m: float = 3e-4, rate_hz: float = 50.0) -> None:
        self.others: dict[str, Position] = {}
        self.standing = Standing("h1", limits, lambda now_s: self.others)
        self.random, self.noise_m, self.period_s = random.Random(1), noise_m, 1.0 / rate_hz
        self.now_s, self.frame = 100.0, 0

    def see(self, position: Position | None, seconds: float = 2.0, tilt_rad: float = 0.01) -> list[str]:
        for _ in range(round(seconds / self.period_s)):
            self.now_s, self.frame = self.now_s + self.period_s, self.frame + 1
            place = None if position is None else self.noisy(position)
            pose = PoseInput("h1", 1, self.frame, place, self.period_s, 0.0, 0.0, tilt_rad)
            self.standing.observe(pose, self.now_s)
        return self.standing.problems(self.now_s)

    def noisy(self, position: Position) -> Position:
        x, y, z = (value + self.random.gauss(0.0, self.noise_m) for value in position)
        return x, y, z


@given(st.integers(0, 2**31), st.floats(1e-4, 1.5e-3), st.sampled_from([20.0, 50.0, 100.0, 200.0]))
def test_vehicle_that_stands_with_ordinary_noise_is_plausible(
    seed: int, noise_m: float, rate_hz: float
) -> None:
    floor = Floor(noise_m=noise_m, rate_hz=rate_hz)
    floor.random.seed(seed)
    floor.others = {"h2": (0.2, 0.3, 0.0)}
    assert floor.see(FLOOR, 3.0) == []
    assert floor.standing.problems(floor.now_s, arming=True) == []


def test_position_that_repeats_itself_for_half_a_second_is_frozen() -> None:
    floor = Floor()
    floor.see(FLOOR, 1.0)
    floor.noise_m = 0.0
    assert floor.see(FLOOR, 0.48) == []
    assert floor.see(FLOOR, 0.1) == [
        "h1: its position has repeated itself exactly for 0.6 s, as no measurement does: is the pose frozen? "
        "See that cameras see its markers"
    ]
    floor.noise_m = 1e-6
    assert floor.see(FLOOR, 0.02) == []


def test_slow_stream_without_repeated_frames_is_not_frozen() -> None:
    floor = Floor(noise_m=1e-5, rate_hz=2.0)
    assert floor.see(FLOOR, 5.0) == []
    floor.now_s += 3.0
    assert floor.standing.problems(floor.now_s) == [], "no new frames are the matter of other checks"


def test_poses_without_noise_are_trusted_where_the_fleet_file_says_so() -> None:
    surveillance = replace(LIMITS.surveillance, trust_repeated_poses=True)
    assert Floor(replace(LIMITS, surveillance=surveillance), noise_m=0.0).see(FLOOR) == []


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ((-0.4, 0.0, -0.5), "h1 stands at z = -0.50 m, below the floor: Y up, or another origin?"),
        (
            (-0.4, 0.0, 0.5),
            "h1 stands at z = 0.50 m, 0.50 m above the floor: Y up, or another origin? From a",
        ),
        (
            (1.8, 0.5, 0.001),
            "h1 is shown at (1.80, 0.50, 0.00) m, outside the volume: put it inside, or is the origin",
        ),
        ((90.0, -50.0, 2.0), "h1 is shown at (90.00, -50.00, 2.00) m, outside the volume: millimetres?"),
    ],
)
def test_place_off_the_floor_of_the_volume_is_named_with_the_likely_cause(
    position: Position, words: str
) -> None:
    (line,) = Floor(noise_m=1e-5).see(position)
    assert line.startswith(words)


@pytest.mark.parametrize("height_m", [-0.09, 0.0, 0.02, 0.29])
def test_vehicle_may_stand_on_a_mat_or_under_an_inaccurate_origin(height_m: float) -> None:
    assert Floor().see((0.0, 0.0, height_m)) == []


def test_limits_are_those_of_the_fleet_file() -> None:
    table = replace(LIMITS, standing=StandingLimits(highest_m=0.9))
    assert Floor(table).see((0.0, 0.0, 0.8)) == []
    low = replace(LIMITS, floor_m=-0.8)
    assert Floor(low).see((0.0, 0.0, -0.8)) == []
    assert Floor(replace(LIMITS, standing=None), noise_m=0.0).see((9.0, 9.0, 9.0)) == []
    with pytest.raises(LimitsError, match=r"standing\.moved_m"):
        StandingLimits(moved_m=0.0)


def test_vehicle_that_lies_on_its_side_is_named() -> None:
    (line,) = Floor().see(FLOOR, tilt_rad=1.5)
    assert line.startswith("h1 is tilted by 86 deg: overturned, Y up, or was the object created with")


def test_vehicle_that_is_carried_is_named_until_it_rests() -> None:
    floor = Floor()
    floor.see(FLOOR, 1.0)
    (line,) = floor.see((0.3, -0.3, 0.02), 0.1)
    assert line.startswith("h1 moves: 100 mm on the floor within the last 1 s; put it down")
    assert floor.see((0.3, -0.3, 0.02), 0.8) != []
    assert floor.see((0.3, -0.3, 0.02), 0.3) == []


def test_drifting_pose_is_named_all_the_time() -> None:
    floor = Floor()
    floor.see(FLOOR, 1.0)
    for number in range(1, 100):
        x, y, z = FLOOR
        found = floor.see((x + 0.001 * number, y, z), 0.02)
    assert found[0].startswith("h1 moves")


def test_two_vehicles_at_one_place_are_one_body() -> None:
    floor = Floor()
    floor.others = {"h2": (0.21, -0.3, 0.02), "h3": (0.2, 0.3, 0.0)}
    assert floor.see(FLOOR) == ["h1 is shown where h2 is: one body for two subjects?"]


def test_vehicle_that_stands_too_close_to_another_one_is_named() -> None:
    floor = Floor(noise_m=1e-5)
    floor.others = {"h2": (0.4, -0.3, 0.02)}
    assert floor.see(FLOOR) == ["h1 stands 0.20 m from h2, closer than 0.3 m: move one"]


def test_axes_that_are_wrong_for_another_vehicle_are_wrong_for_this_one() -> None:
    floor = Floor()
    floor.others = {"h2": (-0.4, 0.0, -0.5)}
    assert floor.see(FLOOR) == ["h2 stands at z = -0.50 m, below the floor: Y up, or another origin?"]


def test_occluded_poses_prove_nothing() -> None:
    floor = Floor()
    assert floor.see(None) == []
    assert floor.standing.problems(floor.now_s, arming=True) == [
        "seen for 0.0 s on the floor, 0.5 s are needed"
    ]


class ArmedFromTheFloor(Bench):
    """An arbiter that judges what stands on the floor; poses have noise unless they are frozen."""

    def __init__(self) -> None:
        super().__init__(LIMITS)
        self.floor = Floor()
        self.position = FLOOR
        self.frozen = False

    def pose(self, vehicle: str = "h1", position: Position | None = None) -> None:
        place = position or self.position
        super().pose(vehicle, place if place is None or self.frozen else self.floor.noisy(place))


def test_plausible_vehicle_is_armed() -> None:
    assert ArmedFromTheFloor().arm().accepted


@pytest.mark.parametrize(
    ("position", "frozen", "words"),
    [
        (FLOOR, True, "pose not plausible: h1: its position has repeated itself exactly"),
        ((-0.4, 0.0, -0.09 - 0.1), False, "pose not plausible: h1 stands at z = -0.19 m, below the floor"),
        ((0.0, 0.0, 0.5), False, "pose not plausible: h1 stands at z = 0.50 m"),
    ],
)
def test_implausible_vehicle_is_not_armed(position: Position, frozen: bool, words: str) -> None:
    bench = ArmedFromTheFloor()
    bench.position, bench.frozen = position, frozen
    answer = bench.arm()
    assert not answer.accepted
    assert words in answer.reason
    assert bench.state is State.DISARMED


def test_vehicle_that_was_not_seen_for_long_enough_is_not_armed() -> None:
    bench = ArmedFromTheFloor()
    place, bench.position = bench.position, None
    bench.run(0.6, IDLE)
    bench.position = place
    bench.run(0.2, IDLE)
    assert "pose not plausible: seen for 0.2 s on the floor" in bench.request(Action.ARM).reason
    bench.run(0.4, IDLE)
    assert bench.request(Action.ARM).accepted


def test_armed_vehicle_whose_pose_freezes_on_the_floor_is_disarmed() -> None:
    bench = ArmedFromTheFloor()
    assert bench.arm().accepted
    bench.run(0.6, IDLE)
    assert bench.state is State.ARMED
    bench.frozen = True
    bench.run(0.7, IDLE)
    assert bench.state is State.DISARMED
    assert bench.reason.startswith("on the floor: h1: its position has repeated itself exactly")


def test_neighbour_does_not_disarm_a_vehicle_that_stands_armed() -> None:
    bench = ArmedFromTheFloor()
    assert bench.arm().accepted
    bench.run(0.6, IDLE)
    bench.pose("h2", (0.6, 0.3, -0.5))
    bench.run(0.2, IDLE)
    assert bench.state is State.ARMED


def test_vehicle_in_flight_is_not_judged_as_one_that_stands() -> None:
    bench = ArmedFromTheFloor()
    assert bench.arm().accepted
    bench.run(PERIOD_S)
    for height_m in (0.1, 0.2, 0.3, 0.4, 0.5):
        bench.position = (0.2, -0.3, height_m)
        bench.run(0.1)
    assert bench.state is State.ARMED
    assert bench.arbiter.standing.problems(bench.now_s) == []
