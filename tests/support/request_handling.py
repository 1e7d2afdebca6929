"""A request handler with a pilot that does not fly, and requests that record their replies."""

from dataclasses import dataclass, field, replace

import numpy as np

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.following.leader_changes import LeaderChanges
from rcopterx.agents.following.leader_plans import LeaderPlans, PeerStatuses
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.requests.external_control import ExternalControl
from rcopterx.agents.requests.request_handler import RequestHandler
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import AgentStatus, LeaderLink, Plan, SetPoint
from rcopterx.bus.requests import Follow, GoTo, Reply, Request
from rcopterx.bus.session import BusAddress
from rcopterx.bus.subscription import Inbox
from rcopterx.control.interfaces import Measurement
from rcopterx.formation.placement import PresentRoom, Room
from rcopterx.vehicles.phases import Event
from support.flight import ExactEstimator, NotedController, still
from support.plans import PlanBus, plan_of
from support.vehicle_types import COAXIAL_LAG
from support.waiting import FakeClock

SETTINGS = AgentSettings(
    bus=BusAddress((), "lab"),
    vehicle="h9",
    vehicles=("h1", "h2", "h9"),
    model=COAXIAL_LAG,
    room=Room((-1.2, -1.2, 0.0), (1.2, 1.2, 2.0)),
)

UP = (0.1, 0.2, 1.0)


@dataclass
class Asked:
    """A request that records its replies."""

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
        assert reply.accepted or reply.reason
        return None if reply.accepted else reply.reason


class HandlerBench:
    """A request handler with a pilot that does not fly."""

    def __init__(self, room: Room = SETTINGS.room) -> None:
        self.clock, settings = FakeClock(), replace(SETTINGS, room=room)
        self.plan_bus = PlanBus()
        controller = NotedController(np.zeros((1, 4)))
        self.pilot = Pilot(COAXIAL_LAG, controller, ExactEstimator(), Guidance())
        self.leaders = LeaderPlans("h9", self.plan_bus.subscribe)  # type: ignore[arg-type]  # no bus
        self.plan_bus.delivered = self.leaders.receive
        self.statuses: dict[str, Inbox[AgentStatus]] = {}
        peers = PeerStatuses("h9", self.statuses, self.clock)
        self.tuning = Tuning(settings.configuration, self.pilot, 0.02)
        external = ExternalControl(self.pilot, Inbox(channels.EXTERNAL_INPUT), lambda task: None)
        self.changes = LeaderChanges(
            "h9", settings.vehicles, PresentRoom(settings.room), self.pilot, self.leaders, peers, self.clock
        )
        self.handler = RequestHandler(settings, self.pilot, self.changes, peers, self.tuning, external)
        self.frame = 10

    def see(self, position_m: tuple[float, float, float] = UP) -> None:
        self.pilot.observe(StampedMeasurement(1, self.frame, 0.02, Measurement(np.array(position_m), 0.0)))
        self.frame += 1

    def fly(self) -> None:
        self.see()
        self.pilot.guidance.on_event(Event.RESUME, still(UP), self.pilot.clock.time_s)

    def arm(self) -> None:
        self.see((0.1, 0.2, 0.0))
        self.pilot.guidance.on_event(Event.ARM, self.pilot.estimate, self.pilot.clock.time_s)

    def ask(self, request: Request) -> Asked:
        """Answer a request, also one that is checked ahead."""
        asked = self.begin(request)
        self.handler.trajectories.wait()
        self.handler.trajectories.finish()
        return asked

    def begin(self, request: Request) -> Asked:
        asked = Asked(request)
        self.handler.handle(asked)  # type: ignore[arg-type]  # a request without a query
        return asked


def go_to(x: float, y: float, z: float) -> GoTo:
    return GoTo(set_point=SetPoint(position_m=(x, y, z), yaw_rad=0.5))


def follow(*names: str, **options: float) -> Follow:
    return Follow(following=tuple(LeaderLink(leader=name, offset_m=(0.5, 0, 0)) for name in names), **options)


def say(bench: HandlerBench, name: str, status: AgentStatus) -> None:
    inbox = bench.statuses.setdefault(name, Inbox(channels.AGENT_STATUS))
    inbox.store(encode(status), bench.clock())


def follow_at(
    bench: HandlerBench, offset_m: tuple[float, float, float], plan: Plan | None = None, leader: str = "h1"
) -> Asked:
    """Ask to follow, and let the leader's plan arrive."""
    asked = bench.ask(Follow(following=(LeaderLink(leader=leader, offset_m=offset_m),)))
    if not asked.answers:
        bench.plan_bus.deliver(plan_of(leader) if plan is None else plan)
        bench.changes.decide()
    return asked
