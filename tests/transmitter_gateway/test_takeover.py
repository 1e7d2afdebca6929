"""A restarted gateway and vehicles that are still in the air."""

from operator import call

import pytest
from arbiter_bench import SLEW, U_HOVER
from msgspec import structs
from restart_bench import LINE, Restart

from rcopterx.simulator.radio_receiver import ReceiverState
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
)
from rcopterx.transmitter_gateway.limits import ArbiterLimits
from rcopterx.transmitter_gateway.serial_port import SerialPort

LAST_FLYING = LastApplied(
    State.ARMED, (0.1, 0.0, 0.56, 0.0), 9.6, lease=5, issued=6, hover_thrust=0.55, commanded=True, ready=True
)
NOW_S = 10.0


def restarted(height_m: float | None = 0.8, link: LinkState = LinkState.READY) -> Arbiter:
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


def test_a_taken_over_vehicle_nobody_commands_comes_down_and_is_cut_in_time() -> None:
    arbiter = restarted()
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


@pytest.mark.parametrize("seen", [True, False])
def test_flight_whose_thrust_was_low_for_a_moment_is_taken_over(restart: Restart, seen: bool) -> None:
    restart.fly()
    restart.run(0.2, thrust=0.0)
    assert restart.page.last is not None
    assert restart.page.last.u[2] == 0.0
    if not seen:
        restart.height_m = None
    restart.die(0.1)
    restart.run(0.1, thrust=None)
    assert restart.state is (State.LAND if seen else State.DESCEND)
    assert restart.transmitter.arbiter.commanded


@pytest.mark.parametrize("seen", [True, False])
def test_vehicle_that_stood_with_low_thrust_is_not_taken_over(restart: Restart, seen: bool) -> None:
    restart.run(1.5, thrust=0.0)
    assert restart.request(Action.ARM).accepted
    restart.run(0.1, thrust=0.0)
    if not seen:
        restart.height_m = None
    restart.die(0.1)
    restart.run(0.1, thrust=None)
    assert restart.state is State.DISARMED


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


def test_a_killed_and_restarted_gateway_never_switches_a_flying_vehicle_off(restart: Restart) -> None:
    restart.fly()
    restart.die(0.4)
    states = restart.run(1.0)
    assert restart.state is State.ARMED
    assert min(restart.throttle_us()) > 1480
    assert set(states) <= {ReceiverState.HOLD, ReceiverState.LINKED}


def test_the_agent_flies_again_with_its_first_command_after_a_restart(restart: Restart) -> None:
    restart.fly()
    restart.die(0.1)
    restart.run(0.04)
    assert restart.state is State.ARMED
    assert restart.counters["entered LAND"] == 1


def test_a_frame_is_written_at_once_without_pose_and_command(restart: Restart) -> None:
    restart.fly()
    restart.die(0.06)
    restart.tick()
    assert restart.state is State.DESCEND
    assert restart.page.last is not None
    assert restart.page.last.written_s == restart.now_s


def test_a_vehicle_that_is_seen_late_lands_closed_loop_and_flies_again(restart: Restart) -> None:
    restart.fly()
    restart.die(0.1)
    restart.height_m = None
    restart.run(0.4, thrust=None)
    restart.height_m = 0.8
    restart.run(0.1, thrust=None)
    assert restart.state is State.LAND
    restart.run(0.1)
    assert restart.state is State.ARMED
    assert min(restart.throttle_us()) > 1405  # 0.74 of the hover thrust


def test_successors_that_die_at_start_one_after_the_other_keep_the_vehicle_in_the_air(
    restart: Restart,
) -> None:
    restart.fly()
    restart.height_m = None
    for _ in range(3):
        restart.die(0.06)
        restart.run(0.02, thrust=None)
    restart.height_m = 0.8
    restart.run(0.2)
    assert restart.state is State.ARMED
    assert min(restart.throttle_us()) > 1480


def test_a_gateway_that_is_back_too_late_starts_disarmed(restart: Restart) -> None:
    restart.fly()
    restart.die(0.8)
    restart.run(1.0)
    assert restart.state is State.DISARMED
    assert set(map(round, restart.throttle_us())) == {1100}


def test_a_port_that_cannot_be_opened_at_first_is_taken_over_when_it_can(restart: Restart) -> None:
    restart.fly()
    other = SerialPort(str(restart.path), LINE, call)
    restart.transmitter.close()
    assert other.service(restart.now_s)
    restart.throttle_us()
    restart.start()
    restart.run(0.2)
    assert restart.transmitter.undecided
    other.close()
    restart.run(0.4)
    assert restart.state is State.ARMED
    assert min(restart.throttle_us()) > 1480


def test_a_port_that_stays_closed_is_given_up_in_time(restart: Restart) -> None:
    restart.fly()
    restart.radio.unplug()
    restart.die(0.1)
    restart.run(0.7)
    assert not restart.transmitter.undecided
    assert restart.state is State.DISARMED


def test_a_kill_outlives_a_restart_however_long_it_takes(restart: Restart) -> None:
    restart.fly()
    restart.request(Action.KILL)
    restart.run(0.1)
    restart.die(30.0)
    restart.run(1.0)
    assert restart.state is State.KILLED
    assert set(map(round, restart.throttle_us())) == {1100}


def test_a_kill_that_could_not_be_written_outlives_a_restart_and_a_reset_ends_it(restart: Restart) -> None:
    restart.radio.unplug()
    restart.run(0.1, thrust=0.0)
    restart.request(Action.KILL)
    restart.tick()
    restart.die(1.0)
    assert restart.state is State.KILLED
    assert restart.request(Action.RESET).accepted
    restart.tick()
    restart.die(1.0)
    assert restart.state is State.DISARMED


def test_a_kill_while_it_is_undecided_counts_and_is_written_at_once(restart: Restart) -> None:
    restart.fly()
    restart.lose_page()
    restart.die(0.1)
    restart.height_m = None
    restart.run(0.06)
    assert restart.transmitter.undecided
    restart.request(Action.KILL)
    restart.run(0.1)
    assert restart.state is State.KILLED
    assert set(map(round, restart.throttle_us())) == {1100}


def test_agents_keep_their_lease_and_the_next_one_gets_the_next_number(restart: Restart) -> None:
    restart.fly()
    restart.die(0.1)
    restart.run(0.1)
    assert (restart.transmitter.arbiter.leases.commanding, restart.transmitter.arbiter.leases.issued) == (
        1,
        1,
    )
    assert restart.transmitter.bid(2, restart.now_s, take_over=True) == 2
    restart.die(0.1)
    assert restart.transmitter.arbiter.leases.issued == 2


class KilledError(Exception):
    """The process ends while it writes a frame."""


def test_delayed_command_of_an_earlier_lease_does_not_count_after_a_kill_while_a_later_one_is_written(
    restart: Restart, monkeypatch: pytest.MonkeyPatch
) -> None:
    restart.fly()
    assert restart.transmitter.bid(2, restart.now_s, take_over=True) == 2

    def killed(frame: bytes, now_s: float) -> None:
        raise KilledError

    monkeypatch.setattr(restart.transmitter.port, "write_frame", killed)
    u = (0.0, 0.0, 0.55, 0.0)
    command = CommandInput(2, 1, 1, restart.sequence, u)
    assert restart.transmitter.on_command(command, restart.now_s).accepted
    with pytest.raises(KilledError):
        restart.tick(0.01)
    restart.die(0.04)
    delayed = CommandInput(1, 1, restart.sequence + 1, restart.sequence, u)
    assert restart.transmitter.on_command(delayed, restart.now_s).reason == "control lease lost"


def test_kill_that_was_answered_outlives_the_process_at_once(restart: Restart) -> None:
    restart.fly()
    assert restart.request(Action.KILL).accepted
    restart.die(0.04)
    assert restart.state is State.KILLED


def test_a_lost_page_leaves_the_radio_silent_until_the_vehicle_is_seen_and_lands_it(restart: Restart) -> None:
    restart.fly()
    restart.lose_page()
    restart.die(0.1)
    restart.height_m = None
    restart.run(0.3)
    assert not restart.throttle_us()
    assert restart.transmitter.snapshot(restart.now_s).module == "waiting for the own pose"
    restart.height_m = 0.8
    restart.run(0.2)
    assert restart.state is State.LAND
    frames = restart.radio.link.take_frames()
    assert min(frame.pulses_us[0] for frame in frames) > 1480
    assert all(abs(pulse - 1500) < 20 for pulse in frames[0].pulses_us[1:4])
    assert restart.counters["last state unknown"] == 1


def test_a_successor_distrusts_poses_that_its_predecessor_distrusted(restart: Restart) -> None:
    restart.fly()
    restart.height_m = 1.8
    restart.run(0.4)
    assert restart.state is State.DESCEND
    restart.die(0.1)
    restart.run(0.2)
    assert restart.state is State.DESCEND


def test_a_kill_by_an_earlier_process_is_shown_as_such(restart: Restart) -> None:
    restart.fly()
    restart.request(Action.KILL)
    restart.run(0.1)
    restart.die(0.1)
    assert restart.transmitter.arbiter.reason == "killed: by an earlier process"


def test_a_lost_page_of_a_vehicle_on_the_floor_leaves_it_disarmed_and_ready(restart: Restart) -> None:
    restart.height_m = 0.02
    restart.run(1.0, thrust=0.0)
    restart.lose_page()
    restart.die(0.1)
    restart.run(1.0, thrust=0.0)
    assert restart.state is State.DISARMED
    assert set(map(round, restart.throttle_us())) == {1100}
    assert restart.request(Action.ARM).accepted


def test_a_lost_page_of_a_vehicle_that_is_not_seen_ends_in_throttle_low(restart: Restart) -> None:
    restart.fly()
    restart.lose_page()
    restart.die(0.1)
    restart.height_m = None
    limit_s = restart.transmitter.arbiter.limits.take_over_s
    assert restart.transmitter.next_deadline_s() == pytest.approx(restart.now_s + limit_s)
    restart.run(limit_s - 0.02)
    assert not restart.throttle_us()
    restart.run(0.04)
    restart.height_m = 0.8
    restart.run(0.3)
    assert restart.state is State.DISARMED
    assert set(map(round, restart.throttle_us())) == {1100}


def test_leases_after_a_lost_page_are_later_than_all_before(restart: Restart) -> None:
    restart.fly()
    restart.lose_page()
    restart.die(0.1)
    restart.run(0.2)
    assert restart.transmitter.bid(2, restart.now_s, take_over=True) > 1000


def test_a_shutdown_continues_after_a_restart_and_commands_do_not_end_it(restart: Restart) -> None:
    restart.fly()
    restart.request(Action.SHUTDOWN)
    restart.run(0.1)
    assert restart.state is State.LAND
    restart.die(0.1)
    restart.run(0.3)
    assert restart.state is State.LAND
