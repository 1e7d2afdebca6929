"""A transmitter gateway in virtual time: several emulated radios, no bus."""

import select
import threading
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
from support.radios import serve
from support.waiting import wait_for

from rcopterx.bus.codec import encode
from rcopterx.bus.heartbeat import Heartbeat
from rcopterx.bus.message import FloatArray, Message
from rcopterx.bus.messages import Applied, Command, CommandTiming, LeaseBid, Pose
from rcopterx.bus.session import BusAddress, Incoming
from rcopterx.bus.subscription import Inbox
from rcopterx.bus.wakeup import Wakeup
from rcopterx.radios.calibration import Calibration
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.radios.protocol import SerialLine
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, State
from rcopterx.transmitter_gateway.kill_keys import KillKeys
from rcopterx.transmitter_gateway.port import Write, WriteOutcome
from rcopterx.transmitter_gateway.process import Gateway
from rcopterx.transmitter_gateway.radios import Radios
from rcopterx.transmitter_gateway.settings import GatewaySettings, TransmitterSettings
from rcopterx.transmitter_gateway.state_page import begin_page
from rcopterx.transmitter_gateway.transmitter import Transmitter

NAMES = ("h1", "h2", "h3")
LINE = SerialLine(100_000, "N", 2)
PERIOD_S = 0.02
NO_PLAN = FloatArray.of(np.zeros((0, 4)))


class OwnBus:
    """Inboxes that the test fills, and what was published; `woken` are the topics that woke the loop."""

    def __init__(self, wake: Callable[[], None]) -> None:
        self.wake = wake
        self.woken: set[str] = set()
        self.is_closed = False
        self.now_s = 0.0
        self.address = BusAddress((), "lab", host="radio")
        self.inboxes: dict[tuple[str, str, str], tuple[Inbox[Any], bool]] = {}
        self.requests: list[Incoming] = []
        self.published: list[tuple[str, Message]] = []

    def clock(self) -> float:
        return self.now_s

    def subscribe(
        self,
        channel: Any,
        unit: str,
        depth: int = 1,
        waking: bool = True,
        fleet: str = "lab",
    ) -> Inbox[Any]:
        inbox: Inbox[Any] = Inbox(channel, depth)
        self.inboxes[channel.topic, unit, fleet] = (inbox, waking)
        return inbox

    def arrive(self, topic: str, unit: str, message: Message, fleet: str = "lab") -> None:
        if not self.inboxes:
            return  # Nothing has joined the bus.
        inbox, waking = self.inboxes[topic, unit, fleet]
        inbox.store(encode(message), self.now_s)
        if waking:
            self.woken.add(topic)
            self.wake()

    def publish(self, channel: Any, unit: str, message: Message) -> None:
        self.published.append((unit, message))

    def pending(self) -> list[Incoming]:
        requests, self.requests = self.requests, []
        return requests

    def serve(self, *_: object) -> None:
        pass

    announce = serve

    def __enter__(self) -> "OwnBus":
        return self

    def __exit__(self, *_: object) -> None:
        self.is_closed = True


class Laboratory(Wakeup):
    """Radios, poses and commands; what waits lets the time pass until the next frame of the Tracker."""

    def __init__(self, directory: Path) -> None:
        super().__init__()
        self.bus = OwnBus(self.notify)
        self.thrust: float | None = 0.0
        self.height_m = 1.0
        self.sinks = False
        self.blocked: set[str] = set()
        """Vehicles whose ports do not open."""
        self.throttle_us: dict[str, list[int]] = {name: [] for name in NAMES}
        self.frame = 0
        self.writes: dict[str, list[Write]] = {name: [] for name in NAMES}
        self._served = dict.fromkeys(NAMES, 0)
        self.radios = {
            name: RadioPty(directory / name, RadioLink(MultiModule(0.0), Receiver(3, connect_s=0.0)))
            for name in NAMES
        }
        self.settings = GatewaySettings(
            self.bus.address,
            tuple(
                TransmitterSettings(
                    name,
                    str(directory / name),
                    MultiProtocol(MultiSettings(rx_num=3), LINE),
                    Calibration(),
                    ArbiterLimits(),
                )
                for name in NAMES
            ),
            NAMES,
            directory / "states",
        )
        for name in NAMES:
            begin_page(self.settings.states / name).close()
        self.begin()

    def begin(self) -> None:
        """Start the first gateway; agents bid for its leases."""
        self.start()
        self.bid()

    def bid(self) -> None:
        for name in NAMES:
            self.bus.arrive("lease_bid", name, LeaseBid(agent=1))

    def start(self) -> None:
        """Start a gateway: the first one, or the successor of one that was killed."""
        self.radios_of_gateway = Radios(
            self.settings, self, KillKeys(-1), set(), Heartbeat(bytearray(32)), self.bus.clock
        )
        self.gateway = Gateway(self.settings, self.bus, self.radios_of_gateway, False)  # type: ignore[arg-type]  # no bus
        self.note_writes()

    def kill(self) -> None:
        """End the gateway as SIGKILL does: its ports and pages close, and nothing more is written."""
        for name, radio in self.radios.items():
            self._serve(name, radio)
        self.radios_of_gateway.close()
        for thread in threading.enumerate():
            if thread.name == "serial port":
                thread.join()

    def close(self) -> None:
        self.radios_of_gateway.close()
        for radio in self.radios.values():
            radio.unplug()
        super().close()

    def transmitter(self, name: str) -> Transmitter:
        return self.radios_of_gateway.transmitters[name]

    def note_writes(self) -> None:
        for name in NAMES:
            self._note_writes(name, self.transmitter(name))

    def _note_writes(self, name: str, transmitter: Transmitter) -> None:
        tick = transmitter.tick

        def noted(now_s: float) -> Write | None:
            write = tick(now_s)
            if write is not None:
                self.writes[name].append(write)
            return write

        transmitter.tick = noted  # type: ignore[method-assign]  # listens on the way

    def states(self) -> set[State]:
        return {self.transmitter(name).arbiter.state for name in NAMES}

    def wait(self, timeout_s: float, descriptors: Collection[int] = (), rest_s: float = 0.0) -> set[int]:
        opening = [self.transmitter(name).port for name in NAMES if name not in self.blocked]
        wait_for(lambda: not any(port.is_opening for port in opening), "a port does not open")
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
        return super().wait(0.0, descriptors)

    def _serve(self, name: str, radio: RadioPty) -> None:
        new = self.writes[name][self._served[name] :]
        self._served[name] += len(new)
        if radio.is_open and new and new[-1].outcome is WriteOutcome.WRITTEN:
            assert select.select([radio.fileno()], [], [], 5.0)[0]
        serve(radio, self.bus.now_s)
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
        self.run(0.6)
        for name in NAMES:
            arm = ActionRequest(Action.ARM, by="operator")
            answer = self.transmitter(name).request(arm, self.bus.now_s)
            assert answer.accepted, answer
        self.thrust = 0.55
        self.run(0.4)
        assert self.states() == {State.ARMED}
