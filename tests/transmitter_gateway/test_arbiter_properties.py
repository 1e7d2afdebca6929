"""Random event sequences: whatever happens, the arbiter keeps its promises (section 8.3)."""

import copy
import itertools
import math
from typing import Any

from arbiter_bench import SLEW, U_HOVER
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from rcopterx.bus.message import SHORTEST_PERIOD_S
from rcopterx.radios.limits import LONGEST_DESCENT_S, ArbiterLimits, Fence, SurveillanceLimits
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import (
    FLYING,
    Action,
    ActionRequest,
    Answer,
    ArbiterOutput,
    CommandInput,
    LinkState,
    PoseInput,
    State,
)
from rcopterx.transmitter_gateway.transitions import TRANSITIONS, Condition

LIMITS = ArbiterLimits(surveillance=SurveillanceLimits(fence=Fence((-2, -2, -0.5), (2, 2, 2))))
AGENTS = (1, 2, 3)
PEOPLE = ("operator", "anybody")
PERIOD_S = 0.02
ROUNDING_S = 1e-6

u_good = st.tuples(
    st.floats(-1.02, 1.02), st.floats(-1.02, 1.02), st.floats(-0.02, 1.02), st.floats(-0.42, 0.42)
)
u_bad = st.sampled_from(
    [
        (math.nan, 0, 0.5, 0),
        (0, math.inf, 0.5, 0),
        (0, 0, 1.03, 0),
        (0, 0, -0.03, 0),
        (0, 0, 0.5),
        None,
        ("0", 0, 0.5, 0),
        (0, 0, 0.5, 0.43),
    ]
)
times = st.one_of(st.floats(0.0, 0.03), st.floats(0.0, 0.3), st.floats(0.0, 3.0))


class ArbiterMachine(RuleBasedStateMachine):
    @initialize(
        ready=st.sampled_from(LinkState), armed=st.integers(0, 3), yaw_rad=st.sampled_from([None, 0.0, 2.0])
    )
    def start(self, ready: LinkState, armed: int, yaw_rad: float | None) -> None:
        self.yaw_rad = yaw_rad
        self.arbiter = Arbiter("h1", LIMITS, U_HOVER, SLEW)
        self.now_s = 100.0
        self.epoch = 3
        self.frame = 0
        self.sequence = 0
        self.fed_s = -math.inf
        self.newest = self.lease = self.arbiter.bid(1, self.now_s, take_over=False)
        self.last: ArbiterOutput = self.arbiter.step(self.now_s)
        self.last_s = self.now_s
        self.moved_s = 4 * [-math.inf]
        self.entered_s = self.now_s
        self.thrust = 0.0
        """Applied last before the arbiter flew without poses."""
        self.reset = self.armed = False
        self.arbiter.link(LinkState.READY if armed else ready)
        if armed:
            for _ in range(30):
                self.fly_on(1, (0, 0, 0, 0), 0)
            self.request(Action.ARM, "operator")
            assert self.arbiter.state is State.ARMED
            self.fly_on(20 * armed, (0.2, 0, 0.56, 0), 6)

    # Events -------------------------------------------------------------------------------------------

    def step(self, seconds: float = 0.0) -> ArbiterOutput:
        self.now_s += seconds
        output = self.arbiter.step(self.now_s)
        self.check(output)
        return output

    def pose(self, **changes: Any) -> None:
        self.step()
        self.frame += 1
        fields = {
            "vehicle": "h1",
            "epoch": self.epoch,
            "frame": self.frame,
            "position_m": (0.0, 0.0, 1.0),
            "period_s": PERIOD_S,
            "yaw_rad": self.yaw_rad,
        }
        self.arbiter.pose(PoseInput(**{**fields, **changes}), self.now_s)

    def command(self, **changes: Any) -> Answer:
        self.sequence += 1
        fields = {
            "lease": self.lease,
            "epoch": self.epoch,
            "sequence": self.sequence,
            "frame": self.frame,
            "u": (0, 0, 0.55, 0),
            "period_s": PERIOD_S,
        }
        command = CommandInput(**{**fields, **changes})
        self.step()
        before = self.snapshot()
        answer = self.arbiter.command(command, self.now_s)
        if answer.accepted:
            self.fed_s = self.now_s
            assert command.lease == self.arbiter.leases.commanding
        else:
            assert self.snapshot() == before
        self.step()
        return answer

    def snapshot(self) -> tuple[Any, ...]:
        """What a rejected command must not change: all that decides about the vehicle."""
        arbiter = self.arbiter
        stream = copy.copy(arbiter._validator.stream)
        return (
            arbiter.state, arbiter.reason, arbiter.commanded, arbiter.leases.commanding, stream,
            arbiter._limiter.u,
            arbiter.next_event_s(),
        )  # fmt: skip

    def request(self, action: Action, by: str) -> Answer:
        self.step()
        self.armed, self.reset = action is Action.ARM, action is Action.RESET and by == "operator"
        answer = self.arbiter.request(ActionRequest(action, by), self.now_s)
        self.step()
        self.armed = self.reset = False
        return answer

    @rule(seconds=times)
    def let_time_pass(self, seconds: float) -> None:
        self.step(seconds)

    @rule()
    def wake_at_the_next_event(self) -> None:
        due_s = self.arbiter.next_event_s()
        if math.isfinite(due_s):
            self.step(max(0.0, due_s - self.now_s))

    @rule(count=st.integers(1, 40), u=u_good, plan=st.integers(0, 8))
    def fly_on(self, count: int, u: tuple[float, ...], plan: int) -> None:
        for _ in range(count):
            self.step(PERIOD_S)
            self.pose()
            self.command(u=u, next_u=(u,) * plan)

    @rule(u=u_good, period_s=st.floats(SHORTEST_PERIOD_S, 0.1) | st.floats())
    def command_of_any_period(self, u: tuple[float, ...], period_s: float) -> None:
        answer = self.command(u=u, next_u=((0, 0, 0.6, 0),) * 6, period_s=period_s)
        assert not answer.accepted or SHORTEST_PERIOD_S <= period_s <= 0.1

    @rule(agent=st.sampled_from(AGENTS), take_over=st.booleans())
    def agent_bids(self, agent: int, take_over: bool) -> None:
        """Who gets a lease commands from now on; until then nothing changes."""
        self.step()
        before, fresh = self.snapshot(), self.now_s < self.fed_s + LIMITS.hold_after_s
        lease = self.arbiter.bid(agent, self.now_s, take_over=take_over)
        assert self.snapshot() == before
        assert lease >= self.arbiter.leases.commanding or not lease
        if fresh and not take_over:
            assert lease <= self.newest
        self.newest = max(self.newest, lease)
        if lease:
            self.lease = lease

    @rule(behind=st.integers(1, 3), ahead=st.integers(1, 100))
    def command_of_another_lease(self, behind: int, ahead: int) -> None:
        assert not self.command(lease=self.arbiter.leases.commanding - behind).accepted
        assert not self.command(lease=self.arbiter.leases.issued + ahead).accepted

    @rule(u=u_bad, in_plan=st.booleans())
    def bad_command(self, u: Any, in_plan: bool) -> None:
        changes: dict[str, Any] = {"next_u": (u,)} if in_plan else {"u": u}
        assert not self.command(**changes).accepted

    @rule(sequence=st.integers(-5, 0), epoch=st.integers(-1, 1))
    def command_out_of_order(self, sequence: int, epoch: int) -> None:
        changes = {"sequence": self.sequence + sequence, "epoch": self.epoch + epoch}
        if epoch == 1:
            assert not self.command(**changes).accepted or self.arbiter.pose_monitor.newest is None
        else:
            self.command(**changes)

    @rule()
    def tracker_restarts(self) -> None:
        self.epoch += 1
        self.frame = 0
        self.pose()

    @rule(x=st.sampled_from([0.0, 0.05, 1.9, 2.5]), vehicle=st.sampled_from(["h1", "h2"]))
    def pose_somewhere(self, x: float, vehicle: str) -> None:
        self.pose(vehicle=vehicle, position_m=(x, 0.0, 1.0))

    @rule(position=st.sampled_from([None, (math.nan, 0, 0), (0, 0)]))
    def useless_pose(self, position: Any) -> None:
        self.pose(position_m=position)

    @rule(
        action=st.sampled_from([Action.ARM, Action.DISARM, Action.RESET]),
        by=st.sampled_from(PEOPLE),
    )
    def any_request(self, action: Action, by: str) -> None:
        assert not self.request(action, by).accepted or by == "operator"

    @rule(by=st.sampled_from(PEOPLE))
    def kill(self, by: str) -> None:
        assert self.request(Action.KILL, by).accepted
        assert self.arbiter.state is State.KILLED

    @precondition(lambda self: self.now_s > 130)
    @rule()
    def shut_down(self) -> None:
        self.request(Action.SHUTDOWN, "anybody")

    @rule(link=st.sampled_from([*LinkState, LinkState.READY, LinkState.READY]))
    def link_changes(self, link: LinkState) -> None:
        self.step()
        self.arbiter.link(link)
        self.step()
        if link is LinkState.LOST:
            assert self.arbiter.state not in FLYING

    # Promises -----------------------------------------------------------------------------------------

    def check(self, output: ArbiterOutput) -> None:
        self.check_output(output)
        self.check_transition(output.state)
        self.check_ages(output)
        if output.state is State.ARMED and self.last.state is State.ARMED:
            for axis, (now, before, rate) in enumerate(zip(output.u, self.last.u, SLEW, strict=True)):
                at_rest_s = min(self.now_s - self.moved_s[axis], 0.04)
                assert abs(now - before) <= rate * (at_rest_s + ROUNDING_S)
                if now != before:
                    self.moved_s[axis] = self.now_s
        self.last, self.last_s = output, self.now_s

    def check_output(self, output: ArbiterOutput) -> None:
        for value, lower, upper in zip(output.u, LIMITS.lower, LIMITS.upper, strict=True):
            assert math.isfinite(value)
            assert lower <= value <= upper
        assert output.state in FLYING or output.u == (0, 0, 0, 0)
        if output.state is State.LAND or (output.state is State.HOLD and self.yaw_rad is not None):
            hover = U_HOVER, LIMITS.hover_correction + LIMITS.landing.thrust
            assert max(abs(output.u[0]), abs(output.u[1])) <= LIMITS.landing.cyclic
            assert abs(output.u[3]) <= LIMITS.landing.yaw
            assert output.u[2] <= max(self.last.u[2], sum(hover))
            self.thrust = output.u[2]
        elif output.state in (State.HOLD, State.DESCEND):
            assert output.u[0] == output.u[1] == output.u[3] == 0
            # Only a vehicle that was seen in the air gets more thrust again.
            assert self.yaw_rad is not None or output.u[2] <= self.thrust + 1e-12
            assert output.u[2] <= U_HOVER + LIMITS.hover_correction
        else:
            self.thrust = output.u[2]

    def check_transition(self, state: State) -> None:
        before = self.last.state
        if state is before:
            return
        self.entered_s = self.now_s
        if before is State.KILLED:
            assert self.reset
            assert state is State.DISARMED
        if before in (State.DISARMED, State.CUT) and state is not State.KILLED:
            assert state is State.DISARMED or (self.armed and state is State.ARMED)

    def check_ages(self, output: ArbiterOutput) -> None:
        if output.state not in FLYING:
            assert not self.arbiter.commanded
            return
        assert self.arbiter.commanded
        age_s = self.now_s - self.fed_s - ROUNDING_S
        if output.state in (State.ARMED, State.HOLD):
            assert age_s < LIMITS.descend_after_s
        if output.state is State.LAND:
            track = self.arbiter.pose_monitor.own_track
            assert self.yaw_rad is not None
            assert track is not None
            assert self.now_s < track.seen_s + LIMITS.landing.pose_age_s
        if output.state is State.ARMED and output.bridging_step == 0:
            assert age_s < LIMITS.hold_after_s
        in_state_s = self.now_s - self.entered_s
        if output.state is State.DESCEND:
            assert in_state_s < LONGEST_DESCENT_S + ROUNDING_S
        if output.state is State.HOLD:
            assert in_state_s < LIMITS.hold_limit_s + ROUNDING_S

    @invariant()
    def counters_count(self) -> None:
        counters = self.arbiter.counters
        assert all(isinstance(name, str) and count > 0 for name, count in counters.items())

    @invariant()
    def next_event_is_in_the_future(self) -> None:
        assert self.arbiter.next_event_s() > self.now_s or self.arbiter.next_event_s() > self.last_s


ArbiterMachine.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestArbiterKeepsItsPromises = ArbiterMachine.TestCase


def test_table_uses_every_condition_and_reaches_every_state() -> None:
    used = set(itertools.chain.from_iterable((*row.needs, *row.unless) for row in TRANSITIONS))
    assert used == set(Condition)
    assert {row.target for row in TRANSITIONS} == set(State)
