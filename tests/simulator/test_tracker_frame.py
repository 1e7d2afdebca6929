"""What is packed at once, or kept from frame to frame, is what the objects of the protocol encode."""

from hypothesis import given
from hypothesis import strategies as st
from support.records import replace

from rcopterx.simulator.tracker_frame import FrameContent, TrackedBody, TrackerFrame
from rcopterx.vicon_gateway.objects import (
    GlobalSegments,
    LatencyInfo,
    ObjectQuality,
    Segment,
    SegmentInfo,
    SubjectInfo,
)
from rcopterx.vicon_gateway.rotations import matrix_from_quaternion, y_up_from_z_up
from rcopterx.vicon_gateway.wire import encode_object

NUMBERS = st.floats(-10.0, 10.0)
BODIES = st.builds(
    TrackedBody,
    st.just(""),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS),
    st.sampled_from((0.5, 1.0)),
    st.booleans(),
    st.sampled_from((None, "root")),
)


@given(st.lists(BODIES, max_size=4), st.booleans())
def test_objects_of_a_frame_are_those_of_the_protocol(bodies: list[TrackedBody], y_up: bool) -> None:
    named = tuple(replace(body, name=f"heli{number}") for number, body in enumerate(bodies, 1))
    ids = {body.name: number for number, body in enumerate(named, 1)}
    samples = (("System", 0.25),)
    content = FrameContent(TrackerFrame(7, named, samples), 50.0, ids, y_up)
    segments = []
    for body in named:
        x, y, z, w = body.quaternion_xyzw
        place = tuple(1000.0 * number for number in body.position_m)
        if y_up:
            place, (x, y, z) = y_up_from_z_up(place), y_up_from_z_up((x, y, z))
        if not body.occluded:
            segments.append((ids[body.name], (Segment(1, place, matrix_from_quaternion((x, y, z, w))),)))
    assert content.objects(9) == [GlobalSegments(*item).encode() for item in segments]
    assert content.objects(8) == [encode_object(8, GlobalSegments(*item).payload()) for item in segments]
    assert content.objects(26) == [LatencyInfo(samples).encode()]
    assert content.objects(40) == [ObjectQuality(ids[body.name], body.quality).encode() for body in named]
    assert content.objects(2) == [
        SubjectInfo(ids[body.name], body.name, (SegmentInfo(0, 1, body.root_segment or body.name),)).encode()
        for body in named
    ]
