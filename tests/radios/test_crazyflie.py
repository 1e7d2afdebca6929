"""Promises of the Crazyflie's driver: directions, arming, stop, watchdog and readiness."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie import (
    FRAMES_PER_REQUEST,
    LONGEST_LINE,
    REARMING_S,
    SILENT_S,
    CrazyflieProtocol,
    CrazyflieSettings,
    FirmwareReports,
)
from rcopterx.radios.protocol import FrameFlags, ProtocolError
from rcopterx.radios.set_points import AttitudeSetPoint

DISARMED, ARMED = 1100.0, 1900.0
HOVER = (1540.0, 1500.0, 1500.0, 1500.0, ARMED)
LOW = (1100.0, 1500.0, 1500.0, 1500.0, DISARMED)
KILL = FrameFlags(kill=True)
pulses = st.floats(1100.0, 1900.0)


def packets(frame: bytes) -> list[crtp.Packet]:
    return [crtp.Packet.from_bytes(raw) for raw in crtp.separated(frame)]


def set_point(frame: bytes) -> AttitudeSetPoint:
    [point] = [crtp.set_point_of(each) for each in packets(frame) if each.port == crtp.COMMANDER]
    return point


def reported(protocol: CrazyflieProtocol, state: crtp.SupervisorState, now_s: float = 0.0) -> None:
    protocol.receive(crtp.joined([state.packet().to_bytes()]), now_s)


def round_of(protocol: CrazyflieProtocol, channels: tuple[float, ...]) -> list[crtp.Packet]:
    return [each for _ in range(FRAMES_PER_REQUEST) for each in packets(protocol.encode(channels))]


@given(pulses, pulses, pulses, st.floats(1200.0, 1900.0))
def test_a_frame_of_an_armed_vehicle_is_read_back(
    aileron: float, elevator: float, rudder: float, throttle: float
) -> None:
    protocol = CrazyflieProtocol()
    sent = (throttle, aileron, elevator, rudder, ARMED)
    point = set_point(protocol.encode(sent))
    assert protocol.settings.pulses_us(point, armed=True) == pytest.approx(sent, abs=0.01)


@pytest.mark.parametrize(
    ("channel", "expected"),
    [
        (1, AttitudeSetPoint(roll_deg=30.0, thrust=0.55)),
        (2, AttitudeSetPoint(pitch_deg=-30.0, thrust=0.55)),
        (3, AttitudeSetPoint(yaw_rate_deg_s=200.0, thrust=0.55)),
    ],
)
def test_sticks_to_the_right_and_forward_are_the_firmwares_directions(
    channel: int, expected: AttitudeSetPoint
) -> None:
    sticks = [*HOVER]
    sticks[channel] = 1900.0
    assert set_point(CrazyflieProtocol().encode(sticks)) == expected


def test_thrust_ends_below_what_the_firmware_needs_for_the_attitude() -> None:
    assert set_point(CrazyflieProtocol().encode((2000.0, *HOVER[1:]))).thrust == 1.0
    assert set_point(CrazyflieProtocol().encode((1000.0, *HOVER[1:]))).thrust == 0.0


@given(pulses, pulses, st.booleans())
def test_without_the_arming_channel_or_with_a_kill_there_is_no_thrust(
    throttle: float, aileron: float, kill: bool
) -> None:
    channels = (throttle, aileron, 1500.0, 1500.0, ARMED if kill else DISARMED)
    frame = CrazyflieProtocol().encode(channels, FrameFlags(kill=kill))
    assert set_point(frame) == AttitudeSetPoint()
    assert (packets(frame)[0] == crtp.EMERGENCY_STOP) is kill


def test_a_vehicle_is_armed_until_it_reports_it_and_disarmed_afterwards() -> None:
    protocol = CrazyflieProtocol()
    protocol.link_opened(0.0)
    on, off = crtp.arm_request(on=True), crtp.arm_request(on=False)
    assert on not in round_of(protocol, HOVER), "nothing is known of the vehicle"
    reported(protocol, crtp.SupervisorState(can_be_armed=True))
    assert on in round_of(protocol, HOVER)
    assert on not in round_of(protocol, LOW)
    reported(protocol, crtp.SupervisorState(armed=True))
    assert on not in round_of(protocol, HOVER)
    assert off in round_of(protocol, LOW)
    reported(protocol, crtp.SupervisorState(armed=True, arms_itself=True))
    assert off not in round_of(protocol, LOW)


def test_the_watchdog_is_fed_from_the_first_flight_on() -> None:
    protocol, without = CrazyflieProtocol(), CrazyflieProtocol(CrazyflieSettings(watchdog=False))
    assert crtp.WATCHDOG not in round_of(protocol, LOW)
    for channels in (HOVER, LOW, LOW):
        assert round_of(protocol, channels).count(crtp.WATCHDOG) == 1
        assert crtp.WATCHDOG not in round_of(without, channels)


def test_the_watchdog_is_fed_often_enough_by_repeated_frames() -> None:
    assert CrazyflieProtocol().keepalive_s * FRAMES_PER_REQUEST < 0.3


@pytest.mark.parametrize(
    ("state", "ready", "words"),
    [
        (crtp.SupervisorState(armed=True, arms_itself=True), True, "ready"),
        (crtp.SupervisorState(can_be_armed=True), True, "ready"),
        (crtp.SupervisorState(), False, "checks itself"),
        (crtp.SupervisorState(armed=True, tumbled=True), False, "lies on its side"),
        (crtp.SupervisorState(armed=True, crashed=True), False, "crashed"),
        (crtp.SupervisorState(locked=True), False, "off and on"),
    ],
)
def test_a_vehicle_is_ready_when_its_firmware_would_fly(
    state: crtp.SupervisorState, ready: bool, words: str
) -> None:
    protocol = CrazyflieProtocol()
    assert protocol.status(0.0).text == "port not open"
    protocol.link_opened(0.0)
    assert not protocol.status(0.0).ready
    reported(protocol, state)
    assert protocol.status(0.0).ready is ready
    assert words in protocol.status(0.0).text
    assert not protocol.status(SILENT_S + 0.1).ready
    assert not protocol.status(SILENT_S + 0.1).ready


def test_an_old_firmware_is_named_although_it_reports_no_state() -> None:
    protocol = CrazyflieProtocol()
    protocol.link_opened(0.0)
    assert crtp.VERSION_REQUEST in round_of(protocol, LOW)
    protocol.receive(crtp.joined([crtp.Packet(13, 1, bytes((0, 10))).to_bytes()]), 0.0)
    assert protocol.status(0.0).text == "firmware too old: protocol 10, 12 is needed (2026.04)"


def test_a_vehicle_that_checks_itself_is_ready_until_it_takes_long() -> None:
    protocol = CrazyflieProtocol()
    protocol.link_opened(0.0)
    reported(protocol, crtp.SupervisorState(armed=True, arms_itself=True, can_fly=True), 0.0)
    reported(protocol, crtp.SupervisorState(arms_itself=True), 0.25)
    assert protocol.status(0.3).ready
    reported(protocol, crtp.SupervisorState(arms_itself=True), REARMING_S)
    assert not protocol.status(REARMING_S + 0.1).ready


def test_the_console_says_why_the_firmware_does_not_arm() -> None:
    protocol = CrazyflieProtocol()
    protocol.link_opened(0.0)
    text = b"SUP: M2 arming RPM check (3000-12000rpm) [FAIL]\nSUP: Disarming\n"
    for part in (text[:30], text[30:60], text[60:]):
        protocol.receive(crtp.joined([crtp.Packet(crtp.CONSOLE, 0, part).to_bytes()]), 0.0)
    protocol.encode(HOVER)
    reported(protocol, crtp.SupervisorState(armed=True))
    assert protocol.status(0.0).text.endswith("SUP: M2 arming RPM check (3000-12000rpm) [FAIL]")


def test_a_console_without_line_ends_does_not_grow_and_hides_no_later_line() -> None:
    reports = FirmwareReports()
    for _ in range(1000):
        reports.take(crtp.Packet(crtp.CONSOLE, 0, b"x" * 30), 0.0)
    for part in (b"\nSUP: M1 arming RPM ", b"check [FAIL]\n"):
        reports.take(crtp.Packet(crtp.CONSOLE, 0, part), 0.0)
    assert reports.complaint == "SUP: M1 arming RPM check [FAIL]"
    reports.take(crtp.Packet(crtp.CONSOLE, 0, 1000 * b"y" + b"[FAIL]\n"), 0.0)
    assert len(reports.complaint) <= LONGEST_LINE


def test_what_the_console_said_before_a_flight_explains_no_later_refusal() -> None:
    reports = FirmwareReports()
    reports.take(crtp.Packet(crtp.CONSOLE, 0, b"M1 blocked [FAIL]\n"), 0.0)
    reports.take(crtp.SupervisorState(armed=True, can_fly=True).packet(), 1.0)
    reports.take(crtp.Packet(crtp.CONSOLE, 0, b"SUP: Crashed, recovery required\n"), 2.0)
    reports.take(crtp.SupervisorState(armed=True).packet(), 60.0)
    problem = reports.problem(60.1, armed=True, thrusts=True)
    assert problem == "the firmware did not arm: its motors have not spun up"


def test_a_successor_counts_the_vehicle_as_ready_until_it_is_silent() -> None:
    protocol = CrazyflieProtocol()
    protocol.link_resumed(5.0)
    assert protocol.status(5.5).ready
    assert not protocol.status(5.1 + SILENT_S).ready
    assert crtp.WATCHDOG in round_of(protocol, HOVER)


@given(st.lists(st.binary(max_size=40)))
def test_malformed_answers_are_counted(raw: list[bytes]) -> None:
    protocol = CrazyflieProtocol()
    protocol.link_opened(0.0)
    for data in raw:
        protocol.receive(data, 0.0)
    protocol.receive(b"\x05\x9c", 0.0)
    protocol.receive(crtp.joined([b"\x9c\x8c\x00"]), 0.0)
    assert protocol.counters["crtp: a frame that ends within a packet"] > 0
    assert protocol.counters["crtp: state of 2 bytes, 3 are needed"] > 0


@pytest.mark.parametrize("settings", [{"full_tilt_deg": 0.0}, {"full_yaw_rate_deg_s": 800.0}])
def test_wrong_settings_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ProtocolError, match=next(iter(settings))):
        CrazyflieSettings(**settings)


def test_the_status_has_the_share_of_requests_that_were_answered() -> None:
    protocol = CrazyflieProtocol()
    protocol.link_opened(0.0)
    for number in range(9):
        round_of(protocol, LOW)
        if number % 2 == 0:
            reported(protocol, crtp.SupervisorState(armed=True))
    assert protocol.status(0.0).text == "ready, link 50 %"


def test_a_colour_is_sent_at_once_and_repeated_as_packets_are_lost_and_firmware_restarts() -> None:
    protocol = CrazyflieProtocol()
    assert not [each for each in round_of(protocol, LOW) if each.port == crtp.PARAMETERS]
    assert protocol.light((255, 128, 1))
    sent = [each.data for each in packets(protocol.encode(LOW)) if each.port == crtp.PARAMETERS]
    # SET_BY_NAME of crazyflie-firmware, crtp_parameters.md; 0xRRGGBB, little end first
    assert sent == [
        b"\0ring\0effect\0\x08\x0e",
        b"\0ring\0fadeTime\0\x06\xcd\xcc\xcc\x3d",
        b"\0ring\0fadeColor\0\x0a\x01\x80\xff\0",
    ]
    again = [each for _ in range(4) for each in round_of(protocol, LOW) if each.port == crtp.PARAMETERS]
    assert len(again) in (9, 12)
