"""Promises of simulated flight controllers between receiver and motors."""

from pathlib import Path

from support.conditions import IDEAL
from support.vehicle_types import QUADROTOR

from rcopterx.radios.calibration import ArmingChannel, Calibration, SwitchChannel
from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.simulator.plant import BodyPose
from rcopterx.simulator.room import SimulatedRoom
from rcopterx.simulator.settings import SimulatedRadio, SimulatedVehicle

SWITCHED = Calibration(arming=ArmingChannel(4), emergency=SwitchChannel(5))
IDLE, LIFTING = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.8, 0.0)


def test_a_flight_controller_runs_its_motors_only_when_armed_with_low_throttle(tmp_path: Path) -> None:
    protocol = MultiProtocol(MultiSettings(rx_num=3))
    radio = SimulatedRadio(protocol, 3)
    start = BodyPose((0.0, 0.0, 0.0))
    vehicle = SimulatedVehicle("q1", "quad", QUADROTOR, start, str(tmp_path / "radio"), radio, SWITCHED)
    room = SimulatedRoom((vehicle,), IDEAL, 0, 0.0)
    now_s = 0.0

    def running(pulses_us: tuple[float, ...], seconds: float = 0.3) -> bool:
        nonlocal now_s
        end_s = now_s + seconds
        while now_s < end_s:
            now_s += 0.02
            room.radios["q1"].link.module.feed(protocol.encode(pulses_us), now_s)
            room.advance(now_s)
        return room.laboratory.plants["q1"].motors_running

    try:
        assert not running(SWITCHED.pulses_us(IDLE, throttle_low=True), 5.0)
        assert not running(SWITCHED.pulses_us(LIFTING)), "not armed"
        assert not running(SWITCHED.pulses_us(LIFTING, armed=True)), "armed with high throttle"
        assert not running(SWITCHED.pulses_us(IDLE, throttle_low=True, armed=True))
        assert running(SWITCHED.pulses_us(LIFTING, armed=True))
        assert not running(SWITCHED.pulses_us(LIFTING, armed=True, stopped=True)), "emergency"
        assert running(SWITCHED.pulses_us(LIFTING, armed=True))
        assert not running(SWITCHED.pulses_us(LIFTING)), "released"
    finally:
        room.close()
