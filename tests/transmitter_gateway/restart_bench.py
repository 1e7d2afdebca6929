"""A gateway that is killed in flight and its successor, on one emulated radio, in virtual time."""

from collections import Counter
from operator import call
from pathlib import Path

from support.radios import serve

from rcopterx.radios.calibration import Calibration
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.radios.protocol import SerialLine
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver, ReceiverState
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, Answer, CommandInput, PoseInput, State
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.state_page import NOT_FLYING, PAGE_BYTES, StatePage
from rcopterx.transmitter_gateway.transmitter import Transmitter

LINE = SerialLine(100_000, "N", 2)
BOOT = b"since this morning"


class Restart:
    """Gateway, radio, poses and commands; the receiver connects at once to a module."""

    def __init__(self, path: Path, connect_s: float = 0.0) -> None:
        self.path = path
        self.now_s = 0.0
        self.sequence = 0
        self.height_m: float | None = 0.8
        self.sinks_m_s = 0.0
        self.memory = bytearray(PAGE_BYTES)
        self.page.save(NOT_FLYING)
        self.radio = RadioPty(path, RadioLink(MultiModule(0.0), Receiver(3, connect_s=connect_s)))
        self.start()
        self.transmitter.bid(1, self.now_s, take_over=False)

    @property
    def page(self) -> StatePage:
        """What a process that starts now knows."""
        return StatePage(self.memory, BOOT)

    def start(self) -> None:
        protocol = MultiProtocol(MultiSettings(rx_num=3), LINE)
        port = SerialPort(str(self.path), LINE, call)
        settings = TransmitterSettings("h1", port.path, protocol, Calibration(), ArbiterLimits())
        self.transmitter = Transmitter(settings, port)
        self.transmitter.resume(self.page, self.now_s)

    def run(self, seconds: float, thrust: float | None = 0.55) -> list[ReceiverState]:
        states = []
        end_s = self.now_s + seconds
        while self.now_s < end_s - 1e-9:
            self.now_s += 0.02
            self.sequence += 1
            if self.height_m is not None:
                self.height_m = max(self.height_m - 0.02 * self.sinks_m_s, 0.02)
                place = (0.0, 0.0, self.height_m)
                self.transmitter.on_pose(PoseInput("h1", 1, self.sequence, place, 0.02, 0.0), self.now_s)
                self.tick()
            if thrust is not None:
                u = (0.0, 0.0, thrust, 0.0)
                self.transmitter.on_command(CommandInput(1, 1, self.sequence, self.sequence, u), self.now_s)
                self.tick()
            serve(self.radio, self.now_s + 0.005)
            self.transmitter.on_readable(self.now_s + 0.005)
            self.tick(0.005)
            states.append(self.radio.link.receiver.state(self.now_s))
        return states

    def tick(self, later_s: float = 0.0) -> None:
        """Let the time pass as the loop does, which sleeps until the next deadline."""
        if self.now_s + later_s >= self.transmitter.next_deadline_s():
            self.transmitter.tick(self.now_s + later_s)

    def fly(self) -> None:
        self.run(1.5, thrust=0.0)
        assert self.request(Action.ARM).accepted
        self.run(4.0)  # Until the thrust is learned that it hovers with here.
        assert self.state is State.ARMED

    def request(self, action: Action) -> Answer:
        return self.transmitter.request(ActionRequest(action, "operator"), self.now_s)

    @property
    def state(self) -> State:
        return self.transmitter.arbiter.state

    @property
    def counters(self) -> Counter[str]:
        return self.transmitter.arbiter.counters

    def die(self, silence_s: float) -> None:
        """Kill the process; its successor starts after a silence."""
        self.transmitter.port.close()
        end_s = self.now_s + silence_s
        while self.now_s < end_s - 1e-9:
            self.now_s += 0.02
            serve(self.radio, self.now_s)
        self.throttle_us()
        self.start()

    def lose_page(self) -> None:
        """Let the page vanish, as when a system removes shared memory."""
        self.memory = bytearray(PAGE_BYTES)

    def lose_adapter(self) -> None:
        """Let the adapter vanish, but not the module's power; the last frame has arrived."""
        self.radio.unplug(powered=True)
        serve(self.radio, self.now_s + 0.01)
        self.throttle_us()

    def throttle_us(self) -> list[float]:
        """Throttles that have arrived since the last call."""
        return [frame.pulses_us[0] for frame in self.radio.link.take_frames()]
