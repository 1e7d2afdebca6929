"""Promises of the simulator's loop, with a bus that only takes notes."""

import os
import select
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any, cast

import pytest
from support.conditions import IDEAL
from support.vehicle_types import COAXIAL_LAG

from rcopterx.bus.host_messages import LaboratoryState
from rcopterx.bus.requests import Inject, InjectedFault
from rcopterx.bus.session import BusAddress, Incoming
from rcopterx.radios.calibration import Calibration
from rcopterx.radios.dsm2_serial import Dsm2Settings
from rcopterx.radios.protocol import SerialLine
from rcopterx.radios.registry import create_protocol
from rcopterx.simulator.plant import BodyPose
from rcopterx.simulator.process import LONGEST_STEP_S, Simulator
from rcopterx.simulator.settings import SimulatedRadio, SimulatedVehicle, SimulatorSettings

LINE = SerialLine(115_200)
WRITTEN_AFTER_S = 0.007


class Bus:
    """Notes published messages, hands out requests, and has a clock that stands still."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.published: list[LaboratoryState] = []
        self.requests: list[Incoming] = []

    def clock(self) -> float:
        return self.now_s

    def serve(self, *_: object) -> None: ...

    def wait(self, timeout_s: float, descriptors: Collection[int]) -> set[int]:
        return set(select.select(descriptors, [], [], timeout_s)[0])

    def publish(self, _channel: object, _unit: str, message: LaboratoryState) -> None:
        self.published.append(message)

    def pending(self) -> list[Incoming]:
        requests, self.requests = self.requests, []
        return requests


class Bench:
    """A simulator with one vehicle whose radio receives at once."""

    def __init__(self, directory: Path, rate_hz: float) -> None:
        self.bus = Bus()
        self.protocol = create_protocol("dsm2_serial", Dsm2Settings(model=5), LINE)
        self.vehicle = SimulatedVehicle(
            name="h1", subject="heli1", model=COAXIAL_LAG, start=BodyPose((0.0, 0.0, 0.0)),
            port=str(directory / "radio-h1"), radio=SimulatedRadio(self.protocol, 5),
            calibration=Calibration(),
        )  # fmt: skip
        settings = SimulatorSettings(
            bus=BusAddress((), "test"), tracker_host="127.0.0.1", tracker_port=0, profile="tracker3",
            rate_hz=rate_hz, conditions=IDEAL, seed=0, vehicles=(self.vehicle,),
        )  # fmt: skip
        self.simulator = Simulator(settings, cast(Any, self.bus))
        self.port = os.open(self.vehicle.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def at(self, time_s: float) -> None:
        self.bus.now_s = 100.0 + time_s
        self.simulator.run_once()

    def write(self, time_s: float) -> None:
        pulses = self.vehicle.calibration.pulses_us((0.1, 0.0, 0.7, 0.0))
        os.write(self.port, self.protocol.encode(pulses))
        self.at(time_s)

    def close(self) -> None:
        os.close(self.port)
        self.simulator.close()


@pytest.fixture
def simulated(tmp_path: Path) -> Iterator[Callable[[float], Bench]]:
    benches: list[Bench] = []

    def make(rate_hz: float) -> Bench:
        benches.append(Bench(tmp_path, rate_hz))
        return benches[-1]

    yield make
    for bench in benches:
        bench.close()


def test_serial_frames_have_the_time_of_their_arrival_and_wait_for_the_next_frame_of_the_tracker(
    simulated: Callable[[float], Bench],
) -> None:
    bench = simulated(50.0)
    for period in range(1, 11):
        begin_s = 0.02 * (period - 1)
        bench.write(begin_s + WRITTEN_AFTER_S)
        assert len(bench.bus.published) == period - 1
        bench.at(begin_s + 0.02)
        assert len(bench.bus.published) == period
    arrivals = [radio[0] for state in bench.bus.published for radio in state.vehicles["h1"].radio]
    assert len(arrivals) == 10
    wire_s = LINE.duration_s(14)
    for period, arrival_s in enumerate(arrivals):
        assert arrival_s == pytest.approx(100.0 + 0.02 * period + WRITTEN_AFTER_S + wire_s, abs=1e-3)


def test_vehicle_flies_by_what_its_radio_hears(simulated: Callable[[float], Bench]) -> None:
    bench = simulated(50.0)
    bench.at(0.02)
    assert bench.bus.published[-1].vehicles["h1"].on_floor
    # Receivers look for their module for some seconds.
    for period in range(2, 152):
        bench.write(0.02 * period - 0.013)
        bench.at(0.02 * period)
    flown = bench.bus.published[-1].vehicles["h1"]
    assert not flown.on_floor
    assert flown.velocity_m_s[0] > 0.0


def test_requests_do_not_wait_for_rare_frames(simulated: Callable[[float], Bench]) -> None:
    bench = simulated(1.0)
    bench.at(0.0)
    replies: list[bytes] = []
    fault = InjectedFault(at_s=0.0, fault={"kind": "close"})
    request = Inject(source="test", faults=(fault,))
    bench.bus.requests.append(Incoming("simulator", "inject", request, b"", 0.0, replies.append))
    bench.at(LONGEST_STEP_S)
    assert len(replies) == 1
    assert not bench.bus.published
