"""Promises of the desk: every request is answered, refusals say why, and a task survives its process."""

from dataclasses import dataclass, field

import msgspec
import numpy as np
import pytest
from support.flight import ExactEstimator, NotedController, still
from support.plans import PlanBus, plan_of
from support.waiting import FakeClock

from agents.desk import FIRST_PLAN_LIMIT_S, Desk, following_of, link_of
from agents.guidance import Guidance
from agents.interfaces import Measurement
from agents.leaders import Leaders
from agents.phases import Event, Phase
from agents.pilot import Frame, Pilot
from agents.settings import AgentSettings
from bus.messages import AgentStatus, Following, SetPoint
from bus.requests import Disarm, Follow, GoTo, Land, Lead, Reply, Request, TakeOff
from bus.session import BusAddress
from vehicles.types import COAXIAL

SETTINGS = AgentSettings(
    bus=BusAddress((), "lab"),
    vehicle="h9",
    vehicles=("h1", "h2", "h9"),
    model=COAXIAL,
    volume_min_m=(-1.2, -1.2, 0.0),
    volume_max_m=(1.2, 1.2, 2.0),
)
UP = (0.1, 0.2, 1.0)


@dataclass
class Asked:
    """A request that remembers its answers."""

    request: Request
    verb: str = "verb"
    unit: str = "h9"
    answers: list[Reply] = field(default_factory=list)

    def answer(self, reply: Reply) -> None:
        self.answers.append(reply)

    @property
    def refusal(self) -> str | None:
        """The reason of the only answer, None if it was accepted."""
        (reply,) = self.answers
        assert reply.accepted == (reply.reason == "")
        return None if reply.accepted else reply.reason


class Office:
    """A desk with a pilot that never has to fly."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.plan_bus = PlanBus()
        controller = NotedController(np.zeros((1, 4)))
        self.pilot = Pilot(COAXIAL, controller, ExactEstimator(), Guidance())
        self.leaders = Leaders("h9", self.plan_bus.subscribe)  # type: ignore[arg-type]  # no bus
        self.desk = Desk(SETTINGS, self.pilot, self.leaders, self.clock)
        self.frame = 10

    def see(self, position_m: tuple[float, float, float] = UP) -> None:
        self.pilot.observe(Frame(1, self.frame, 0.02, Measurement(np.array(position_m), 0.0)))
        self.frame += 1

    def fly(self) -> None:
        self.see()
        self.pilot.guidance.on_event(Event.RESUME, still(UP))

    def arm(self) -> None:
        self.see((0.1, 0.2, 0.0))
        self.pilot.guidance.on_event(Event.ARM, None)

    def ask(self, request: Request) -> Asked:
        asked = Asked(request)
        self.desk.handle(asked)  # type: ignore[arg-type]  # a request without a query
        return asked


@pytest.fixture
def office() -> Office:
    return Office()


def go_to(x: float, y: float, z: float) -> GoTo:
    return GoTo(set_point=SetPoint(position_m=(x, y, z), yaw_rad=0.5))


def follow(*names: str, **options: float) -> Follow:
    return Follow(following=tuple(Following(leader=name, offset_m=(0.5, 0, 0)) for name in names), **options)


@pytest.mark.parametrize("request_", [TakeOff(), Land(), go_to(0, 0, 1)])
def test_a_vehicle_that_was_never_seen_is_not_moved(office: Office, request_: Request) -> None:
    assert office.ask(request_).refusal == "the motion capture has not seen the vehicle"


def test_leaders_may_be_changed_before_the_vehicle_was_seen(office: Office) -> None:
    assert office.ask(Lead()).refusal is None
    asked = office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.settle_waiting()
    assert asked.refusal is None
    assert office.plan_bus.open_names() == ["h1"]


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (TakeOff(), "take-off needs an armed vehicle on the floor, the phase is ground"),
        (Land(), "nothing to land, the phase is ground"),
        (go_to(0, 0, 1), "set points are for flying vehicles, the phase is ground"),
        (Disarm(), "an agent does not serve verb"),
    ],
)
def test_what_makes_no_sense_on_the_floor_is_refused_with_the_phase(
    office: Office, request_: Request, words: str
) -> None:
    office.see((0.0, 0.0, 0.0))
    assert office.ask(request_).refusal == words
    assert office.pilot.guidance.phase is Phase.GROUND


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ((1.3, 0.0, 1.0), "x: 1.3 m is outside the flight volume -1.2 .. 1.2 m"),
        ((0.0, -9.0, 1.0), "y: -9 m is outside the flight volume -1.2 .. 1.2 m"),
        ((0.0, 0.0, 2.1), "z: 2.1 m is outside the flight volume 0 .. 2 m"),
    ],
)
def test_set_points_outside_the_volume_are_refused_by_axis(
    office: Office, place: tuple[float, float, float], words: str
) -> None:
    office.fly()
    assert office.ask(go_to(*place)).refusal == words
    assert office.pilot.guidance.set_point()[0] == pytest.approx(UP)


def test_a_good_set_point_is_taken(office: Office) -> None:
    office.fly()
    assert office.ask(go_to(0.5, -0.5, 1.5)).refusal is None
    position_m, yaw_rad = office.pilot.guidance.set_point()
    assert (*position_m, yaw_rad) == pytest.approx((0.5, -0.5, 1.5, 0.5))


def test_take_off_above_the_volume_is_refused(office: Office) -> None:
    office.arm()
    refusal = office.ask(TakeOff(height_m=2.5)).refusal
    assert refusal == "height_m: 2.5 m is above the flight volume, which ends at 2 m"
    assert office.ask(TakeOff(height_m=1.0)).refusal is None
    assert office.pilot.guidance.phase is Phase.TAKEOFF


def test_land_is_accepted_in_the_air(office: Office) -> None:
    office.fly()
    assert office.ask(Land()).refusal is None
    assert office.pilot.guidance.phase is Phase.LANDING


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("h9",), "a vehicle cannot follow itself"),
        (("h1", "h9"), "a vehicle cannot follow itself"),
        (("h7",), "unknown vehicle 'h7', known are h1, h2, h9"),
        (("h1", "h1"), "a leader is named twice"),
    ],
)
def test_impossible_leaders_are_refused_at_once(office: Office, names: tuple[str, ...], words: str) -> None:
    office.fly()
    assert office.ask(follow(*names)).refusal == words
    assert office.plan_bus.opened == []


def test_a_leader_without_a_plan_is_refused_after_a_moment_and_the_old_one_stays(office: Office) -> None:
    office.fly()
    office.plan_bus.deliver(plan_of("h1"))
    first = office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.settle_waiting()
    assert first.refusal is None
    second = office.ask(follow("h2"))
    office.desk.settle_waiting()
    assert second.answers == []
    office.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    office.desk.settle_waiting()
    assert second.refusal == "no plan from h2"
    assert [link.leader for link in office.pilot.guidance.links] == ["h1"]
    assert office.plan_bus.open_names() == ["h1"]


def test_following_begins_as_soon_as_the_plan_is_here(office: Office) -> None:
    office.fly()
    asked = office.ask(follow("h1", "h2", transition_s=3.0))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.settle_waiting()
    assert asked.answers == []
    office.plan_bus.deliver(plan_of("h2"))
    office.desk.settle_waiting()
    assert asked.refusal is None
    assert [(link.leader, link.duration_s) for link in office.pilot.guidance.links] == [
        ("h1", 3.0),
        ("h2", 3.0),
    ]


def test_requests_that_wait_do_not_take_each_others_plans_away(office: Office) -> None:
    office.fly()
    first, second = office.ask(follow("h1")), office.ask(follow("h2"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.settle_waiting()
    assert first.refusal is None
    office.plan_bus.deliver(plan_of("h2"))
    office.desk.settle_waiting()
    assert second.refusal is None
    assert office.plan_bus.open_names() == ["h2"]


def test_a_cycle_is_refused_with_the_line_that_leads_back(office: Office) -> None:
    office.fly()
    asked = office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1", ancestors=("h2", "h9")))
    office.desk.settle_waiting()
    assert asked.refusal == "a cycle: h1 follows h2 follows h9"
    assert office.pilot.guidance.links == ()
    assert office.plan_bus.open_names() == []


def test_lead_forgets_the_leaders_and_their_plans(office: Office) -> None:
    office.fly()
    office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.settle_waiting()
    assert office.ask(Lead()).refusal is None
    assert office.pilot.guidance.links == ()
    assert office.plan_bus.open_names() == []


def test_set_points_of_followers_are_refused_and_the_leader_named(office: Office) -> None:
    office.fly()
    office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.settle_waiting()
    refusal = office.ask(go_to(0, 0, 1)).refusal
    assert refusal is not None
    assert "follows h1" in refusal


@pytest.mark.parametrize("frame", ["inertial", "heading"])
def test_links_survive_the_way_through_messages(frame: str) -> None:
    following = Following(leader="h1", offset_m=(0.1, 0.2, 0.3), yaw_offset_rad=0.4, frame=frame, weight=2.0)
    assert following_of(link_of(following), 0.0) == following


STATUS = AgentStatus(
    phase="flying",
    controller="paper",
    estimator="kalman",
    horizon=50,
    epoch=1,
    frame=9,
    set_point=SetPoint(position_m=(0.5, 0.5, 1.2), yaw_rad=3.0),
)


def test_a_restarted_agent_goes_on_to_the_set_point(office: Office) -> None:
    office.fly()
    office.desk.resume(STATUS)
    position_m, yaw_rad = office.pilot.guidance.set_point()
    assert (*position_m, yaw_rad) == pytest.approx((0.5, 0.5, 1.2, 3.0))


def test_a_restarted_agent_goes_on_following(office: Office) -> None:
    office.fly()
    office.desk.resume(replace_following(STATUS, Following(leader="h2", offset_m=(0.4, 0.0, 0.1))))
    (link,) = office.pilot.guidance.links
    assert (link.leader, tuple(link.target.position_m)) == ("h2", (0.4, 0.0, 0.1))
    assert office.plan_bus.open_names() == ["h2"]


def test_a_restarted_agent_goes_on_landing_and_does_not_fly_into_the_floor(office: Office) -> None:
    office.fly()
    landing = replace_following(STATUS, Following(leader="h2"), phase="landing")
    office.desk.resume(landing)
    assert office.pilot.guidance.phase is Phase.LANDING
    assert not office.pilot.guidance.follows


def replace_following(status: AgentStatus, following: Following, phase: str = "flying") -> AgentStatus:
    return msgspec.structs.replace(status, following=(following,), phase=phase)
