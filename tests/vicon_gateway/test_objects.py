import json
from pathlib import Path

import pytest
from datastream_strategies import wire_objects
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.vicon_gateway.objects import (
    Contents,
    FrameInfo,
    GlobalSegments,
    LatencyInfo,
    ObjectEnums,
    RequestFrame,
    Segment,
    SegmentInfo,
    StreamInfo,
    SubjectInfo,
    WireObject,
    decode_body,
    packet,
)
from rcopterx.vicon_gateway.wire import DYNAMIC_TYPES, STATIC_TYPES, ObjectType, WireError

WORKED_EXAMPLE = {
    name: bytes.fromhex(text)
    for name, text in json.loads(
        (Path(__file__).parents[1] / "fixtures" / "vicon_worked_example.json").read_text()
    ).items()
}
TYPES = frozenset({1, 2, 5, 9, 26, 100004})
YAW_90_DEG = (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
LATENCY = LatencyInfo((("System", 0.0055),))


def heli1_at(x_mm: float) -> GlobalSegments:
    return GlobalSegments(1, (Segment(1, (x_mm, -250.5, 1234.5), YAW_90_DEG),))


EXAMPLE_OBJECTS: dict[str, tuple[WireObject, ...]] = {
    "offer": (ObjectEnums(TYPES),),
    "selection": (ObjectEnums(TYPES), RequestFrame(streaming=True)),
    "first_frame": (
        Contents({1: 1, 2: 1, 5: 1, 9: 1, 26: 1}),
        StreamInfo(2_700_000),
        SubjectInfo(1, "heli1", (SegmentInfo(0, 1, "heli1"),)),
        FrameInfo(41),
        LATENCY,
        heli1_at(1000.0),
    ),
    "next_frame": (
        Contents({1: 0, 2: 0, 5: 1, 9: 1, 26: 1}, frozenset({1, 2})),
        FrameInfo(42),
        LATENCY,
        heli1_at(1001.0),
    ),
    "occluded_frame": (
        Contents({1: 0, 2: 0, 5: 1, 9: 0, 26: 1}, frozenset({1, 2})),
        FrameInfo(43),
        LATENCY,
    ),
}


@pytest.mark.parametrize(
    ("name", "size"),
    [("offer", 44), ("selection", 53), ("first_frame", 312), ("next_frame", 230), ("occluded_frame", 114)],
)
def test_worked_example_is_produced_and_parsed_byte_for_byte(name: str, size: int) -> None:
    data, objects = WORKED_EXAMPLE[name], EXAMPLE_OBJECTS[name]
    assert len(data) == size
    assert packet(*objects) == data
    assert decode_body(data[8:]) == list(objects)


@given(wire_objects)
def test_every_object_survives_encoding_and_decoding(item: WireObject) -> None:
    assert type(item).parse(item.payload()) == item


@given(wire_objects, st.binary(max_size=20))
def test_surplus_bytes_at_the_end_of_a_payload_are_skipped(item: WireObject, surplus: bytes) -> None:
    assert type(item).parse(item.payload() + surplus) == item


@given(wire_objects, st.data())
def test_cut_payload_is_refused(item: WireObject, data: st.DataObject) -> None:
    payload = item.payload()
    with pytest.raises(WireError):
        type(item).parse(payload[: data.draw(st.integers(0, len(payload) - 1))])


@given(st.lists(wire_objects, max_size=5))
def test_unknown_types_are_skipped_by_their_length(items: list[WireObject]) -> None:
    unknown = b"\x39\x30\x00\x00\x03\x00\x00\x00abc"
    body = unknown + b"".join(item.encode() + unknown for item in items)
    assert decode_body(body) == items


def test_sizes_of_fixed_layouts_are_those_of_the_catalogue() -> None:
    pose = Segment(1, (0.0, 0.0, 0.0), YAW_90_DEG)
    assert len(GlobalSegments(1, (pose,)).payload()) == 8 + 100
    assert len(SubjectInfo(1, "n" * 7, (SegmentInfo(0, 1, "m" * 3),)).payload()) == 56 + 7 + 3


def test_frame_period_is_in_ticks_of_135_mhz() -> None:
    assert StreamInfo(2_700_000).period_s == 0.02
    assert StreamInfo(675_000).period_s == 0.005


def test_every_data_type_is_either_static_or_dynamic() -> None:
    data_types = {int(kind) for kind in ObjectType if kind < 100_000 and kind != ObjectType.PING}
    assert data_types == STATIC_TYPES | DYNAMIC_TYPES
    assert not STATIC_TYPES & DYNAMIC_TYPES
