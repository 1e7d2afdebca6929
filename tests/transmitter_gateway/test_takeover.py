"""A restarted gateway and vehicles that are still in the air."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from arbiter_bench import SLEW, U_HOVER

from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver, ReceiverState
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.calibration import Calibration
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
from rcopterx.transmitter_gateway.protocols.base import SerialLine
from rcopterx.transmitter_gateway.protocols.multi import MultiProtocol, MultiSettings
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.snapshot import Write
from rcopterx.transmitter_gateway.transmitter import FIRST_POSE_S, RECALL_LIMIT_S, Transmitter

LINE = SerialLine(100_000, "N", 2)
LAST_FLYING = LastApplied(State.ARMED, (0.1, 0.0, 0.56, 0.0), written_s=9.6, lease=5, issued=6)
NOW_S = 10.0


def restarted(height_m: float | None = 0.8, link: LinkState = LinkState.READY) -> Arbiter:
    arbiter = Arbiter("h1", ArbiterLimits(), U_HOVER, SLEW)
    arbiter.link(link)
    if height_m is not None:
        arbiter.pose(PoseInput("h1", 7, 100, (0.0, 0.0, height_m), 0.02), NOW_S)
    return arbiter


def take_over(arbiter: Arbiter, **changes: object) -> Answer:
    fields = {name: getattr(LAST_FLYING, name) for name in ("state", "u", "written_s", "lease", "issued")}
    last = LastApplied(**{**fields, **changes})  # type: ignore[arg-type]  # test data
    arbiter.resume_leases(last.lease, last.issued, NOW_S)
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


def test_a_descent_goes_on_to_its_end() -> None:
    arbiter = restarted()
    assert take_over(arbiter, state=State.DESCEND).accepted
    command(arbiter, LAST_FLYING.lease, NOW_S + 0.02)
    assert arbiter.state is State.DESCEND
    assert not arbiter.commanded


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"written_s": NOW_S - 0.7}, "no frames for 0.70 s, longer than 0.7 s"),
        ({"u": (0.0, 0.0, 0.05, 0.0)}, "the thrust was low"),
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
        (None, LinkState.READY, "own pose not seen"),
        (0.09, LinkState.READY, "at 0.09 m it may stand on the floor"),
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


class Restart:
    """A gateway that is killed in flight and its successor, on one emulated radio, in virtual time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.now_s = 0.0
        self.sequence = 0
        self.last_write: Write | None = None
        self.radio = RadioPty(path, RadioLink(MultiModule(0.0), Receiver(3, connect_s=0.0)))
        self.start()

    def start(self) -> None:
        protocol = MultiProtocol(MultiSettings(rx_num=3), LINE)
        port = SerialPort(str(self.path), LINE)
        self.transmitter = Transmitter("h1", ArbiterLimits(), Calibration(), protocol, port)
        self.transmitter.arbiter.bid(1, self.now_s, take_over=False)

    def run(self, seconds: float, thrust: float = 0.55, *, poses: bool = True) -> list[ReceiverState]:
        states = []
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.now_s += 0.02
            self.sequence += 1
            if poses:
                self.transmitter.on_pose(PoseInput("h1", 1, self.sequence, (0.0, 0.0, 0.8), 0.02), self.now_s)
                self.tick()
            command = CommandInput(1, 1, self.sequence, self.sequence, (0.0, 0.0, thrust, 0.0))
            self.transmitter.on_command(command, self.now_s)
            self.tick()
            self.radio.service(self.now_s + 0.005)
            self.transmitter.on_readable(self.now_s + 0.005)
            self.tick(0.005)
            states.append(self.radio.output(self.now_s).state)
        return states

    def tick(self, later_s: float = 0.0) -> None:
        self.last_write = self.transmitter.tick(self.now_s + later_s) or self.last_write

    def fly(self) -> None:
        self.run(1.5, thrust=0.0)
        assert self.transmitter.request(ActionRequest(Action.ARM, "operator"), self.now_s).accepted
        self.run(1.0)
        assert self.state is State.ARMED

    @property
    def state(self) -> State:
        return self.transmitter.arbiter.state

    def die(self, silence_s: float) -> LastApplied:
        write = self.last_write
        assert write is not None
        words = LastApplied(
            write.output.state,
            write.output.u,
            write.time_s,
            self.transmitter.arbiter.lease,
            self.transmitter.arbiter.issued,
        )
        self.transmitter.close()
        end_s = self.now_s + silence_s
        while self.now_s < end_s:
            self.now_s += 0.02
            self.radio.service(self.now_s)
        self.start()
        self.transmitter.await_recall(self.now_s)
        return words

    def throttle_us(self) -> list[float]:
        return [frame.pulses_us[0] for frame in self.radio.link.take_frames()]


@pytest.fixture
def restart(tmp_path: Path) -> Iterator[Restart]:
    bench = Restart(tmp_path / "h1")
    yield bench
    bench.transmitter.close()
    bench.radio.close()


def test_a_killed_and_restarted_gateway_never_switches_a_flying_vehicle_off(restart: Restart) -> None:
    restart.fly()
    words = restart.die(0.4)
    restart.throttle_us()
    restart.transmitter.recall(words, restart.now_s)
    states = restart.run(1.0)
    assert restart.state is State.ARMED
    assert min(restart.throttle_us()) > 1480
    assert set(states) <= {ReceiverState.HOLD, ReceiverState.LINKED}


def test_the_agent_flies_again_with_its_first_command_after_a_restart(restart: Restart) -> None:
    restart.fly()
    words = restart.die(0.1)
    restart.transmitter.recall(words, restart.now_s)
    restart.run(0.04)
    assert restart.state is State.ARMED
    assert restart.transmitter.arbiter.counters["entered DESCEND"] == 1


def test_a_gateway_that_is_back_too_late_starts_disarmed(restart: Restart) -> None:
    restart.fly()
    words = restart.die(0.8)
    restart.throttle_us()
    restart.transmitter.recall(words, restart.now_s)
    restart.run(1.0)
    assert restart.state is State.DISARMED
    assert set(map(round, restart.throttle_us())) == {1100}


def test_nothing_is_written_before_the_own_pose_is_seen_and_only_for_a_moment(restart: Restart) -> None:
    restart.fly()
    words = restart.die(0.3)
    restart.throttle_us()
    restart.transmitter.recall(words, restart.now_s)
    decide_s = restart.now_s + FIRST_POSE_S
    assert restart.transmitter.next_deadline_s() == pytest.approx(decide_s)
    restart.run(0.06, poses=False)
    assert not restart.throttle_us()
    restart.run(0.2, poses=False)
    assert restart.state is State.DISARMED
    assert set(map(round, restart.throttle_us())) == {1100}


def test_a_kill_outlives_a_restart_however_long_it_takes(restart: Restart) -> None:
    restart.fly()
    restart.transmitter.request(ActionRequest(Action.KILL, "operator"), restart.now_s)
    restart.run(0.1)
    words = restart.die(30.0)
    restart.transmitter.recall(words, restart.now_s)
    restart.run(1.0)
    assert restart.state is State.KILLED


def test_a_kill_while_it_is_undecided_counts(restart: Restart) -> None:
    restart.fly()
    words = restart.die(0.3)
    restart.throttle_us()
    restart.transmitter.recall(words, restart.now_s)
    restart.transmitter.request(ActionRequest(Action.KILL, "operator"), restart.now_s)
    restart.run(0.3)
    assert restart.state is State.KILLED
    assert set(map(round, restart.throttle_us())) == {1100}


@pytest.mark.parametrize("late_s", [0.3, 0.45])
def test_recall_that_takes_its_time_still_keeps_a_vehicle_in_the_air(restart: Restart, late_s: float) -> None:
    restart.fly()
    words = restart.die(0.05)
    restart.throttle_us()
    restart.run(late_s)
    assert not restart.throttle_us()
    restart.transmitter.recall(words, restart.now_s)
    restart.run(0.5)
    assert restart.state is State.ARMED
    assert min(restart.throttle_us()) > 1480


def test_recall_that_never_comes_leaves_throttle_low_and_arming_refused(restart: Restart) -> None:
    restart.fly()
    restart.die(0.05)
    restart.throttle_us()
    restart.run(RECALL_LIMIT_S - 0.05)
    assert not restart.throttle_us()
    restart.run(2.0, thrust=0.0)
    assert set(map(round, restart.throttle_us())) == {1100}
    assert restart.transmitter.snapshot(restart.now_s).module == "waiting for the recall"
    arm = ActionRequest(Action.ARM, "operator")
    assert restart.transmitter.request(arm, restart.now_s).reason == "missing: transmitter ready"
    restart.transmitter.recall(None, restart.now_s)
    restart.run(0.1, thrust=0.0)
    assert restart.transmitter.request(arm, restart.now_s).accepted


def test_flight_that_is_recalled_too_late_stays_over_and_is_counted(restart: Restart) -> None:
    restart.fly()
    words = restart.die(0.05)
    restart.run(RECALL_LIMIT_S + 0.05)
    restart.throttle_us()
    restart.transmitter.recall(words, restart.now_s)
    restart.run(0.5)
    assert restart.state is State.DISARMED
    assert set(map(round, restart.throttle_us())) == {1100}
    assert restart.transmitter.arbiter.counters["recalled too late"] == 1


def test_kill_that_is_recalled_late_is_a_kill_all_the_same(restart: Restart) -> None:
    restart.fly()
    restart.transmitter.request(ActionRequest(Action.KILL, "operator"), restart.now_s)
    restart.run(0.1)
    words = restart.die(0.05)
    restart.run(5.0)
    assert restart.state is State.DISARMED
    restart.transmitter.recall(words, restart.now_s)
    restart.run(0.1)
    assert restart.state is State.KILLED


def test_kill_before_the_recall_is_written_at_once(restart: Restart) -> None:
    restart.fly()
    restart.die(0.05)
    restart.throttle_us()
    restart.transmitter.request(ActionRequest(Action.KILL, "operator"), restart.now_s)
    restart.run(0.1)
    assert set(map(round, restart.throttle_us())) == {1100}
    assert restart.state is State.KILLED
