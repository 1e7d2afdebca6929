"""Promises of arbiter and autopilot together: each state of the arbiter is one of the autopilot."""

import math
from collections.abc import Callable

import pytest
from mavlink_bench import WOULD_REFUSE, Bench
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.radios.mavlink_settings import ARDUPILOT, MODES
from rcopterx.radios.mavlink_state import REPEATED_S, SILENT_S
from rcopterx.simulator.autopilot import (
    CONSISTENT_S,
    ENDURANCE_S,
    GCS_LOSS_S,
    LAND,
    LANDING,
    LOITER,
    LOSS_S,
    PAUSE_S,
    EmulatedAutopilot,
)
from rcopterx.transmitter_gateway.inputs import Action, PoseInput, State

OFFBOARD = MODES["offboard"].reported


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_vehicle_that_is_not_armed_gets_no_thrust_and_keeps_its_mode(bench: Bench) -> None:
    assert not any(bench.run(4.0, 0.6))
    assert bench.state is State.DISARMED
    assert (bench.vehicle.armed, bench.vehicle.mode) == (False, LOITER)
    assert bench.module == "ready, 16.80 V, link 100 %"


def test_a_vehicle_is_armed_in_its_mode_without_thrust_and_then_flies(bench: Bench) -> None:
    bench.fly()
    assert bench.pulses_us[0] == pytest.approx(1580.0, abs=1.0)
    assert bench.pulses_us[2] == pytest.approx(1540.0, abs=1.0)


@pytest.mark.parametrize("mode", ["guided", "guided_nogps"])
def test_a_vehicle_flies_in_modes_of_ardupilot(mode: str) -> None:
    Bench(mode=mode).fly()


def attitudes_per_s(bench: Bench) -> float:
    """Attitudes that arrive in the next second."""
    number, start_s = 0, bench.now_s
    while bench.now_s < start_s + 1.0:
        before = bench.vehicle.reports

        def counted(now_s: float, before: Callable[[float], list[bytes]] = before) -> list[bytes]:
            nonlocal number
            packets = before(now_s)
            number += sum(packet[7] == mavlink.MAVLINK_MSG_ID_ATTITUDE for packet in packets)
            return packets

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(bench.vehicle, "reports", counted)
            bench.run(0.1)
    return number


def test_attitudes_stay_frequent_when_another_ground_station_requests_slow_streams() -> None:
    bench = Bench(mode="guided_nogps")
    bench.fly()
    assert attitudes_per_s(bench) >= 45
    other = mavlink.MAVLink(None, 250, mavlink.MAV_COMP_ID_MISSIONPLANNER)
    request = mavlink.MAVLink_request_data_stream_message(1, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    bench.vehicle.receive(request.pack(other), bench.now_s)
    bench.run(1.0)
    assert attitudes_per_s(bench) >= 45


@pytest.mark.parametrize("mode", MODES)
def test_a_landed_vehicle_is_disarmed_also_where_its_autopilot_misses_the_landing(mode: str) -> None:
    bench = Bench(mode=mode)
    bench.fly()
    bench.height_m = 0.02
    bench.request(Action.SHUTDOWN)
    while bench.state is not State.CUT:
        bench.run(0.02, None)
    bench.run(0.5, None)
    assert bench.vehicle.armed, "its landing detector refuses"
    assert bench.transmitter.protocol.status(bench.now_s).armed
    assert bench.module.startswith("the autopilot is still armed: Disarming denied: not landed")
    bench.run(2.5, None)
    assert not bench.vehicle.armed
    assert "ready" in bench.module


def test_an_autopilot_that_refuses_to_disarm_is_not_forced_where_it_is_not_seen_on_the_floor() -> None:
    bench = Bench(mode="guided_nogps")
    bench.fly()
    bench.run(4.5, None, seen=False)
    assert bench.state is State.CUT
    assert bench.vehicle.armed
    assert bench.module.startswith("the autopilot is still armed")


@pytest.mark.parametrize("terminates", [False, True])
def test_a_kill_stops_the_motors_within_a_period_and_ends_with_a_reset(terminates: bool) -> None:
    bench = Bench(flight_termination=terminates)
    bench.fly()
    assert bench.request(Action.KILL)
    bench.transmitter.tick(bench.now_s + 0.004)
    assert not bench.motors_run
    assert not bench.vehicle.armed
    bench.run(1.0, 0.0)
    assert bench.request(Action.RESET)
    assert bench.vehicle.terminated is terminates
    if terminates:
        bench.run(2.0, 0.0)
        assert not bench.request(Action.ARM)
        assert bench.module.startswith("the autopilot would refuse to arm")
        bench.vehicle.power_cycle(bench.now_s)
    bench.fly()


def test_without_commands_the_arbiter_holds_and_lands_and_the_autopilot_obeys(bench: Bench) -> None:
    bench.fly()
    bench.run(LOSS_S + 0.5, None)
    assert bench.state is State.LAND
    assert bench.vehicle.mode == OFFBOARD


def test_a_gateway_that_dies_leaves_a_vehicle_that_lands_by_itself(bench: Bench) -> None:
    bench.fly()
    died_s = bench.now_s
    while bench.vehicle.mode == OFFBOARD:
        bench.now_s += 0.02
        bench.live()
    assert bench.now_s - died_s == pytest.approx(LOSS_S, abs=0.05)
    assert bench.vehicle.mode == LAND
    assert bench.pulses_us[1:4] == pytest.approx((1500.0, 1500.0, 1500.0))
    assert bench.motors_run


def test_an_ardupilot_that_has_just_booted_is_not_ready_and_says_why() -> None:
    bench = Bench(mode="guided_nogps")
    bench.run(3.0, 0.0)
    assert not bench.request(Action.ARM)
    assert bench.module == "the autopilot would refuse to arm: PreArm: Accels inconsistent"
    bench.fly()


def test_a_px4_with_an_empty_battery_is_not_ready_in_the_mode_of_its_start() -> None:
    bench = Bench()
    bench.run(3.0, 0.0)
    assert bench.module.startswith("ready")
    bench.vehicle.flown_s = ENDURANCE_S
    bench.run(1.2, 0.0)
    assert bench.vehicle.mode == LOITER
    assert not bench.request(Action.ARM)
    assert bench.module == "the autopilot would refuse to arm: Critical battery"
    bench.run(2.0 * REPEATED_S, 0.0)
    assert bench.module == "the autopilot would refuse to arm: Critical battery", "PX4 says it once"


def test_an_autopilot_that_answers_no_command_is_not_called_ready_when_it_is_to_arm() -> None:
    bench = Bench()
    bench.run(3.0, 0.0)
    bench.vehicle.hangs = True
    assert bench.request(Action.ARM)
    bench.run(SILENT_S + 0.5, 0.0)
    assert bench.module.endswith("; not armed: no answer")
    assert not bench.vehicle.armed


def test_an_ardupilot_whose_gateway_dies_keeps_its_tilt_then_hovers_level_then_lands() -> None:
    bench = Bench(mode="guided_nogps")
    bench.fly()
    hover_us, died_s = bench.pulses_us[0], bench.now_s
    seen: dict[float, tuple[float, ...]] = {}
    while bench.now_s < died_s + GCS_LOSS_S + PAUSE_S + 1.0:
        bench.now_s += 0.02
        bench.live()
        seen[bench.now_s - died_s] = bench.pulses_us
    tilted = [after_s for after_s, pulses_us in seen.items() if abs(pulses_us[2] - 1500.0) > 1.0]
    assert max(tilted) == pytest.approx(0.5, abs=0.05), "GUID_TIMEOUT"
    sinking = [after_s for after_s, pulses_us in seen.items() if pulses_us[0] < hover_us - 10.0]
    assert min(sinking) == pytest.approx(GCS_LOSS_S + PAUSE_S, abs=0.05)
    assert bench.vehicle.mode == LANDING[ARDUPILOT]


def test_a_pilot_who_changes_the_mode_keeps_the_vehicle(bench: Bench) -> None:
    bench.fly()
    bench.vehicle.mode = LOITER
    bench.run(2.0)
    assert bench.state is not State.ARMED
    bench.run(10.0)
    assert (bench.vehicle.armed, bench.vehicle.mode) == (True, LOITER)


def test_a_battery_failsafe_lands_the_vehicle_and_is_named_with_its_mode_until_the_next_take_off() -> None:
    bench = Bench(mode="guided_nogps")
    bench.vehicle.parameters["BATT_FS_LOW_ACT"] = 1.0
    bench.fly()
    empties(bench.vehicle, bench.now_s)
    bench.run(1.2)
    why = "mode LAND (9): Battery Failsafe"
    assert (bench.state, bench.vehicle.mode, bench.module) == (State.LAND, LANDING[ARDUPILOT], why)
    bench.height_m = 0.02
    while bench.state is not State.CUT:
        bench.run(0.02)
    assert bench.vehicle.armed, "it has not detected its landing yet"
    assert bench.transmitter.arbiter.reason == f"descent over: transmitter not ready: {why}"
    assert bench.module == f"armed in {why}"
    bench.vehicle.armed = False
    bench.run(5.0, 0.0)
    assert bench.module.startswith(WOULD_REFUSE)
    assert bench.module.endswith("PreArm: Battery 1 below minimum arming voltage")
    assert not bench.request(Action.ARM)


def test_a_vehicle_that_disarms_itself_in_flight_is_not_armed_again(bench: Bench) -> None:
    bench.fly()
    bench.vehicle.armed = False
    bench.run(3.0)
    assert not bench.vehicle.armed
    assert bench.state is not State.ARMED


def test_a_refusal_in_several_packets_is_shown_whole_with_its_cause_and_without_tabs() -> None:
    bench = Bench()
    bench.run(2.5, 0.0)
    assert bench.request(Action.ARM)
    empties(bench.vehicle, bench.now_s)
    bench.run(0.5, 0.0)
    assert not bench.vehicle.armed
    text = "Critical battery; Arming denied: Resolve system health failures first"
    assert bench.module == f"ready, 16.80 V, link 100 %; refused: {text}", (
        "of 52 characters, 50 fit in a packet"
    )


def test_a_vehicle_that_refuses_to_arm_does_not_take_off_and_says_why() -> None:
    bench = Bench()
    bench.run(2.5, 0.0)
    bench.vehicle.terminated = True
    assert bench.request(Action.ARM)
    assert not any(bench.run(3.0))
    assert bench.state is not State.ARMED
    assert bench.module.startswith("the autopilot did not arm: Arming denied: flight terminated")
    bench.height_m = 0.02
    bench.run(5.0, None)
    assert bench.state is State.CUT
    assert bench.module.startswith("the autopilot would refuse to arm: Arming denied: flight terminated")


def test_a_vehicle_that_restarts_in_flight_is_not_flown_on(bench: Bench) -> None:
    bench.fly()
    bench.vehicle.power_cycle(bench.now_s)
    assert not any(bench.run(3.0))
    assert bench.state is not State.ARMED


def test_without_yaw_stick_the_heading_of_the_take_off_is_kept(bench: Bench) -> None:
    bench.yaw_rad = 2.0
    bench.fly()
    assert bench.pulses_us[3] == pytest.approx(1500.0, abs=1.0)
    bench.yaw_rad += 0.1
    bench.run(0.1)
    turned = bench.pulses_us[3]
    assert turned > 1500.0, "turned to the left, it turns back to the right"
    rate_deg_s = (turned - 1500.0) / 400.0 * bench.settings.full_yaw_rate_deg_s
    assert rate_deg_s == pytest.approx(math.degrees(0.28), rel=0.05)


def test_poses_of_the_own_vehicle_are_passed_to_its_autopilot(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, seen = Bench(external_pose=True), []
    monkeypatch.setattr(bench.transmitter.protocol, "pose_seen", lambda *pose, standing: seen.append(pose))
    bench.run(0.1)
    other = PoseInput("c2", 1, 1, (9.0, 9.0, 9.0), 0.02, 0.0)
    hidden = PoseInput("c1", 1, 100, None, 0.02, 0.0)
    for pose in (other, hidden):
        bench.transmitter.on_pose(pose, bench.now_s)
    assert set(seen) == {((0.0, 0.0, 0.8), 0.0)}


def test_silence_of_the_autopilot_ends_a_flight(bench: Bench) -> None:
    bench.fly()
    bench.vehicle.powered = False
    bench.run(1.5)
    assert bench.state is not State.ARMED
    assert "no attitude" in bench.module
    bench.run(3.0)
    assert "vehicle gone: no heartbeat" in bench.module


def test_an_ardupilot_that_takes_thrusts_for_climb_rates_is_not_armed() -> None:
    bench = Bench(mode="guided_nogps")
    bench.vehicle.parameters["GUID_OPTIONS"] = 0.0
    bench.run(2.0, 0.0)
    assert not bench.request(Action.ARM)
    assert bench.module == "parameters of the autopilot: GUID_OPTIONS is 0, right is 8, thrust of set points"


def test_commands_of_someone_else_are_not_obeyed_in_another_mode(bench: Bench) -> None:
    bench.run(2.5, 0.0)
    bench.vehicle.armed = True
    bench.run(2.0, 0.0)
    assert bench.vehicle.armed, "armed by someone else, in another mode"
    assert bench.module == "armed in mode LOITER (50593792)"
    assert not bench.request(Action.ARM)


def boots(vehicle: EmulatedAutopilot, now_s: float) -> None:
    vehicle.power_cycle(now_s)


def empties(vehicle: EmulatedAutopilot, now_s: float) -> None:
    vehicle.flown_s = ENDURANCE_S


def terminates(vehicle: EmulatedAutopilot, now_s: float) -> None:
    vehicle.terminated = True


CAUSES: list[tuple[str, Callable[[EmulatedAutopilot, float], None], str]] = [
    ("guided_nogps", boots, "PreArm: Accels inconsistent"),
    ("guided_nogps", empties, "PreArm: Battery 1 below minimum arming voltage"),
    ("guided_nogps", terminates, "Arming denied: flight terminated, restart it"),
    ("guided", boots, "PreArm: Accels inconsistent"),
    ("offboard", empties, "Critical battery"),
]


@pytest.mark.parametrize("later_s", [0.0, 0.5])
@pytest.mark.parametrize(("mode", "happens", "reason"), CAUSES)
def test_a_vehicle_that_would_refuse_to_arm_is_not_ready_within_a_second_and_says_why(
    mode: str, happens: Callable[[EmulatedAutopilot, float], None], reason: str, later_s: float
) -> None:
    bench = Bench(mode=mode)
    bench.run(CONSISTENT_S + 2.0 + later_s, 0.0)
    assert bench.module.startswith("ready")
    happens(bench.vehicle, bench.now_s)
    bench.run(1.0, 0.0)
    assert not bench.request(Action.ARM)
    bench.run(1.0, 0.0)
    assert bench.module == WOULD_REFUSE + reason
