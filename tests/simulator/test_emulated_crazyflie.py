"""Promises of the emulated Crazyflie: its ages, its supervisor and its motors."""

import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import IDEAL
from support.vehicle_types import QUADROTOR

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie import CrazyflieSettings, ring_colour
from rcopterx.radios.set_points import AttitudeSetPoint
from rcopterx.simulator.crazyflie import Crazyflie, battery_voltage_v
from rcopterx.simulator.crazyflie_supervisor import (
    BLOCKED_S,
    FLYING_S,
    INVERTED_S,
    LANDED_S,
    LEVEL_AFTER_S,
    PERIOD_S,
    SPIN_UP_S,
    STANDING_G,
    STOP_AFTER_S,
    TILTED_S,
    WATCHDOG_S,
)
from rcopterx.simulator.first_order_plant import FirstOrderPlant
from rcopterx.simulator.plant import BodyPose

SETTINGS = CrazyflieSettings()
HOVER_THRUST = float(QUADROTOR.hover_input[2])
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
    assert 0.0 < level_s - (1.0 + LEVEL_AFTER_S) <= PERIOD_S
    assert 0.0 < stop_s - (1.0 + STOP_AFTER_S) <= PERIOD_S
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
    assert vehicle.motors_run, "once unlocked, thrust stays unlocked until a restart"


def test_a_link_that_ends_just_after_a_landing_locks_it_as_in_flight() -> None:
    for stood_s in (0.0, FLYING_S - STOP_AFTER_S - 0.1, FLYING_S + 2 * PERIOD_S):
        vehicle = Crazyflie(SETTINGS)
        flown(vehicle)
        for step in range(max(round(stood_s / 0.02), 1)):
            vehicle.receive(crtp.set_point_packet(AttitudeSetPoint()).to_bytes(), 1.0 + 0.02 * step)
        vehicle.advance(20.0)
        assert asked(vehicle, 20.0).locked is (stood_s < FLYING_S), stood_s


def test_after_a_landing_it_checks_itself_and_obeys_no_thrust_meanwhile() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    states = []
    for step in range(300):
        now_s = 0.1 + 0.02 * step
        vehicle.receive(crtp.set_point_packet(AttitudeSetPoint()).to_bytes(), now_s)
        states.append((now_s, asked(vehicle, now_s)))
    flying_s = [now_s for now_s, state in states if state.flying]
    grounded_s = [now_s for now_s, state in states if not state.can_fly]
    assert max(flying_s) == pytest.approx(0.1 + FLYING_S, abs=3 * PERIOD_S)
    assert min(grounded_s) == pytest.approx(0.1 + FLYING_S + LANDED_S, abs=4 * PERIOD_S)
    assert max(grounded_s) - min(grounded_s) == pytest.approx(4 * PERIOD_S, abs=PERIOD_S)


@pytest.mark.parametrize(
    ("force_g", "after_s"),
    [((0.0, 1.0), TILTED_S), ((-1.0, 0.0), INVERTED_S), ((0.4, 0.2), TILTED_S)],
    ids=["on its side", "upside down", "sinking fast"],
)
def test_a_vehicle_that_tumbles_in_flight_stops_until_it_is_upright_and_recovered(
    force_g: tuple[float, float], after_s: float
) -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    vehicle.advance(1.0)
    vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), 1.0)
    vehicle.supervisor.force_g = force_g
    stopped_s = None
    for step in range(150):
        now_s = 1.0 + 0.02 * step
        vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), now_s)
        stopped_s = now_s if stopped_s is None and not vehicle.motors_run else stopped_s
    assert stopped_s == pytest.approx(1.0 + after_s, abs=2.1 * PERIOD_S)
    assert asked(vehicle, 4.0).crashed
    assert asked(vehicle, 4.0).tumbled
    vehicle.receive(crtp.RECOVERY.to_bytes(), 4.1)
    assert asked(vehicle, 4.2).crashed, "not upright"
    vehicle.supervisor.force_g = STANDING_G
    vehicle.advance(4.3)
    vehicle.receive(crtp.RECOVERY.to_bytes(), 4.3)
    vehicle.advance(4.6)
    state = asked(vehicle, 4.6)
    assert (state.crashed, state.tumbled, state.can_fly) == (False, False, True)


def test_free_fall_is_no_tumble_and_a_tilt_of_a_moment_neither() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    for step in range(300):
        now_s = 0.02 * step
        tilted = now_s % 1.0 < TILTED_S - 2 * PERIOD_S
        falls = step % 100 < 50
        vehicle.supervisor.force_g = (0.05 if falls else 0.4 if tilted else 1.0), 0.05
        vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), now_s)
        assert vehicle.motors_run


def test_a_motor_that_stops_in_flight_locks_a_brushless_vehicle() -> None:
    vehicle = Crazyflie(SETTINGS, arms_itself=False)
    vehicle.receive(crtp.arm_request(on=True).to_bytes(), 0.0)
    vehicle.advance(SPIN_UP_S + 0.2)
    flown(vehicle, SPIN_UP_S + 0.2)
    vehicle.supervisor.blocked = True
    vehicle.advance(SPIN_UP_S + 0.2 + BLOCKED_S + 3 * PERIOD_S)
    assert asked(vehicle, SPIN_UP_S + 0.2 + BLOCKED_S + 3 * PERIOD_S).locked


@pytest.mark.parametrize(
    ("sticks", "force_g"),
    [
        ((0.0, 0.0, HOVER_THRUST, 0.0), (1.0, 0.0)),
        ((0.6, -0.4, HOVER_THRUST, 0.0), (1.0, 0.0)),
        ((0.3, 0.0, 0.4 * HOVER_THRUST, 0.0), (0.4, 0.0)),
        (None, (0.0, 0.0)),
    ],
    ids=["hovers", "accelerates", "sinks", "falls"],
)
def test_it_measures_the_force_of_its_rotors_along_its_body(
    sticks: tuple[float, ...] | None, force_g: tuple[float, float]
) -> None:
    vehicle = Crazyflie(SETTINGS)
    model = replace(QUADROTOR, damping=(-1e-3, -1e-3, -1e-3, -1.0))
    plant = FirstOrderPlant("c1", model, IDEAL, 0, BodyPose((0.0, 0.0, 50.0), 0.7))
    plant.stop_motors() if sticks is None else plant.set_input(sticks)
    for _ in range(100):
        plant.advance(0.01)
        vehicle.sense(plant)
    assert vehicle.supervisor.force_g == pytest.approx(force_g, abs=0.03)
    plant.place(BodyPose((0.0, 0.0, 0.0)))
    vehicle.sense(plant)
    assert vehicle.supervisor.force_g == STANDING_G


def test_a_watchdog_that_was_fed_once_stops_it_a_second_after_the_last_time() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    for step in range(200):
        vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), step / 50)
        if step < 100:
            vehicle.receive(crtp.WATCHDOG.to_bytes(), step / 50)
        if not 99 / 50 + WATCHDOG_S <= step / 50 < 99 / 50 + WATCHDOG_S + PERIOD_S:
            assert vehicle.motors_run is (step / 50 < 99 / 50 + WATCHDOG_S)
    assert asked(vehicle, 4.0).locked


def test_a_stop_lasts_until_a_restart() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    vehicle.receive(crtp.EMERGENCY_STOP.to_bytes(), 0.1)
    vehicle.advance(0.1 + PERIOD_S)
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
    vehicle.receive(crtp.set_point_packet(FLY).to_bytes(), 0.1 + SPIN_UP_S + 2 * PERIOD_S)
    assert vehicle.motors_run
    vehicle.receive(off, 0.6)
    vehicle.advance(0.6 + PERIOD_S)
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


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 2.0))
def test_the_voltage_falls_with_the_charge_and_with_the_load(used: float, more: float, load: float) -> None:
    voltage_v = battery_voltage_v(used, load)
    assert 0.0 <= battery_voltage_v(min(used + more, 1.0), load) <= voltage_v <= 4.2
    assert battery_voltage_v(used, load + 0.1) <= voltage_v


def test_the_battery_of_its_body_is_measured_ends_its_power_and_is_full_after_a_power_cycle() -> None:
    vehicle = Crazyflie(SETTINGS)
    conditions = replace(IDEAL, battery_endurance_s=10.0)
    plant = FirstOrderPlant("c1", QUADROTOR, conditions, 0, BodyPose((0.0, 0.0, 5.0)))
    plant.set_input((0.0, 0.0, HOVER_THRUST, 0.0))
    plant.advance(5.0)
    vehicle.sense(plant)
    assert plant.used == 0.0, "a vehicle that was just switched on has a full battery"
    plant.advance(5.0)
    vehicle.sense(plant)
    assert vehicle.voltage_v == pytest.approx(battery_voltage_v(0.5, 1.0), abs=0.02)
    plant.advance(6.0)
    vehicle.sense(plant)
    assert not vehicle.powered
    vehicle.power_cycle(20.0)
    vehicle.sense(plant)
    assert vehicle.powered
    assert vehicle.voltage_v > 3.7


def test_the_thrust_does_not_fall_with_the_battery_as_the_firmware_compensates_for_it() -> None:
    conditions = replace(IDEAL, battery_endurance_s=10.0, battery_sag=0.3)
    plant = FirstOrderPlant("c1", QUADROTOR, conditions, 0, BodyPose((0.0, 0.0, 5.0)))
    vehicle = Crazyflie(SETTINGS)
    vehicle.sense(plant)
    plant.set_input((0.0, 0.0, HOVER_THRUST, 0.0))
    plant.advance(9.0)
    vehicle.sense(plant)
    assert vehicle.voltage_v < 3.5
    assert plant.position_m[2] == pytest.approx(5.0, abs=0.01)
    plant.compensated = False
    plant.advance(0.5)
    assert plant.position_m[2] < 4.9, "as any other vehicle"


def test_without_its_battery_nothing_runs_and_nothing_answers() -> None:
    vehicle = Crazyflie(SETTINGS)
    flown(vehicle)
    vehicle.switch_off()
    assert not vehicle.motors_run
    assert vehicle.receive(crtp.NULL_PACKET, 0.2) == []


@given(st.tuples(*3 * [st.integers(0, 255)]))
def test_the_led_ring_shows_the_colour_of_its_parameters(colour: tuple[int, int, int]) -> None:
    vehicle = Crazyflie(CrazyflieSettings())
    for packet in ring_colour(*colour):
        (raw,) = vehicle.receive(packet.to_bytes(), 1.0)
        assert crtp.Packet.from_bytes(raw).data[-1] == 0
    assert vehicle.light == colour


@pytest.mark.parametrize(
    ("packet", "error"),
    [
        (crtp.set_parameter("ring", "fadeColor", crtp.UINT8, b"\1"), 22),
        (crtp.set_parameter("ring", "colour", crtp.UINT8, b"\1"), 2),
        (crtp.set_parameter("lamp", "effect", crtp.UINT8, b"\1"), 2),
        (crtp.Packet(crtp.PARAMETERS, crtp.NAMED_CHANNEL, b"\0ring"), 2),
        (crtp.Packet(crtp.PARAMETERS, crtp.NAMED_CHANNEL, b""), 2),
    ],
)
def test_a_parameter_that_does_not_exist_or_of_another_type_is_an_error(
    packet: crtp.Packet, error: int
) -> None:
    vehicle = Crazyflie(CrazyflieSettings())
    (raw,) = vehicle.receive(packet.to_bytes(), 1.0)
    assert crtp.Packet.from_bytes(raw).data[-1] == error
    assert vehicle.light is None
