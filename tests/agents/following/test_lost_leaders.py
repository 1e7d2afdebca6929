"""Promises of a follower whose leader is lost: uses its last plan, holds, leads, follows another or lands."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from support.flight import ExactEstimator, NotedController, still
from support.plans import PlanBus, plan_of
from support.statuses import flying_status
from support.vehicle_types import COAXIAL_LAG
from support.waiting import FakeClock

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.following.following import LostLeaders
from rcopterx.agents.following.leader_plans import LeaderPlans, PeerStatuses, followed_leader
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.settings import Succession
from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import AgentStatus, LeaderLink, SetPoint
from rcopterx.bus.subscription import Inbox
from rcopterx.control.interfaces import Measurement
from rcopterx.formation.succession import FollowingMode
from rcopterx.vehicles.phases import Event, Phase

PERIOD_S = 0.02
OWN = LeaderLink(leader="h1", offset_m=(-0.5, 0.0, 0.0))
FELLOW = LeaderLink(leader="h1", offset_m=(0.5, 0.5, 0.0))


@dataclass
class Orphan:
    """A follower of h1 in flight, and its fellow h2."""

    policy: str
    successors: tuple[str, ...] = ("h2", "h9")
    clock: FakeClock = field(default_factory=FakeClock)
    plan_bus: PlanBus = field(default_factory=PlanBus)
    statuses: dict[str, Inbox[AgentStatus]] = field(default_factory=dict)
    frame: int = 10
    modes: list[FollowingMode] = field(default_factory=list)

    def __post_init__(self) -> None:
        controller = NotedController(np.zeros((1, 4)))
        self.pilot = Pilot(COAXIAL_LAG, controller, ExactEstimator(), Guidance([followed_leader(OWN)]))
        self.leaders = LeaderPlans("h9", self.plan_bus.subscribe)  # type: ignore[arg-type]  # no bus
        self.plan_bus.delivered = self.leaders.receive
        neighbours = PeerStatuses("h9", self.statuses, self.clock)
        succession = Succession(self.policy, 2.0, {"h1": self.successors}, frozenset(self.successors))
        self.lost = LostLeaders("h9", succession, self.pilot, self.leaders, neighbours, self.clock)
        self.leaders.subscribe_to(["h1", "h2"])
        self.pilot.observe(
            StampedMeasurement(1, self.frame, PERIOD_S, Measurement(np.array([-0.5, 0.0, 1.0]), 0.0))
        )
        self.pilot.guidance.on_event(Event.RESUME, still((-0.5, 0.0, 1.0)), 0.0)

    def fly(self, seconds: float, *plans: str, followable: bool = True) -> None:
        """Fly on; only these vehicles give plans."""
        for _ in range(round(seconds / PERIOD_S)):
            self.frame += 1
            self.clock.advance(PERIOD_S)
            self.pilot.observe(
                StampedMeasurement(1, self.frame, PERIOD_S, Measurement(np.array([-0.5, 0.0, 1.0]), 0.0))
            )
            for name in plans:
                place = (0.0, 0.0, 1.0) if name == "h1" else (0.5, 0.5, 1.0)
                plan = plan_of(name, self.frame, position_m=place, followable=followable)
                self.plan_bus.deliver(plan, self.clock())
            self.fellow()
            found = self.leaders.plans(self.pilot.clock)
            self.lost.update(found)
            self.pilot.control(found)
            if self.modes[-1:] != [self.lost.following_mode]:
                self.modes.append(self.lost.following_mode)

    def fellow(self, phase: str = "flying") -> None:
        status = flying_status(
            phase=phase,
            set_point=SetPoint(position_m=(0.5, 0.5, 1.0), yaw_rad=0.0),
            following=(FELLOW,),
            assigned=(FELLOW,),
        )
        self.statuses.setdefault("h2", Inbox(channels.AGENT_STATUS)).store(encode(status), self.clock())

    @property
    def followed(self) -> list[str]:
        return [link.leader for link in self.pilot.guidance.task.followed]


def test_a_follower_uses_the_last_plan_and_then_holds_its_place() -> None:
    orphan = Orphan("hold")
    orphan.fly(1.0, "h1")
    orphan.fly(5.0)
    assert orphan.modes == [FollowingMode.FOLLOW, FollowingMode.USE_LAST_PLAN, FollowingMode.HOLD]
    assert orphan.pilot.guidance.phase is Phase.FLYING
    assert orphan.pilot.guidance.set_point()[0] == pytest.approx([-0.5, 0.0, 1.0], abs=1e-6)
    orphan.fly(1.0, "h1")
    assert orphan.modes[-1] is FollowingMode.FOLLOW
    lost = {kind: count for kind, count in orphan.pilot.events.items() if kind.startswith("leader_lost")}
    assert lost == {"leader_lost_use_last_plan": 1, "leader_lost_hold": 1}


def test_a_pause_shorter_than_a_plan_is_only_ridden_out() -> None:
    orphan = Orphan("land")
    orphan.fly(1.0, "h1")
    orphan.fly(0.3)
    orphan.fly(0.5, "h1")
    assert orphan.modes == [FollowingMode.FOLLOW, FollowingMode.USE_LAST_PLAN, FollowingMode.FOLLOW]


def test_the_first_successor_leads_where_it_is_until_the_leader_returns() -> None:
    orphan = Orphan("promote", successors=("h9", "h2"))
    orphan.fly(1.0, "h1", "h2")
    orphan.fly(3.0, "h2")
    assert orphan.modes == [
        FollowingMode.FOLLOW,
        FollowingMode.USE_LAST_PLAN,
        FollowingMode.HOLD,
        FollowingMode.LEAD,
    ]
    assert orphan.followed == []
    assert orphan.pilot.guidance.go_to(orphan.pilot.guidance.way_to(np.array([0.0, 0.5, 1.0]), 0.0)) is None
    orphan.fly(0.1, "h1", "h2")
    assert orphan.followed == ["h1"]
    assert orphan.modes[-1] is FollowingMode.FOLLOW


def test_the_others_follow_the_heir_and_keep_their_places() -> None:
    orphan = Orphan("promote")
    orphan.fly(1.0, "h1", "h2")
    orphan.fly(3.0, "h2")
    assert orphan.modes[-1] is FollowingMode.FOLLOW_SUCCESSOR
    assert orphan.followed == ["h2"]
    (link,) = orphan.pilot.guidance.task.followed
    assert link.target.position_m == pytest.approx([-1.0, -0.5, 0.0])
    assert [link.leader for link in orphan.pilot.guidance.task.assigned] == ["h1"]
    orphan.fly(1.0, "h1", "h2")
    assert orphan.followed == ["h1"]


def test_without_a_successor_the_place_is_held() -> None:
    orphan = Orphan("promote", successors=())
    orphan.fly(1.0, "h1")
    orphan.fly(4.0)
    assert orphan.modes[-1] is FollowingMode.HOLD
    assert orphan.followed == ["h1"]


def test_a_follower_lands_when_the_fleet_file_says_so() -> None:
    orphan = Orphan("land")
    orphan.fly(1.0, "h1")
    orphan.fly(1.9)
    assert orphan.pilot.guidance.phase is Phase.FLYING
    orphan.fly(0.5)
    assert orphan.pilot.guidance.phase is Phase.LANDING


def test_a_leader_that_lands_is_lost_as_well() -> None:
    orphan = Orphan("promote", successors=("h9",))
    orphan.fly(1.0, "h1")
    orphan.fly(3.0, "h1", followable=False)
    assert orphan.modes == [FollowingMode.FOLLOW, FollowingMode.HOLD, FollowingMode.LEAD]


def test_a_leader_that_was_never_there_is_only_waited_for() -> None:
    orphan = Orphan("land")
    orphan.fly(5.0)
    assert orphan.modes == [FollowingMode.HOLD]
    assert orphan.pilot.guidance.phase is Phase.FLYING


def test_a_restarted_follower_goes_on_waiting_for_its_leader() -> None:
    orphan = Orphan("promote", successors=("h9",))
    orphan.lost.expect()
    orphan.fly(1.9)
    assert orphan.modes == [FollowingMode.HOLD]
    orphan.fly(0.3)
    assert orphan.modes[-1] is FollowingMode.LEAD


def test_other_leaders_by_request_end_the_mourning() -> None:
    orphan = Orphan("promote", successors=("h9",))
    orphan.fly(1.0, "h1")
    orphan.fly(3.0)
    orphan.pilot.guidance.lead(orphan.pilot.estimate)
    orphan.fly(0.1)
    assert orphan.modes[-1] is FollowingMode.FOLLOW
    orphan.fly(1.0, "h1")
    assert orphan.followed == []
