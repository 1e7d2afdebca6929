"""Plans are received from vehicles that could come near, from no others, and no longer than needed."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from support.plans import PlanBus, plan_of
from support.statuses import hovering

from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.following.traffic import MOST, PATIENCE, UPDATE_EVERY_TICKS, Traffic, way
from rcopterx.agents.separation.avoidance import SeparationEllipsoid
from rcopterx.bus.messages import AgentStatus, LeaderLink, SetPoint
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.vehicles.tuples import Three

BESIDE = LeaderLink(leader="h1", offset_m=(-0.4, 0.0, 0.0))


def status(
    at: Three,
    aim: Three | None = None,
    velocity: Three = (0.0, 0.0, 0.0),
    following: tuple[LeaderLink, ...] = (),
    phase: str = "flying",
) -> AgentStatus:
    set_point = SetPoint(position_m=aim or at, yaw_rad=0.0)
    return hovering(at, *following, phase=phase, frame=10, set_point=set_point, velocity_m_s=velocity)


@dataclass
class Road:
    """The traffic of a vehicle h9 on a bus that tests fill."""

    clearance: SeparationEllipsoid | None = field(default_factory=SeparationEllipsoid)
    bus: PlanBus = field(default_factory=PlanBus)

    def __post_init__(self) -> None:
        self.traffic = Traffic("h9", self.clearance, self.bus.subscribe)  # type: ignore[arg-type]  # no bus
        self.clock = FleetClock()
        self.clock.frames_until(1, 10, 0.02)

    def heard(self, own: AgentStatus, **others: AgentStatus) -> list[str]:
        self.traffic.update(own, others)
        return self.bus.open_names()


OWN = status((0.0, 0.0, 1.0))


def test_only_vehicles_that_could_come_near_are_heard() -> None:
    heard = Road().heard(
        OWN,
        near=status((0.4, 0.0, 1.0)),
        far=status((1.2, 0.0, 1.0)),
        sent_here=status((-1.2, 0.0, 1.0), aim=(1.0, 0.0, 1.0)),
        flies_by=status((0.0, 1.2, 1.0), velocity=(0.0, -0.8, 0.0)),
        below=status((0.0, 0.0, 0.0), phase="armed"),
    )
    assert heard == ["below", "flies_by", "near", "sent_here"]


def test_a_vehicle_that_is_sent_somewhere_hears_who_is_on_its_way() -> None:
    own = status((-1.0, 0.0, 1.0), aim=(1.0, 0.0, 1.0))
    assert Road().heard(own, ahead=status((0.2, 0.2, 1.0)), behind=status((-1.0, 1.1, 1.0))) == ["ahead"]


def test_mates_in_their_places_need_no_plans_of_each_other() -> None:
    road = Road()
    own = status((-0.4, 0.0, 1.0), following=(BESIDE,))
    h1, mate = status((0.0, 0.0, 1.0)), LeaderLink(leader="h1", offset_m=(-0.4, 0.5, 0.0))
    assert road.heard(own, h1=h1, h2=status((-0.4, 0.5, 1.0), following=(mate,))) == []
    assert road.heard(own, h1=h1, h2=status((-0.8, 0.1, 1.0), following=(mate,))) == ["h2"]


def test_a_leader_does_not_hear_its_followers() -> None:
    follower = LeaderLink(leader="h9", offset_m=(-0.4, 0.0, 0.0))
    assert Road().heard(OWN, h2=status((0.2, 0.0, 1.0), following=(follower,))) == []


def test_a_plan_is_heard_no_longer_once_its_vehicle_is_gone() -> None:
    road = Road()
    assert road.heard(OWN, h2=status((0.4, 0.0, 1.0))) == ["h2"]
    for _ in range(PATIENCE - 1):
        assert road.heard(OWN, h2=status((1.2, 0.0, 1.0))) == ["h2"]
    assert road.heard(OWN, h2=status((1.2, 0.0, 1.0))) == []


@pytest.mark.parametrize("phase", ["armed", "takeoff", "landing", "emergency"])
def test_nobody_is_heard_unless_in_free_flight(phase: str) -> None:
    assert Road().heard(status((0.0, 0.0, 1.0), phase=phase), h2=status((0.4, 0.0, 1.0))) == []


def test_the_nearest_are_heard_when_many_are_near() -> None:
    others = {f"v{number}": status((0.1 + 0.05 * number, 0.0, 1.0)) for number in range(MOST + 2)}
    assert Road().heard(OWN, **others) == [f"v{number}" for number in range(MOST)]


def test_without_avoidance_nothing_is_heard_and_nothing_kept_clear() -> None:
    road = Road(clearance=None)
    assert not any(road.traffic.due() for _ in range(3 * UPDATE_EVERY_TICKS))
    assert road.heard(OWN, h2=status((0.4, 0.0, 1.0))) == []
    assert road.traffic.neighbours(road.clock, {}) == {}


def test_plans_come_on_the_own_clock_with_their_shares() -> None:
    road = Road()
    road.heard(OWN, h2=status((0.4, 0.0, 1.0)), h3=status((0.0, 0.4, 1.0)))
    road.bus.deliver(plan_of("h2", frame=9, position_m=(0.4, 0.0, 1.0)))
    road.bus.deliver(plan_of("h3", frame=9, epoch=2))
    found = road.traffic.neighbours(road.clock, {})
    assert list(found) == ["h2"]
    assert found["h2"].scale == 1.0
    assert found["h2"].plan.ahead_s == pytest.approx(0.0)
    position_m = found["h2"].plan.trajectory.position_m[0]
    assert position_m == pytest.approx([0.4, 0.0, 1.0], abs=TrajectoryArray.RESOLUTION[0])


def test_a_plan_that_is_too_old_says_nothing() -> None:
    road = Road()
    road.heard(OWN, h2=status((0.4, 0.0, 1.0)))
    road.clock.frames_until(1, 60, 0.02)
    road.bus.deliver(plan_of("h2", frame=10))
    assert road.traffic.neighbours(road.clock, {}) == {}


def test_refused_plans_are_counted_also_after_their_subscription_is_closed() -> None:
    road = Road()
    road.heard(OWN, h2=status((0.4, 0.0, 1.0)))
    road.bus.opened[0].store(b"nonsense", 100.0)
    road.traffic.neighbours(road.clock, {})
    before = road.traffic.rejected
    assert sum(before.values()) == 1
    assert all(kind.startswith("neighbour_plan.") for kind in before)
    for _ in range(PATIENCE):
        road.heard(OWN, h2=status((1.2, 0.0, 1.0)))
    assert road.bus.open_names() == []
    assert road.traffic.rejected == before


def test_a_way_reaches_as_far_as_a_vehicle_can_get() -> None:
    places = way(status((0.0, 0.0, 1.0), aim=(9.0, 0.0, 1.0), velocity=(0.0, 1.0, 0.0)))
    assert places.max(axis=0) == pytest.approx([1.56, 1.2, 1.0])
    assert np.isfinite(way(status((0.0, 0.0, 1.0)))).all()
