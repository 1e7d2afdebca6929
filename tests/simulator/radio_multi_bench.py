"""An emulated Multiprotocol module and its frames, driven in virtual time."""

from support.radios import HandheldReceiver

from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.radios.multi_answers import AnswerParser, MultiStatus
from rcopterx.radios.protocol import FrameFlags
from rcopterx.simulator.radio import RadioLink
from rcopterx.simulator.radio_module import AirPacket
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver

FRAME_S = 27 * 120e-6


HOVER = [1540.0]


BOOTED_S = 1.0


def frame(pulses: list[float] | None = None, **flags: bool) -> bytes:
    protocol = MultiProtocol(MultiSettings(rx_num=3))
    return protocol.encode(pulses or HOVER, FrameFlags(**flags), disarmed=True)


class Bench:
    """A module with virtual time, fed at 50 Hz."""

    def __init__(self, receiver: Receiver | None = None, **module_options: bool) -> None:
        self.module = MultiModule(0.0, **module_options)
        self.link = RadioLink(self.module, receiver or HandheldReceiver(3, connect_s=0.0))
        self.now_s = 0.0
        self.packets: list[AirPacket] = []
        self.answers = b""
        receive = self.link.receiver.receive

        def note(packet: AirPacket) -> None:
            self.packets.append(packet)
            receive(packet)

        self.link.receiver.receive = note  # type: ignore[method-assign]  # listens in on the air

    def run(self, seconds: float, data: bytes | None) -> list[AirPacket]:
        first = len(self.packets)
        for _ in range(round(seconds / 0.02)):
            if data is not None:
                self.link.module.feed(data, self.now_s)
            self.now_s += 0.02
            self.answers += self.link.advance(self.now_s)
        return self.packets[first:]

    def statuses(self) -> list[MultiStatus]:
        answers, self.answers = self.answers, b""
        return AnswerParser().feed(answers)


def booted(receiver: Receiver | None = None) -> Bench:
    bench = Bench(receiver)
    bench.run(BOOTED_S, frame())
    return bench
