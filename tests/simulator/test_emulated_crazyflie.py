"""Promises of the emulated Crazyflie: its ages, its supervisor and its motors."""

import struct

import pytest

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.radios.set_points import AttitudeSetPoint
from rcopterx.simulator.crazyflie import LEVEL_AFTER_S, SPIN_UP_S, STOP_AFTER_S, WATCHDOG_S, Crazyflie

SETTINGS = CrazyflieSettings()
FLY = AttitudeSetPoint(roll_deg=15.0, thrust=0.6)


def flown(vehicle: Crazyflie, now_s: float = 0.0) -> None:
    for point in (AttitudeSetPoint(), FLY):
        vehicle.receive(crtp.set_point_packet(point).to_bytes(), now_s)
    assert vehicle.motors_run


def asked(vehicle: Crazyflie, now_s: float) -> crtp.SupervisorState:
    [answer] = vehicle.receive(crtp.STATE_REQUEST.to_bytes(), now_s)
    state = crtp.SupervisorState.of(crtp.Packet.from_bytes(answer))
    assert state is not None
    return state


def test_thrust_counts_only_after_a_set_point_without_thrust() -> None:
    vehicle = Crazyflie(SETTINGS)
    vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), 0.0)
    assert not vehicle.motors_run
    flown(vehicle, 0.1)
    assert vehicle.take_outputs()[-1][1][:2] == pytest.approx((1580.0, 1700.0))


def test_without_set_points_it_levels_itself_then_stops_until_a_restart() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle, 1.0)
    vehicle.take_outputs()
    vehicle.advance(10.0)
    (level_s, level), (stop_s, stopped) = vehicle.take_outputs()
    assert (level_s, stop_s) == (1.0 + LEVEL_AFTER_S, 1.0 + STOP_AFTER_S)
    assert level[:2] == pytest.approx((1580.0, 1500.0))
    assert stopped[0] == 1100.0
    assert asked(vehicle, 10.0).locked
    vehicle.power_cycle(11.0)
    assert not asked(vehicle, 11.0).locked


def test_without_set_points_on_the_floor_it_is_not_locked() -> None:
    vehicle = Crazyflie(SETTINGS)
    vehicle.receive(crtp.set_point_packet(AttitudeSetPoint()).to_bytes(), 0.0)
    vehicle.advance(10.0)
    assert asked(vehicle, 10.0).armed
    vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), 10.0)
    assert not vehicle.motors_run, "thrust waits for a set point without thrust again"


def test_a_watchdog_that_was_fed_once_stops_it_a_second_after_the_last_time() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    for step in range(200):
        vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), step / 50)
        if step < 100:
            vehicle.receive(crtp.WATCHDOG.to_bytes(), step / 50)
        assert vehicle.motors_run is (step / 50 < 99 / 50 + WATCHDOG_S)
    assert asked(vehicle, 4.0).locked


def test_a_stop_lasts_until_a_restart() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    vehicle.receive(crtp.EMERGENCY_STOP.to_bytes(), 0.1)
    assert not vehicle.motors_run
    for packet in (
        crtp.arm_request(on=True),
        crtp.set_point_packet(AttitudeSetPoint()),
        crtp.set_point_packet(FLY),
    ):
        vehicle.receive(packet.to_bytes(), 0.2)
    assert not vehicle.motors_run
    vehicle.power_cycle(1.0)
    flown(vehicle, 1.1)


def test_a_brushless_vehicle_flies_only_while_it_is_armed() -> None:
    vehicle = Crazyflie(SETTINGS, arms_itself=False)
    on, off = (crtp.arm_request(on=on).to_bytes() for on in (True, False))
    for point in (AttitudeSetPoint(), FLY):
        vehicle.receive(crtp.set_point_packet(point).to_bytes(), 0.0)
    assert not vehicle.motors_run
    assert asked(vehicle, 0.0).can_be_armed
    [answer] = vehicle.receive(on, 0.1)
    assert crtp.Packet.from_bytes(answer).data == b"\x81\x01\x01"
    assert not vehicle.motors_run, "its motors spin up"
    vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), 0.11 + SPIN_UP_S)
    assert vehicle.motors_run
    vehicle.receive(off, 0.6)
    assert not vehicle.motors_run


def test_packets_that_it_does_not_know_are_counted() -> None:
    vehicle = Crazyflie(SETTINGS)
    for raw in (bytes(40), crtp.Packet(13, 0).to_bytes(), crtp.Packet(crtp.COMMANDER, 0, b"1").to_bytes()):
        assert vehicle.receive(raw, 0.0) == []
    assert vehicle.rejected.total() == 3
    assert vehicle.receive(crtp.NULL_PACKET, 0.0) == [crtp.NULL_PACKET]


def test_a_set_point_is_what_the_vehicle_gets() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle, 0.5)
    [last] = vehicle.take_frames()[-1:]
    assert (last.arrival_s, last.pulses_us[0]) == (0.5, pytest.approx(1580.0))
    assert struct.calcsize("<fffH") == len(crtp.set_point_packet(FLY).data)


def test_without_its_battery_nothing_runs_and_nothing_answers() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    vehicle.switch_off()
    assert not vehicle.motors_run
    assert vehicle.receive(crtp.NULL_PACKET, 0.2) == []
