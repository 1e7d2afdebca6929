"""An agent on a bus of its own, with the gateways played by the test."""

from collections.abc import Callable
from dataclasses import replace

from support.flight import ExactEstimator, NotedController
from support.vehicle_types import COAXIAL_LAG
from support.waiting import FakeClock, wait_for

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.following.leader_plans import followed_leader
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.process import Agent
from rcopterx.agents.settings import AgentSettings
from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus, Applied, Command, LeaderLink, Lease, Pose
from rcopterx.bus.session import BusAddress, Session
from rcopterx.bus.stepping import StepBus
from rcopterx.formation.placement import Room

HOVER = COAXIAL_LAG.hover_input
LEASE = 1
FOLLOWING = (LeaderLink(leader="h1", offset_m=(-0.5, 0.0, 0.0)),)
Join = Callable[..., Session]


def settings_of(address: BusAddress, following: tuple[LeaderLink, ...] = ()) -> AgentSettings:
    return AgentSettings(
        bus=replace(address, host="main"),
        vehicle="h9",
        vehicles=("h1", "h9"),
        model=COAXIAL_LAG,
        room=Room((-1.2, -1.2, 0.0), (1.2, 1.2, 2.0)),
        following=following,
    )


class Bench:
    """An agent on a test's bus, with the gateways played by the test and the clock set by it."""

    def __init__(self, join: Join, address: BusAddress, following: tuple[LeaderLink, ...] = ()) -> None:
        self.clock = FakeClock()
        self.settings = settings_of(address, following)
        links = [followed_leader(link) for link in following]
        controller = NotedController(HOVER[None, :])
        self.pilot = Pilot(COAXIAL_LAG, controller, ExactEstimator(), Guidance(links))
        self.others = join()
        self.commands = self.others.subscribe(channels.COMMAND, "h9", depth=256)
        self.plans = self.others.subscribe(channels.PLAN, "h9", depth=256)
        self.bids = self.others.subscribe(channels.LEASE_BID, "h9", depth=256)
        self.lease = LEASE
        """What the gateway answers to bids; 0 for another agent commands."""
        self.statuses = self.others.subscribe(channels.AGENT_STATUS, "h9")
        self.bus = StepBus(join(clock=self.clock))
        # Not the default: on a busy computer the agent would leave out statuses.
        self.agent = Agent(self.settings, self.pilot, self.bus, realtime=False, stopwatch=self.clock)
        self.frame = 100
        self.sent: list[Command] = []

    def step_until(self, condition: Callable[[], object], what: str) -> None:
        def stepped() -> bool:
            self.agent.step()
            lease = self.agent.handover.lease
            bidders = {bid.message.agent for bid in self.bids.drain()}
            if not (lease.held or lease.lost):
                # The clock stands still, so that a bid or an answer that the bus dropped is not repeated.
                bidders.add(lease.agent)
            for bidder in bidders:
                self.answer(bidder)
            self.sent += [received.message for received in self.commands.drain()]
            return bool(condition())

        wait_for(stepped, what)

    def answer(self, agent: int, commanding: int = 0) -> None:
        """Publish the lease of an agent, and which lease commands."""
        answer = Lease(agent=agent, number=self.lease, commanding=commanding, issued=self.lease)
        self.others.publish(channels.LEASE, "h9", answer)

    def pose(self, occluded: bool = False, publish: bool = True) -> Pose:
        place = {} if occluded else {"position_m": (0.0, 0.0, 1.0), "quaternion_xyzw": (0.0, 0.0, 0.0, 1.0)}
        message = Pose(
            epoch=1,
            frame=self.frame,
            period_s=0.02,
            latency_s=0.0,
            received_s=0.0,
            occluded=occluded,
            host="main",
            **place,
        )
        if publish:
            self.others.publish(channels.POSE, "h9", message)
        return message

    def see(self, occluded: bool = False) -> None:
        """The next frame arrives 20 ms later."""
        self.frame += 1
        self.clock.advance(0.02)

        def seen() -> bool:
            if self.pilot.clock.frame == self.frame:
                return True
            # The bus drops poses on a busy machine; one that comes twice is ignored the second time.
            self.pose(occluded)
            return False

        self.step_until(seen, f"frame {self.frame} does not arrive")

    def apply(self, state: str, thrust: float = 0.0, sequence: int = 0, lease: int = LEASE) -> None:
        self.others.publish(
            channels.APPLIED,
            "h9",
            Applied(
                state=state, input=(0.0, 0.0, thrust, 0.0), pulse_width_us=(1500.0,), epoch=0, frame=0,
                sequence=sequence, lease=lease, fresh=False,
            ),
        )  # fmt: skip

    def start(self, state: str = "armed", thrust: float = 0.545, sequence: int = 0) -> None:
        """The agent has seen its vehicle and knows its transmitter."""

        def informed() -> bool:
            self.frame += 1
            self.pose()
            self.apply(state, thrust, sequence)
            return self.pilot.informed

        self.step_until(informed, "the agent does not start")
        self.settle()

    def settle(self) -> None:
        """Wait until everything that was published has been dealt with."""
        self.see()
        if self.pilot.guidance.follows:
            self.clock.advance(0.005)
        self.command_of(self.frame)

    def command_of(self, frame: int) -> Command:
        def arrived() -> bool:
            return any(command.frame == frame for command in self.sent)

        self.step_until(arrived, f"no command of frame {frame}")
        return next(command for command in self.sent if command.frame == frame)

    def status(self) -> AgentStatus:
        """A status written after this call."""
        before = self.statuses.latest()
        self.clock.advance(0.25)
        self.step_until(lambda: self.statuses.latest() is not before, "no status")
        received = self.statuses.latest()
        assert received is not None
        return received.message
