import math
from collections.abc import Sequence

import pytest
from datastream_strategies import positions_m, unit_quaternions
from hypothesis import given
from test_objects import TYPES, WORKED_EXAMPLE

from rcopterx.vicon_gateway.datastream import DataStreamSession
from rcopterx.vicon_gateway.frame import CapturedFrame, Position, Quaternion
from rcopterx.vicon_gateway.objects import (
    ApplicationInfo,
    Contents,
    FrameInfo,
    GlobalSegments,
    LatencyInfo,
    ObjectEnums,
    ObjectQuality,
    Ping,
    RequestFrame,
    Segment,
    SegmentInfo,
    StreamInfo,
    SubjectInfo,
    decode_body,
    packet,
)
from rcopterx.vicon_gateway.rotations import matrix_from_quaternion, y_up_from_z_up
from rcopterx.vicon_gateway.wire import WireError, encode_object, encode_packet

KEEP_ALIVE = encode_packet(encode_object(100003, b""))  # type numbers that are not known are skipped

FULL_OFFER = frozenset({1, 2, 5, 6, 7, 8, 9, 23, 26, 28, 29, 36, 37, 39, 40, 42, 901, 28001, 100004})
SELECTED = Contents({1: 0, 2: 0, 5: 1, 9: 0, 26: 0}, frozenset({1, 2}))
STATICS = (
    StreamInfo(2_700_000),
    SubjectInfo(1, "heli1", (SegmentInfo(0, 1, "heli1"),)),
    SubjectInfo(2, "heli2", (SegmentInfo(0, 5, "heli2"),)),
)


def started(offer: frozenset[int] = TYPES) -> DataStreamSession:
    session = DataStreamSession()
    session.feed(packet(ObjectEnums(frozenset(offer))), 0.0)
    session.take_outgoing()
    return session


def pose(subject: int, x_mm: float = 1000.0, segment: int = 1) -> GlobalSegments:
    return GlobalSegments(subject, (Segment(segment, (x_mm, 0.0, 0.0)),))


def first(frame: int = 0, *extra: GlobalSegments) -> bytes:
    return packet(Contents({1: 1, 2: 2, 5: 1, 9: 0, 26: 0}), *STATICS, FrameInfo(frame), *extra)


def later(frame: int, *extra: GlobalSegments) -> bytes:
    return packet(SELECTED, FrameInfo(frame), *extra)


def take(session: DataStreamSession, data: bytes, now_s: float = 0.0) -> CapturedFrame:
    session.feed(data, now_s)
    frame = session.take_frame()
    assert frame is not None
    return frame


def test_worked_example_is_played_and_understood() -> None:
    session = DataStreamSession()
    session.feed(WORKED_EXAMPLE["offer"], 0.0)
    assert session.take_outgoing() == WORKED_EXAMPLE["selection"]
    frame = take(session, WORKED_EXAMPLE["first_frame"], 10.0)
    assert (frame.frame, frame.period_s, frame.received_s, frame.latency_s) == (41, 0.02, 10.0, 0.0055)
    (heli1,) = frame.subjects
    assert heli1.name == "heli1"
    assert not heli1.occluded
    assert heli1.position_m == (1.0, -0.2505, 1.2345)
    assert heli1.quaternion_xyzw == pytest.approx((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)), abs=1e-15)
    assert heli1.quality is None
    assert take(session, WORKED_EXAMPLE["next_frame"]).subjects[0].position_m == (1.001, -0.2505, 1.2345)
    occluded = take(session, WORKED_EXAMPLE["occluded_frame"])
    assert occluded.frame == 43
    assert occluded.subjects[0] == ("heli1", True, None, None, None)


def test_selection_and_streaming_go_out_in_one_packet_with_what_is_wanted_and_offered() -> None:
    session = DataStreamSession()
    session.feed(packet(ObjectEnums(frozenset(FULL_OFFER))), 0.0)
    outgoing = session.take_outgoing()
    assert decode_body(outgoing[8:]) == [
        ObjectEnums(frozenset({1, 2, 5, 9, 26, 37, 39, 40, 100004})),
        RequestFrame(streaming=True),
    ]
    assert session.take_outgoing() == b""


@pytest.mark.parametrize("data", [b"HTTP/1.1 400 Bad Request\r\n", b"vrpn: ver. 07.35  0\0\0\0", b"\0" * 12])
def test_other_servers_are_recognised_by_their_first_bytes(data: bytes) -> None:
    with pytest.raises(WireError, match="not a DataStream server"):
        DataStreamSession().feed(data, 0.0)


def test_first_packet_without_offer_is_no_datastream_server() -> None:
    with pytest.raises(WireError, match="not a DataStream server"):
        DataStreamSession().feed(KEEP_ALIVE, 0.0)


@pytest.mark.parametrize(
    ("missing", "what"), [(9, "the poses"), (2, "the subjects"), (5, "frame id"), (1, "period")]
)
def test_server_that_offers_no_poses_is_refused_loudly(missing: int, what: str) -> None:
    with pytest.raises(WireError, match=rf"does not offer .*{what} \(type {missing}\)"):
        DataStreamSession().feed(packet(ObjectEnums(TYPES - {missing})), 0.0)


def test_frames_before_the_selection_show_nothing_and_are_ignored() -> None:
    session = started()
    session.feed(packet(Contents({1: 1, 2: 2, 5: 1}), *STATICS, FrameInfo(7)), 0.0)
    assert session.take_frame() is None
    assert take(session, later(8)).frame == 8


def test_frame_without_contents_is_taken_as_it_is() -> None:
    frame = take(started(TYPES - {100004}), packet(*STATICS, FrameInfo(3), pose(1)))
    assert [subject.occluded for subject in frame.subjects] == [False, True]


def test_every_listed_subject_is_delivered_with_explicit_occlusion() -> None:
    frame = take(started(), first(0, pose(2, 250.0, segment=5)))
    assert frame.subjects[0] == ("heli1", True, None, None, None)
    assert frame.subjects[1].position_m == (0.25, 0.0, 0.0)


def test_motionless_subject_left_out_as_unchanged_stays_visible() -> None:
    session = started()
    take(session, first(0, pose(1)))
    still = take(session, packet(Contents({5: 1}, frozenset({1, 2, 9})), FrameInfo(1)))
    assert still.subjects[0].position_m == (1.0, 0.0, 0.0)
    gone = take(session, later(2))
    assert gone.subjects[0].occluded


def test_static_object_alone_wipes_the_subject_list() -> None:
    session = started(FULL_OFFER)
    assert len(take(session, first(0, pose(1))).subjects) == 2
    wiped = packet(Contents({5: 1, 9: 1, 40: 1}), ObjectQuality(1, 0.5), FrameInfo(1), pose(1))
    assert take(session, wiped).subjects == ()


def test_period_stays_known_when_the_carry_over_drops_it() -> None:
    session = started(FULL_OFFER)
    take(session, first(0))
    frame = take(session, packet(Contents({5: 1, 9: 0}), ObjectQuality(1, 0.5), FrameInfo(1)))
    assert frame.period_s == 0.02


def test_subjects_may_come_and_go() -> None:
    session = started()
    take(session, first(0, pose(1)))
    one = packet(
        Contents({1: 0, 2: 1, 5: 1, 9: 1}, frozenset({1})), STATICS[2], FrameInfo(1), pose(2, 1.0, 5)
    )
    assert [subject.name for subject in take(session, one).subjects] == ["heli2"]
    assert [subject.name for subject in take(session, first(2)).subjects] == ["heli1", "heli2"]


def test_root_segment_is_found_by_its_parent_whatever_its_name_and_place() -> None:
    info = SubjectInfo(1, "heli1", (SegmentInfo(9, 1, "heli1"), SegmentInfo(0, 9, "airframe")))
    segments = GlobalSegments(1, (Segment(1, (1.0, 1.0, 1.0)), Segment(9, (2000.0, 0.0, 0.0))))
    session = started()
    frame = take(session, packet(SELECTED, STATICS[0], info, FrameInfo(0), segments))
    assert frame.subjects[0].position_m == (2.0, 0.0, 0.0)


def test_surplus_bytes_behind_the_segments_are_no_segment() -> None:
    arm = Segment(1, (1.0, 1.0, 1.0))
    payload = GlobalSegments(2, (arm,)).payload() + GlobalSegments(0, (Segment(5),)).payload()[8:]
    session = started()
    session.feed(first(0), 0.0)
    frame = take(session, encode_packet(SELECTED.encode(), FrameInfo(1).encode(), encode_object(9, payload)))
    assert frame.subjects[1].occluded


@given(positions_m, unit_quaternions)
def test_y_up_servers_are_converted_to_z_up(position_m: Position, quaternion: Quaternion) -> None:
    expected = take(started(), first(0, _segment(position_m, quaternion))).subjects[0]
    turned = _segment(y_up_from_z_up(position_m), (*y_up_from_z_up(quaternion[:3]), quaternion[3]))
    session = started(FULL_OFFER)
    y_up = packet(Contents({37: 1, 9: 1}), *STATICS, ApplicationInfo(y_up=True), FrameInfo(0), turned)
    found = take(session, y_up).subjects[0]
    assert found.position_m == pytest.approx(expected.position_m, abs=1e-12)
    assert expected.quaternion_xyzw is not None
    assert found.quaternion_xyzw is not None
    dot = sum(a * b for a, b in zip(found.quaternion_xyzw, expected.quaternion_xyzw, strict=True))
    assert abs(dot) == pytest.approx(1.0, abs=1e-12)


def _segment(position_m: Position, quaternion: Quaternion) -> GlobalSegments:
    x, y, z = position_m
    mm = (x * 1000.0, y * 1000.0, z * 1000.0)
    return GlobalSegments(1, (Segment(1, mm, matrix_from_quaternion(quaternion)),))


@given(positions_m, unit_quaternions)
def test_poses_are_in_metres_with_unit_quaternions(position_m: Position, quaternion: Quaternion) -> None:
    subject = take(started(), first(0, _segment(position_m, quaternion))).subjects[0]
    assert subject.position_m == pytest.approx(position_m, abs=1e-12)
    assert subject.quaternion_xyzw is not None
    assert math.hypot(*subject.quaternion_xyzw) == pytest.approx(1.0, abs=1e-15)
    dot = sum(a * b for a, b in zip(subject.quaternion_xyzw, quaternion, strict=True))
    assert abs(dot) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(
    "bad",
    [
        Segment(1, (math.nan, 0.0, 0.0)),
        Segment(1, (0.0, math.inf, 0.0)),
        Segment(1, (0.0, 0.0, 1e12)),
        Segment(1, (0.0, 0.0, 0.0), (0.0,) * 9),
        Segment(1, (0.0, 0.0, 0.0), (math.nan,) * 9),
    ],
)
def test_pose_that_is_none_is_refused_counted_and_shown_as_occluded(bad: Segment) -> None:
    session = started()
    frame = take(session, first(0, GlobalSegments(1, (bad,)), pose(2, 1.0, 5)))
    assert [subject.occluded for subject in frame.subjects] == [True, False]
    assert session.counters.rejected == 1


def test_quality_is_per_subject_and_refused_out_of_range() -> None:
    session = started(FULL_OFFER)
    qualities = (ObjectQuality(1, 0.25), ObjectQuality(2, math.nan))
    frame = take(session, packet(SELECTED, *STATICS, *qualities, FrameInfo(0), pose(1)))
    assert [subject.quality for subject in frame.subjects] == [0.25, None]
    assert session.counters.rejected == 1


def test_latency_is_the_sum_of_the_plausible_samples() -> None:
    session = started()
    samples = (("Data Collected", 0.003), ("bad", math.nan), ("worse", -1.0), ("Processing", 0.002))
    frame = take(session, packet(SELECTED, *STATICS, FrameInfo(0), LatencyInfo(samples)))
    assert frame.latency_s == pytest.approx(0.005)
    assert session.counters.rejected == 2


def test_ping_goes_out_at_most_once_per_second() -> None:
    session = started(FULL_OFFER)
    take(session, first(0), 10.0)
    assert decode_body(session.take_outgoing()[8:]) == [Ping(1)]
    session.feed(packet(Ping(1)), 10.004)
    assert session.take_frame() is None
    assert session.take_outgoing() == b""
    take(session, later(1), 10.5)
    assert session.take_outgoing() == b""
    take(session, later(2), 11.0)
    assert decode_body(session.take_outgoing()[8:]) == [Ping(2)]


def test_nothing_is_pinged_where_it_is_not_offered() -> None:
    session = started()
    take(session, first(0), 10.0)
    take(session, later(1), 20.0)
    assert session.take_outgoing() == b""


def test_pings_unanswered_or_answered_wrongly_never_pile_up() -> None:
    session = started(FULL_OFFER)
    session.feed(first(0), 0.0)
    assert session.take_outgoing().endswith(packet(Ping(1)))
    for second in range(1, 6):
        session.feed(later(second) + packet(Ping(999)), float(second))
        assert session.take_outgoing() == packet(Ping(second + 1))
    assert session.network_latency_s is None


def latencies(round_trips_s: Sequence[float]) -> list[float]:
    """Latencies of frames, each after one more answered ping."""
    session, found = started(FULL_OFFER), []
    session.feed(first(0), 0.0)
    for number, round_trip_s in enumerate(round_trips_s, start=1):
        session.feed(packet(Ping(number)), 2.0 * number - 2.0 + round_trip_s)
        found.append(take(session, later(number), 2.0 * number).latency_s)
    return found


def test_half_the_shortest_round_trip_of_three_pings_and_more_is_network_latency() -> None:
    assert latencies([0.004, 0.002, 0.003, 0.4]) == pytest.approx([0.0, 0.0, 0.001, 0.001])


def test_a_ping_that_waits_for_a_processor_after_the_start_ages_no_pose() -> None:
    assert latencies([0.4, 0.002, 0.4, 0.4]) == pytest.approx([0.0, 0.0, 0.001, 0.001])


def test_only_the_newest_frame_is_delivered_and_the_others_are_counted() -> None:
    session = started()
    frame = take(session, first(0) + b"".join(later(number, pose(1)) for number in range(1, 10)))
    assert frame.frame == 9
    assert session.take_frame() is None
    assert (session.counters.frames, session.counters.skipped, session.counters.lost) == (1, 9, 0)


def test_carry_over_is_applied_to_frames_that_are_skipped() -> None:
    session = started()
    unchanged = packet(Contents({5: 1}, frozenset({1, 2, 9})), FrameInfo(2))
    frame = take(session, first(0) + later(1, pose(1)) + unchanged)
    assert frame.frame == 2
    assert not frame.subjects[0].occluded


def test_missing_frame_ids_are_counted_as_lost() -> None:
    session = started()
    session.feed(first(10), 0.0)
    session.feed(later(11), 0.0)
    session.feed(later(15), 0.0)
    assert session.counters.lost == 3


def test_frame_id_that_jumps_back_is_a_restart_and_delivered() -> None:
    session = started()
    take(session, first(1000))
    assert take(session, later(3)).frame == 3
    assert (session.counters.restarts, session.counters.lost) == (1, 0)


def test_repeated_frame_is_not_delivered_again() -> None:
    session = started()
    take(session, first(5))
    session.feed(later(5), 0.0)
    assert session.take_frame() is None
    assert session.counters.repeated == 1


def test_frame_id_that_means_none_is_refused() -> None:
    session = started()
    session.feed(first(0xFFFFFFFF), 0.0)
    assert session.take_frame() is None
    assert session.counters.rejected == 1


def test_frames_without_a_usable_period_are_refused_until_there_is_one() -> None:
    session = started()
    session.feed(packet(SELECTED, StreamInfo(0), *STATICS[1:], FrameInfo(0)), 0.0)
    assert session.take_frame() is None
    assert session.counters.rejected == 2
    assert take(session, first(1)).period_s == 0.02


@pytest.mark.parametrize(
    "harmless", [encode_packet(), KEEP_ALIVE, encode_packet(encode_object(64123, bytes(40)))]
)
def test_packets_without_data_are_passed_over(harmless: bytes) -> None:
    session = started()
    take(session, first(0))
    session.feed(harmless, 0.0)
    assert session.take_frame() is None
    assert take(session, later(1)).frame == 1


@pytest.mark.parametrize("kind", [1, 2, 5, 9, 26, 37, 40])
def test_cut_objects_are_refused_as_soon_as_they_arrive(kind: int) -> None:
    session = started(FULL_OFFER)
    frame = FrameInfo(0).encode() if kind != 5 else b""
    with pytest.raises(WireError):
        session.feed(encode_packet(SELECTED.encode(), frame, encode_object(kind, b"")), 0.0)


def test_names_with_blanks_and_umlauts_pass_through() -> None:
    info = SubjectInfo(1, "Käfer 3 ", (SegmentInfo(0, 1, "x"),))
    assert take(started(), packet(SELECTED, STATICS[0], info, FrameInfo(0))).subjects[0].name == "Käfer 3 "
