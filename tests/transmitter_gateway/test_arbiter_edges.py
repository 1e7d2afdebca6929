"""Limits met exactly. All times are multiples of 1/1024 s, which floats add without rounding."""

import math
from collections.abc import Sequence
from itertools import pairwise

import pytest
from arbiter_bench import HOVER, IDLE, Bench

from rcopterx.radios.limits import LONGEST_DESCENT_S, ArbiterLimits, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import Action, Answer, Input, LinkState, PoseInput, Position, State

TICK_S = 1 / 1024
PERIOD_S = 1 / 64
LIMITS = ArbiterLimits(
    hold_after_s=4 / 64,
    descend_after_s=16 / 64,
    cut_after_s=2.0,
    bridge_s=8 / 64,
    hold_limit_s=0.5,
    arm_low_s=0.5,
    surveillance=SurveillanceLimits(
        tracking_hold_s=0.125, tracking_descend_s=0.25, maximum_thrust_s=4.0, jump_descend_s=0.25
    ),
)
LOW_M = 0.11
"""A descent from here lasts no longer than any."""
PLAN = tuple((0.0, 0.0, 0.5, 0.0) for _ in range(12))


class Clockwork(Bench):
    """A bench without link at first, whose time begins at 0; poses are at a height."""

    def __init__(self, limits: ArbiterLimits = LIMITS, height_m: float = 0.5) -> None:
        super().__init__(limits, start_s=0.0)
        self.height_m = height_m
        self.arbiter.link(LinkState.LOST)
        self.epoch = 1

    def wait(self, seconds: float) -> State:
        super().wait(seconds)
        return self.state

    def pose(self, position: Position | None = None, vehicle: str = "h1") -> None:
        self.frame += 1
        position = position or (0.0, 0.0, self.height_m)
        pose = PoseInput(vehicle, self.epoch, self.frame, position, PERIOD_S)
        self.arbiter.pose(pose, self.now_s)

    def command(
        self, u: Sequence[float] = HOVER, plan: Sequence[Input] = (), period_s: float = PERIOD_S
    ) -> Answer:
        return super().command(u, next_u=plan, period_s=period_s)

    def run(self, periods: int, u: Sequence[float] | None = HOVER, *, poses: bool = True) -> None:
        for _ in range(periods):
            self.wait(PERIOD_S)
            if poses:
                self.pose()
            if u is not None:
                self.command(u)

    def fly(self) -> "Clockwork":
        self.arbiter.link(LinkState.READY)
        self.run(33, IDLE)
        assert self.request(Action.ARM).accepted
        self.run(64)
        return self

    def tracked(self, seconds: float) -> State:
        """Wait with poses every tick but no command."""
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            self.pose()
            self.arbiter.step(self.now_s)
        return self.state


def flying(height_m: float = 0.5) -> Clockwork:
    return Clockwork(height_m=height_m).fly()


def test_a_new_arbiter_says_that_it_started_and_has_no_link() -> None:
    clock = Clockwork()
    assert clock.reason == "started"
    clock.run(40, IDLE)
    assert clock.request(Action.ARM).reason == "missing: transmitter ready; serial link lost"


def test_reason_names_who_requested_a_state() -> None:
    clock = flying()
    clock.run(64, IDLE)
    clock.request(Action.DISARM)
    assert clock.reason == "disarmed: by operator"
    clock.request(Action.KILL, by="someone")
    clock.run(1, None)
    clock.wait(LIMITS.hold_after_s)
    assert clock.request(Action.RESET).reason == "DISARMED: kill reset: by operator"


def test_states_entered_and_refusals_are_counted_each_time() -> None:
    clock = flying()
    for _ in range(3):
        clock.request(Action.DISARM, by="stranger")
        clock.tracked(4 / 64)
        clock.command()
    assert clock.arbiter.counters["refused: disarm"] == 3
    assert clock.arbiter.counters["entered HOLD"] == 3
    assert clock.arbiter.counters["entered ARMED"] == 4


@pytest.mark.parametrize(
    ("age_s", "before", "after"),
    [
        (LIMITS.hold_after_s, State.ARMED, State.HOLD),
        (LIMITS.descend_after_s, State.HOLD, State.DESCEND),
        (LIMITS.cut_after_s, State.DESCEND, State.CUT),
    ],
)
def test_command_ages_end_exactly_at_their_limit(age_s: float, before: State, after: State) -> None:
    clock = flying(LOW_M)
    assert clock.tracked(age_s - TICK_S) is before
    assert clock.tracked(TICK_S) is after


def test_commands_gone_cut_exactly_at_their_limit_without_a_descent_before() -> None:
    for extra_s, state in ((-TICK_S, State.DESCEND), (0.0, State.CUT)):
        clock = flying(LOW_M)
        assert clock.wait(LIMITS.cut_after_s + extra_s) is state


def test_descent_ends_exactly_at_its_limit() -> None:
    clock = flying(LOW_M)
    clock.request(Action.SHUTDOWN)
    descent_s = LIMITS.cut_after_s - LIMITS.descend_after_s
    clock.run(round(descent_s / PERIOD_S) - 1)
    assert clock.wait(PERIOD_S - TICK_S) is State.DESCEND
    assert clock.wait(TICK_S) is State.CUT


@pytest.mark.parametrize("height_m", [1.0, 2.0, 9.0])
def test_a_descent_from_a_height_lasts_until_the_floor_and_ends_by_time(height_m: float) -> None:
    clock = Clockwork(height_m=height_m).fly()
    clock.request(Action.SHUTDOWN)
    descent_s = LIMITS.descents_s(height_m)[1]
    assert LIMITS.cut_after_s < descent_s <= LONGEST_DESCENT_S
    assert clock.wait(descent_s - TICK_S) is State.DESCEND
    assert clock.wait(2 * TICK_S) is State.CUT


def test_hold_ends_exactly_at_its_limit() -> None:
    clock = flying()
    clock.pose((0.2, 0.0, 0.5), "h2")
    clock.arbiter.step(clock.now_s)
    assert clock.state is State.HOLD
    for _ in range(31):
        clock.run(1)
        clock.pose((0.2, 0.0, 0.5), "h2")
    assert clock.wait(PERIOD_S - TICK_S) is State.HOLD
    assert clock.arbiter.next_event_s() == clock.now_s + TICK_S
    assert clock.wait(TICK_S) is State.DESCEND


def test_half_a_second_of_low_thrust_counts_from_its_first_command() -> None:
    for periods, accepted in ((32, False), (33, True)):
        clock = Clockwork()
        clock.arbiter.link(LinkState.READY)
        clock.run(periods, IDLE)
        assert clock.request(Action.ARM).accepted == accepted


def test_vehicle_counts_as_landed_exactly_after_half_a_second_of_low_thrust() -> None:
    clock = flying()
    clock.run(1, (0, 0, 0.05, 0))
    # The applied thrust follows the command by its slew rate.
    while clock.arbiter.step(clock.now_s).u[2] > LIMITS.low_thrust:
        clock.run(1, (0, 0, 0.05, 0))
    clock.run(31, (0, 0, 0.05, 0))
    clock.wait(PERIOD_S - TICK_S)
    clock.pose((0.2, 0.0, 0.5), "h2")
    clock.command((0, 0, 0.05, 0))
    assert clock.state is State.HOLD
    assert clock.wait(TICK_S) is State.ARMED


@pytest.mark.parametrize(("period_s", "steps"), [(1 / 64, 8), (1 / 32, 4), (3 / 64, 2)])
def test_number_of_planned_inputs_is_limited_by_time(period_s: float, steps: int) -> None:
    clock = flying()
    clock.run(1)
    clock.command(HOVER, PLAN, period_s)
    assert clock.tracked((steps + 1) * period_s - TICK_S) is State.ARMED
    assert clock.arbiter.step(clock.now_s).bridging_step == steps
    clock.tracked(TICK_S)
    assert clock.state is not State.ARMED


def test_a_landed_vehicle_whose_plan_takes_off_is_watched_from_the_first_planned_thrust() -> None:
    clock = Clockwork()
    clock.arbiter.link(LinkState.READY)
    clock.run(33, IDLE)
    clock.request(Action.ARM)
    clock.run(40, IDLE)
    clock.run(8, IDLE, poses=False)
    assert clock.state is State.ARMED
    clock.command(IDLE, PLAN)
    assert clock.wait(1.5 * PERIOD_S) is State.HOLD
    assert clock.arbiter.step(clock.now_s).u == (0, 0, 0, 0)


def test_a_moment_of_low_thrust_in_flight_does_not_suspend_the_surveillance() -> None:
    clock = flying()
    while clock.arbiter.step(clock.now_s).u[2] > LIMITS.low_thrust:
        clock.run(1, IDLE)
    clock.run(4, IDLE)
    clock.pose((0.2, 0.0, 0.5), "h2")
    clock.arbiter.step(clock.now_s)
    assert clock.state is State.HOLD


# Inputs of the pose monitor -----------------------------------------------------------------------------


def test_a_jump_of_the_own_pose_is_not_believed_in_flight() -> None:
    clock = flying()
    for _ in range(17):
        clock.wait(PERIOD_S)
        clock.pose((0.6, 0.0, 1.0))
        clock.command()
    assert clock.state is State.DESCEND
    for _ in range(32):
        clock.run(1)
    assert clock.state is State.DESCEND
    assert clock.arbiter.counters["pose jump"] == 17


def test_a_vehicle_on_the_floor_may_be_carried_elsewhere() -> None:
    disarmed = Clockwork()
    disarmed.arbiter.link(LinkState.READY)
    disarmed.run(33, IDLE)
    disarmed.wait(PERIOD_S)
    disarmed.pose((3.0, 0.0, 0.0))
    disarmed.command(IDLE)
    assert disarmed.request(Action.ARM).accepted
    disarmed.run(4, IDLE)
    assert disarmed.arbiter.counters["pose jump"] == 0


def test_a_restarted_tracker_is_followed_in_flight_only_with_its_raw_poses() -> None:
    clock = flying()
    clock.epoch, clock.frame = 2, 0
    clock.wait(PERIOD_S)
    assert clock.command().reason == "epoch not in the raw poses"
    clock.wait(PERIOD_S)
    clock.pose()
    clock.sequence = 0
    assert clock.command().accepted
    clock.run(8)
    assert clock.state is State.ARMED


def test_thrust_time_adds_up_over_landings_and_starts_anew_with_arming() -> None:
    clock = flying()
    clock.run(64, IDLE)
    clock.run(64)
    clock.run(64, IDLE)
    clock.run(96)
    assert clock.state is State.ARMED
    clock.run(64)
    assert clock.state is State.DESCEND
    clock.run(160, IDLE)
    assert clock.state is State.CUT
    clock.request(Action.DISARM)
    clock.run(33, IDLE)
    assert clock.request(Action.ARM).accepted
    clock.run(240)
    assert clock.state is State.ARMED
    clock.run(32)
    assert clock.state is State.DESCEND


# Next event -----------------------------------------------------------------------------------------


def test_next_events_in_order() -> None:
    clock = flying()
    clock.run(1)
    clock.command(HOVER, PLAN)
    sent_s = clock.now_s
    events = []
    while clock.state is not State.CUT and len(events) < 50:
        clock.now_s = clock.arbiter.next_event_s()
        if clock.now_s < sent_s + 1.0:
            clock.pose()
        clock.arbiter.step(clock.now_s)
        events.append((clock.now_s - sent_s) / PERIOD_S)
    for expected in (1.5, 2, 3, 4, 5, 6, 7, 16, 128):
        assert expected in events
    assert all(later > earlier for earlier, later in pairwise(events))
    assert len(events) < 40


def test_lost_tracking_is_an_event_of_its_own() -> None:
    clock = flying()
    seen_s = clock.now_s
    clock.wait(PERIOD_S)
    clock.command(HOVER, PLAN)
    events = []
    while len(events) < 30:
        clock.now_s = clock.arbiter.next_event_s()
        clock.command(HOVER, PLAN)
        events.append(clock.now_s - seen_s)
        if clock.state is State.DESCEND:
            break
    assert 0.125 in events
    assert events[-1] == 0.25


def test_end_of_a_descent_is_an_event() -> None:
    clock = flying(LOW_M)
    clock.request(Action.SHUTDOWN)
    begin_s = clock.now_s
    descent_s = LIMITS.cut_after_s - LIMITS.descend_after_s
    clock.run(round(descent_s / PERIOD_S) - 1)
    clock.wait(PERIOD_S - TICK_S)
    assert clock.arbiter.next_event_s() == begin_s + descent_s


def test_no_event_is_left_when_only_the_past_has_limits() -> None:
    limits = ArbiterLimits(surveillance=SurveillanceLimits(tracking_hold_s=None, tracking_descend_s=None))
    clock = Clockwork(limits).fly()
    clock.run(400)
    clock.arbiter._validator.stream = None
    assert clock.arbiter.next_event_s() == math.inf
