import json
import math
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.simulator.tracker_frame import PROFILES, FrameContent, TrackedBody, TrackerFrame
from rcopterx.simulator.tracker_session import EMPTY_PACKET, TrackerConnection
from rcopterx.vicon_gateway.datastream import DataStreamSession
from rcopterx.vicon_gateway.objects import (
    ApplicationInfo,
    Contents,
    FrameInfo,
    GlobalSegments,
    LatencyInfo,
    ObjectEnums,
    Ping,
    RequestFrame,
    SubjectInfo,
    WireObject,
    decode_body,
    packet,
)
from rcopterx.vicon_gateway.wire import ObjectType, WireError, encode_object, encode_packet, split_objects

WORKED_EXAMPLE = {
    name: bytes.fromhex(text)
    for name, text in json.loads(
        (Path(__file__).parents[1] / "fixtures" / "vicon_worked_example.json").read_text()
    ).items()
}
TYPES = frozenset({1, 2, 5, 9, 26, 100004})
IDS = {"h1": 1, "h2": 2}
ALL = PROFILES["tracker3"]


def captured(number: int, *bodies: TrackedBody, y_up: bool = False) -> FrameContent:
    return FrameContent(TrackerFrame(number, bodies or (body(number),)), 50.0, IDS, y_up)


def body(number: int, name: str = "h1", occluded: bool = False) -> TrackedBody:
    return TrackedBody(name, (0.1 * number, 0.0, 1.0), occluded=occluded)


def connection(*requests: WireObject, offer: frozenset[int] = ALL) -> TrackerConnection:
    session = TrackerConnection(offer)
    assert session.receive(packet(*requests)) == []
    return session


def sent(data: bytes | None) -> list[WireObject]:
    assert data is not None
    return decode_body(data[8:])


def payloads(data: bytes | None) -> list[tuple[int, bytes]]:
    assert data is not None
    return split_objects(data[8:])


def kinds(data: bytes | None) -> set[int]:
    return {kind for kind, _ in payloads(data)}


def test_emulator_plays_the_worked_example_object_by_object() -> None:
    session = TrackerConnection(TYPES)
    assert session.greeting() == WORKED_EXAMPLE["offer"]
    assert session.receive(WORKED_EXAMPLE["selection"]) == []
    yaw_90_deg = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    for number, x_m, name in (
        (41, 1.0, "first_frame"),
        (42, 1.001, "next_frame"),
        (43, 0.0, "occluded_frame"),
    ):
        heli1 = TrackedBody("heli1", (x_m, -0.2505, 1.2345), yaw_90_deg, occluded=number == 43)
        frame = TrackerFrame(number, (heli1,), (("System", 0.0055),))
        data = session.publish(FrameContent(frame, 50.0, {"heli1": 1}))
        assert data is not None
        assert decode_like(data) == decode_like(WORKED_EXAMPLE[name])
        assert len(data) == len(WORKED_EXAMPLE[name])


def decode_like(data: bytes) -> list[object]:
    """Decode with poses rounded to 1e-9 mm: metres and sqrt(0.5) are not exact, the example's numbers are."""
    found: list[object] = []
    for item in decode_body(data[8:]):
        if isinstance(item, GlobalSegments):
            values = [
                (s.id, *(round(v, 9) + 0.0 for v in (*s.translation_mm, *s.rotation))) for s in item.segments
            ]
            found.append((item.subject, values))
        else:
            found.append(item)
    return found


def test_nothing_is_sent_before_the_selection_even_when_frames_are_requested() -> None:
    session = connection(RequestFrame(streaming=True))
    assert session.publish(captured(0)) is None
    session.receive(packet(ObjectEnums(TYPES)))
    assert FrameInfo(1) in sent(session.publish(captured(1)))


def test_selection_alone_sends_nothing() -> None:
    session = connection(ObjectEnums(TYPES))
    assert session.publish(captured(0)) is None


def test_push_sends_every_frame_whatever_is_selected() -> None:
    session = connection(ObjectEnums(frozenset({100004})), RequestFrame(streaming=True))
    assert sent(session.publish(captured(0))) == [Contents()]
    session.receive(packet(ObjectEnums(frozenset({5}))))
    assert sent(session.publish(captured(1))) == [FrameInfo(1)]


def test_empty_selection_gets_empty_packets_that_count_as_nothing() -> None:
    session = connection(ObjectEnums(), RequestFrame(streaming=True))
    assert session.publish(captured(0)) == EMPTY_PACKET
    assert session.publish(captured(1)) == EMPTY_PACKET
    session.receive(packet(ObjectEnums(TYPES)))
    assert FrameInfo(2) in sent(session.publish(captured(2)))


def test_only_what_is_offered_is_sent() -> None:
    session = connection(ObjectEnums(ALL | {14, 25}), RequestFrame(True), offer=PROFILES["tracker1"])
    assert kinds(session.publish(captured(0))) == PROFILES["tracker1"]


@pytest.mark.parametrize("profile", PROFILES)
def test_every_offered_frame_type_can_be_sent(profile: str) -> None:
    session = connection(ObjectEnums(PROFILES[profile]), RequestFrame(True), offer=PROFILES[profile])
    assert kinds(session.publish(captured(0))) == PROFILES[profile] - {42}


def test_contents_come_first_with_counts_and_what_is_left_out() -> None:
    session = connection(ObjectEnums(TYPES | {40}), RequestFrame(True))
    both = (body(0), body(0, "h2", occluded=True))
    first = sent(session.publish(captured(0, *both)))
    assert first[0] == Contents({1: 1, 2: 2, 5: 1, 9: 1, 26: 1, 40: 2})
    second = sent(session.publish(captured(1, *both)))
    assert second[0] == Contents({1: 0, 2: 0, 5: 1, 9: 1, 26: 1, 40: 0}, frozenset({1, 2, 40}))


def test_changed_static_object_is_sent_again_with_all_of_its_type() -> None:
    session = connection(ObjectEnums(TYPES), RequestFrame(True))
    session.publish(captured(0, body(0)))
    objects = sent(session.publish(captured(1, body(1), body(1, "h2"))))
    assert [item.name for item in objects if isinstance(item, SubjectInfo)] == ["h1", "h2"]
    assert objects[0] == Contents({1: 0, 2: 2, 5: 1, 9: 2, 26: 1}, frozenset({1}))


def test_last_subject_that_goes_is_seen_to_go() -> None:
    server = connection(ObjectEnums(TYPES), RequestFrame(True), offer=TYPES)
    client = DataStreamSession()
    client.feed(server.greeting(), 0.0)
    for content in (captured(0), FrameContent(TrackerFrame(1, ()), 50.0, IDS)):
        data = server.publish(content)
        assert data is not None
        client.feed(data, 0.0)
    frame = client.take_frame()
    assert frame is not None
    assert frame.subjects == ()


def test_client_without_contents_gets_everything_in_every_frame() -> None:
    session = connection(ObjectEnums(TYPES - {100004}), RequestFrame(True))
    assert kinds(session.publish(captured(0, body(0)))) == kinds(session.publish(captured(1, body(0))))


def test_reselected_type_is_sent_again() -> None:
    session = connection(ObjectEnums(TYPES), RequestFrame(True))
    session.publish(captured(0))
    session.receive(packet(ObjectEnums(TYPES - {2})))
    session.publish(captured(1))
    session.receive(packet(ObjectEnums(TYPES)))
    assert 2 in kinds(session.publish(captured(2)))


def test_ping_is_answered_at_once_in_a_packet_of_its_own_whatever_the_profile() -> None:
    session = TrackerConnection(PROFILES["tracker1"])
    replies = session.receive(packet(Ping(2**63)) + packet(Ping(7)))
    assert replies == [packet(Ping(2**63)), packet(Ping(7))]


def test_requests_that_mean_nothing_here_are_ignored() -> None:
    session = TrackerConnection(ALL)
    unknown = encode_packet(encode_object(123, b"abc"))
    assert session.receive(unknown + EMPTY_PACKET) == []


def test_malformed_request_is_refused() -> None:
    with pytest.raises(WireError):
        TrackerConnection(ALL).receive(b"GET / HTTP/1.1\r\n")
    with pytest.raises(WireError):
        TrackerConnection(ALL).receive(encode_packet(bytes(100_000)))


def test_requests_may_arrive_byte_by_byte() -> None:
    session = TrackerConnection(ALL)
    for byte in packet(ObjectEnums(TYPES), RequestFrame(True)):
        session.receive(bytes((byte,)))
    assert session.publish(captured(0)) is not None


def test_occluded_subject_is_listed_without_poses() -> None:
    session = connection(ObjectEnums(ALL), RequestFrame(True))
    objects = payloads(session.publish(captured(0, body(0), body(0, "h2", occluded=True))))
    for kind in (ObjectType.GLOBAL_SEGMENTS, ObjectType.LOCAL_SEGMENTS):
        subjects = [struct.unpack_from("<I", payload) for found, payload in objects if found == kind]
        assert subjects == [(1,)]


def test_y_up_says_so_and_turns_the_poses() -> None:
    session = connection(ObjectEnums(frozenset({9, 37})), RequestFrame(True))
    still = TrackedBody("h1", (1.0, 2.0, 3.0))
    objects = sent(session.publish(captured(0, still, y_up=True)))
    assert ApplicationInfo(y_up=True) in objects
    (segments,) = (item for item in objects if isinstance(item, GlobalSegments))
    assert segments.segments[0].translation_mm == (1000.0, 3000.0, -2000.0)


def test_latency_samples_are_sent_as_given() -> None:
    samples = (("Data Collected", 0.002), ("Processing", 0.001))
    session = connection(ObjectEnums(frozenset({26})), RequestFrame(True))
    content = FrameContent(TrackerFrame(0, (), samples), 50.0, {})
    assert sent(session.publish(content)) == [LatencyInfo(samples)]


steps = st.lists(
    st.tuples(st.frozensets(st.sampled_from(["h1", "h2"])), st.booleans(), st.integers(0, 2)),
    min_size=1,
    max_size=12,
)


@given(steps, st.sampled_from(sorted(PROFILES)))
def test_our_client_sees_what_was_captured_through_any_carry_over(
    sequence: list[tuple[frozenset[str], bool, int]], profile: str
) -> None:
    server = TrackerConnection(PROFILES[profile])
    client = DataStreamSession()
    client.feed(server.greeting(), 0.0)
    server.receive(client.take_outgoing())
    for number, (listed, occluded, place) in enumerate(sequence):
        bodies = tuple(
            TrackedBody(name, (float(place), 0.0, 1.0), occluded=occluded) for name in sorted(listed)
        )
        data = server.publish(FrameContent(TrackerFrame(number, bodies), 50.0, IDS))
        assert data is not None
        client.feed(data, 0.0)
        frame = client.take_frame()
        assert frame is not None
        expected = [(item.name, occluded, None if occluded else item.position_m) for item in bodies]
        assert [(s.name, s.occluded, s.position_m) for s in frame.subjects] == expected
