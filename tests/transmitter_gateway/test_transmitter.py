import select
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from operator import call
from pathlib import Path

import pytest

from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_module import SerialFrame
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.transmitter_gateway.calibration import (
    ArmingChannel,
    Calibration,
    ChannelCalibration,
    SwitchChannel,
    ThrottleCalibration,
)
from rcopterx.transmitter_gateway.inputs import (
    Action,
    ActionRequest,
    Answer,
    CommandInput,
    LinkState,
    PoseInput,
    State,
)
from rcopterx.transmitter_gateway.limits import ArbiterLimits
from rcopterx.transmitter_gateway.port import WriteOutcome
from rcopterx.transmitter_gateway.protocols.base import (
    ProtocolError,
    PulseRangeError,
    RadioProtocol,
    SerialLine,
)
from rcopterx.transmitter_gateway.protocols.dsm2_serial import Dsm2SerialProtocol
from rcopterx.transmitter_gateway.protocols.multi import MultiProtocol, MultiSettings
from rcopterx.transmitter_gateway.protocols.ppm import PpmGenProtocol
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.snapshot import Write
from rcopterx.transmitter_gateway.transmitter import Transmitter

LINE = SerialLine(100_000, "N", 2)
IDLE = (0.0, 0.0, 0.0, 0.0)
HOVER = (0.1, -0.1, 0.55, 0.05)
FRAME_S = 27 * 120e-6


def settings_of(calibration: Calibration, protocol: RadioProtocol | None = None) -> TransmitterSettings:
    protocol = protocol or MultiProtocol(MultiSettings(rx_num=3), LINE)
    return TransmitterSettings("h1", "/nonexistent", protocol, calibration, ArbiterLimits())


class Bench:
    """Transmitter and emulated radio on a pseudo-terminal, driven in virtual time."""

    def __init__(self, path: Path, calibration: Calibration | None = None) -> None:
        self.now_s = 0.0
        self.radio = RadioPty(path, RadioLink(MultiModule(0.0), Receiver(3, connect_s=0.0)))
        self.port = SerialPort(str(path), LINE, call)
        self.transmitter = Transmitter(settings_of(calibration or Calibration()), self.port)
        self.transmitter.arbiter.bid(1, 0.0, take_over=False)
        self.sequence = 0
        self.next_command_s = 0.02
        self.frames: list[SerialFrame] = []
        self.writes: list[Write] = []

    def close(self) -> None:
        self.transmitter.close()
        self.radio.close()

    @property
    def state(self) -> State:
        return self.transmitter.arbiter.state

    def exchange(self) -> None:
        """Let what was written arrive and what is answered be read."""
        self._tick()
        self.radio.service(self.now_s)
        self.frames += self.radio.link.take_frames()
        descriptor = self.port.fileno()
        if descriptor is not None and select.select([descriptor], [], [], 0)[0]:
            self.transmitter.on_readable(self.now_s)
            self._tick()

    def _tick(self) -> None:
        write = self.transmitter.tick(self.now_s)
        if write is None or write.outcome is not WriteOutcome.WRITTEN:
            return
        self.writes.append(write)
        if self.radio.is_open:
            assert select.select([self.radio.fileno()], [], [], 5.0)[0]

    def command(self, u: tuple[float, ...] = HOVER) -> Answer:
        self.sequence += 1
        pose = PoseInput("h1", 1, self.sequence, (0.0, 0.0, 1.0), 0.02)
        self.transmitter.on_pose(pose, self.now_s)
        self._tick()
        answer = self.transmitter.on_command(CommandInput(1, 1, self.sequence, self.sequence, u), self.now_s)
        self.exchange()
        return answer

    def tick(self) -> None:
        self.exchange()

    def run(self, seconds: float, u: tuple[float, ...] | None = HOVER, period_s: float = 0.02) -> None:
        end_s = self.now_s + seconds
        while True:
            due_s = max(self.transmitter.next_deadline_s(), self.now_s)
            command_s = max(self.next_command_s, self.now_s) if u is not None else end_s
            if min(due_s, command_s) >= end_s:
                break
            if command_s <= due_s and u is not None:
                self.now_s = command_s
                self.next_command_s = command_s + period_s
                self.command(u)
            else:
                self.now_s = due_s + 1e-9
                self.tick()
        self.now_s = end_s
        self.exchange()

    def settle(self) -> None:
        """Let the last frame arrive."""
        self.run(0.005, None)

    def request(self, action: Action) -> Answer:
        answer = self.transmitter.request(ActionRequest(action, "operator"), self.now_s)
        self.exchange()
        return answer

    def fly(self, after_s: float = 1.2) -> "Bench":
        self.run(after_s, IDLE)
        assert self.request(Action.ARM).accepted
        self.run(0.5)
        assert self.state is State.ARMED
        self.frames.clear()
        return self

    def received(self) -> list[float]:
        """Throttle pulse widths of the frames accepted since the last call [us]."""
        frames, self.frames = self.frames, []
        return [round(frame.pulses_us[0]) for frame in frames]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path / "h1")
    yield bench
    bench.close()


def intervals(frames: list[SerialFrame]) -> list[float]:
    return [b.arrival_s - a.arrival_s for a, b in pairwise(frames)]


def test_frames_are_kept_alive_before_anybody_commands(bench: Bench) -> None:
    bench.run(2.0, None)
    assert intervals(bench.frames) == pytest.approx([0.025] * (len(bench.frames) - 1), abs=1e-4)
    assert set(bench.received()) == {1100}
    status = bench.transmitter.snapshot(bench.now_s)
    assert (status.state, status.link, status.binding) == (State.DISARMED, LinkState.READY, False)
    assert status.module == "module 1.3.4.72 ready, DSM 2 1F"


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
    for _ in range(100):
        bench.run(0.02, None)
        bench.sequence += 1
        bench.transmitter.on_pose(PoseInput("h1", 1, bench.sequence, (0, 0, 1), 0.02), bench.now_s)
        bad = CommandInput(1, 1, bench.sequence, 0, (float("nan"), 0, 0.5, 0))
        assert not bench.transmitter.on_command(bad, bench.now_s).accepted
        bench.exchange()
    assert bench.state is State.CUT
    assert bench.transmitter.snapshot(bench.now_s).counters["command not finite"] == 100


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
        bench.radio.service(module_s)
    bench.exchange()
    assert bench.state is not State.ARMED
    bench.next_command_s = bench.now_s
    bench.run(0.1)
    assert bench.state is State.ARMED


def test_silent_commands_hold_descend_and_cut_on_the_wire(bench: Bench) -> None:
    bench.fly()
    start_s = bench.now_s
    while bench.state is not State.CUT and bench.now_s < start_s + 3:
        bench.sequence += 1
        bench.transmitter.on_pose(PoseInput("h1", 1, bench.sequence, (0, 0, 1), 0.02), bench.now_s)
        bench.run(0.02, None)
    assert bench.now_s - start_s == pytest.approx(2.0, abs=0.05)
    bench.settle()
    throttle = bench.received()
    assert throttle[0] == 1540
    assert sorted(set(throttle), reverse=True)[-2:] == pytest.approx([1425, 1100], abs=2)
    assert throttle == sorted(throttle, reverse=True)


def test_a_kill_is_written_at_once_and_reaches_the_vehicle(bench: Bench) -> None:
    bench.fly()
    bench.request(Action.KILL)
    bench.run(0.06)
    assert bench.frames[-1].kill
    killed_s = next(frame.arrival_s for frame in bench.frames if frame.kill)
    assert bench.now_s - 0.06 <= killed_s <= bench.now_s - 0.06 + 0.0088
    assert bench.radio.link.receiver.output(bench.now_s).pulses_us[0] < 910
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
        searching = bench.transmitter.snapshot(bench.now_s)
        assert searching.module == "waiting until the receiver has found the radio"
        assert searching.link is LinkState.UP
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
    for _ in range(200):
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
    status = bench.transmitter.snapshot(bench.now_s)
    assert status.link is LinkState.LOST
    assert "h1" in status.module
    bench.radio.replug(bench.now_s)
    bench.received()
    bench.run(0.17, IDLE)
    assert bench.port.is_open
    assert bench.transmitter.snapshot(bench.now_s).link is LinkState.UP
    assert (
        bench.request(Action.ARM).reason
        == "missing: commanded thrust low long enough; missing: transmitter ready"
    )
    bench.run(1.0)
    assert bench.state is State.DISARMED
    assert set(bench.received()) <= {1100}
    bench.run(1.0, IDLE)
    assert bench.request(Action.ARM).accepted


def test_binding_ends_when_the_module_is_done_and_settles_for_5_s(bench: Bench) -> None:
    receiver = bench.radio.link.receiver
    receiver.enter_bind_mode()
    bench.run(1.5, IDLE)
    assert bench.transmitter.bind(bench.now_s).accepted
    started_s = bench.now_s
    bench.run(0.2, IDLE)
    assert bench.frames[-1].bind
    assert bench.transmitter.snapshot(bench.now_s).binding
    while bench.transmitter.snapshot(bench.now_s).binding:
        bench.run(0.1, IDLE)
        assert bench.now_s < started_s + 7.5
    assert bench.now_s - started_s == pytest.approx(6.03, abs=0.6)
    assert receiver.model_match == 3
    assert bench.transmitter.snapshot(bench.now_s).link is LinkState.UP
    assert not bench.request(Action.ARM).accepted
    bench.run(0.1, IDLE)
    assert not bench.frames[-1].bind
    bench.run(5.2, IDLE)
    assert bench.request(Action.ARM).accepted


def test_bind_is_given_up_after_7_s_when_the_module_never_says_it_is_done(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    bench.transmitter.bind(bench.now_s)
    bench.port.read_available = lambda now_s: b""  # type: ignore[method-assign]  # its answers stop
    bench.run(6.9, IDLE)
    assert bench.transmitter.snapshot(bench.now_s).binding
    bench.run(0.2, IDLE)
    assert not bench.transmitter.snapshot(bench.now_s).binding


def test_binding_and_range_check_are_refused_in_flight_and_without_a_port(bench: Bench) -> None:
    bench.fly()
    transmitter = bench.transmitter
    for what, refused in (
        ("binding", transmitter.bind(bench.now_s)),
        ("range check", transmitter.range_check(True)),
        ("calibration", transmitter.show(IDLE)),
    ):
        assert refused == Answer(False, f"{what} is only possible while DISARMED, not ARMED")
    assert not transmitter.busy(bench.now_s)
    bench.radio.unplug()
    bench.run(0.75)
    assert transmitter.bind(bench.now_s) == Answer(False, f"binding is not possible: {bench.port.problem}")


def test_what_is_requested_at_the_workbench_is_written_at_once(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    for request, answer in (
        (lambda: bench.transmitter.range_check(True), Answer(True, "range check on")),
        (lambda: bench.transmitter.range_check(False), Answer(True, "range check off")),
        (lambda: bench.transmitter.show(IDLE), Answer(True, "shown")),
        (lambda: bench.transmitter.bind(bench.now_s), Answer(True, "binding")),
    ):
        bench.run(1.0, None)
        last_s = bench.writes[-1].time_s
        while bench.writes[-1].time_s == last_s:
            bench.run(0.001, None)
        # A frame has just been written; the next one waits for the receiver only, not for the keep-alive.
        written = len(bench.writes)
        assert request() == answer
        bench.run(0.0075, None)
        assert len(bench.writes) == written + 1


def test_inputs_are_shown_with_low_throttle_until_their_time_or_the_end_is_requested(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    throttle, pitch = 0, 2
    centre_us = bench.writes[-1].pulses_us[pitch]
    assert bench.transmitter.show((0.5, 0.0, 0.9, 0.0), until_s=bench.now_s + 0.5).accepted
    bench.run(0.4, IDLE)
    assert abs(bench.writes[-1].pulses_us[pitch] - centre_us) > 100
    assert bench.writes[-1].pulses_us[throttle] == 1100
    assert bench.request(Action.ARM).reason == "missing: transmitter ready"
    bench.run(0.2, None)
    assert bench.writes[-1].pulses_us[pitch] == centre_us
    assert bench.transmitter.show((0.5, 0.0, 0.0, 0.0)).accepted
    bench.run(10.0, None)
    assert abs(bench.writes[-1].pulses_us[pitch] - centre_us) > 100
    assert bench.transmitter.show(None).accepted
    bench.run(0.1, IDLE)
    assert bench.writes[-1].pulses_us[pitch] == centre_us
    assert not bench.transmitter.busy(bench.now_s)


def test_a_throttle_within_the_calibration_is_shown_with_the_arming_channel_on(tmp_path: Path) -> None:
    arming = ArmingChannel(4)
    calibration = Calibration(throttle=ThrottleCalibration(us0=1150, us1=1900), arming=arming)
    bench = Bench(tmp_path / "h1", calibration)
    try:
        bench.run(1.0, None)
        for throttle_us in (1100.0, 1500.0, 1900.0):
            assert bench.transmitter.show(IDLE, throttle_us=throttle_us).accepted
            bench.run(0.1, None)
            assert bench.writes[-1].pulses_us[0] == throttle_us
            assert arming.is_on(bench.writes[-1].pulses_us)
        for throttle_us in (1099.0, 1901.0):
            refused = bench.transmitter.show(IDLE, throttle_us=throttle_us)
            assert refused == Answer(False, f"throttle {throttle_us:g} us is outside 1100 .. 1900")
        assert bench.transmitter.show(IDLE).accepted
        bench.run(0.1, None)
        assert not arming.is_on(bench.writes[-1].pulses_us)
    finally:
        bench.close()


def test_the_snapshot_shows_reason_lease_planned_input_and_all_counters(bench: Bench) -> None:
    bench.fly()
    bench.sequence += 1
    rows = ((0.0, 0.0, 0.55, 0.0),) * 5
    command = CommandInput(1, 1, bench.sequence, bench.sequence, HOVER, rows)
    assert bench.transmitter.on_command(command, bench.now_s).accepted
    bench.run(0.07, None)
    snapshot = bench.transmitter.snapshot(bench.now_s)
    assert snapshot.reason == bench.transmitter.arbiter.reason == "armed: by operator"
    assert snapshot.lease == 1
    assert snapshot.bridging_step > 0
    assert snapshot.counters["openings"] == 1
    assert snapshot.counters["entered ARMED"] == 1
    assert snapshot.counters["frames written"] == len(bench.writes)


def test_range_check_reduces_the_power_and_forbids_arming(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    assert bench.transmitter.range_check(True).reason == "range check on"
    bench.run(0.1, IDLE)
    bench.radio.link.receiver.in_range_check_reach = False
    bench.run(2.0, IDLE)
    assert bench.radio.link.receiver.output(bench.now_s).state == "failsafe"
    assert bench.request(Action.ARM).reason == "missing: transmitter ready"
    bench.transmitter.range_check(False)
    bench.run(0.1, IDLE)
    assert bench.radio.link.receiver.output(bench.now_s).state == "linked"
    assert bench.request(Action.ARM).accepted


def test_full_port_is_tried_again_and_then_given_up(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.fly()
    monkeypatch.setattr(bench.port, "write_frame", lambda frame, now_s: WriteOutcome.SHORT)
    bench.run(0.02)
    assert bench.transmitter.next_deadline_s() <= bench.now_s + 0.005


def make(
    protocol: RadioProtocol, *, calibration: Calibration | None = None, low_power: bool = False
) -> Transmitter:
    settings = settings_of(calibration or Calibration(), protocol)
    return Transmitter(replace(settings, low_power=low_power), SerialPort("/nonexistent", LINE, call))


@pytest.mark.parametrize(
    "build",
    [
        lambda: make(MultiProtocol(), calibration=Calibration(throttle=ThrottleCalibration(us1=2050))),
        lambda: make(
            MultiProtocol(), calibration=Calibration(roll=ChannelCalibration(1, gain_us=600, lo_us=900))
        ),
        lambda: make(Dsm2SerialProtocol(), calibration=Calibration(roll=ChannelCalibration(6))),
    ],
    ids=["throttle", "roll", "channel"],
)
def test_a_calibration_the_radio_cannot_carry_is_refused_at_the_start(
    build: Callable[[], Transmitter],
) -> None:
    with pytest.raises(PulseRangeError):
        build()


def test_wishes_the_radio_does_not_offer_are_refused() -> None:
    with pytest.raises(ProtocolError, match="low_power"):
        make(PpmGenProtocol(), low_power=True)
    transmitter = make(PpmGenProtocol())
    assert transmitter.range_check(True) == Answer(False, "ppm: check the range with the radio itself")
    assert transmitter.bind(0.0) == Answer(False, "ppm: bind with the radio itself")


def test_poses_of_others_are_not_acted_on_before_the_own_turn(bench: Bench) -> None:
    bench.fly()
    for _ in range(3):
        bench.sequence += 1
        bench.transmitter.on_pose(PoseInput("h2", 1, bench.sequence, (0.1, 0, 1), 0.02), bench.now_s)
    bench.run(0.05)
    assert bench.state is State.HOLD
