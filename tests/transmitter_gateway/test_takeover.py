"""A restarted gateway and vehicles that are still in the air."""

import pytest
from arbiter_bench import SLEW, U_HOVER
from msgspec import structs

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import (
    Action,
    ActionRequest,
    Answer,
    CommandInput,
    LastApplied,
    LinkState,
    PoseInput,
    State,
    Track,
)
from rcopterx.vehicles.lift_off import LiftOffLimits

LAST_FLYING = LastApplied(
    State.ARMED, (0.1, 0.0, 0.56, 0.0), 9.6, lease=5, issued=6, hover_thrust=0.55, commanded=True, ready=True
)
NOW_S = 10.0


def restarted(height_m: float | None = 0.6, link: LinkState = LinkState.READY) -> Arbiter:
    arbiter = Arbiter("h1", ArbiterLimits(), U_HOVER, SLEW)
    arbiter.link(link)
    if height_m is not None:
        arbiter.pose(PoseInput("h1", 7, 100, (0.0, 0.0, height_m), 0.02), NOW_S)
    return arbiter


def take_over(arbiter: Arbiter, **changes: object) -> Answer:
    last = structs.replace(LAST_FLYING, **changes)
    arbiter.leases.resume(last.lease, last.issued, NOW_S)
    return arbiter.take_over(last, NOW_S)


def command(arbiter: Arbiter, lease: int, now_s: float, sequence: int = 1) -> None:
    arbiter.command(CommandInput(lease, 7, sequence, 100, (0.0, 0.0, 0.55, 0.0)), now_s)
    arbiter.step(now_s)


def test_a_flying_vehicle_is_taken_over_descending_from_the_thrust_that_acts() -> None:
    arbiter = restarted()
    answer = take_over(arbiter, u=(0.3, -0.2, 0.52, 0.1))
    assert answer == Answer(True, "DESCEND: taken over: by this gateway")
    output = arbiter.step(NOW_S + 0.01)
    assert output.state is State.DESCEND
    assert output.u == pytest.approx((0.0, 0.0, 0.515, 0.0))
    assert arbiter.commanded


@pytest.mark.parametrize(("known_s", "share"), [(0.0, 0.15), (9.0, 0.15 * 0.2 / 9.2)])
def test_a_vehicle_that_is_not_seen_again_sinks_as_under_the_process_that_had_learned_its_thrust(
    known_s: float, share: float
) -> None:
    arbiter = restarted(height_m=None)
    assert take_over(arbiter, hover_known_s=known_s).accepted
    for step in range(100):
        output = arbiter.step(NOW_S + 0.01 * step)
    below = ArbiterLimits().descend_below_hover
    assert output.u[2] == pytest.approx(LAST_FLYING.hover_thrust * (1.0 - below - share), abs=1e-3)


def test_more_thrust_than_needed_to_hover_is_not_taken_over() -> None:
    arbiter = restarted()
    take_over(arbiter, u=(0.0, 0.0, 1.0, 0.0))
    assert arbiter.step(NOW_S).u[2] == U_HOVER


def test_the_earlier_agent_flies_on_with_its_next_command_and_nobody_before_it_does() -> None:
    arbiter = restarted()
    take_over(arbiter)
    command(arbiter, LAST_FLYING.lease - 1, NOW_S + 0.01)
    assert arbiter.state is State.DESCEND
    command(arbiter, LAST_FLYING.lease, NOW_S + 0.02)
    assert arbiter.state is State.ARMED


def test_a_still_vehicle_with_an_empty_battery_is_not_taken_for_another_body_after_a_restart() -> None:
    weak = 0.8  # thrust that carries it now
    arbiter = Arbiter("h1", ArbiterLimits(lift_off=LiftOffLimits(hover_thrust=U_HOVER)), U_HOVER, SLEW)
    arbiter.link(LinkState.READY)
    assert take_over(arbiter, u=(0.0, 0.0, weak, 0.0), hover_thrust=weak).accepted
    for number in range(100):
        now_s = NOW_S + 0.02 * number
        place = (0.0, 0.0, 0.8 + 1e-4 * (number % 3))
        arbiter.pose(PoseInput("h1", 7, 100 + number, place, 0.02), now_s)
        arbiter.command(CommandInput(5, 7, 1 + number, 100 + number, (0.0, 0.0, weak, 0.0)), now_s)
        arbiter.step(now_s)
    assert arbiter.state is State.ARMED


def test_a_taken_over_vehicle_nobody_commands_comes_down_and_is_cut_in_time() -> None:
    arbiter = restarted(0.11)
    take_over(arbiter)
    limits = arbiter.limits
    over_s = NOW_S + limits.cut_after_s - limits.descend_after_s
    assert arbiter.step(over_s - 0.01).state is State.DESCEND
    assert arbiter.step(over_s + 0.01).state is State.CUT


def test_a_landing_that_commands_do_not_end_goes_on_to_its_end() -> None:
    arbiter = restarted()
    assert take_over(arbiter, state=State.LAND, commanded=False).accepted
    command(arbiter, LAST_FLYING.lease, NOW_S + 0.02)
    assert arbiter.state is State.DESCEND
    assert not arbiter.commanded


def test_a_vehicle_that_is_not_seen_yet_is_taken_over_too() -> None:
    arbiter = restarted(None)
    assert take_over(arbiter).accepted
    assert arbiter.state is State.DESCEND
    command(arbiter, LAST_FLYING.lease, NOW_S + 0.02)
    arbiter.pose(PoseInput("h1", 7, 100, (0.0, 0.0, 0.8), 0.02), NOW_S + 0.03)
    assert arbiter.step(NOW_S + 0.03).state is State.ARMED


def test_a_vehicle_is_taken_over_to_land_while_the_process_shuts_down() -> None:
    arbiter = restarted()
    arbiter.request(ActionRequest(Action.SHUTDOWN, "gateway"), NOW_S)
    assert take_over(arbiter).accepted
    command(arbiter, LAST_FLYING.lease, NOW_S + 0.02)
    assert arbiter.state is State.DESCEND


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"written_s": NOW_S - 0.7}, "no frames for 0.70 s, longer than 0.7 s"),
        ({"grounded": True}, "it stood on the floor"),
        ({"state": State.DISARMED}, "DISARMED before"),
        ({"state": State.CUT}, "CUT before"),
    ],
)
def test_what_is_not_certainly_a_flight_stays_disarmed(changes: dict[str, object], words: str) -> None:
    arbiter = restarted()
    answer = take_over(arbiter, **changes)
    assert not answer.accepted
    assert answer.reason.startswith(words)
    assert arbiter.reason == f"not taken over: {answer.reason}"
    assert arbiter.state is State.DISARMED
    assert not arbiter.commanded
    take_over(arbiter, **changes)
    assert arbiter.counters["refused: take over"] == 2


@pytest.mark.parametrize(
    ("height_m", "link", "words"),
    [
        (0.09, LinkState.READY, "it may stand on the floor"),
        (0.1, LinkState.LOST, "serial link lost"),
        (0.8, LinkState.LOST, "serial link lost"),
    ],
)
def test_poses_and_port_have_to_agree(height_m: float | None, link: LinkState, words: str) -> None:
    arbiter = restarted(height_m, link)
    answer = take_over(arbiter)
    assert (answer.accepted, answer.reason) == (False, words)
    assert arbiter.state is State.DISARMED
    assert not arbiter.commanded


def test_an_armed_vehicle_cannot_be_taken_over_a_second_time() -> None:
    arbiter = restarted()
    take_over(arbiter)
    command(arbiter, LAST_FLYING.lease, NOW_S + 0.02)
    assert not take_over(arbiter).accepted
    assert arbiter.state is State.ARMED


AGO_S = 0.5
"""For so long no process of the gateway received a pose."""


def seen_before(velocity_x_m_s: float = 0.0, yaw_rad: float | None = 0.0, height_m: float = 0.6) -> Track:
    seen_s = NOW_S - AGO_S
    return Track(
        7,
        75,
        seen_s,
        position_m=(0.0, 0.0, height_m),
        seen_s=seen_s,
        seen_frame=75,
        seen_epoch=7,
        velocity_m_s=(velocity_x_m_s, 0.0, 0.0),
        yaw_rad=yaw_rad,
        captured_s=seen_s,
    )


def commanded(arbiter: Arbiter, x_m: float, yaw_rad: float = 0.0, seconds: float = 0.5) -> None:
    """Let the earlier agent command while the poses are at `x_m`."""
    for number in range(1, round(seconds / 0.02) + 1):
        now_s = NOW_S + 0.02 * number
        place = (x_m, 0.0, 0.6 + 1e-4 * (number % 3))
        arbiter.pose(PoseInput("h1", 7, 100 + number, place, 0.02, yaw_rad), now_s)
        command = CommandInput(5, 7, number, 100 + number, (0.0, 0.0, 0.55, 0.0))
        arbiter.command(command, now_s)
        arbiter.step(now_s)


@pytest.mark.parametrize("early", [False, True], ids=["seen after", "seen before the take-over"])
@pytest.mark.parametrize("x_m", [1.0, -1.0])
def test_another_body_that_is_seen_first_after_a_restart_is_not_believed(x_m: float, early: bool) -> None:
    arbiter = restarted(height_m=None)
    if early:
        arbiter.pose(PoseInput("h1", 7, 100, (x_m, 0.0, 0.6), 0.02, 0.0), NOW_S)
    assert take_over(arbiter, track=seen_before()).accepted
    commanded(arbiter, x_m)
    assert arbiter.state is State.DESCEND
    assert arbiter.pose_monitor.mistaken


@pytest.mark.parametrize("early", [False, True], ids=["seen after", "seen before the take-over"])
@pytest.mark.parametrize(
    ("velocity_m_s", "x_m"), [(0.0, 0.5), (0.0, -0.5), (1.5, 0.75), (1.5, 0.2), (1.5, 1.2)]
)
def test_a_vehicle_that_moved_on_during_a_restart_is_believed(
    velocity_m_s: float, x_m: float, early: bool
) -> None:
    arbiter = restarted(height_m=None)
    if early:
        arbiter.pose(PoseInput("h1", 7, 100, (x_m, 0.0, 0.6), 0.02, 0.0), NOW_S)
    assert take_over(arbiter, track=seen_before(velocity_m_s)).accepted
    commanded(arbiter, x_m)
    assert arbiter.state is State.ARMED
    assert arbiter.counters["pose jump"] == 0


def test_a_heading_that_jumped_during_a_restart_is_not_believed() -> None:
    arbiter = restarted(height_m=None)
    assert take_over(arbiter, track=seen_before()).accepted
    commanded(arbiter, 0.0, yaw_rad=3.0)
    assert arbiter.state is State.LAND
    assert arbiter.pose_monitor.mistaken


def test_a_flight_goes_on_from_what_an_earlier_process_believed_of_an_occluded_vehicle() -> None:
    arbiter = restarted(height_m=None)
    arbiter.pose(PoseInput("h1", 7, 100, None, 0.02), NOW_S)
    assert take_over(arbiter, track=seen_before()).accepted
    commanded(arbiter, 0.1)
    assert arbiter.state is State.ARMED
