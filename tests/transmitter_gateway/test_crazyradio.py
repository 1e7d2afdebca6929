"""Promises of the Crazyradio: several vehicles on one dongle, with a dongle that only exists in memory."""

import re
import select
from collections import Counter
from collections.abc import Iterator, Sequence
from threading import Event

import pytest
from support.radio_addresses import radio_paths
from support.waiting import FakeClock, wait_for

from rcopterx.radios.crazyflie import CrazyflieProtocol, CrazyflieSettings
from rcopterx.radios.crazyradio import IN, OUT, SET_ADDRESS, SET_CHANNEL, SET_RATE
from rcopterx.radios.crtp import EMERGENCY_STOP, RadioAddress, joined
from rcopterx.radios.protocol import FrameFlags, ProtocolError
from rcopterx.simulator.crazyflie import Crazyflie
from rcopterx.simulator.crazyradio import EmulatedDongle
from rcopterx.transmitter_gateway.crazyradio import Crazyradio, CrazyradioPort
from rcopterx.transmitter_gateway.port import WriteOutcome

FIRST, SECOND = "radio://0/80/2M/E7E7E7E701", "radio://0/90/1M/E7E7E7E702"
LOW = (1100.0, 1500.0, 1500.0, 1500.0, 1100.0)


def place(path: str) -> tuple[int, int, bytes]:
    address = RadioAddress.of(path)
    return address.channel, address.rate, address.address


class Dongle:
    """A dongle with two vehicles in reach; an answer leaves a vehicle with the next packet to it."""

    def __init__(self) -> None:
        self.tuned: dict[int, int | bytes] = {}
        self.requests: Counter[int] = Counter()
        self.vehicles = {place(path): Crazyflie(CrazyflieSettings()) for path in (FIRST, SECOND)}
        self.queues: dict[object, list[bytes]] = {key: [] for key in self.vehicles}
        self.plugged = True
        self.held = Event()  # transfers wait while it is not set
        self.held.set()
        self.written: list[bytes] = []
        self._answer: list[int] = []

    def _check(self) -> None:
        if not self.plugged:
            raise OSError(19, "No such device (it may have been disconnected)")

    def ctrl_transfer(self, kind: int, request: int, value: int, index: int, data: bytes | None) -> int:
        self._check()
        assert (kind, index) == (0x40, 0)
        self.requests[request] += 1
        self.tuned[request] = value if data is None else data
        return 0

    def write(self, endpoint: int, data: bytes, timeout: int) -> int:
        self._check()
        assert endpoint == OUT
        assert 1 <= len(data) <= 32
        self.written.append(data)
        assert self.held.wait(10.0)
        tuned = (self.tuned[SET_CHANNEL], self.tuned[SET_RATE], self.tuned[SET_ADDRESS])
        vehicle = self.vehicles.get(tuned)
        self._answer = [0x30]
        if vehicle is not None:
            queue = self.queues[tuned]
            self._answer = [0x11, *(queue.pop(0) if queue else b"")]
            queue += vehicle.receive(data, 0.0)
        return len(data)

    def read(self, endpoint: int, size: int, timeout: int) -> Sequence[int]:
        self._check()
        assert endpoint == IN
        return self._answer


class Bench:
    def __init__(self) -> None:
        self.dongle = Dongle()
        self.radio = Crazyradio(self.find)
        self.ports: list[CrazyradioPort] = []
        self.now_s = 0.0

    def find(self) -> Dongle:
        if not self.dongle.plugged:
            raise OSError("there are 0 Crazyradios, number 0 is not plugged in")
        return self.dongle

    def port(self, path: str) -> CrazyradioPort:
        port = CrazyradioPort(path, RadioAddress.of(path), self.radio)
        self.ports.append(port)
        return port

    def opened(self, port: CrazyradioPort) -> bool:
        self.now_s += 1.0
        return port.service(self.now_s)

    def sent(self, port: CrazyradioPort, frame: bytes) -> bool:
        return port.write_frame(frame, self.now_s) is WriteOutcome.WRITTEN


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    for port in bench.ports:
        port.close()


def ready(bench: Bench, port: CrazyradioPort, protocol: CrazyflieProtocol) -> bool:
    bench.sent(port, protocol.encode(LOW))
    protocol.receive(port.read_available(bench.now_s), bench.now_s)
    return protocol.status(bench.now_s).ready


def test_two_vehicles_on_one_dongle_report_that_they_are_ready(bench: Bench) -> None:
    for path in (FIRST, SECOND):
        port, protocol = bench.port(path), CrazyflieProtocol()
        wait_for(lambda port=port: bench.opened(port), "the radio")
        protocol.link_opened(bench.now_s)
        wait_for(lambda port=port, protocol=protocol: ready(bench, port, protocol), "the radio")
        assert port.counters["packets acknowledged"] > 0
        assert port.counters["packets not acknowledged"] == 0
        assert port.counters["packets repeated"] == port.counters["packets acknowledged"]
    assert bench.dongle.requests[SET_CHANNEL] == 2, "a dongle is tuned only to another vehicle"


def test_an_answer_makes_the_port_readable(bench: Bench) -> None:
    port = bench.port(FIRST)
    assert port.fileno() is None
    wait_for(lambda: bench.opened(port), "the radio")
    descriptor = port.fileno()
    wait_for(lambda: bench.sent(port, joined([b"\x9c\x0c", b"\xff"])), "the radio")
    assert select.select([descriptor], [], [], 10.0)[0] == [descriptor]
    assert port.read_available(0.0).startswith(b"\x04\x9c\x8c")
    assert not select.select([descriptor], [], [], 0.0)[0]


def test_a_kill_does_not_wait_for_the_requests_of_the_frame_before_it(bench: Bench) -> None:
    port, protocol = bench.port(FIRST), CrazyflieProtocol()
    wait_for(lambda: bench.opened(port), "the radio")
    wait_for(lambda: not port.waiting, "the radio")
    bench.dongle.held.clear()
    bench.sent(port, joined([b"\xff"]))
    wait_for(lambda: not port.waiting, "the dongle takes no packet")
    assert bench.sent(port, protocol.encode(LOW))
    assert not bench.sent(port, protocol.encode(LOW)), "packets of the last frame wait"
    bench.dongle.written.clear()
    assert bench.sent(port, protocol.encode(LOW, FrameFlags(kill=True)))
    bench.dongle.held.set()
    wait_for(lambda: not port.waiting, "the radio")
    assert bench.dongle.written[0] == EMERGENCY_STOP.to_bytes()


def test_a_vehicle_out_of_reach_is_counted_and_disturbs_no_other(bench: Bench) -> None:
    away, near = bench.port("radio://0/10/250K/E7E7E7E7E7"), bench.port(FIRST)
    wait_for(lambda: away.is_open or bench.opened(away), "the radio")
    wait_for(lambda: near.is_open or bench.opened(near), "the radio")
    for port, name in ((away, "packets not acknowledged"), (near, "packets acknowledged")):
        wait_for(lambda port=port: bench.sent(port, joined([b"\xff"])), "the radio")
        wait_for(lambda port=port, name=name: port.counters[name] == 1, "the radio")


def test_a_dongle_that_is_unplugged_closes_its_ports_until_it_is_back(bench: Bench) -> None:
    port = bench.port(FIRST)
    wait_for(lambda: bench.opened(port), "the radio")
    bench.dongle.plugged = False
    wait_for(lambda: port.write_frame(joined([b"\xff"]), bench.now_s) is WriteOutcome.CLOSED, "the radio")
    assert not port.is_open
    # The dongle is searched again at once.
    assert re.search("No such device|not plugged in", port.problem or "")
    assert port.fileno() is None
    wait_for(lambda: not bench.opened(port) and "not plugged in" in (port.problem or ""), "the radio")
    bench.dongle.plugged = True
    wait_for(lambda: bench.opened(port), "the radio")
    assert (port.counters["openings"], port.counters["losses"]) == (2, 1)


def test_a_frame_is_not_queued_behind_one_that_waits(bench: Bench) -> None:
    port = bench.port(FIRST)
    wait_for(lambda: bench.opened(port), "the radio")
    frames = [port.write_frame(joined([b"\xff"] * 3), bench.now_s) for _ in range(100)]
    wait_for(lambda: not port.waiting, "the radio")
    sent = frames.count(WriteOutcome.WRITTEN)
    wait_for(lambda: port.counters["packets acknowledged"] == 3 * sent, "the radio")
    assert sent + frames.count(WriteOutcome.BACKLOG) == 100


@pytest.mark.parametrize(
    ("vehicles", "limit"),
    [(4, None), (10, "this Crazyradio carries 3.. packets/s, 10 vehicles need 600: use more")],
)
def test_a_dongle_names_its_limit_when_it_has_too_many_vehicles(vehicles: int, limit: str | None) -> None:
    clock = FakeClock()
    dongle = EmulatedDongle(0, "empty", clock.advance)
    radio = Crazyradio(lambda: dongle, clock, at_once=True)
    ports = [CrazyradioPort(path, RadioAddress.of(path), radio) for path in radio_paths(vehicles)]
    assert all(port.service(0.0) for port in ports)
    for _ in range(1000 // vehicles):
        assert all(port.write_frame(joined([b"\xff"]), 0.0) is WriteOutcome.WRITTEN for port in ports)
    texts = {port.overload for port in ports}
    assert len(texts) == 1
    [text] = texts
    assert text is None if limit is None else re.fullmatch(limit, text or "")


def test_without_a_thread_a_frame_is_sent_while_it_is_written_and_a_dongle_that_is_back_is_used(
    bench: Bench,
) -> None:
    bench.radio = Crazyradio(bench.find, at_once=True)
    port = bench.port(FIRST)
    assert bench.opened(port)
    assert bench.sent(port, joined([b"\xff", b"\xff"]))
    assert port.counters["packets acknowledged"] == 2
    bench.dongle.plugged = False
    bench.sent(port, joined([b"\xff"]))
    assert port.write_frame(joined([b"\xff"]), bench.now_s) is WriteOutcome.CLOSED
    assert not bench.opened(port)
    bench.dongle.plugged = True
    assert bench.opened(port)


@pytest.mark.parametrize(
    "path",
    [
        "radio://0/126/2M/E7E7E7E7E7",
        "radio://0/80/3M/E7E7E7E7E7",
        "radio://0/80/2M/E7E7",
        "radio://80/2M",
        "0/80/2M/E7E7E7E7E7",
    ],
)
def test_another_radio_address_is_refused(path: str) -> None:
    with pytest.raises(ProtocolError, match=r"radio://0/80/2M/E7E7E7E7E7"):
        RadioAddress.of(path)
