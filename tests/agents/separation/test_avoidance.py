"""Who is near, and how large the ellipsoid between two vehicles is."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs
from support.failing import FailingController
from support.flight import ExactEstimator, NotedController
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.following.traffic import FORMATION_SCALE, ellipsoid_scale
from rcopterx.agents.pilot import TOO_FAST, Pilot
from rcopterx.agents.separation.avoidance import (
    NEAR,
    OVER_S,
    TOUCHING,
    NeighbourPlan,
    SeparationEllipsoid,
    near,
)
from rcopterx.bus.messages import LeaderLink
from rcopterx.control.interfaces import AvoidsObstacles, Measurement, Obstacle
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.control.references.columns import COLUMNS
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.formation.law import LeaderPlan
from rcopterx.formation.topology import places
from rcopterx.vehicles.phases import Event, Phase

CLEARANCE = SeparationEllipsoid()
STAGES = 30
OWN = Trajectory(np.zeros((STAGES, COLUMNS)), 0.02)
LINKS = {
    "h1": (),
    "h2": (LeaderLink(leader="h1", offset_m=(-0.4, 0.5, 0.0)),),
    "h3": (LeaderLink(leader="h2", offset_m=(-0.3, 0.0, 0.0)),),
    "h4": (),
}
HEADS = {"h1": np.array([0.0, 0, 1, 0]), "h4": np.array([0.2, 0, 1, 0])}
WHERE = places(LINKS, HEADS)


def flying(velocity: float, start: float, ahead_s: float = 0.0, scale: float = 1.0) -> NeighbourPlan:
    samples = np.zeros((30, COLUMNS))
    samples[:, 0] = start + velocity * 0.02 * np.arange(30)
    samples[:, 4] = velocity
    return NeighbourPlan(LeaderPlan(Trajectory(samples, 0.02), ahead_s), scale)


def test_only_plans_that_come_near_are_kept_clear_of() -> None:
    others = {"comes": flying(-1.0, 0.8), "leaves": flying(1.0, 0.8), "far": flying(0.0, 2.0)}
    found = near(CLEARANCE, others, OWN, 0.02, STAGES, 0.0)
    assert len(found.obstacles) == 1
    assert found.touching
    assert found.closest_m == pytest.approx(0.8 - 0.58)
    assert near(CLEARANCE, {}, OWN, 0.02, STAGES, 0.0).closest_m == np.inf


def test_an_old_plan_is_read_at_the_present_and_goes_on_beyond_its_end() -> None:
    found = near(CLEARANCE, {"h2": flying(-1.0, 1.0, ahead_s=0.08)}, OWN, 0.02, STAGES, 0.02)
    assert found.obstacles[0].positions_m[:, 0] == pytest.approx(0.9 - 0.02 * np.arange(30))


def test_the_share_shrinks_the_ellipsoid_and_what_counts_as_near() -> None:
    beside = flying(0.0, 0.35 * 0.5 * (NEAR + 0.1), scale=0.5)
    assert near(CLEARANCE, {"h2": beside}, OWN, 0.02, STAGES, 0.0).obstacles == ()
    nearer = flying(0.0, 0.35 * 0.5 * (NEAR - 0.1), scale=0.5)
    (obstacle,) = near(CLEARANCE, {"h2": nearer}, OWN, 0.02, STAGES, 0.0).obstacles
    assert obstacle.half_axes_m[:, 0] == pytest.approx(0.175)
    assert near(CLEARANCE, {"h2": flying(0.0, 0.0, scale=0.0)}, OWN, 0.02, STAGES, 0.0).obstacles == ()


def test_others_keep_farther_from_a_subject_whose_future_is_a_guess() -> None:
    plan = structs.replace(flying(0.0, 1.0).plan, margins_m=(0.0, 0.3))
    (obstacle,) = near(CLEARANCE, {"wand": NeighbourPlan(plan, 1.0)}, OWN, 0.01, STAGES, 0.0).neighbours
    assert obstacle.half_axes_m[0] == pytest.approx((0.35, 0.35, 0.6))
    assert obstacle.half_axes_m[1] == pytest.approx((0.5, 0.5, 0.75))
    assert obstacle.half_axes_m[2:] == pytest.approx(np.tile((0.65, 0.65, 0.9), (STAGES - 2, 1)))


@pytest.mark.parametrize(("speed_m_s", "start_m", "too_fast"), [(-1.0, 1.0, False), (-3.0, 1.0, True)])
def test_a_subject_is_too_fast_if_it_arrives_before_the_vehicle_can_be_aside(
    speed_m_s: float, start_m: float, too_fast: bool
) -> None:
    other = flying(speed_m_s, start_m)
    hand = structs.replace(other, plan=structs.replace(other.plan, margins_m=(0.1,) * 30))
    found = near(CLEARANCE, {"hand": hand}, OWN, 0.02, STAGES, 0.0, side_m_s2=2.0)
    assert found.over_m == pytest.approx(0.7 if too_fast else -np.inf)
    assert near(CLEARANCE, {"h2": other}, OWN, 0.02, STAGES, 0.0).over_m == -np.inf


@given(
    st.integers(0, 2**32 - 1),
    st.floats(-0.3, 1.0),
    st.sampled_from([0.02, 0.03]),
    st.sampled_from([0.02, 0.05]),
)
def test_distances_are_those_of_the_plans_read_at_the_same_instants(
    seed: int, ahead_s: float, own_period_s: float, other_period_s: float
) -> None:
    random = np.random.default_rng(seed)
    own, other = (
        Trajectory(random.normal(size=(stages, COLUMNS)), period_s)
        for stages, period_s in ((STAGES, own_period_s), (9, other_period_s))
    )
    found = near(CLEARANCE, {"h2": NeighbourPlan(LeaderPlan(other, ahead_s), 1.0)}, own, 0.02, STAGES, 0.01)
    other_m = other.resampled(ahead_s + 0.01, 0.02, STAGES).position_m
    gap_m = own.resampled(0.02, 0.02, STAGES).position_m - other_m
    assert found.closest_m == pytest.approx(np.linalg.norm(gap_m, axis=1).min(), abs=1e-12)
    closest = CLEARANCE.normalised(gap_m).min()
    assert [len(found.obstacles), found.touching] == [closest < NEAR, closest < TOUCHING]
    for obstacle in found.obstacles:
        assert (obstacle.positions_m == other_m).all()


@pytest.mark.parametrize("axes", [(0.0, 0.6), (0.35, -1.0), (6.0, 0.6), (float("nan"), 0.6)])
def test_half_axes_that_make_no_sense_are_refused(axes: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"_m: .* must be above 0"):
        SeparationEllipsoid(*axes)


def test_a_leader_gives_no_way_to_those_who_follow_it() -> None:
    for follower in ("h2", "h3"):
        assert ellipsoid_scale(CLEARANCE, LINKS, WHERE, "h1", follower) == 0.0
        assert ellipsoid_scale(CLEARANCE, LINKS, WHERE, follower, "h1") > 0.0


def test_chosen_places_closer_than_the_ellipsoid_are_respected() -> None:
    scale = ellipsoid_scale(CLEARANCE, LINKS, WHERE, "h3", "h2")
    assert scale == pytest.approx(FORMATION_SCALE * 0.3 / 0.35)
    assert ellipsoid_scale(CLEARANCE, LINKS, WHERE, "h2", "h1") == 1.0


def test_vehicles_of_different_formations_keep_the_whole_ellipsoid() -> None:
    assert ellipsoid_scale(CLEARANCE, LINKS, WHERE, "h1", "h4") == 1.0
    assert ellipsoid_scale(CLEARANCE, LINKS, {}, "h3", "h2") == 1.0


def pilot_with(controller: str) -> Pilot:
    """In the air at one metre, sent straight on."""
    built = CONTROLLERS.build(controller, COAXIAL_LAG, 0.02, {"horizon": 30})
    estimator = ESTIMATORS.build("extended_kalman", COAXIAL_LAG, 0.02, {})
    pilot = Pilot(COAXIAL_LAG, built, estimator, Guidance(), CLEARANCE)
    pilot.observe(StampedMeasurement(1, 1, 0.02, Measurement(np.array([0.0, 0.0, 1.0]), 0.0)))
    pilot.note_applied("armed", 0, COAXIAL_LAG.hover_input)
    pilot.guidance.go_to(pilot.guidance.way_to(np.array([1.0, 0.0, 1.0]), 0.0))
    return pilot


ACROSS = {"h2": NeighbourPlan(LeaderPlan(hold(np.array([0.3, 0.0, 1.0]), 0.0, 0.02, 30), 0.0), 1.0)}


@pytest.mark.parametrize("controller", CONTROLLERS.available())
def test_a_controller_that_cannot_avoid_says_so(controller: str) -> None:
    pilot = pilot_with(controller)
    for _ in range(3):
        pilot.control({}, ACROSS)
    if isinstance(pilot.controller, AvoidsObstacles):
        assert pilot.avoidance.ticks == 2
        assert pilot.avoidance.closest_m is not None
        assert 0.0 <= pilot.avoidance.closest_m < 0.31
        assert not pilot.events["cannot_avoid"]
    else:
        assert pilot.events["cannot_avoid"] == 2
        assert pilot.avoidance.ticks == 0


class Avoiding(NotedController):
    """Records the obstacles that it avoids."""

    obstacles: Sequence[Obstacle] = ()

    def set_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        self.obstacles = obstacles


def test_a_default_controller_that_flew_for_another_one_avoids_no_vehicle_that_has_gone() -> None:
    default = Avoiding(COAXIAL_LAG.hover_input[None, :])
    pilot = Pilot(COAXIAL_LAG, default, ExactEstimator(), Guidance(), CLEARANCE, default)
    pilot.observe(StampedMeasurement(1, 1, 0.02, Measurement(np.array([0.0, 0.0, 1.0]), 0.0)))
    pilot.note_applied("armed", 0, COAXIAL_LAG.hover_input)
    pilot.control({})
    pilot.use_controller(FailingController(default, ["raises"]))
    while not pilot.step_guard.given_up:
        pilot.control({}, ACROSS)
    assert default.obstacles
    pilot.control({})
    assert pilot.controller is default
    assert not default.obstacles


def test_a_vehicle_that_takes_off_or_lands_goes_straight_on() -> None:
    pilot = pilot_with("cascade")
    pilot.control({}, ACROSS)
    pilot.guidance.on_event(Event.LAND, pilot.estimate, pilot.clock.time_s)
    for _ in range(3):
        pilot.control({}, ACROSS)
    assert pilot.avoidance.ticks == 0


def test_vehicles_that_all_keep_clear_of_this_one_leave_no_distance_to_report() -> None:
    pilot = pilot_with("cascade")
    passive = {name: structs.replace(neighbour, scale=0.0) for name, neighbour in ACROSS.items()}
    for _ in range(3):
        pilot.control({}, passive)
    assert pilot.avoidance.closest_m is None


def fast_hand(height_m: float) -> dict[str, NeighbourPlan]:
    """A hand that comes at three metres a second at the vehicle of `pilot_with`."""
    samples = np.zeros((30, COLUMNS))
    samples[:, :3] = np.array([1.0, 0.0, height_m]) - 0.06 * np.arange(30)[:, None] * [1.0, 0.0, 0.0]
    samples[:, 4] = -3.0
    return {"hand": NeighbourPlan(LeaderPlan(Trajectory(samples, 0.02), 0.0, margins_m=(0.1,) * 30), 1.0)}


def test_a_vehicle_goes_above_a_subject_that_is_too_fast_and_says_so() -> None:
    pilot = pilot_with("cascade")
    for _ in range(5):
        output = pilot.control({}, fast_hand(1.0))
    assert output.plan.position_m[-1, 2] > 1.3
    assert pilot.guidance.phase is Phase.FLYING
    assert pilot.events["subject_too_fast"] == 4
    assert TOO_FAST in pilot.remarks
    for _ in range(round(OVER_S / 0.02) + 1):
        pilot.control({})
    assert TOO_FAST not in pilot.remarks


def test_a_vehicle_lands_where_the_ceiling_is_too_low_to_go_above() -> None:
    pilot = pilot_with("cascade")
    for _ in range(3):
        pilot.control({}, fast_hand(COAXIAL_LAG.state_max[2] - 0.65))
    assert pilot.guidance.phase is Phase.LANDING
    assert TOO_FAST in pilot.remarks
