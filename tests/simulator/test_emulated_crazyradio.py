"""Promises of the emulated Crazyradio: packets take their time, are repeated, and reach vehicles in reach."""

from collections.abc import Callable, Iterator
from itertools import count

import pytest

from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.radios.crazyradio import (
    ACKNOWLEDGED,
    IN,
    OUT,
    RETRIES,
    SET_ADDRESS,
    SET_CHANNEL,
    SET_RATE,
    TO_DEVICE,
)
from rcopterx.radios.crtp import STATE_REQUEST, Packet, RadioAddress, SupervisorState
from rcopterx.simulator.crazyflie import Crazyflie
from rcopterx.simulator.crazyradio import PACKET_S, SETTING_S, EmulatedDongle, place_of
from rcopterx.simulator.radio_kinds import set_condition
from rcopterx.simulator.vehicle_udp import VehicleOnAir

PROBE = b"\xff"


class Bench:
    """Vehicles on one channel and a dongle; the time is what the dongle waits."""

    numbers = count()

    def __init__(self) -> None:
        self.now_s = 0.0
        self.laboratory = f"bench-{next(self.numbers)}"
        self.dongle = EmulatedDongle(0, self.laboratory, self.wait)
        self.vehicles: dict[bytes, VehicleOnAir] = {}
        self.dongle.ctrl_transfer(TO_DEVICE, SET_CHANNEL, 80, 0, None)
        self.dongle.ctrl_transfer(TO_DEVICE, SET_RATE, 2, 0, None)

    def wait(self, seconds: float) -> None:
        self.now_s += seconds

    def vehicle(self, last: int) -> bytes:
        address = bytes((0xE7, 0xE7, 0xE7, 0xE7, last))
        place = place_of(self.laboratory, RadioAddress(0, 80, 2, address))
        self.vehicles[address] = VehicleOnAir(place, Crazyflie(CrazyflieSettings()))
        return address

    def tune(self, address: bytes) -> None:
        self.dongle.ctrl_transfer(TO_DEVICE, SET_ADDRESS, 0, 0, address)

    def send(self, packet: bytes) -> list[int]:
        self.dongle.write(OUT, packet, 100)
        for vehicle in self.vehicles.values():
            vehicle.receive(self.now_s)
        return self.dongle.read(IN, 64, 100)


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    for vehicle in bench.vehicles.values():
        vehicle.unplug()


@pytest.fixture
def without_losses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.simulator.crazyradio.LOST", 0.0)


def duration_s(bench: Bench, work: Callable[[], object]) -> float:
    began_s = bench.now_s
    work()
    return bench.now_s - began_s


@pytest.mark.usefixtures("without_losses")
def test_another_vehicle_costs_the_time_of_a_setting(bench: Bench) -> None:
    first, second = bench.vehicle(1), bench.vehicle(2)
    bench.tune(first)
    bench.send(PROBE)
    assert duration_s(bench, lambda: bench.send(PROBE)) == pytest.approx(PACKET_S)
    bench.tune(second)
    assert duration_s(bench, lambda: bench.send(PROBE)) == pytest.approx(PACKET_S + SETTING_S)


@pytest.mark.usefixtures("without_losses")
def test_an_answer_arrives_with_a_later_acknowledgement(bench: Bench) -> None:
    bench.tune(bench.vehicle(1))
    assert bench.send(STATE_REQUEST.to_bytes()) == [ACKNOWLEDGED]
    status, *answer = bench.send(PROBE)
    assert status == ACKNOWLEDGED
    state = SupervisorState.of(Packet.from_bytes(bytes(answer)))
    assert state is not None
    assert state.arms_itself


def test_lost_packets_are_repeated_and_arrive(bench: Bench) -> None:
    bench.tune(bench.vehicle(1))
    statuses = [bench.send(PROBE)[0] for _ in range(2000)]
    assert all(status & ACKNOWLEDGED for status in statuses)
    assert 5 < sum(status >> 4 for status in statuses) < 50


@pytest.mark.parametrize("condition", ["off", "unplugged"])
def test_a_vehicle_without_power_or_out_of_reach_acknowledges_nothing_until_it_is_back(
    bench: Bench, condition: str
) -> None:
    address = bench.vehicle(1)
    bench.tune(address)
    assert bench.send(PROBE)[0] & ACKNOWLEDGED
    set_condition(bench.vehicles[address], condition, bench.now_s)
    assert [bench.send(PROBE) for _ in range(3)] == 3 * [[RETRIES << 4]]
    set_condition(bench.vehicles[address], "ready", bench.now_s)
    assert bench.send(PROBE)[0] & ACKNOWLEDGED


def test_two_laboratories_of_one_computer_do_not_reach_each_other(bench: Bench) -> None:
    other = Bench()
    bench.tune(bench.vehicle(1))
    other.tune(bytes.fromhex("E7E7E7E701"))
    assert bench.send(PROBE)[0] & ACKNOWLEDGED
    assert not other.send(PROBE)[0] & ACKNOWLEDGED
