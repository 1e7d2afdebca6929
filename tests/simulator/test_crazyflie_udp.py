"""Promises of CRTP over UDP, between a gateway's port and an emulated Crazyflie, on real sockets."""

from collections.abc import Iterator

import pytest
from support.udp import udp_paths

from rcopterx.radios.crazyflie import CrazyflieProtocol
from rcopterx.radios.protocol import ProtocolError
from rcopterx.radios.udp import udp_address
from rcopterx.simulator.crazyflie import Crazyflie
from rcopterx.simulator.radio_kinds import condition_refused, radio_end_of, set_condition
from rcopterx.simulator.settings import SimulatedRadio
from rcopterx.simulator.vehicle_udp import VehicleUdp
from rcopterx.transmitter_gateway.port import WriteOutcome
from rcopterx.transmitter_gateway.udp_port import UdpPort

HOVER = (1540.0, 1500.0, 1500.0, 1500.0, 1900.0)
LOW = (1100.0, 1500.0, 1500.0, 1500.0, 1100.0)


class Bench:
    def __init__(self) -> None:
        self.protocol = CrazyflieProtocol()
        [self.path] = udp_paths(1)
        self.radio = self.switched_on()
        self.port = UdpPort(self.path, self.protocol)
        self.now_s = 0.0

    def switched_on(self) -> VehicleUdp:
        radio = radio_end_of(self.path, SimulatedRadio(self.protocol, 0), 0.0)
        assert isinstance(radio, VehicleUdp)
        return radio

    @property
    def vehicle(self) -> Crazyflie:
        return self.radio.vehicle

    def run(self, seconds: float, pulses_us: tuple[float, ...] = LOW) -> list[WriteOutcome]:
        outcomes = []
        for _ in range(round(seconds / 0.02)):
            self.now_s += 0.02
            if self.port.service(self.now_s):
                self.protocol.link_opened(self.now_s)
            outcomes.append(self.port.write_frame(self.protocol.encode(pulses_us), self.now_s))
            self.radio.receive(self.now_s)
            self.radio.advance(self.now_s)
            self.protocol.receive(self.port.read_available(self.now_s), self.now_s)
        return outcomes

    @property
    def text(self) -> str:
        return self.port.problem or self.protocol.status(self.now_s).text


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.port.close()
    bench.radio.unplug()


def test_a_port_opens_when_the_vehicle_answers_and_the_vehicle_flies(bench: Bench) -> None:
    assert bench.run(0.5)[-1] is WriteOutcome.WRITTEN
    assert bench.text == "ready, 4.19 V, link 100 %"
    bench.run(0.5, HOVER)
    assert bench.vehicle.motors_run
    assert bench.radio.reception.take_outputs()[-1][1][0] == pytest.approx(1540.0)
    assert len(bench.radio.reception.take_frames()) > 40


def test_nobody_there_is_a_closed_port_that_opens_later(bench: Bench) -> None:
    bench.radio.unplug()
    assert bench.run(0.5)[-1] is WriteOutcome.CLOSED
    assert not bench.port.is_open
    assert bench.path in bench.text
    bench.radio = bench.switched_on()
    bench.run(0.5)
    assert bench.text == "ready, 4.19 V, link 100 %"


def test_a_radio_that_is_unplugged_in_flight_is_noticed_and_the_vehicle_stops_itself(bench: Bench) -> None:
    bench.run(0.5)
    bench.run(0.5, HOVER)
    set_condition(bench.radio, "unplugged", bench.now_s)
    assert WriteOutcome.CLOSED in bench.run(0.5, HOVER)
    assert not bench.port.is_open
    assert bench.port.counters["losses"] == 1
    bench.run(2.0, HOVER)
    assert not bench.vehicle.motors_run
    set_condition(bench.radio, "ready", bench.now_s)
    bench.run(0.5)
    assert "locked" in bench.text


def test_taking_the_battery_out_ends_a_stop(bench: Bench) -> None:
    bench.run(0.5)
    bench.vehicle.receive(b"\x9d\x03", bench.now_s)
    bench.run(0.5)
    assert "locked" in bench.text
    set_condition(bench.radio, "off", bench.now_s)
    bench.run(1.5)
    assert "silent" in bench.text
    set_condition(bench.radio, "ready", bench.now_s)
    bench.run(0.5)
    assert bench.text.startswith("ready")
    assert condition_refused(bench.radio, "refusing") is not None


def test_a_port_that_is_in_use_is_an_error(bench: Bench) -> None:
    with pytest.raises(OSError, match="in use"):
        bench.switched_on()


@pytest.mark.parametrize(
    "path", ["/dev/ttyUSB0", "udp://19850", "udp://127.0.0.1:port", "udp://h:70000", "udp://:1"]
)
def test_another_address_is_refused(path: str) -> None:
    with pytest.raises(ProtocolError, match="no address"):
        udp_address(path)
