from collections.abc import Iterator
from operator import call
from pathlib import Path

import pytest
from support.radios import serve

from rcopterx.radios.dsm2_serial import Dsm2Settings
from rcopterx.radios.dsmp import DsmpSettings
from rcopterx.radios.multi import MultiSettings
from rcopterx.radios.ppm import PpmSettings
from rcopterx.radios.protocol import SerialLine
from rcopterx.radios.registry import create_protocol
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_kinds import condition_refused, module_of, set_condition
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver, ReceiverState
from rcopterx.simulator.settings import SimulatedRadio
from rcopterx.transmitter_gateway.serial_port import SerialPort

KINDS = {
    "multi": MultiSettings(rx_num=5, inverted_line=False),
    "dsm2_serial": Dsm2Settings(model=5),
    "dsmp": DsmpSettings(model=5, eleven_bit=True),
    "ppm": PpmSettings(channels=8, order="AETR"),
}


class Bench:
    """A radio of the simulator and the port a gateway would write to, in virtual time."""

    def __init__(self, path: Path, kind: str) -> None:
        line = SerialLine(115_200)
        self.protocol = create_protocol(kind, KINDS[kind], line)
        module = module_of(SimulatedRadio(self.protocol, 5), 0.0)
        self.radio = RadioPty(path, RadioLink(module, Receiver(5, connect_s=0.0)))
        self.port = SerialPort(str(path), line, call)
        self.now_s = 0.0

    def run(self, seconds: float) -> None:
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            if self.port.service(self.now_s):
                self.protocol.link_opened(self.now_s)
            self.port.write_frame(self.protocol.encode([1540.0, 1450.0, 1520.0, 1480.0]), self.now_s)
            self.now_s += 0.025
            serve(self.radio, self.now_s)
            self.protocol.receive(self.port.read_available(self.now_s), self.now_s)

    @property
    def state(self) -> ReceiverState:
        return self.radio.link.receiver.state(self.now_s)

    def text(self) -> str:
        return self.protocol.status(self.now_s).text


@pytest.fixture
def bench(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Bench]:
    bench = Bench(tmp_path / "radio", request.param)
    yield bench
    bench.port.close()
    bench.radio.unplug()


@pytest.mark.parametrize("bench", KINDS, indirect=True)
def test_every_radio_is_set_up_as_its_protocol_expects(bench: Bench) -> None:
    bench.run(1.5)
    assert bench.radio.link.receiver.pulses_us(bench.now_s)[:4] == pytest.approx(
        [1540, 1450, 1520, 1480], abs=1.5
    )
    assert bench.protocol.status(bench.now_s).ready


@pytest.mark.parametrize("bench", KINDS, indirect=True)
@pytest.mark.parametrize("condition", ["unplugged", "off"])
def test_a_radio_without_power_is_silent_until_it_is_mended(bench: Bench, condition: str) -> None:
    bench.run(1.5)
    set_condition(bench.radio, condition, bench.now_s)
    bench.run(1.5)
    assert bench.state is ReceiverState.FAILSAFE
    set_condition(bench.radio, "ready", bench.now_s)
    bench.run(2.5)
    assert bench.state is ReceiverState.LINKED


@pytest.mark.parametrize("bench", ["multi"], indirect=True)
def test_a_module_that_was_off_boots_before_it_transmits_again(bench: Bench) -> None:
    bench.run(1.5)
    for condition in ("off", "adapter"):
        set_condition(bench.radio, condition, bench.now_s)
        bench.run(1.5)
        assert bench.state is ReceiverState.FAILSAFE
    before = bench.radio.link.module.rf_channels
    set_condition(bench.radio, "ready", bench.now_s)
    bench.run(2.5)
    assert bench.radio.link.module.rf_channels > before


@pytest.mark.parametrize("bench", ["multi"], indirect=True)
def test_a_module_that_refuses_that_refuses_the_protocol_says_so_and_can_be_mended(bench: Bench) -> None:
    bench.run(1.5)
    set_condition(bench.radio, "refusing", bench.now_s)
    bench.run(1.5)
    assert not bench.protocol.status(bench.now_s).ready
    assert "protocol" in bench.text()
    set_condition(bench.radio, "ready", bench.now_s)
    bench.run(1.5)
    assert bench.protocol.status(bench.now_s).ready


@pytest.mark.parametrize("bench", ["ppm"], indirect=True)
def test_only_a_module_with_answers_can_refuse(bench: Bench) -> None:
    assert condition_refused(bench.radio, "refusing") is not None
    assert condition_refused(bench.radio, "off") is None
    assert not isinstance(bench.radio.link.module, MultiModule)
