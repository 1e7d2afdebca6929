"""What the arbiter puts out, and what link, shutdown and raw poses do to it."""

import math

import pytest
from arbiter_bench import HOVER, IDLE, PERIOD_S, PLAN, Bench, flying, silent

from rcopterx.radios.limits import ArbiterLimits, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import Action, LinkState, State

LONGEST_S = ArbiterLimits().descents_s(0.6)[1]
"""Longest descent from where the bench flies."""

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


def test_shutdown_descends_then_cuts_whatever_is_commanded() -> None:
    bench = flying()
    assert bench.request(Action.SHUTDOWN, by="anybody").accepted
    assert (bench.state, bench.reason) == (State.DESCEND, "shutting down")
    assert bench.run(LONGEST_S - 0.02).state is State.DESCEND
    assert bench.run(0.04).state is State.CUT
    assert bench.reason == "descent over: shutting down"


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


# Pose monitor in the table --------------------------------------------------------------------------------


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
    assert entered[State.CUT] == pytest.approx(0.3 + LONGEST_S, abs=0.041)


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
        bench.pose("h2", (0.2, 0.0, 0.6))
        bench.run(PERIOD_S)
        assert bench.now_s - start_s < 1.0
    assert bench.reason == "hold lasted too long"
    assert bench.now_s - start_s == pytest.approx(0.5, abs=0.05)


def test_neighbour_that_leaves_gives_control_back() -> None:
    bench = flying()
    bench.pose("h2", (0.2, 0.0, 0.6))
    bench.run(0.1)
    assert (bench.state, bench.reason) == (State.HOLD, "raw poses: h2 closer than 0.3 m")
    bench.pose("h2", (0.4, 0.0, 0.6))
    bench.frame += 1
    bench.pose("h2", (0.4, 0.0, 0.6))
    assert bench.run(0.04).state is State.ARMED


def test_a_thrust_too_low_to_be_repeated_is_raised_unless_it_is_commanded_for_half_a_second() -> None:
    bench = Bench()
    bench.yaw_rad = 0.0
    bench.fly()
    bench.run(0.4, IDLE)
    limited = bench.outputs[-1].u[2]
    assert 0.2 < limited < 0.55
    assert bench.arbiter.counters["thrusts limited downwards"] > 0
    bench.run(0.3, IDLE)
    assert bench.outputs[-1].u[2] == 0.0


def test_thrust_time_counts_flying_only_and_ends_in_a_descent() -> None:
    bench = Bench(ArbiterLimits(surveillance=SurveillanceLimits(maximum_thrust_s=2.0)))
    bench.arm()
    bench.run(5.0, IDLE)
    started_s = bench.now_s
    while bench.state is State.ARMED and bench.now_s < started_s + 3:
        bench.run(PERIOD_S)
    assert bench.now_s - started_s == pytest.approx(2.0, abs=0.05)
    assert bench.reason == "raw poses: thrust for 2 s, the longest allowed"
    bench.run(4.0)
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
    assert changes[len(armed) :] == [
        (State.HOLD, 0, 0.1),
        (State.DESCEND, 0, 0.2),
        (State.CUT, 0, round(0.2 + LONGEST_S, 6)),
    ]


@pytest.mark.parametrize("needed", [0.3, 0.52, 0.85])
def test_descent_starts_from_the_thrust_that_a_steady_hover_needed(needed: float) -> None:
    bench = flying()
    bench.yaw_rad = 0.0
    bench.run(9.0, (0, 0, needed, 0))
    bench.yaw_rad = None
    silent(bench, 0.1)
    assert bench.outputs[-1].state is State.HOLD
    assert bench.outputs[-1].u[2] == pytest.approx(needed, abs=0.005)
    silent(bench, 0.6)
    assert bench.outputs[-1].state is State.DESCEND
    assert 0.89 * needed - 0.005 < bench.outputs[-1].u[2] < 0.95 * needed
