"""A gateway process that dies and is started again: what its vehicles do meanwhile and afterwards."""

from operator import call

import pytest
from restart_bench import LINE, Restart

from rcopterx.simulator.radio_receiver import ReceiverState
from rcopterx.transmitter_gateway.inputs import Action, CommandInput, State
from rcopterx.transmitter_gateway.serial_port import SerialPort


@pytest.mark.parametrize("seen", [True, False])
def test_flight_whose_thrust_was_low_for_a_moment_is_taken_over(restart: Restart, seen: bool) -> None:
    restart.height_m = 5.0  # so high that no thrust is too low
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
    assert restart.state is State.LAND  # the last pose that the earlier process received is not old
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
    restart.transmitter.port.close()
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
    assert restart.transmitter.arbiter.reason == "killed: by an earlier process"
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
    assert restart.transmitter.link(restart.now_s).text == "waiting for the own pose"
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
