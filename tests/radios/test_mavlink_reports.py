"""Promises of the MAVLink driver: readiness, silence and malformed bytes in the reports of an autopilot."""

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mavlink_peer import ARDUPILOT, HOVER, IDLE, LOW, PARAMETERS, PX4, Peer
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.radios.mavlink import MavlinkProtocol
from rcopterx.radios.mavlink_parameters import RULES, TRIES
from rcopterx.radios.mavlink_state import HEARTBEAT_GONE_S, REPEATED_S, SILENT_S


@pytest.mark.parametrize(
    ("act", "ready", "words"),
    [
        (lambda peer: None, False, "no heartbeat from the autopilot yet"),
        (lambda peer: peer.heartbeat(), True, "ready, link 100 %"),
        (lambda peer: peer.heartbeat(autopilot=ARDUPILOT), False, "does not have the mode"),
    ],
)
def test_a_vehicle_is_ready_when_its_autopilot_would_fly(
    act: Callable[[Peer], None], ready: bool, words: str
) -> None:
    peer = Peer()
    act(peer)
    assert peer.ready is ready
    assert words in peer.text
    assert MavlinkProtocol().status(0.0).text == "port not open"


@pytest.mark.parametrize(
    ("autopilot", "name", "value", "words"),
    [
        (ARDUPILOT, "GUID_OPTIONS", 0.0, "0, right is 8, thrust of set points"),
        (ARDUPILOT, "GUID_OPTIONS", 7.0, "7, right is 8, thrust of set points"),
        (ARDUPILOT, "GUID_TIMEOUT", 3.0, "3, right is 0.5 s"),
        (ARDUPILOT, "GUID_TIMEOUT", 0.1, "0.1, right is 0.5 s"),
        (ARDUPILOT, "FS_GCS_ENABLE", 0.0, "0, right is 5, land without the gateway"),
        (ARDUPILOT, "MAV_GCS_SYSID", 254.0, "254, right is 255, own_system"),
        (ARDUPILOT, "SYSID_MYGCS", 254.0, "254, right is 255, own_system"),
        (ARDUPILOT, "ATC_ANGLE_MAX", 20.0, "20, right is 30"),
        (ARDUPILOT, "ANGLE_MAX", 2000.0, "2000, right is 100 * 30"),
        (PX4, "COM_OF_LOSS_T", 5.0, "5, right is 0.5 s"),
        (PX4, "COM_OF_LOSS_T", 0.1, "0.1, right is 0.5 s"),
        (PX4, "MC_YAWRATE_MAX", 100.0, "100, right is 200"),
    ],
)
def test_a_parameter_that_forbids_flights_is_named(
    autopilot: int, name: str, value: float, words: str
) -> None:
    mode = "offboard" if autopilot == PX4 else "guided"
    right, wrong = Peer(mode=mode), Peer(parameters=PARAMETERS | {name: value}, mode=mode)
    for peer in (right, wrong):
        peer.heartbeat(autopilot=autopilot)
    assert right.ready
    assert not wrong.ready
    assert wrong.text == f"parameters of the autopilot: {name} is {words}"


def test_every_parameter_that_is_read_has_a_row_and_the_right_value_on_the_page() -> None:
    page = (Path(__file__).parents[2] / "docs" / "mavlink.md").read_text()
    rows = [line.split("|")[1:3] for line in page.splitlines() if line.startswith("| `")]
    named = {name: value for names, value in rows for name in re.findall(r"`(\w+)`", names)}
    assert {rule.name for rules in RULES.values() for rule in rules} <= named.keys()
    assert (named["GUID_TIMEOUT"].strip(), named["COM_OF_LOSS_T"].strip()) == ("0.5", "0.5")


def test_parameters_are_requested_some_times_and_unknown_ones_are_not_awaited() -> None:
    peer = Peer(parameters={"COM_OF_LOSS_T": math.nan})
    peer.heartbeat()
    assert peer.text == "the parameters of the autopilot are being read"
    requested = [
        each.param_id
        for _ in range(60)
        for each in peer.frame(LOW)
        if each.get_type() == "PARAM_REQUEST_READ"
    ]
    assert requested == ["COM_OF_LOSS_T", "MC_YAWRATE_MAX"] * TRIES
    peer.attitude(0.0)
    assert peer.ready


def test_silence_is_noticed() -> None:
    peer = Peer()
    peer.heartbeat()
    peer.now_s = SILENT_S + 0.1
    assert peer.text == "no attitude from the autopilot"
    peer.now_s = HEARTBEAT_GONE_S + 0.1
    peer.attitude(0.0)
    assert peer.text == "vehicle gone: no heartbeat for 3.1 s"
    peer.heartbeat()
    assert peer.text == "no SYS_STATUS from the autopilot, which has the result of its checks"
    peer.summary()
    assert peer.ready


PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
GYRO, ACCEL = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
BATTERY, GPS = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY, mavlink.MAV_SYS_STATUS_SENSOR_GPS
OFFBOARD_MODE, REFUSES = 6 << 16, "the autopilot would refuse to arm: "


@pytest.mark.parametrize(
    ("autopilot", "mode", "enabled", "health", "words"),
    [
        (ARDUPILOT, 0, PREARM, 0, REFUSES + "its own checks fail"),
        (ARDUPILOT, 0, PREARM | BATTERY, 0, REFUSES + "battery"),
        (ARDUPILOT, 0, PREARM, PREARM, "ready"),
        (ARDUPILOT, 0, 0, 0, "ready"),
        # PX4 never enables the bit of its checks, and in hold they fail without a position.
        (PX4, OFFBOARD_MODE, 0, 0, REFUSES + "its own checks fail"),
        (PX4, OFFBOARD_MODE, 0, PREARM, "ready"),
        (PX4, 0, GPS, 0, "ready"),
        (PX4, 0, BATTERY | GYRO | ACCEL, GYRO | ACCEL, REFUSES + "battery"),
        (PX4, 0, BATTERY | GYRO | ACCEL, BATTERY, REFUSES + "gyroscope and accelerometer"),
        (PX4, 0, BATTERY, PREARM, "ready"),
    ],
)
def test_an_autopilot_that_would_refuse_to_arm_is_not_ready_and_says_why(
    autopilot: int, mode: int, enabled: int, health: int, words: str
) -> None:
    peer = Peer(mode="guided" if autopilot == ARDUPILOT else "offboard")
    peer.heartbeat(autopilot=autopilot, mode=mode)
    peer.summary(16_000, enabled, health)
    assert peer.text.startswith(words)
    assert peer.ready is (words == "ready")


def test_the_newest_text_of_failed_checks_is_the_reason() -> None:
    peer = Peer(mode="guided")
    peer.heartbeat(autopilot=ARDUPILOT)
    peer.summary(16_000, PREARM | BATTERY, 0)
    for text in ("PreArm: Accels inconsistent", "PreArm: Battery 1 below minimum arming voltage"):
        peer.now_s += REPEATED_S + 1.0
        peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_CRITICAL, text.encode()))
        peer.heartbeat(autopilot=ARDUPILOT)
        peer.attitude(0.0)
        peer.summary(16_000, PREARM | BATTERY, 0)
        assert peer.text == REFUSES + text


def test_a_text_that_the_autopilot_withdraws_is_no_reason() -> None:
    peer = Peer(mode="guided")
    peer.heartbeat(autopilot=ARDUPILOT, mode=0)
    for text in ("GCS Failsafe", "PreArm: Accels inconsistent", "GCS Failsafe Cleared"):
        peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_WARNING, text.encode()))
    peer.summary(16_000, PREARM, 0)
    assert peer.text == REFUSES + "PreArm: Accels inconsistent"


def test_a_report_that_arrives_less_than_half_as_often_as_requested_is_requested_again() -> None:
    def requests(interval: int) -> int:
        found = 0
        for number in range(80):
            if number % interval == 0:
                peer.attitude(0.0)
            found += sum(
                each.get_type() == "COMMAND_LONG" and each.param1 == mavlink.MAVLINK_MSG_ID_ATTITUDE
                for each in peer.frame(LOW)
                if each.get_type() == "COMMAND_LONG"
            )
        return found

    peer = Peer(None)
    peer.attitude(0.0)
    peer.summary()
    requests(1)
    assert requests(1) == 0
    assert requests(10) > 3, "4 Hz, as MAVProxy requests it"
    requests(1)
    assert requests(1) == 0


def test_reports_that_do_not_arrive_are_requested_each_until_they_do() -> None:
    def requested() -> set[int]:
        return {
            each.param1
            for _ in range(20)
            for each in peer.frame(LOW)
            if each.get_type() == "COMMAND_LONG" and each.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        }

    peer = Peer(None)
    assert requested() == {mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_SYS_STATUS}
    peer.attitude(0.0)
    assert requested() == {mavlink.MAVLINK_MSG_ID_SYS_STATUS}
    peer.summary()
    assert requested() == set()


def test_the_status_has_voltage_and_the_share_of_packets_that_arrived() -> None:
    peer = Peer()
    peer.heartbeat()
    assert peer.text == "ready, link 100 %"
    peer.summary(15_430)
    peer.link.seq = (peer.link.seq + 4) % 256
    peer.attitude(0.0)
    peer.attitude(0.0)
    assert peer.text == "ready, 15.43 V, link 78 %"


def test_reports_arrive_in_pieces_as_on_a_serial_line() -> None:
    peer = Peer()
    for message in (
        peer.link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, PX4, 0, 0, 0),
        peer.link.attitude_encode(0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0),
    ):
        for byte in message.pack(peer.link):
            peer.protocol.receive(bytes((byte,)), 0.0)
    assert peer.ready
    assert peer.set_point(IDLE)[1][2] == pytest.approx(1.5)


def test_packets_of_other_dialects_count_and_those_of_others_do_not() -> None:
    peer = Peer(dialect=ardupilotmega)
    peer.heartbeat()
    peer.report(peer.link.meminfo_encode(0, 0))
    peer.attitude(0.0)
    other = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    peer.protocol.receive(other.attitude_encode(0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0).pack(other), 0.0)
    peer.protocol.receive(b"\xfe" + peer.link.meminfo_encode(0, 0).pack(peer.link, True)[1:], 0.0)
    assert peer.text == "ready, link 100 %"
    assert peer.set_point(HOVER)[1][2] == 0.0


PIECES = st.one_of(
    st.binary(max_size=60),
    st.sampled_from([b"\xfd", b"\xfd\xff\x00", b"\xfe\x09", b"\xfd\x09\x01"]),
    st.builds(
        lambda yaw, end: (
            mavlink.MAVLink(None, 1, 1)
            .attitude_encode(0, 0, 0, yaw, 0, 0, 0)
            .pack(mavlink.MAVLink(None, 1, 1))[:end]
        ),
        st.floats(width=32),
        st.integers(1, 60),
    ),
)


@given(st.lists(PIECES, max_size=12))
def test_malformed_bytes_are_counted_and_never_raise(raw: list[bytes]) -> None:
    peer = Peer()
    for data in raw:
        peer.protocol.receive(data, 0.0)
        assert len(peer.text) < 200
    # Longer than the longest packet: whatever had begun has ended.
    peer.protocol.receive(bytes(600), 0.0)
    assert peer.protocol.counters["mavlink: malformed"] > 0


def test_an_attitude_that_is_not_finite_is_counted_and_not_used() -> None:
    peer = Peer(1.0)
    peer.attitude(math.nan)
    assert peer.protocol.counters["mavlink: an attitude that is not finite"] == 1
    assert peer.set_point(HOVER)[1][2] == pytest.approx(1.0)
