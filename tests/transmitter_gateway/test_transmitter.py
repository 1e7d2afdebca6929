import statistics
from itertools import pairwise
from pathlib import Path

import pytest
from support.radios import serve
from transmitter_bench import FRAME_S, HOVER, IDLE, Bench, settings_of

from rcopterx.radios.calibration import (
    ArmingChannel,
    Calibration,
    SwitchChannel,
    ThrottleCalibration,
)
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.simulator.radio_module import SerialFrame
from rcopterx.transmitter_gateway.inputs import Action, CommandInput, LinkState, PoseInput, State
from rcopterx.transmitter_gateway.port import WriteOutcome
from rcopterx.transmitter_gateway.transmitter import Transmitter


def intervals(frames: list[SerialFrame]) -> list[float]:
    return [b.arrival_s - a.arrival_s for a, b in pairwise(frames)]


def test_frames_are_kept_alive_before_anybody_commands(bench: Bench) -> None:
    bench.run(2.0, None)
    assert intervals(bench.frames) == pytest.approx([0.025] * (len(bench.frames) - 1), abs=1e-4)
    assert set(bench.received()) == {1100}
    assert bench.state is State.DISARMED
    assert bench.transmitter.link(bench.now_s).state is LinkState.READY
    assert bench.transmitter.link(bench.now_s).text == "module 1.3.4.72 ready, DSM 2 1F"


def test_accepted_commands_are_written_on_arrival(bench: Bench) -> None:
    bench.fly()
    first = bench.sequence
    bench.run(1.0)
    bench.settle()
    commands = bench.sequence - first
    assert len(bench.frames) == commands
    assert intervals(bench.frames) == pytest.approx([0.02] * (commands - 1), abs=1e-6)
    write = bench.writes[-1]
    assert write.output.u == HOVER
    assert write.output.cause is not None
    assert write.output.cause.sequence == bench.sequence
    assert bench.frames[-1].arrival_s == pytest.approx(write.time_s + FRAME_S)


def test_commands_of_50_hz_with_2_ms_of_jitter_are_never_delayed_by_a_keepalive(bench: Bench) -> None:
    bench.fly()
    for n in range(50):
        bench.next_command_s = bench.now_s + 0.02 + (0.002 if n % 2 else -0.002)
        bench.run(bench.next_command_s + 0.001 - bench.now_s)
        assert bench.writes[-1].time_s == pytest.approx(bench.now_s - 0.001)


def test_frames_never_come_closer_than_the_receiver_needs(bench: Bench) -> None:
    bench.fly()
    bench.run(1.0, HOVER, period_s=0.003)
    gaps = intervals(bench.frames)
    assert min(gaps) >= FRAME_S + 0.001 - 1e-6
    assert max(gaps) <= 0.007
    assert bench.radio.link.module.rejected["wrong length"] == 0


def test_rejected_commands_write_nothing_and_feed_nothing(bench: Bench) -> None:
    bench.fly()
    for _ in range(250):
        bench.run(0.02, None)
        bench.sequence += 1
        bench.transmitter.on_pose(PoseInput("h1", 1, bench.sequence, (0, 0, 1), 0.02), bench.now_s)
        bad = CommandInput(1, 1, bench.sequence, 0, (float("nan"), 0, 0.5, 0))
        assert not bench.transmitter.on_command(bad, bench.now_s).accepted
        bench.exchange()
    assert bench.state is State.CUT
    assert bench.transmitter.arbiter.counters["command not finite"] == 250


def test_own_poses_are_judged_by_the_next_tick(bench: Bench) -> None:
    bench.fly()
    bench.sequence += 1
    bench.transmitter.on_pose(PoseInput("h2", 1, bench.sequence, (0, 0, 1), 0.02), bench.now_s)
    assert bench.transmitter.next_deadline_s() > bench.now_s
    bench.transmitter.on_pose(PoseInput("h1", 1, bench.sequence, (0, 0, 1), 0.02), bench.now_s)
    assert bench.transmitter.next_deadline_s() < bench.now_s


def test_commands_are_obeyed_at_once_after_a_pause_in_which_the_module_received_no_frames(
    bench: Bench,
) -> None:
    bench.fly()
    module_s = bench.now_s
    bench.now_s += 0.6
    while module_s < bench.now_s:
        module_s += 0.01
        serve(bench.radio, module_s)
    bench.exchange()
    assert bench.state is not State.ARMED
    bench.next_command_s = bench.now_s
    bench.run(0.1)
    assert bench.state is State.ARMED


def test_silent_commands_hold_descend_and_cut_on_the_wire(bench: Bench) -> None:
    bench.fly()
    start_s = bench.now_s
    while bench.state is not State.CUT and bench.now_s < start_s + 6:
        bench.sequence += 1
        bench.transmitter.on_pose(PoseInput("h1", 1, bench.sequence, (0, 0, 1), 0.02), bench.now_s)
        bench.run(0.02, None)
    limits = ArbiterLimits()
    longest_s = limits.descend_after_s + limits.descents_s(0.6)[1]
    assert bench.now_s - start_s == pytest.approx(longest_s, abs=0.05)
    bench.settle()
    throttle = bench.received()
    assert throttle[0] == 1540
    assert statistics.mode(throttle[:-1]) == pytest.approx(1425, abs=2)
    assert throttle[-1] == 1100
    assert throttle == sorted(throttle, reverse=True)


def test_a_kill_is_written_at_once_and_reaches_the_vehicle(bench: Bench) -> None:
    bench.fly()
    bench.request(Action.KILL)
    bench.run(0.06)
    assert bench.frames[-1].kill
    killed_s = next(frame.arrival_s for frame in bench.frames if frame.kill)
    assert bench.now_s - 0.06 <= killed_s <= bench.now_s - 0.06 + 0.0088
    assert bench.radio.link.receiver.pulses_us(bench.now_s)[0] < 910
    bench.run(1.0, IDLE)
    bench.request(Action.RESET)
    bench.run(0.1, IDLE)
    assert not bench.frames[-1].kill


def test_a_flight_controller_is_armed_for_the_flight_only_and_released_with_the_kill(tmp_path: Path) -> None:
    arming, emergency = ArmingChannel(4), SwitchChannel(5)
    bench = Bench(tmp_path / "radio", Calibration(arming=arming, emergency=emergency))
    try:
        bench.settle()
        assert not any(arming.is_on(frame.pulses_us) for frame in bench.frames)
        bench.fly(after_s=6.5)
        bench.run(0.5)
        flown = bench.frames[-1].pulses_us
        assert arming.is_on(flown)
        assert flown[0] > 1500.0
        bench.request(Action.KILL)
        bench.run(0.05, None)
        killed = next(frame.pulses_us for frame in bench.frames if frame.kill)
        assert (arming.is_on(killed), emergency.is_on(killed)) == (False, True)
        assert killed[0] == pytest.approx(1100.0, abs=1.0)
    finally:
        bench.close()


def test_a_flight_controller_sees_its_arming_channel_off_before_it_can_be_armed(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "radio", Calibration(arming=ArmingChannel(4)))
    try:
        bench.run(5.5, IDLE)
        assert not bench.request(Action.ARM).accepted
        text = bench.transmitter.link(bench.now_s).text
        assert text == "waiting until the receiver has found the radio"
        assert bench.transmitter.link(bench.now_s).state is LinkState.UP
        bench.run(1.0, IDLE)
        assert bench.request(Action.ARM).accepted
    finally:
        bench.close()


def test_shutdown_lands_sends_at_least_25_low_frames_and_finishes(bench: Bench) -> None:
    bench.fly()
    bench.request(Action.SHUTDOWN)
    assert not bench.transmitter.finished
    bench.run(1.75)
    assert bench.state is State.DESCEND
    bench.received()
    for _ in range(400):
        bench.run(0.01)
        if bench.transmitter.finished:
            break
    assert bench.transmitter.finished
    bench.settle()
    low = [throttle for throttle in bench.received() if throttle == 1100]
    assert 30 <= len(low) <= 32


def test_disarmed_vehicles_get_throttle_low_without_trim_also_in_bind_frames(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "h1")
    calibration = Calibration(throttle=ThrottleCalibration(us0=1180))
    bench.transmitter = Transmitter(settings_of(calibration), bench.port)
    bench.transmitter.arbiter.bid(1, bench.now_s, take_over=False)
    bench.run(1.0, IDLE)
    assert bench.transmitter.bind(bench.now_s).accepted
    bench.run(1.0, IDLE)
    assert any(frame.bind for frame in bench.frames)
    bench.run(12.0, IDLE)
    assert not bench.transmitter.busy(bench.now_s)
    assert set(bench.received()) == {1100}
    bench.request(Action.ARM)
    bench.run(0.1, IDLE)
    assert bench.received()[-1] == 1180
    bench.request(Action.SHUTDOWN)
    bench.run(0.9, None)
    assert bench.received()[-25:] == [1100] * 25
    assert bench.transmitter.finished
    bench.close()


def test_shutdown_without_a_port_finishes_at_once(bench: Bench) -> None:
    bench.radio.unplug()
    bench.run(0.3, None)
    bench.request(Action.SHUTDOWN)
    assert bench.transmitter.finished


def test_long_unplugging_in_flight_disarms_and_replugging_needs_a_ready_module_and_arming(
    bench: Bench,
) -> None:
    bench.fly()
    bench.radio.unplug()
    bench.run(0.75)
    assert bench.state is State.DISARMED
    assert bench.transmitter.link(bench.now_s).state is LinkState.LOST
    assert "h1" in bench.transmitter.link(bench.now_s).text
    bench.radio.replug(bench.now_s)
    bench.received()
    bench.run(0.17, IDLE)
    assert bench.port.is_open
    assert bench.transmitter.link(bench.now_s).state is LinkState.UP
    assert bench.request(Action.ARM).reason.startswith(
        "missing: commanded thrust low long enough; missing: transmitter ready: "
    )
    bench.run(1.0)
    assert bench.state is State.DISARMED
    assert set(bench.received()) <= {1100}
    bench.run(1.0, IDLE)
    assert bench.request(Action.ARM).accepted


def test_openings_states_and_frames_are_counted_and_planned_inputs_show(bench: Bench) -> None:
    bench.fly()
    bench.sequence += 1
    rows = ((0.0, 0.0, 0.55, 0.0),) * 5
    command = CommandInput(1, 1, bench.sequence, bench.sequence, HOVER, rows)
    assert bench.transmitter.on_command(command, bench.now_s).accepted
    bench.run(0.07, None)
    assert bench.transmitter.arbiter.reason == "armed: by operator"
    assert bench.transmitter.output.bridging_step > 0
    assert bench.port.counters["openings"] == 1
    assert bench.transmitter.arbiter.counters["entered ARMED"] == 1
    assert bench.port.counters["frames written"] == len(bench.writes)


def test_full_port_is_tried_again_and_then_given_up(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.fly()
    monkeypatch.setattr(bench.port, "write_frame", lambda frame, now_s: WriteOutcome.SHORT)
    bench.run(0.02)
    assert bench.transmitter.next_deadline_s() <= bench.now_s + 0.005


def test_poses_of_others_are_not_acted_on_before_the_own_turn(bench: Bench) -> None:
    bench.fly()
    for _ in range(3):
        bench.sequence += 1
        bench.transmitter.on_pose(PoseInput("h2", 1, bench.sequence, (0.1, 0, 0.6), 0.02), bench.now_s)
    bench.run(0.05)
    assert bench.state is State.HOLD
