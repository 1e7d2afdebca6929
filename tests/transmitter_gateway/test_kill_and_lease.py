"""Who may kill, reset, disarm and command a vehicle."""

import pytest
from arbiter_bench import HOVER, IDLE, Bench, flying, silent

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.inputs import FLYING, NEUTRAL, Action, LinkState, State


@pytest.mark.parametrize("by", ["operator", "agent", "anybody"])
def test_kill_is_honoured_from_anyone_and_latches(by: str) -> None:
    bench = flying()
    assert bench.request(Action.KILL, by=by).accepted
    assert bench.reason == f"killed: by {by}"
    output = bench.run(3.0, HOVER)
    assert (output.state, output.u) == (State.KILLED, NEUTRAL)
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


def test_disarming_is_for_an_operator() -> None:
    for by, accepted in (("operator", True), ("anybody", False)):
        bench = flying()
        bench.run(0.8, IDLE)
        answer = bench.request(Action.DISARM, by=by)
        assert answer.accepted == accepted
        assert bench.state is (State.DISARMED if accepted else State.ARMED)
    assert answer.reason == "only an operator may disarm"


@pytest.mark.parametrize(
    ("silence_s", "state"), [(0.0, State.ARMED), (0.08, State.HOLD), (1.0, State.DESCEND)]
)
def test_disarming_is_refused_while_the_vehicle_may_be_in_the_air(silence_s: float, state: State) -> None:
    bench = flying()
    silent(bench, silence_s)
    assert bench.state is state
    answer = bench.request(Action.DISARM)
    assert answer.reason == "it may be in the air: land it first; kill is what cuts motors"
    assert not answer.accepted
    assert bench.state is state
    assert bench.arbiter.counters["refused: disarm"] == 1


def test_disarming_is_refused_in_a_landing_and_where_the_vehicle_is_not_seen() -> None:
    bench = Bench()
    bench.yaw_rad = 0.0
    bench.fly()
    silent(bench, 0.4)
    assert bench.state is State.LAND
    assert not bench.request(Action.DISARM).accepted
    bench.position = None
    bench.run(0.1)
    assert not bench.request(Action.DISARM).accepted
    assert bench.state in FLYING


def test_disarming_works_at_once_for_a_vehicle_that_is_seen_on_the_floor() -> None:
    bench = Bench()
    bench.yaw_rad, bench.position = 0.0, (0.0, 0.0, 0.05)
    bench.fly()
    assert bench.request(Action.DISARM).accepted
    assert (bench.state, bench.reason) == (State.DISARMED, "disarmed: by operator")


@pytest.mark.parametrize(("height_m", "accepted"), [(0.03, True), (0.06, False), (0.09, False)])
def test_disarming_is_refused_where_the_vehicle_would_fall_faster_than_it_may_touch_down(
    height_m: float, accepted: bool
) -> None:
    bench = Bench()
    bench.yaw_rad, bench.position = 0.0, (0.0, 0.0, 0.0)
    bench.fly()
    for step in range(10):
        bench.position = (0.0, 0.0, height_m * (step + 1) / 10)
        bench.run(0.02, HOVER)
    bench.run(0.6, HOVER)
    assert bench.request(Action.DISARM).accepted == accepted


def test_disarming_works_without_sight_after_the_thrust_was_low_for_long_enough() -> None:
    bench = flying()
    bench.run(0.5, IDLE)
    assert not bench.request(Action.DISARM).accepted
    bench.run(0.3, IDLE)
    assert bench.request(Action.DISARM).accepted


def test_disarming_works_when_the_motors_are_cut() -> None:
    bench = flying()
    silent(bench, 4.0)
    assert bench.state is State.CUT
    assert bench.request(Action.DISARM).accepted
    assert bench.state is State.DISARMED


def test_a_vehicle_that_stands_on_the_floor_for_long_is_disarmed_by_itself() -> None:
    bench = Bench(ArbiterLimits(disarm_after_s=3.0))
    bench.run(10.0, IDLE)
    assert bench.request(Action.ARM).accepted
    bench.run(2.9, IDLE)
    assert bench.state is State.ARMED
    bench.run(0.2, IDLE)
    assert (bench.state, bench.reason) == (State.DISARMED, "on the floor for long")


def test_a_flight_starts_the_time_on_the_floor_anew() -> None:
    bench = Bench(ArbiterLimits(disarm_after_s=3.0))
    bench.fly()
    bench.run(5.0, HOVER)
    bench.run(2.9, IDLE)
    assert bench.state is State.ARMED
    bench.run(0.3, IDLE)
    assert bench.state is State.DISARMED


def test_the_time_on_the_floor_ends_without_any_message() -> None:
    bench = Bench(ArbiterLimits(disarm_after_s=0.6))
    assert bench.arm().accepted
    bench.run(0.55, IDLE)
    assert bench.now_s < bench.arbiter.next_event_s() <= bench.now_s + 0.06


def test_disarmed_vehicle_has_no_thrust_whatever_is_commanded() -> None:
    bench = flying()
    bench.run(0.8, IDLE)
    bench.request(Action.DISARM)
    assert bench.run(1.0, HOVER).u == NEUTRAL
    assert not bench.arbiter.commanded


def test_the_first_command_of_a_later_lease_takes_over_between_two_commands() -> None:
    bench = flying()
    successor = bench.arbiter.bid(2, bench.now_s, take_over=True)
    assert bench.run(0.1, HOVER).u == HOVER
    assert bench.command((0, 0, 0.5, 0), lease=successor).accepted
    assert bench.command(HOVER).reason == "control lease lost"
    assert bench.arbiter.leases.commanding == successor
    assert bench.run(0.2, (0, 0, 0.5, 0), lease=successor).u == (0, 0, 0.5, 0)
    assert bench.state is State.ARMED
    assert bench.arbiter.counters["agents that took over"] == 1


def test_an_agent_that_only_starts_takes_over_from_nobody_who_commands() -> None:
    bench = flying()
    assert bench.arbiter.bid(2, bench.now_s, take_over=False) == 0
    bench.run(0.06, None)
    assert bench.arbiter.bid(2, bench.now_s, take_over=False) == bench.lease + 1


def test_commands_of_leases_that_were_lost_or_never_issued_do_not_feed_the_watchdog() -> None:
    bench = flying()
    successor = bench.arbiter.bid(2, bench.now_s, take_over=True)
    bench.command(HOVER, lease=successor)
    for number in range(400):
        bench.wait(0.01)
        bench.frame += 1
        bench.pose()
        bench.command(HOVER, lease=bench.lease if number % 2 else successor + 1)
    assert bench.state is State.CUT
    assert bench.arbiter.counters["control lease lost"] > 100
    assert bench.arbiter.counters["no such control lease"] > 100
