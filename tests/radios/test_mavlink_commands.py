"""Promises of the MAVLink driver: modes, arming, disarming and stop are requested until they are reported."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mavlink_peer import (
    ARDUPILOT,
    ARM,
    ARMED,
    DISARMED,
    GUIDED,
    GUIDED_NOGPS,
    HOVER,
    IDLE,
    KILL,
    LOW,
    MODE,
    OFFBOARD,
    PX4,
    Peer,
    pulses,
)
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.radios.mavlink import FORCE, set_point_of
from rcopterx.radios.mavlink_state import REPEATED_S, SETTLING_S, TEXT_S
from rcopterx.radios.protocol import FrameFlags
from rcopterx.radios.set_points import AttitudeSetPoint


@pytest.mark.parametrize(
    ("mode", "autopilot", "number", "reported", "mask"),
    [
        ("offboard", PX4, OFFBOARD, OFFBOARD << 16, 0b011),
        ("guided_nogps", ARDUPILOT, GUIDED_NOGPS, GUIDED_NOGPS, 0),
        ("guided", ARDUPILOT, GUIDED, GUIDED, 0),
    ],
)
def test_mode_then_arming_are_requested_until_they_are_reported(
    mode: str, autopilot: int, number: int, reported: int, mask: int
) -> None:
    peer = Peer(mode=mode)
    peer.heartbeat(autopilot=autopilot)
    assert peer.commands(LOW) == []
    assert peer.commands(IDLE, 31) == [(MODE, 1, number)] * 4
    peer.answer(MODE)
    assert peer.commands(IDLE) == [(ARM, 1, 0)]
    peer.heartbeat(autopilot=autopilot, mode=reported)
    assert peer.commands(IDLE) == [(ARM, 1, 0)]
    peer.answer(ARM)
    peer.attitude(0.0)
    assert peer.commands(HOVER) == []
    assert peer.ready
    assert peer.set_point(HOVER)[0].type_mask == mask


def test_a_late_heartbeat_does_not_undo_an_answer() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(IDLE)
    peer.answer(ARM)
    peer.heartbeat(mode=OFFBOARD << 16, armed=False)
    peer.attitude(0.0)
    peer.frame(HOVER)
    assert peer.ready
    peer.now_s += SETTLING_S
    peer.heartbeat(mode=OFFBOARD << 16, armed=False)
    peer.attitude(0.0)
    assert peer.text == "the autopilot has disarmed"


def test_an_answer_to_someone_else_says_nothing_about_our_commands() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(IDLE)
    peer.report(peer.link.command_ack_encode(ARM, mavlink.MAV_RESULT_ACCEPTED, target_system=7))
    assert (ARM, 1, 0) in peer.commands(IDLE)


def test_with_thrust_no_vehicle_is_armed_and_the_refusal_is_shown() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    assert peer.commands(HOVER, 3) == []
    assert peer.text == "the autopilot did not arm: no answer"
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text == "the autopilot did not arm: MAV_RESULT 2"
    peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_INFO, b"home set"))
    peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_CRITICAL, b"Preflight Fail: compass"))
    peer.answer(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    assert peer.text == "the autopilot did not arm: Preflight Fail: compass"
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text == "the autopilot did not arm: MAV_RESULT 2", "a text belongs to one refusal"
    peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_CRITICAL, b"Preflight Fail: compass"))
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    peer.frame(LOW)
    assert peer.text == "ready, link 100 %; refused: Preflight Fail: compass"


LONG_TEXT = "PreArm: Compass 2 not healthy, GPS 1: not configured, battery 1 below minimum arming voltage"


def parts_of(peer: Peer, text: str, number: int) -> list[object]:
    pieces = [text[start : start + 50].encode() for start in range(0, len(text), 50)]
    severity = mavlink.MAV_SEVERITY_CRITICAL
    return [peer.link.statustext_encode(severity, piece, number, n) for n, piece in enumerate(pieces)]


@pytest.mark.parametrize("order", [(0, 1), (1, 0), (0, 0, 1)])
def test_a_text_in_several_packets_is_joined_by_their_numbers(order: tuple[int, ...]) -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(HOVER, 3)
    parts = parts_of(peer, LONG_TEXT, 7)
    for number in order:
        peer.report(parts[number])
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text == f"the autopilot did not arm: {LONG_TEXT}"


def test_an_answer_between_the_packets_of_a_text_shows_no_half_text() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(HOVER, 3)
    first, second = parts_of(peer, LONG_TEXT, 7)
    peer.report(first)
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text == "the autopilot did not arm: MAV_RESULT 2"
    peer.report(second)
    assert peer.text == f"the autopilot did not arm: {LONG_TEXT}"


def test_a_packet_of_a_text_that_was_lost_is_shown_as_dots() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(HOVER, 3)
    peer.report(parts_of(peer, LONG_TEXT, 7)[1])
    peer.report(parts_of(peer, LONG_TEXT, 8)[0])
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text == f"the autopilot did not arm: ... {LONG_TEXT[50:]}"


def test_a_vehicle_is_disarmed_until_it_reports_it_but_not_in_a_mode_of_others() -> None:
    peer = Peer()
    peer.heartbeat(armed=True, mode=OFFBOARD << 16)
    assert set(peer.commands(LOW, 31)) == {(ARM, 0, 0)}
    peer.heartbeat(mode=OFFBOARD << 16)
    assert peer.commands(LOW) == []
    peer.heartbeat(armed=True)
    assert peer.commands(LOW) == []
    peer.attitude(0.0)
    assert peer.text == "armed in mode of a pilot or a failsafe (0)"


def test_a_mode_that_changes_in_flight_is_not_changed_back() -> None:
    peer = Peer()
    peer.heartbeat(armed=True, mode=OFFBOARD << 16)
    peer.frame(HOVER)
    peer.heartbeat(armed=True, mode=4 << 16 | 6 << 24)
    peer.attitude(0.0)
    assert peer.commands(HOVER) == []
    assert peer.text == "mode LAND (100925440)"
    peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_WARNING, b"Battery Failsafe"))
    assert peer.text == "mode LAND (100925440): Battery Failsafe"


@given(pulses, pulses, st.booleans())
def test_without_the_arming_channel_or_with_a_kill_there_is_no_thrust(
    throttle: float, aileron: float, kill: bool
) -> None:
    peer = Peer()
    peer.heartbeat(armed=True, mode=OFFBOARD << 16)
    channels = (throttle, aileron, 1500.0, 1500.0, ARMED if kill else DISARMED)
    by_kind = {each.get_type(): each for each in peer.frame(channels, FrameFlags(kill=kill))}
    assert set_point_of(by_kind["SET_ATTITUDE_TARGET"])[0] == AttitudeSetPoint()
    command = by_kind["COMMAND_LONG"]
    assert (command.command, command.param1, command.param2 == FORCE) == (ARM, 0, kill)


def test_a_kill_forces_in_every_frame_until_it_is_reported_and_then_now_and_then() -> None:
    peer = Peer(flight_termination=True)
    for known in (False, True):
        if known:
            peer.heartbeat(armed=True, mode=OFFBOARD << 16)
        for _ in range(5):
            kinds = [(each.command, each.param1, each.param2) for each in peer.frame(HOVER, KILL)[:2]]
            assert kinds == [(ARM, 0, FORCE), (mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1, 0)]
    peer.heartbeat(armed=False)
    forced = [
        each for _ in range(40) for each in peer.frame(LOW, KILL) if getattr(each, "param2", 0) == FORCE
    ]
    assert len(forced) in (3, 4)


def warning(peer: Peer, text: bytes, severity: int = mavlink.MAV_SEVERITY_WARNING) -> None:
    peer.report(peer.link.statustext_encode(severity, text))


def test_texts_of_long_ago_explain_neither_a_refusal_nor_a_mode() -> None:
    peer = Peer()
    peer.heartbeat(armed=True, mode=OFFBOARD << 16)
    peer.frame(HOVER)
    warning(peer, b"GPS Glitch")
    peer.now_s += TEXT_S + 0.5
    peer.attitude(0.0)
    peer.heartbeat(armed=True, mode=4 << 16 | 6 << 24)
    assert peer.text == "mode LAND (100925440)"
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(HOVER, 3)
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert "GPS Glitch" not in peer.text
    peer.now_s += TEXT_S + 0.5
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.attitude(0.0)
    warning(peer, b"Compass 2 calibrated")
    assert "Compass" not in peer.text


def test_a_refusal_shows_its_text_and_the_warning_just_before_as_px4_sends_the_cause() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(HOVER, 3)
    warning(peer, b"Preflight Fail: ekf2 missing data")
    peer.now_s += 1.0
    peer.attitude(0.0)
    warning(peer, b"Arming denied: Resolve system health failures", mavlink.MAV_SEVERITY_CRITICAL)
    peer.answer(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    assert peer.text.endswith(
        "Preflight Fail: ekf2 missing data; Arming denied: Resolve system health failures"
    )


def test_tabs_and_other_control_characters_of_a_text_are_spaces() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(HOVER, 3)
    warning(peer, b"Arming denied:\tResolve\x07 failures\t")
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text.endswith(": Arming denied: Resolve failures")


def test_a_refusal_that_is_not_repeated_is_forgotten_and_explains_no_later_one() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(IDLE)
    warning(peer, b"Arming denied: throttle is high")
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    peer.frame(LOW)
    assert peer.text.endswith("; refused: Arming denied: throttle is high")
    peer.now_s += REPEATED_S + 0.5
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.attitude(0.0)
    peer.summary(health=mavlink.MAV_SYS_STATUS_PREARM_CHECK)
    assert "refused" not in peer.text
    assert peer.ready
    peer.commands(HOVER, 3)
    assert peer.text == "the autopilot did not arm: no answer"


def colours(peer: Peer, frames: int) -> list[tuple[int, ...]]:
    return [
        (each.instance, each.pattern, each.custom_len, *each.custom_bytes[:3])
        for _ in range(frames)
        for each in peer.frame(LOW)
        if each.get_type() == "LED_CONTROL"
    ]


def test_a_colour_is_sent_to_ardupilot_at_once_and_with_every_heartbeat() -> None:
    peer = Peer(mode="guided_nogps")
    assert colours(peer, 40) == []
    assert peer.protocol.light((255, 0, 7))
    assert colours(peer, 1) == [(255, 255, 3, 255, 0, 7)]
    assert len(colours(peer, 40)) in (1, 2)


def test_px4_has_no_colours() -> None:
    peer = Peer(mode="offboard")
    assert not peer.protocol.light((255, 0, 7))
    assert colours(peer, 40) == []
