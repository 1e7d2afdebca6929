"""When the arbiter lands its vehicle in a closed loop, and when it does not."""

import math
from itertools import pairwise

import pytest
from arbiter_bench import EDGE_S, HOVER, IDLE, PERIOD_S, U_HOVER, Bench, silent

from rcopterx.radios.limits import ArbiterLimits, Fence, LandingLimits, SurveillanceLimits
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import NEUTRAL, Action, LastApplied, LinkState, PoseInput, State


def seen_flying(limits: ArbiterLimits | None = None) -> Bench:
    bench = Bench(limits)
    bench.yaw_rad = 0.5
    return bench.fly()


def drift(bench: Bench, seconds: float) -> None:
    """Climb so slowly that only the height shows that the vehicle flies."""
    for _ in range(round(seconds / PERIOD_S)):
        assert bench.position is not None
        x, y, z = bench.position
        bench.position = (x, y, z + 0.01 * PERIOD_S)
        bench.run(PERIOD_S, None)


def test_silent_commands_hold_then_land_for_as_long_as_it_takes() -> None:
    bench = seen_flying()
    silent(bench, 0.06 + EDGE_S)
    assert bench.state is State.HOLD
    silent(bench, 0.14)
    assert (bench.state, bench.reason) == (State.LAND, "commands silent")
    drift(bench, 15.0)
    assert bench.state is State.LAND
    assert bench.outputs[-1].cause is None


def test_hold_of_a_vehicle_that_is_seen_holds_its_place() -> None:
    bench = seen_flying()
    silent(bench, 0.1)
    assert bench.state is State.HOLD
    bench.position = (0.05, 0.0, 0.55)
    bench.run(0.04, None)
    pitch, roll, thrust, _ = bench.outputs[-1].u
    assert math.hypot(pitch, roll) > 0.01
    assert thrust > U_HOVER


def test_hold_of_a_vehicle_at_rest_neither_climbs_nor_sinks() -> None:
    bench = seen_flying()
    bench.run(9.0)
    silent(bench, 0.19)
    assert bench.state is State.HOLD
    assert bench.outputs[-1].u == pytest.approx((0.0, 0.0, U_HOVER, 0.0), abs=0.006)


def test_vehicle_moves_away_from_others_that_are_too_close_and_nowhere_between_them() -> None:
    bench = Bench()
    bench.yaw_rad = 0.0
    bench.fly()
    bench.pose("h2", (0.2, 0.0, 0.6))
    bench.run(0.1)
    assert bench.state is State.HOLD
    assert bench.outputs[-1].u[0] < -0.1
    bench.pose("h3", (-0.2, 0.0, 0.6))
    bench.run(0.1)
    assert bench.outputs[-1].u[0] == pytest.approx(0.0, abs=0.01)


def test_fresh_commands_end_a_landing() -> None:
    bench = seen_flying()
    silent(bench, 2.5)
    assert bench.state is State.LAND
    bench.command(HOVER)
    assert (bench.state, bench.reason) == (State.ARMED, "commands fresh again")


def test_landing_goes_on_open_loop_when_the_pose_is_lost_and_closed_loop_when_it_returns() -> None:
    bench = seen_flying()
    silent(bench, 1.0)
    age_s = bench.arbiter.limits.landing.pose_age_s
    track = bench.arbiter.pose_monitor.own_track
    assert track is not None
    bench.wait(track.seen_s + age_s - EDGE_S - bench.now_s)
    assert bench.state is State.LAND
    assert bench.arbiter.next_event_s() == pytest.approx(bench.now_s + EDGE_S)
    bench.wait(2 * EDGE_S)
    assert (bench.state, bench.reason) == (State.DESCEND, "own pose not seen: commands silent")
    assert bench.outputs[-1].u[:2] == (0.0, 0.0)
    bench.frame += 1
    bench.pose()
    bench.wait(EDGE_S)
    assert (bench.state, bench.reason) == (State.LAND, "own pose seen: commands silent")


def test_open_loop_descent_during_a_landing_lasts_its_time_and_is_cut() -> None:
    bench = seen_flying()
    silent(bench, 3.0)
    bench.wait(0.2)
    assert bench.state is State.DESCEND
    entered_s, height_m = bench.now_s, bench.arbiter.pose_monitor.height_m(0.0)
    _, longest_s = ArbiterLimits().descents_s(height_m)
    bench.wait(longest_s - EDGE_S)
    assert bench.state is State.DESCEND
    bench.wait(2 * EDGE_S)
    assert (bench.state, bench.reason) == (State.CUT, "descent over: commands silent")
    assert bench.now_s - entered_s == pytest.approx(longest_s, abs=0.01)


def test_landing_that_takes_too_long_goes_on_open_loop_although_the_vehicle_is_seen() -> None:
    bench = seen_flying(ArbiterLimits(landing=LandingLimits(longest_s=3.0)))
    silent(bench, 0.2 + EDGE_S)
    began_s = bench.now_s
    drift(bench, 3.0 - 0.05)
    assert bench.state is State.LAND
    drift(bench, 0.1)
    assert (bench.state, bench.reason) == (State.DESCEND, "landing lasted too long: commands silent")
    drift(bench, 1.9)
    assert bench.state is State.DESCEND  # It is still seen in the air.
    assert bench.now_s - began_s < 5.1


def test_vehicle_that_stays_in_the_air_comes_down_because_its_thrust_fades() -> None:
    bench = seen_flying(ArbiterLimits(landing=LandingLimits(longest_s=1.0)))
    drift(bench, 0.2 + 1.0 + 1.8 + 0.1)
    assert bench.state is State.DESCEND
    thrusts = []
    while bench.state is State.DESCEND:
        thrusts.append(bench.outputs[-1].u[2])
        drift(bench, PERIOD_S)
    assert (bench.state, bench.reason) == (State.CUT, "descent over: commands silent")
    assert all(0 <= before - after <= 0.0011 for before, after in pairwise(thrusts))
    assert thrusts[-1] < 0.05


def descend_to(bench: Bench, height_m: float, seconds: float = 2.0) -> None:
    """Sink to a height at a steady rate."""
    assert bench.position is not None
    x, y, z = bench.position
    steps = round(seconds / PERIOD_S)
    for step in range(1, steps + 1):
        bench.position = (x, y, z + (height_m - z) * step / steps)
        bench.run(PERIOD_S, None)


def test_vehicle_that_touches_down_is_cut() -> None:
    bench = seen_flying()
    silent(bench, 0.5)
    descend_to(bench, 0.0)
    assert bench.state is State.LAND
    bench.run(0.5, None)
    assert (bench.state, bench.reason) == (State.CUT, "landed: commands silent")
    assert bench.outputs[-1].u == NEUTRAL


def test_vehicle_on_a_table_is_cut_when_it_does_not_sink_any_more() -> None:
    bench = seen_flying()
    silent(bench, 0.5)
    descend_to(bench, 0.5)
    bench.run(10.0, None)
    assert (bench.state, bench.reason) == (State.CUT, "landed: commands silent")


def test_vehicle_that_hovers_against_its_landing_is_not_cut_within_seconds() -> None:
    bench = seen_flying()
    silent(bench, 3.0)
    assert bench.state is State.LAND


def test_open_loop_descent_that_is_seen_on_the_floor_is_cut() -> None:
    bench = seen_flying(ArbiterLimits(surveillance=SurveillanceLimits(maximum_jump_m=None)))
    silent(bench, 0.5)
    bench.wait(1.0)
    assert bench.state is State.DESCEND
    bench.position = (0.0, 0.0, 0.0)
    bench.run(0.3, None)
    assert bench.state is State.DESCEND
    bench.run(0.3, None)
    assert (bench.state, bench.reason) == (State.CUT, "landed: commands silent")


@pytest.mark.parametrize(("idle_s", "state"), [(0.0, State.DESCEND), (1.2, State.DESCEND)])
def test_vehicle_on_the_floor_is_never_lifted_by_its_arbiter(idle_s: float, state: State) -> None:
    bench = Bench()
    bench.yaw_rad = 0.0
    bench.position = (0.0, 0.0, 0.0)
    bench.arm()
    bench.run(0.1, (0.0, 0.0, 0.3, 0.0))
    bench.run(idle_s, IDLE)
    before = bench.outputs[-1].u[2]
    bench.run(0.26, None)
    assert bench.state is state
    assert bench.outputs[-1].u[:2] == (0.0, 0.0)
    assert bench.outputs[-1].u[2] <= before


def test_spool_up_that_is_interrupted_on_the_floor_ends_in_a_cut() -> None:
    bench = Bench()
    bench.yaw_rad = 0.0
    bench.position = (0.0, 0.0, 0.0)
    bench.arm()
    bench.run(0.1, (0.0, 0.0, 0.3, 0.0))
    bench.run(0.6, None)
    assert (bench.state, bench.reason) == (State.CUT, "landed: commands silent")


@pytest.mark.parametrize(
    "position", [(0.0, 0.0, 0.31), (0.0, 0.0, 0.05)], ids=["on a table", "markers above the floor"]
)
def test_floor_is_where_the_vehicle_stood_unless_that_is_a_table(
    position: tuple[float, float, float],
) -> None:
    bench = Bench()
    bench.yaw_rad = 0.0
    bench.position = position
    bench.arm()
    stood_m = bench.arbiter.pose_monitor.floor_m(0.0)
    assert stood_m == (position[2] if position[2] < 0.2 else 0.0)
    bench.arbiter.pose_monitor.take_over(None, None, bench.now_s)
    assert bench.arbiter.pose_monitor.floor_m(-0.4) == -0.4


def test_shutdown_lands_whatever_is_commanded() -> None:
    bench = seen_flying()
    bench.request(Action.SHUTDOWN, by="anybody")
    assert (bench.state, bench.reason) == (State.LAND, "shutting down")
    bench.run(3.0, HOVER)
    assert bench.state is State.LAND


def test_module_that_is_not_ready_lands_a_vehicle_that_is_seen() -> None:
    bench = seen_flying()
    bench.arbiter.link(LinkState.UP)
    bench.run(0.1)
    assert (bench.state, bench.reason) == (State.LAND, "transmitter not ready")
    bench.arbiter.link(LinkState.READY)
    assert bench.run(0.1).state is State.ARMED


def fenced(maximum_jump_m: float | None = None) -> Bench:
    """Flying in a box that is 1 m wide, and cut 1 m outside."""
    fence = Fence((-0.5, -0.5, -1.0), (0.5, 0.5, 2.0), cut_m=1.0)
    return seen_flying(
        ArbiterLimits(surveillance=SurveillanceLimits(fence=fence, maximum_jump_m=maximum_jump_m))
    )


def test_vehicle_outside_the_fence_lands_and_is_not_given_back_there() -> None:
    bench = fenced()
    bench.position = (0.65, 0.0, 0.6)
    bench.run(1.0)
    assert (bench.state, bench.reason) == (State.LAND, "raw poses: outside the fence in x")


def runaway(x_m: float) -> Bench:
    """A vehicle that drifts out of its volume, whatever its commands, up to a place."""
    bench = fenced()
    for n in range(1, 101):
        bench.position = (x_m * n / 100, 0.0, 0.6)
        bench.run(0.02)
    return bench


@pytest.mark.parametrize(("x_m", "state"), [(1.49, State.LAND), (1.51, State.CUT), (-1.51, State.CUT)])
def test_vehicle_that_does_not_obey_is_cut_far_outside_the_fence(x_m: float, state: State) -> None:
    bench = runaway(x_m)
    assert bench.state is state
    cut = state is State.CUT
    assert bench.reason == "far outside the fence: " * cut + "raw poses: outside the fence in x"


def test_vehicle_that_obeys_is_braked_wherever_it_is() -> None:
    bench = fenced()
    for n in range(30):
        bench.position = (1.6 + 0.01 * n, 0.0, 0.6)
        bench.run(0.02)
    assert bench.state is State.LAND


def test_vehicle_that_is_not_believed_is_not_cut_for_where_it_seems_to_be() -> None:
    bench = fenced(maximum_jump_m=0.1)
    bench.position = (5.0, 0.0, 0.6)
    bench.run(0.5)
    assert bench.state is State.DESCEND


@pytest.mark.parametrize("seconds", [0.3, 2.5])
def test_commands_after_a_pause_of_the_process_count_if_the_vehicle_is_seen_in_the_air(
    seconds: float,
) -> None:
    bench = seen_flying()
    bench.now_s += seconds
    bench.frame += 1
    bench.pose()
    bench.command(HOVER)
    assert bench.state is State.ARMED


def test_pause_of_the_process_beyond_the_limit_cuts_a_vehicle_that_has_come_down() -> None:
    bench = seen_flying(ArbiterLimits(surveillance=SurveillanceLimits(maximum_jump_m=None)))
    bench.now_s += 2.5
    bench.frame += 1
    bench.position = (0.0, 0.0, 0.0)
    bench.pose()
    bench.command(HOVER)
    assert (bench.state, bench.reason) == (State.CUT, "commands gone")


# Taking over ------------------------------------------------------------------------------------------


def taken_over(last: LastApplied) -> Arbiter:
    arbiter = Bench().arbiter
    arbiter.pose(PoseInput("h1", 7, 100, (0.0, 0.0, 0.8), 0.02, 0.0), 1000.0)
    assert arbiter.take_over(last, 1000.0).accepted
    return arbiter


def last_applied(state: State, *, commanded: bool, mistaken: bool = False) -> LastApplied:
    return LastApplied(
        state, (0.1, 0.0, 0.56, 0.0), 999.9, 1, 1, 0.55, commanded=commanded, mistaken=mistaken
    )


@pytest.mark.parametrize("commanded", [True, False])
@pytest.mark.parametrize("before", [State.ARMED, State.HOLD, State.LAND, State.DESCEND])
def test_vehicle_of_an_earlier_process_is_landed_until_its_source_commands_again_if_that_counted(
    before: State, commanded: bool
) -> None:
    arbiter = taken_over(last_applied(before, commanded=commanded))
    assert (arbiter.state, arbiter.commanded) == (State.LAND, commanded)
    assert arbiter.reason == "taken over: by this gateway"


def test_descent_of_a_vehicle_that_was_mistaken_for_another_continues_open_loop() -> None:
    arbiter = taken_over(last_applied(State.DESCEND, commanded=True, mistaken=True))
    assert arbiter.state is State.DESCEND
    assert arbiter.pose_monitor.mistaken
    for frame in range(101, 120):
        now_s = 1000.0 + (frame - 100) * 0.02
        arbiter.pose(PoseInput("h1", 7, frame, (0.0, 0.0, 0.8), 0.02, 0.0), now_s)
        assert arbiter.step(now_s).state is State.DESCEND
