import math

import pytest
from arbiter_bench import HOVER, IDLE, PERIOD_S, U_HOVER, Bench

from transmitter_gateway.inputs import NEUTRAL, Action, Cause, LinkState, State
from transmitter_gateway.limits import ArbiterLimits, SurveillanceLimits

PLAN = tuple((0.0, 0.0, 0.5 + 0.01 * n, 0.0) for n in range(1, 7))


def flying(limits: ArbiterLimits | None = None) -> Bench:
    return Bench(limits).fly()


# Arming ---------------------------------------------------------------------------------------------


def test_arbiter_starts_disarmed_with_neutral_output() -> None:
    bench = Bench()
    output = bench.run(1.0)
    assert (output.state, output.u, output.throttle_low, output.kill) == (
        State.DISARMED,
        NEUTRAL,
        False,
        False,
    )
    assert output.cause is None


def test_arming_gives_the_source_control() -> None:
    bench = Bench()
    answer = bench.arm()
    assert answer.accepted
    assert answer.reason == "ARMED: armed: by agent"
    assert bench.arbiter.holder == "agent"
    output = bench.run(0.2, (0.1, -0.1, 0.04, 0.05))
    assert output.u == (0.1, -0.1, 0.04, 0.05)
    assert output.cause == Cause("agent", bench.epoch, bench.sequence, bench.frame)


def test_arming_needs_low_thrust_for_half_a_second() -> None:
    bench = Bench()
    bench.run(0.5, HOVER)
    bench.run(0.5, (0, 0, 0.05, 0))
    answer = bench.request(Action.ARM, source="agent")
    assert answer.reason == "missing: commanded thrust low long enough"
    bench.run(0.04, (0, 0, 0.05, 0))
    assert bench.request(Action.ARM, source="agent").accepted


def test_thrust_above_the_low_limit_restarts_the_half_second() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    bench.run(0.02, (0, 0, 0.051, 0))
    bench.run(0.4, IDLE)
    assert not bench.request(Action.ARM, source="agent").accepted


def test_a_gap_in_the_stream_restarts_the_half_second() -> None:
    bench = Bench()
    bench.run(0.5, IDLE)
    bench.run(0.08, None)
    bench.run(0.4, IDLE)
    assert not bench.request(Action.ARM, source="agent").accepted
    bench.run(0.14, IDLE)
    assert bench.request(Action.ARM, source="agent").accepted


def test_arming_needs_fresh_commands() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    bench.run(0.08, None)
    assert bench.request(Action.ARM, source="agent").reason == "missing: commands fresh"


def test_arming_a_source_that_never_spoke_says_all_that_is_missing() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    answer = bench.request(Action.ARM, source="other")
    assert answer.reason == "missing: commanded thrust low long enough; missing: commands fresh"
    assert bench.state is State.DISARMED


@pytest.mark.parametrize(
    ("link", "words"),
    [
        (LinkState.UP, "missing: transmitter ready"),
        (LinkState.LOST, "missing: transmitter ready; serial link lost"),
    ],
)
def test_arming_needs_a_ready_transmitter(link: LinkState, words: str) -> None:
    bench = Bench()
    bench.arbiter.link(link)
    assert bench.arm().reason == words


def test_arming_needs_a_tracked_vehicle() -> None:
    bench = Bench()
    bench.position = None
    assert bench.arm().reason == "surveillance: descend: own pose lost for 0.3 s"


def test_arming_beside_another_vehicle_is_refused() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    bench.pose("h2", (0.2, 0.0, 1.0))
    assert bench.request(Action.ARM, source="agent").reason == "surveillance: hold: h2 closer than 0.3 m"


def test_only_an_operator_or_the_source_itself_may_arm() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    refused = bench.request(Action.ARM, by="stranger", source="agent")
    assert refused.reason == "only an operator or the source itself may arm"
    assert bench.request(Action.ARM, by="agent", source="agent").accepted
    assert bench.arbiter.counters["refused: arm"] == 1


def test_arming_again_changes_nothing() -> None:
    bench = flying()
    entered = bench.arbiter.counters["entered ARMED"]
    assert bench.request(Action.ARM, source="agent").accepted
    assert bench.arbiter.counters["entered ARMED"] == entered


def test_arming_another_source_in_flight_is_refused() -> None:
    bench = flying()
    answer = bench.request(Action.ARM, source="other")
    assert answer.reason == "agent has the control lease: hand over instead"


def test_arming_while_shutting_down_is_refused() -> None:
    bench = Bench()
    bench.request(Action.SHUTDOWN)
    assert bench.arm().reason == "shutting down"


# Output while ARMED ------------------------------------------------------------------------------------


def test_output_is_slew_limited_per_axis() -> None:
    bench = flying()
    bench.command((0.5, -0.5, 0.5, 0.1))
    bench.run(0.2, (0.5, -0.5, 0.5, 0.1))
    bench.wait(0.01)
    bench.command((-1.0, 1.0, 1.0, 0.4))
    first = bench.outputs[-1].u
    assert first == pytest.approx((0.5 - 0.8, -0.5 + 0.8, 0.5 + 0.16, 0.4))
    limited = bench.arbiter.counters["steps slew limited"]
    second = bench.wait(0.01).u
    assert second == pytest.approx((first[0] - 0.2, first[1] + 0.2, first[2] + 0.04, 0.4))
    assert bench.arbiter.counters["steps slew limited"] == limited + 1


def test_a_command_within_the_slew_rates_is_played_at_once_whatever_was_stepped_just_before() -> None:
    """Poses and deadlines step the arbiter at any moment; a command must not wait for the next one."""
    bench = flying()
    wanted = (0.3, -0.3, 0.6, 0.1)
    bench.wait(PERIOD_S)
    bench.arbiter.step(bench.now_s)
    bench.command(wanted)
    assert bench.outputs[-1].u == wanted
    bench.wait(PERIOD_S - 0.001)
    bench.wait(0.001)
    bench.command(HOVER)
    assert bench.outputs[-1].u == HOVER


def test_a_long_pause_does_not_allow_a_jump() -> None:
    bench = Bench(ArbiterLimits(hold_after_s=1.0, descend_after_s=2.0, cut_after_s=3.0, arm_low_s=0.5))
    bench.arm()
    bench.command((1.0, 0, 1.0, 0))
    before = bench.arbiter.step(bench.now_s).u[2]
    assert bench.wait(0.09).u[2] - before == pytest.approx(0.16)


def test_output_settles_on_the_command_exactly() -> None:
    bench = flying()
    assert bench.command().reason == "accepted"
    assert bench.run(0.2, HOVER).u == HOVER


def test_time_running_backwards_is_ignored() -> None:
    bench = flying()
    assert bench.arbiter.step(bench.now_s - 10).u == HOVER
    assert bench.state is State.ARMED


# Staleness ------------------------------------------------------------------------------------------


def silent(bench: Bench, seconds: float) -> None:
    """Poses go on, commands stop."""
    start_s = bench.now_s
    for n in range(int(seconds / 0.001)):
        if n % 20 == 0:
            bench.frame += 1
            bench.pose()
        bench.wait(0.001)
    bench.wait(start_s + seconds - bench.now_s)


EDGE_S = 0.0005
"""A moment before and after a limit, so that rounding decides no test."""


def test_hold_begins_at_60_ms_without_planned_inputs() -> None:
    bench = flying()
    silent(bench, 0.06 - EDGE_S)
    assert bench.state is State.ARMED
    silent(bench, 2 * EDGE_S)
    assert bench.state is State.HOLD
    assert bench.reason == "commands late"


def test_hold_levels_the_vehicle_and_never_adds_thrust() -> None:
    for thrust, held in ((0.8, U_HOVER), (0.4, 0.4)):
        bench = Bench().fly((0.5, 0.5, thrust, 0.2))
        silent(bench, 0.07)
        assert bench.outputs[-1].state is State.HOLD
        assert bench.outputs[-1].u == pytest.approx((0, 0, held, 0), abs=0.005)
        assert bench.outputs[-1].cause is None


def test_descend_begins_at_200_ms_and_ramps_down_to_just_below_hover() -> None:
    bench = flying()
    silent(bench, 0.2 - EDGE_S)
    assert bench.state is State.HOLD
    silent(bench, 2 * EDGE_S)
    assert bench.state is State.DESCEND
    assert bench.reason == "commands silent"
    silent(bench, 0.05)
    assert bench.outputs[-1].u == pytest.approx((0, 0, U_HOVER - 0.5 * 0.05, 0), abs=0.005)
    silent(bench, 0.2)
    assert bench.outputs[-1].u == pytest.approx((0, 0, U_HOVER - 0.06, 0), abs=0.005)


def test_descend_does_not_raise_a_lower_thrust() -> None:
    bench = Bench().fly((0, 0, 0.3, 0))
    silent(bench, 1.0)
    assert bench.state is State.DESCEND
    assert bench.outputs[-1].u == pytest.approx((0, 0, 0.3, 0))


def test_cut_begins_at_2_s_and_needs_a_new_arming() -> None:
    bench = flying()
    silent(bench, 2.0 - EDGE_S)
    assert bench.state is State.DESCEND
    silent(bench, 2 * EDGE_S)
    assert bench.state is State.CUT
    assert bench.reason == "commands gone"
    output = bench.run(1.0, HOVER)
    assert (output.state, output.u, output.throttle_low) == (State.CUT, NEUTRAL, True)
    assert bench.arbiter.holder is None
    assert bench.arm().accepted


@pytest.mark.parametrize("silence_s", [0.08, 1.0])
def test_a_fresh_command_returns_to_armed(silence_s: float) -> None:
    bench = flying()
    silent(bench, silence_s)
    assert bench.state in (State.HOLD, State.DESCEND)
    bench.command(HOVER)
    assert bench.state is State.ARMED
    assert bench.reason == "commands fresh again"


def test_a_command_after_a_long_freeze_cannot_hide_the_freeze() -> None:
    bench = flying()
    bench.now_s += 2.5
    bench.frame += 1
    bench.pose()
    bench.command(HOVER)
    assert bench.state is State.CUT


# Bridging -------------------------------------------------------------------------------------------


def test_planned_inputs_are_played_one_per_period_then_hold() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    sent_s = bench.now_s
    seen: dict[int, float] = {}
    while bench.state is State.ARMED:
        silent(bench, 0.001)
        step = bench.outputs[-1].bridging_step
        if bench.state is State.ARMED:
            seen.setdefault(step, bench.now_s - sent_s)
    expected = {0: 0.001, 1: 0.03, 2: 0.04, 3: 0.06, 4: 0.08, 5: 0.1, 6: 0.12}
    assert seen == pytest.approx(expected, abs=0.0011)
    assert bench.now_s - sent_s == pytest.approx(0.14, abs=0.0011)
    assert bench.state is State.HOLD
    assert bench.arbiter.counters["planned inputs played"] == 6
    silent(bench, 0.06)
    assert bench.state is State.DESCEND


def test_planned_inputs_are_applied() -> None:
    bench = flying()
    bench.run(0.3, (0, 0, 0.5, 0), next_u=PLAN)
    silent(bench, 0.059)
    assert bench.outputs[-1].bridging_step == 2
    assert bench.outputs[-1].u == pytest.approx((0, 0, 0.52, 0))
    assert bench.outputs[-1].cause == Cause("agent", 7, bench.sequence, bench.outputs[-1].cause.frame)  # type: ignore[union-attr]  # fails if None


def test_at_most_six_planned_inputs_are_played() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN * 3)
    silent(bench, 0.14 - EDGE_S)
    assert (bench.state, bench.outputs[-1].bridging_step) == (State.ARMED, 6)
    silent(bench, 2 * EDGE_S)
    assert bench.state is State.HOLD


@pytest.mark.parametrize(("count", "hold_s"), [(1, 0.06), (2, 0.06), (3, 0.08), (5, 0.12)])
def test_a_short_plan_holds_when_it_is_used_up(count: int, hold_s: float) -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN[:count])
    silent(bench, hold_s - EDGE_S)
    assert bench.state is State.ARMED
    silent(bench, 2 * EDGE_S)
    assert bench.state is State.HOLD


@pytest.mark.parametrize(("period_s", "hold_s"), [(0.01, 0.07), (0.04, 0.16), (0.06, 0.18)])
def test_bridging_lasts_at_most_120_ms_and_a_period(period_s: float, hold_s: float) -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN, period_s=period_s)
    silent(bench, hold_s - EDGE_S)
    assert bench.state is State.ARMED
    silent(bench, 2 * EDGE_S)
    assert bench.state is State.HOLD


def test_a_new_command_ends_bridging() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    silent(bench, 0.07)
    assert bench.outputs[-1].bridging_step == 3
    bench.command(HOVER, next_u=PLAN)
    assert bench.outputs[-1].bridging_step == 0
    silent(bench, 0.05)
    assert bench.arbiter.counters["planned inputs played"] == 5


def test_bridging_needs_a_plausible_pose() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    bench.wait(0.1)
    assert bench.state is State.HOLD
    assert bench.reason == "raw poses: own pose lost for 0.1 s"


def test_bridging_does_not_return_from_hold() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    bench.wait(0.1)
    bench.frame += 1
    bench.pose()
    assert bench.wait(0.001).state is State.HOLD
    bench.command(HOVER)
    assert bench.state is State.ARMED


# Kill, reset, disarm, lease ----------------------------------------------------------------------------


@pytest.mark.parametrize("by", ["operator", "agent", "anybody"])
def test_kill_is_honoured_from_anyone_and_latches(by: str) -> None:
    bench = flying()
    assert bench.request(Action.KILL, by=by).accepted
    assert bench.reason == f"killed: by {by}"
    output = bench.run(3.0, HOVER)
    assert (output.state, output.kill, output.throttle_low, output.u) == (State.KILLED, True, True, NEUTRAL)
    assert bench.arm().reason == "killed: an operator must reset first"


@pytest.mark.parametrize("silence_s", [0.08, 1.0, 3.0])
def test_kill_is_honoured_in_every_state(silence_s: float) -> None:
    bench = flying()
    silent(bench, silence_s)
    bench.request(Action.KILL, by="anybody")
    assert bench.state is State.KILLED
    disarmed = Bench()
    disarmed.request(Action.KILL, by="anybody")
    assert disarmed.state is State.KILLED


def test_kill_survives_link_loss_disarming_and_shutdown() -> None:
    bench = flying()
    bench.request(Action.KILL)
    bench.arbiter.link(LinkState.LOST)
    bench.request(Action.DISARM)
    bench.request(Action.SHUTDOWN)
    bench.run(3.0)
    assert bench.state is State.KILLED


def test_reset_is_for_an_operator_with_throttle_low() -> None:
    bench = flying()
    bench.request(Action.KILL)
    bench.run(0.1, HOVER)
    assert bench.request(Action.RESET, by="agent").reason == "only an operator may reset a kill"
    assert bench.request(Action.RESET).reason == "a source asks for thrust: lower it first"
    assert bench.state is State.KILLED
    bench.run(0.02, (0, 0, 0.05, 0))
    assert bench.request(Action.RESET).accepted
    assert bench.state is State.DISARMED
    assert bench.request(Action.RESET).reason == "not killed"


def test_reset_is_possible_when_nobody_commands() -> None:
    bench = flying()
    bench.request(Action.KILL)
    bench.run(0.06, None)
    assert bench.request(Action.RESET).accepted


def test_disarming_is_for_holder_and_operator() -> None:
    for by, accepted in (("operator", True), ("agent", True), ("other", False)):
        bench = flying()
        answer = bench.request(Action.DISARM, by=by)
        assert answer.accepted == accepted
        assert bench.state is (State.DISARMED if accepted else State.ARMED)
    assert answer.reason == "only the holder of the control lease or an operator may disarm"


@pytest.mark.parametrize(("silence_s", "state"), [(0.08, State.HOLD), (1.0, State.DESCEND), (3.0, State.CUT)])
def test_disarming_works_in_every_live_state(silence_s: float, state: State) -> None:
    bench = flying()
    silent(bench, silence_s)
    assert bench.state is state
    bench.request(Action.DISARM)
    assert (bench.state, bench.reason) == (State.DISARMED, "disarmed: by operator")


@pytest.mark.parametrize(("silence_s", "state"), [(0.08, State.HOLD), (1.0, State.DESCEND)])
def test_a_freeze_beyond_the_limit_cuts_from_every_flying_state(silence_s: float, state: State) -> None:
    bench = flying()
    silent(bench, silence_s)
    assert bench.state is state
    assert bench.wait(2.0).state is State.CUT
    assert bench.reason == "commands gone"


def test_disarmed_vehicle_has_no_thrust_whatever_is_commanded() -> None:
    bench = flying()
    bench.request(Action.DISARM)
    assert bench.run(1.0, HOVER).u == NEUTRAL
    assert bench.arbiter.holder is None


def test_control_is_handed_over_by_holder_or_operator_to_a_source_that_streams() -> None:
    bench = flying()
    silence = bench.request(Action.HAND_OVER, source="other")
    assert silence.reason == "other sends no fresh commands"
    refused = bench.command((0, 0, 0.5, 0), source="other")
    assert refused.reason == "source without control lease"
    assert bench.request(Action.HAND_OVER, by="other", source="other").reason == (
        "only the holder of the control lease or an operator may hand over"
    )
    assert bench.request(Action.HAND_OVER, by="agent", source="other").accepted
    assert bench.arbiter.holder == "other"
    assert bench.reason == "control handed over to other"
    assert bench.command(HOVER).reason == "source without control lease"
    assert bench.run(0.2, (0, 0, 0.5, 0), source="other").u == (0, 0, 0.5, 0)


def test_control_cannot_be_handed_over_to_a_source_that_fell_silent() -> None:
    bench = flying()
    bench.command((0, 0, 0.5, 0), source="other")
    bench.run(0.08, HOVER)
    assert not bench.request(Action.HAND_OVER, source="other").accepted


def test_nobody_flying_has_nothing_to_hand_over() -> None:
    bench = Bench()
    assert (
        bench.request(Action.HAND_OVER, source="agent").reason == "nobody has the control lease: arm instead"
    )


def test_commands_without_the_lease_never_feed_the_watchdog() -> None:
    bench = flying()
    for _ in range(201):
        bench.wait(0.01)
        bench.frame += 1
        bench.pose()
        bench.command(HOVER, source="other")
    assert bench.state is State.CUT
    assert bench.arbiter.counters["source without control lease"] == 200


# Link and shutdown ------------------------------------------------------------------------------------


@pytest.mark.parametrize("silence_s", [0.0, 0.08, 1.0, 3.0])
def test_lost_link_disarms(silence_s: float) -> None:
    bench = flying()
    silent(bench, silence_s)
    bench.arbiter.link(LinkState.LOST)
    bench.wait(0.001)
    assert bench.state is State.DISARMED
    assert bench.reason == "serial link lost"
    bench.arbiter.link(LinkState.READY)
    assert bench.run(1.0, HOVER).state is State.DISARMED


def test_module_that_is_not_ready_in_flight_brings_the_vehicle_down() -> None:
    bench = flying()
    bench.arbiter.link(LinkState.UP)
    bench.run(0.1)
    assert bench.state is State.DESCEND
    assert bench.reason == "transmitter not ready"
    bench.arbiter.link(LinkState.READY)
    assert bench.run(0.1).state is State.ARMED


def test_module_that_is_not_ready_ends_a_hold_too() -> None:
    bench = flying()
    silent(bench, 0.08)
    bench.arbiter.link(LinkState.UP)
    assert bench.wait(0.001).state is State.DESCEND


def test_shutdown_descends_then_cuts_whatever_is_commanded() -> None:
    bench = flying()
    assert bench.request(Action.SHUTDOWN, by="anybody").accepted
    assert (bench.state, bench.reason) == (State.DESCEND, "shutting down")
    assert bench.run(1.78).state is State.DESCEND
    assert bench.run(0.04).state is State.CUT
    assert bench.reason == "descent over"


def test_shutdown_on_the_floor_cuts_at_once() -> None:
    bench = Bench()
    bench.arm()
    bench.run(0.1, IDLE)
    bench.request(Action.SHUTDOWN)
    assert bench.state is State.CUT


@pytest.mark.parametrize(
    ("silence_s", "state"), [(0.0, State.ARMED), (0.08, State.HOLD), (0.3, State.DESCEND)]
)
def test_shutdown_on_the_floor_cuts_from_every_flying_state(silence_s: float, state: State) -> None:
    bench = Bench().fly()
    bench.run(1.2, IDLE)
    silent(bench, silence_s)
    assert bench.state is state
    bench.request(Action.SHUTDOWN)
    assert bench.state is State.CUT


def test_shutdown_in_hold_descends() -> None:
    bench = flying()
    silent(bench, 0.08)
    bench.request(Action.SHUTDOWN)
    assert bench.state is State.DESCEND


# Surveillance in the table --------------------------------------------------------------------------------


def test_lost_tracking_holds_descends_and_cuts() -> None:
    bench = flying()
    lost_s = bench.now_s
    entered: dict[State, float] = {}
    bench.position = None
    while bench.state is not State.CUT:
        bench.run(PERIOD_S)
        entered.setdefault(bench.state, bench.now_s - lost_s)
    assert entered[State.HOLD] == pytest.approx(0.1, abs=0.021)
    assert entered[State.DESCEND] == pytest.approx(0.3, abs=0.021)
    assert entered[State.CUT] == pytest.approx(2.1, abs=0.041)


def test_tracking_that_returns_gives_control_back() -> None:
    bench = flying()
    bench.position = None
    bench.run(0.4)
    assert bench.state is State.DESCEND
    bench.position = (0.0, 0.0, 0.95)
    assert bench.run(0.04).state is State.ARMED


def test_vehicle_on_the_floor_is_left_alone() -> None:
    bench = Bench().fly()
    bench.run(1.2, IDLE)
    bench.position = None
    assert bench.run(2.0, IDLE).state is State.ARMED
    bench.run(0.1, HOVER)
    assert bench.state is State.DESCEND
    assert bench.outputs[-1].u[2] <= 0.05


def test_neighbour_too_close_holds_and_after_half_a_second_descends() -> None:
    bench = flying()
    start_s = bench.now_s
    while bench.state is not State.DESCEND:
        bench.pose("h2", (0.2, 0.0, 1.0))
        bench.run(PERIOD_S)
        assert bench.now_s - start_s < 1.0
    assert bench.reason == "hold lasted too long"
    assert bench.now_s - start_s == pytest.approx(0.5, abs=0.05)


def test_neighbour_that_leaves_gives_control_back() -> None:
    bench = flying()
    bench.pose("h2", (0.2, 0.0, 1.0))
    bench.run(0.1)
    assert (bench.state, bench.reason) == (State.HOLD, "raw poses: h2 closer than 0.3 m")
    bench.pose("h2", (0.4, 0.0, 1.0))
    bench.frame += 1
    bench.pose("h2", (0.4, 0.0, 1.0))
    assert bench.run(0.04).state is State.ARMED


def test_thrust_time_counts_flying_only_and_ends_in_a_descent() -> None:
    bench = Bench(ArbiterLimits(surveillance=SurveillanceLimits(maximum_thrust_s=2.0)))
    bench.arm()
    bench.run(5.0, IDLE)
    started_s = bench.now_s
    while bench.state is State.ARMED and bench.now_s < started_s + 3:
        bench.run(PERIOD_S)
    assert bench.now_s - started_s == pytest.approx(2.0, abs=0.05)
    assert bench.reason == "raw poses: thrust for 2 s, the longest allowed"
    bench.run(3.0)
    assert bench.state is State.CUT
    assert bench.arm().accepted
    bench.run(0.5)
    assert bench.state is State.ARMED


def test_a_short_thrust_limit_does_not_forbid_arming() -> None:
    bench = Bench(ArbiterLimits(surveillance=SurveillanceLimits(maximum_thrust_s=0.5)))
    assert bench.arm().accepted


# Next event -----------------------------------------------------------------------------------------


def test_nothing_is_due_on_the_ground() -> None:
    assert Bench().arbiter.next_event_s() == math.inf


def test_waking_at_next_event_meets_every_limit_in_time() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    sent_s = bench.now_s
    changes: list[tuple[State, int, float]] = []
    for _ in range(200):
        if bench.state is State.CUT:
            break
        due_s = bench.arbiter.next_event_s()
        assert due_s > bench.now_s
        bench.now_s = due_s
        output = bench.wait(0.0)
        if not changes or changes[-1][:2] != (output.state, output.bridging_step):
            changes.append((output.state, output.bridging_step, round(bench.now_s - sent_s, 6)))
    armed = [change for change in changes if change[0] is State.ARMED]
    assert [(step, at) for _, step, at in armed] == [(1, 0.03), (2, 0.04), (3, 0.06), (4, 0.08)]
    assert changes[len(armed) :] == [(State.HOLD, 0, 0.1), (State.DESCEND, 0, 0.2), (State.CUT, 0, 2.0)]


@pytest.mark.parametrize("needed", [0.52, 0.6])
def test_descent_starts_from_the_thrust_that_a_steady_hover_needed(needed: float) -> None:
    bench = flying()
    bench.run(6.0, (0, 0, needed, 0))
    silent(bench, 0.1)
    assert bench.outputs[-1].state is State.HOLD
    assert bench.outputs[-1].u[2] == pytest.approx(needed, abs=0.001)
    silent(bench, 0.4)
    assert bench.outputs[-1].state is State.DESCEND
    assert bench.outputs[-1].u[2] == pytest.approx(needed - 0.06, abs=0.001)
