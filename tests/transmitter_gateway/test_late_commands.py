"""The ladder of a vehicle whose commands stay away: HOLD, DESCEND, CUT."""

import pytest
from arbiter_bench import EDGE_S, HOVER, U_HOVER, Bench, flying, silent

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.inputs import NEUTRAL, State


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
    silent(bench, 0.3)
    sinking = (1.0 - 0.11 - 0.15) * U_HOVER  # No flight has shown yet what a hover needs.
    assert bench.outputs[-1].u == pytest.approx((0, 0, sinking, 0), abs=0.005)


def test_descend_does_not_raise_a_lower_thrust() -> None:
    bench = Bench().fly((0, 0, 0.3, 0))
    silent(bench, 1.0)
    assert bench.state is State.DESCEND
    assert bench.outputs[-1].u == pytest.approx((0, 0, 0.3, 0))


def test_cut_begins_after_the_longest_descent_and_needs_a_new_arming() -> None:
    bench, limits = flying(), ArbiterLimits()
    silent(bench, limits.descend_after_s + limits.descents_s(0.6)[1] - EDGE_S)
    assert bench.state is State.DESCEND
    silent(bench, 4 * EDGE_S)
    assert bench.state is State.CUT
    assert bench.reason == "descent over: commands silent"
    output = bench.run(1.0, HOVER)
    assert (output.state, output.u) == (State.CUT, NEUTRAL)
    assert not bench.arbiter.commanded
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


@pytest.mark.parametrize(
    ("silence_s", "state", "reason"),
    [(0.08, State.HOLD, "commands gone"), (1.0, State.DESCEND, "descent over: commands silent")],
)
def test_a_freeze_beyond_the_limit_cuts_from_every_flying_state(
    silence_s: float, state: State, reason: str
) -> None:
    bench = flying()
    silent(bench, silence_s)
    assert bench.state is state
    assert bench.wait(4.0).state is State.CUT
    assert bench.reason == reason


def test_thrust_near_the_floor_is_not_taken_for_that_of_a_hover() -> None:
    bench = Bench()
    bench.position = (0.0, 0.0, 0.09)
    bench.fly()
    bench.run(6.0, (0, 0, 0.6, 0))
    silent(bench, 0.1)
    assert bench.outputs[-1].u[2] == pytest.approx(U_HOVER)


def test_an_agent_that_stays_in_an_epoch_the_poses_have_left_no_longer_commands() -> None:
    bench = flying()
    left, frame = bench.epoch, bench.frame
    bench.epoch += 1
    bench.run(0.2, epoch=left, frame=frame)
    assert bench.state is State.ARMED
    bench.run(0.3, epoch=left, frame=frame)
    assert bench.state is State.DESCEND
    assert bench.reason == "commands silent"
    assert bench.arbiter.counters["older epoch"] > 0


def test_an_agent_whose_frames_are_far_ahead_of_the_poses_does_not_command() -> None:
    bench = flying()
    bench.run(0.3, frame=2**52)
    assert bench.state is State.DESCEND
    assert bench.arbiter.counters["command ahead of the raw poses"] == 15
