"""Promises of the packets of a Crazyflie: what is encoded is decoded, all else is rejected."""

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios import crtp
from rcopterx.radios.protocol import FrameDecodeError
from rcopterx.radios.set_points import AttitudeSetPoint

packets = st.builds(crtp.Packet, st.integers(0, 15), st.integers(0, 3), st.binary(max_size=crtp.LONGEST_DATA))
angles = st.floats(-400.0, 400.0, width=32)
states = st.builds(crtp.SupervisorState, *[st.booleans()] * 7)


@given(packets)
def test_a_packet_survives_its_encoding(packet: crtp.Packet) -> None:
    assert crtp.Packet.from_bytes(packet.to_bytes()) == packet


@given(angles, angles, angles, st.integers(0, 65535))
def test_a_set_point_survives_its_encoding(roll: float, pitch: float, yaw: float, thrust: int) -> None:
    set_point = AttitudeSetPoint(roll, pitch, yaw, thrust / crtp.FULL_THRUST)
    assert crtp.set_point_of(crtp.set_point_packet(set_point)) == set_point


@given(states)
def test_a_state_survives_its_encoding(state: crtp.SupervisorState) -> None:
    assert crtp.SupervisorState.of(state.packet()) == state


@given(st.lists(packets))
def test_a_frame_separates_into_its_packets(sent: list[crtp.Packet]) -> None:
    frame = crtp.joined(packet.to_bytes() for packet in sent)
    assert [crtp.Packet.from_bytes(raw) for raw in crtp.separated(frame)] == sent


@given(st.binary(max_size=80))
def test_any_bytes_are_decoded_or_rejected(raw: bytes) -> None:
    with suppress(FrameDecodeError):
        for part in crtp.separated(raw):
            crtp.SupervisorState.of(crtp.Packet.from_bytes(part))
    with suppress(FrameDecodeError):
        crtp.set_point_of(crtp.Packet.from_bytes(raw))


def test_the_bytes_are_those_of_the_documentation() -> None:
    point = AttitudeSetPoint(1.0, -2.0, 3.0, 2 / 3)
    assert crtp.set_point_packet(point).to_bytes() == b"\x3c" + struct.pack("<fffH", 1.0, -2.0, 3.0, 40_000)
    assert crtp.STATE_REQUEST.to_bytes() == b"\x9c\x0c"
    assert crtp.arm_request(on=True).to_bytes() == b"\x9d\x01\x01"
    assert crtp.EMERGENCY_STOP.to_bytes() == b"\x9d\x03"
    assert crtp.WATCHDOG.to_bytes() == b"\x9d\x04"
    answer = crtp.Packet.from_bytes(b"\x9c\x8c\x42\x00")
    assert crtp.SupervisorState.of(answer) == crtp.SupervisorState(armed=True, locked=True)


@pytest.mark.parametrize(
    "packet",
    [
        crtp.Packet(crtp.COMMANDER, 0, struct.pack("<fffH", float("nan"), 0.0, 0.0, 0)),
        crtp.Packet(crtp.COMMANDER, 0, bytes(13)),
        crtp.Packet(crtp.COMMANDER, 1, bytes(14)),
    ],
)
def test_a_set_point_that_is_none_is_rejected(packet: crtp.Packet) -> None:
    with pytest.raises(FrameDecodeError):
        crtp.set_point_of(packet)
