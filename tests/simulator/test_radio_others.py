"""Boards and encoders other than the Multiprotocol module, driven by their own protocols."""

import math
from collections.abc import Callable
from typing import NamedTuple

import pytest
from support.radios import HandheldReceiver

from rcopterx.radios.dsm2_serial import Dsm2SerialProtocol, Dsm2Settings
from rcopterx.radios.dsmp import DsmpProtocol, DsmpSettings
from rcopterx.radios.ppm import PpmGenProtocol, PpmSettings
from rcopterx.radios.protocol import FrameFlags, RadioProtocol
from rcopterx.simulator.radio import RadioLink
from rcopterx.simulator.radio_boards import Dsm2Board, DsmpModule, TrainerTransmitter
from rcopterx.simulator.radio_module import RadioModule
from rcopterx.simulator.radio_receiver import Receiver, ReceiverState

HOVER = [1540.0, 1450.0, 1520.0, 1480.0]


class Outputs(NamedTuple):
    """Outputs of a receiver, and their source."""

    state: ReceiverState
    pulses_us: tuple[float, ...]


class Bench:
    def __init__(
        self, module: RadioModule, protocol: RadioProtocol, receiver: Receiver | None = None
    ) -> None:
        self.module, self.protocol = module, protocol
        self.link = RadioLink(module, receiver or HandheldReceiver(3, connect_s=0.0))
        self.now_s = 0.0
        protocol.link_opened(0.0)

    def run(
        self, seconds: float, pulses: list[float] | None = HOVER, flags: FrameFlags | None = None
    ) -> Outputs:
        end_s = self.now_s + seconds
        while self.now_s < end_s - 1e-9:
            if pulses is not None:
                frame = self.protocol.encode(pulses, flags or FrameFlags(), disarmed=True)
                self.link.module.feed(frame, self.now_s)
            self.now_s += self.protocol.keepalive_s
            self.protocol.receive(self.link.advance(self.now_s), self.now_s)
        receiver = self.link.receiver
        return Outputs(receiver.state(self.now_s), receiver.pulses_us(self.now_s))


def dsm2() -> Bench:
    return Bench(Dsm2Board(), Dsm2SerialProtocol(Dsm2Settings(3)))


def dsmp(**settings: bool) -> Bench:
    return Bench(DsmpModule(), DsmpProtocol(DsmpSettings(model=3, **settings)))


def ppm() -> Bench:
    settings = PpmSettings(order="AETR")
    return Bench(TrainerTransmitter(settings, model_match=3), PpmGenProtocol(settings))


@pytest.mark.parametrize("build", [dsm2, dsmp, ppm])
def test_channels_reach_the_vehicle(build: Callable[[], Bench]) -> None:
    bench = build()
    output = bench.run(1.0)
    assert output.state is ReceiverState.LINKED
    assert output.pulses_us[:4] == pytest.approx(HOVER, abs=1.2)
    assert bench.link.take_frames()[-1].pulses_us[:4] == pytest.approx(HOVER, abs=1.2)
    assert not bench.module.rejected


@pytest.mark.parametrize("build", [dsm2, dsmp])
def test_boards_repeat_the_last_frame_for_ever(build: Callable[[], Bench]) -> None:
    bench = build()
    bench.run(1.0)
    output = bench.run(10.0, None)
    assert output.state is ReceiverState.LINKED
    assert output.pulses_us[0] == pytest.approx(1540, abs=1.2)


def test_trainer_signal_stops_100_ms_after_the_last_packet_and_the_parked_sticks_take_over() -> None:
    bench = ppm()
    bench.run(1.0)
    assert bench.run(0.075, None).pulses_us[0] == 1540
    assert bench.run(0.075, None).pulses_us[0] == 1100


@pytest.mark.parametrize("build", [dsm2, dsmp, ppm])
def test_fragments_and_glued_frames_are_rejected(build: Callable[[], Bench]) -> None:
    bench = build()
    bench.run(1.0)
    bench.link.take_frames()
    frame = bench.protocol.encode(HOVER)
    bench.link.module.feed(frame[:-1], bench.now_s)
    bench.run(0.1, None)
    bench.link.module.feed(frame + frame, bench.now_s)
    bench.run(0.1, None)
    assert not bench.link.take_frames()
    assert sum(bench.module.rejected.values()) == 2


@pytest.mark.parametrize("build", [dsm2, dsmp])
def test_range_check_power_does_not_reach_far(build: Callable[[], Bench]) -> None:
    bench = build()
    bench.run(1.0)
    bench.link.receiver.in_range_check_reach = False
    assert bench.run(2.0, flags=FrameFlags(range_check=True)).state is ReceiverState.FAILSAFE


def test_board_binds_only_when_asked_in_its_first_frame() -> None:
    receiver = HandheldReceiver(None, connect_s=0.0)
    receiver.enter_bind_mode()
    late = Bench(Dsm2Board(), Dsm2SerialProtocol(Dsm2Settings(3)), receiver)
    late.run(0.1, [1100.0])
    late.run(3.0, [1100.0], FrameFlags(bind=True))
    assert receiver.binding
    late.module.power_cycle(late.now_s)
    late.run(3.0, [1100.0], FrameFlags(bind=True))
    assert receiver.model_match == 3
    assert late.run(1.0, [1100.0]).state is ReceiverState.LINKED


def test_dsmp_reports_its_firmware_and_carries_11_bits() -> None:
    bench = Bench(DsmpModule(firmware=2), DsmpProtocol(DsmpSettings(model=3, eleven_bit=True)))
    output = bench.run(1.5)
    assert output.pulses_us[:4] == pytest.approx(HOVER, abs=0.6)
    assert bench.protocol.status(bench.now_s).text == "module 2.0"
    assert math.isclose(bench.protocol.keepalive_s, 0.011)


def test_dsmp_before_its_first_set_up_misreads_11_bit_channels() -> None:
    module = DsmpModule()
    sender = DsmpProtocol(DsmpSettings(eleven_bit=True))
    sender.encode(HOVER)
    module.feed(sender.encode(HOVER), 0.0)
    module.advance(1.0)
    assert not module.frames
    assert sum(module.rejected.values()) == 1
