"""A transmitter and an emulated radio on a pseudo-terminal, driven in virtual time."""

import select
from operator import call
from pathlib import Path

from support.radios import HandheldReceiver, serve

from rcopterx.radios.calibration import Calibration
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.radios.protocol import RadioProtocol, SerialLine
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_module import SerialFrame
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, Answer, CommandInput, PoseInput, State
from rcopterx.transmitter_gateway.port import Write, WriteOutcome
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.settings import TransmitterSettings
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
        self.radio = RadioPty(path, RadioLink(MultiModule(0.0), HandheldReceiver(3, connect_s=0.0)))
        self.port = SerialPort(str(path), LINE, call)
        self.transmitter = Transmitter(settings_of(calibration or Calibration()), self.port)
        self.transmitter.arbiter.bid(1, 0.0, take_over=False)
        self.sequence = 0
        self.next_command_s = 0.02
        self.frames: list[SerialFrame] = []
        self.writes: list[Write] = []

    def close(self) -> None:
        self.transmitter.port.close()
        self.radio.unplug()

    @property
    def state(self) -> State:
        return self.transmitter.arbiter.state

    def exchange(self) -> None:
        """Let what was written arrive and what is answered be read."""
        self._tick()
        serve(self.radio, self.now_s)
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
        pose = PoseInput("h1", 1, self.sequence, (0.0, 0.0, 0.6), 0.02)
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
