"""The loop of a transmitter gateway in virtual time: several emulated radios, no bus."""

import select
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rcopterx.bus.codec import encode
from rcopterx.bus.heartbeat import Heartbeat
from rcopterx.bus.keys import EVERY_FLEET, FLEET_UNIT
from rcopterx.bus.message import FloatArray, Message
from rcopterx.bus.messages import Applied, Command, Kill, LeaseBid, Pose, TransmitterStatus
from rcopterx.bus.session import BusAddress, Incoming, NotServedError
from rcopterx.bus.subscription import Inbox
from rcopterx.bus.timing import CommandTiming
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.transmitter_gateway.calibration import Calibration
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, State
from rcopterx.transmitter_gateway.kill_keys import KillKeys
from rcopterx.transmitter_gateway.limits import ArbiterLimits
from rcopterx.transmitter_gateway.process import TURN_S, Gateway
from rcopterx.transmitter_gateway.protocols.base import SerialLine
from rcopterx.transmitter_gateway.protocols.multi import MultiProtocol, MultiSettings
from rcopterx.transmitter_gateway.settings import GatewaySettings, TransmitterSettings
from rcopterx.transmitter_gateway.snapshot import Write
from rcopterx.transmitter_gateway.surveillance import Track
from rcopterx.transmitter_gateway.transmitter import Transmitter
from rcopterx.transmitter_gateway.wakeup import Wakeup

NAMES = ("h1", "h2", "h3")
LINE = SerialLine(100_000, "N", 2)
PERIOD_S = 0.02
NO_PLAN = FloatArray.of(np.zeros((0, 4)))


class OwnBus:
    """Inboxes that the test fills, and what was published."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.address = BusAddress((), "lab", host="radio")
        self.inboxes: dict[tuple[str, str, str], tuple[Inbox[Any], Callable[[], None]]] = {}
        self.published: list[tuple[str, Message]] = []

    def clock(self) -> float:
        return self.now_s

    def subscribe(
        self,
        channel: Any,
        unit: str,
        depth: int = 1,
        wake: Callable[[], None] = lambda: None,
        waking: bool = True,
        fleet: str = "lab",
    ) -> Inbox[Any]:
        inbox: Inbox[Any] = Inbox(channel, depth)
        self.inboxes[channel.topic, unit, fleet] = (inbox, wake if waking else lambda: None)
        return inbox

    def arrive(self, topic: str, unit: str, message: Message, fleet: str = "lab") -> None:
        inbox, wake = self.inboxes[topic, unit, fleet]
        inbox.store(encode(message), self.now_s)
        wake()

    def publish(self, channel: Any, unit: str, message: Message) -> None:
        self.published.append((unit, message))

    def pending(self) -> list[Incoming]:
        return []

    def request(self, *_: object, **__: object) -> None:
        raise NotServedError("nobody remembers")

    def serve(self, *_: object) -> None:
        pass

    def wake(self) -> None:
        pass

    announce = serve


class Laboratory(Wakeup):
    """Radios, poses and commands; what waits lets the time pass until the next frame of the Tracker."""

    def __init__(self, directory: Path) -> None:
        super().__init__()
        self.bus = OwnBus()
        self.thrust: float | None = 0.0
        self.height_m = 1.0
        self.sinks = False
        self.throttle_us: dict[str, list[int]] = {name: [] for name in NAMES}
        self.frame = 0
        self.writes: dict[str, list[Write]] = {name: [] for name in NAMES}
        self._served = dict.fromkeys(NAMES, 0)
        self.radios = {
            name: RadioPty(directory / name, RadioLink(MultiModule(0.0), Receiver(3, connect_s=0.0)))
            for name in NAMES
        }
        transmitters = (
            TransmitterSettings(
                name,
                str(directory / name),
                MultiProtocol(MultiSettings(rx_num=3), LINE),
                Calibration(),
                ArbiterLimits(),
            )
            for name in NAMES
        )
        settings = GatewaySettings(self.bus.address, "transmitters", tuple(transmitters), NAMES)
        keys = KillKeys(-1)
        self.gateway = Gateway(
            settings,
            self.bus,
            self,
            keys,
            False,
            Heartbeat(bytearray(32)),  # type: ignore[arg-type]  # no bus
        )
        self.gateway.recall.join()
        for name in NAMES:
            self._note_writes(name)
            self.bus.arrive("lease_bid", name, LeaseBid(agent=1))

    def close(self) -> None:
        for name, radio in self.radios.items():
            self.transmitter(name).close()
            radio.close()
        super().close()

    def transmitter(self, name: str) -> Transmitter:
        return self.gateway.stations[name].transmitter

    def _note_writes(self, name: str) -> None:
        transmitter = self.transmitter(name)
        tick = transmitter.tick

        def noted(now_s: float) -> Write | None:
            write = tick(now_s)
            if write is not None:
                self.writes[name].append(write)
            return write

        transmitter.tick = noted  # type: ignore[method-assign]  # listens on the way

    def states(self) -> set[State]:
        return {self.transmitter(name).arbiter.state for name in NAMES}

    def wait(self, descriptors: Iterable[int], timeout_s: float) -> set[int]:
        next_frame_s = (self.frame + 1) * PERIOD_S
        self.bus.now_s = min(self.bus.now_s + max(timeout_s, 1e-4), next_frame_s)
        for name, radio in self.radios.items():
            self._serve(name, radio)
        if self.bus.now_s == next_frame_s:
            self.frame += 1
            if self.sinks:
                self.height_m = max(0.0, self.height_m - 0.4 * PERIOD_S)
            for number, name in enumerate(NAMES):
                self.bus.arrive("pose", name, self.pose(float(number)))
                if self.thrust is not None:
                    self.bus.arrive("command", name, self.command(self.thrust))
        return super().wait(descriptors, 0.0)

    def _serve(self, name: str, radio: RadioPty) -> None:
        if len(self.writes[name]) > self._served[name]:
            self._served[name] = len(self.writes[name])
            assert select.select([radio.fileno()], [], [], 5.0)[0]
        radio.service(self.bus.now_s)
        self.throttle_us[name] += [round(frame.pulses_us[0]) for frame in radio.link.take_frames()]

    def pose(self, x_m: float) -> Pose:
        return Pose(
            epoch=1, frame=self.frame, period_s=PERIOD_S, latency_s=0.0, received_s=0.0, occluded=False,
            position_m=(x_m, 0.0, self.height_m), quaternion_xyzw=(0.0, 0.0, 0.0, 1.0),
        )  # fmt: skip

    def command(self, thrust: float, lease: int = 1) -> Command:
        return Command(
            epoch=1, frame=self.frame, lease=lease, sequence=self.frame, input=(0.0, 0.0, thrust, 0.0),
            next_inputs=NO_PLAN, period_s=PERIOD_S, timing=self.timing(),
        )  # fmt: skip

    def timing(self) -> CommandTiming:
        return CommandTiming(
            latency_s=0.001, gateway_host="main", received_s=self.frame, agent_host="other",
            arrived_s=1.0, began_s=2.0, ready_s=3.0,
        )  # fmt: skip

    def applied(self, name: str) -> list[Applied]:
        """Published frames of a vehicle."""
        return [
            message for unit, message in self.bus.published if unit == name and isinstance(message, Applied)
        ]

    def turn(self) -> None:
        self.gateway.wait()
        self.gateway.step()

    def run(self, seconds: float) -> None:
        end_s = self.bus.now_s + seconds
        while self.bus.now_s < end_s:
            self.turn()

    def fly(self) -> None:
        self.run(1.5)
        for name in NAMES:
            arm = ActionRequest(Action.ARM, by="operator")
            assert self.transmitter(name).request(arm, self.bus.now_s).accepted
        self.thrust = 0.55
        self.run(1.0)
        assert self.states() == {State.ARMED}


@pytest.fixture
def laboratory(tmp_path: Path) -> Iterator[Laboratory]:
    laboratory = Laboratory(tmp_path)
    yield laboratory
    laboratory.close()


def fail(*_: object, **__: object) -> None:
    raise RuntimeError("broken")


@pytest.mark.parametrize("broken", ["request", "on_readable", "next_deadline_s"])
def test_broken_transmitter_does_not_keep_the_others_from_landing(
    laboratory: Laboratory, broken: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    laboratory.fly()
    monkeypatch.setattr(laboratory.transmitter("h2"), broken, fail)
    flown_s = laboratory.bus.now_s
    laboratory.sinks = True
    laboratory.gateway.bring_down(lambda: False)
    assert 2.5 < laboratory.bus.now_s - flown_s < 4.5
    for name in ("h1", "h3"):
        assert laboratory.transmitter(name).arbiter.state is State.CUT
        assert laboratory.throttle_us[name][-25:] == [1100] * 25
    assert ("h2: cannot be brought down" in caplog.text) == (broken != "next_deadline_s")
    assert not any(laboratory.transmitter(name).port.is_open for name in NAMES)


def test_error_in_the_poses_still_brings_everybody_down(
    laboratory: Laboratory, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    laboratory.fly()
    monkeypatch.setattr(laboratory.bus.inboxes["pose", "h2", "lab"][0], "drain", fail)
    laboratory.gateway.bring_down(lambda: False)
    assert laboratory.states() == {State.CUT}
    assert "broken" in capsys.readouterr().err


@pytest.mark.parametrize("fleet", ["lab", EVERY_FLEET])
def test_a_kill_of_this_fleet_or_of_every_fleet_is_obeyed_and_published_at_once(
    laboratory: Laboratory, fleet: str
) -> None:
    laboratory.fly()
    laboratory.bus.published.clear()
    kill = Kill(source="operator", reason="test", vehicles=("h2",))
    laboratory.bus.arrive("kill", FLEET_UNIT, kill, fleet)
    laboratory.gateway.step()
    assert laboratory.transmitter("h2").arbiter.state is State.KILLED
    assert laboratory.transmitter("h1").arbiter.state is State.ARMED
    states = {
        name: message.state
        for name, message in laboratory.bus.published
        if isinstance(message, TransmitterStatus)
    }
    assert states == {"h1": "armed", "h2": "killed", "h3": "armed"}


def test_kill_counts_while_an_error_brings_vehicles_down(laboratory: Laboratory) -> None:
    laboratory.fly()
    flown_s = laboratory.bus.now_s
    laboratory.gateway.bring_down(lambda: laboratory.bus.now_s > flown_s + 0.2)
    assert laboratory.states() == {State.KILLED}
    assert laboratory.bus.now_s - flown_s < 1.5


def test_shut_down_lands_everybody_and_closes_the_ports(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.sinks = True
    laboratory.gateway.shut_down()
    assert laboratory.states() == {State.CUT}
    assert {laboratory.transmitter(name).arbiter.reason for name in NAMES} == {"landed"}
    for name in NAMES:
        assert laboratory.throttle_us[name][-25:] == [1100] * 25
        assert not laboratory.transmitter(name).port.is_open


def test_what_is_written_for_a_command_tells_the_stages_it_has_passed(laboratory: Laboratory) -> None:
    laboratory.fly()
    written = [message for _, message in laboratory.bus.published if isinstance(message, Applied)]
    fresh = [applied for applied in written if applied.fresh]
    assert fresh
    for applied in fresh:
        assert applied.host == "radio"
        assert applied.timing is not None
        assert applied.timing.received_s == applied.frame
        assert applied.command_arrived_s is not None
        assert applied.command_arrived_s <= applied.written_s
    assert all(applied.timing is None for applied in written if not applied.fresh)


def test_every_written_frame_is_published_at_once(laboratory: Laboratory) -> None:
    laboratory.fly()
    for _ in range(300):
        laboratory.bus.published.clear()
        written = {name: len(laboratory.writes[name]) for name in NAMES}
        laboratory.turn()
        for name in NAMES:
            writes = laboratory.writes[name][written[name] :]
            assert [applied.written_s for applied in laboratory.applied(name)] == [w.time_s for w in writes]


def test_another_state_is_published_at_once(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.thrust = None
    silent = laboratory.transmitter("h2").arbiter
    while silent.state is not State.HOLD:
        frame = laboratory.frame
        laboratory.bus.published.clear()
        laboratory.turn()
        for name in ("h1", "h3") if laboratory.frame > frame else ():
            laboratory.bus.arrive("command", name, laboratory.command(0.55))
    assert laboratory.applied("h2")[-1].state == "hold"


def own_track(laboratory: Laboratory) -> Track:
    track = laboratory.transmitter("h1").arbiter.surveillance.own_track
    assert track is not None
    return track


def next_frame_arrives(laboratory: Laboratory) -> float:
    frame = laboratory.frame
    while laboratory.frame == frame:
        laboratory.turn()
    return laboratory.bus.now_s


def test_commands_are_written_on_arrival_and_judged_with_the_poses_that_are_there(
    laboratory: Laboratory,
) -> None:
    laboratory.fly()
    arrived_s = next_frame_arrives(laboratory)
    assert laboratory.writes["h1"][-1].time_s == arrived_s
    assert own_track(laboratory).frame == laboratory.frame


def test_poses_wait_at_most_a_turn_and_count_from_their_arrival(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.thrust = None
    while laboratory.states() != {State.HOLD}:
        laboratory.turn()
    arrived_s = next_frame_arrives(laboratory)
    while own_track(laboratory).frame < laboratory.frame:
        laboratory.turn()
    assert laboratory.bus.now_s <= arrived_s + TURN_S
    assert own_track(laboratory).seen_s == arrived_s


def test_flood_of_commands_for_one_vehicle_is_read_in_portions_between_those_of_others(
    laboratory: Laboratory,
) -> None:
    laboratory.fly()
    laboratory.thrust = None
    laboratory.bus.now_s += 0.01
    laboratory.frame += 1
    flood = 200
    for _ in range(flood):
        laboratory.bus.arrive("command", "h2", laboratory.command(0.5, lease=2))
    laboratory.bus.arrive("command", "h3", laboratory.command(0.6))
    laboratory.gateway.step()
    write = laboratory.writes["h3"][-1]
    assert write.output.cause is not None
    assert write.output.cause.sequence == laboratory.frame
    counters = laboratory.transmitter("h2").arbiter.counters
    assert 0 < refused(counters) < flood / 10
    laboratory.run(0.02)
    assert refused(counters) == flood


def refused(counters: Counter[str]) -> int:
    return counters["no such control lease"] + counters["old sequence number"]


def test_kill_is_reported_at_once_also_where_it_cannot_be_written(laboratory: Laboratory) -> None:
    laboratory.run(1.0)
    laboratory.radios["h2"].unplug()
    laboratory.run(0.3)
    laboratory.bus.published.clear()
    laboratory.gateway.kill("test")
    laboratory.gateway.step()
    reported = {
        unit: message.state
        for unit, message in laboratory.bus.published
        if isinstance(message, TransmitterStatus)
    }
    assert reported == dict.fromkeys(NAMES, "killed")
    laboratory.bus.published.clear()
    laboratory.gateway.step()
    assert not any(isinstance(message, TransmitterStatus) for _, message in laboratory.bus.published)
