"""Packets read at once by the layout of the one before say what they say object by object."""

import math
import struct
from random import Random
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcopterx.vicon_gateway.control_objects import Contents, ObjectEnums, Ping, offer_packet, packet
from rcopterx.vicon_gateway.datastream import WANTED_TYPES, DataStreamSession
from rcopterx.vicon_gateway.frame import CapturedFrame
from rcopterx.vicon_gateway.frame_layout import MAX_BYTES, FrameLayout
from rcopterx.vicon_gateway.objects import (
    ApplicationInfo,
    FrameInfo,
    FrameRateInfo,
    LatencyInfo,
    ObjectQuality,
    SegmentInfo,
    StreamInfo,
    SubjectInfo,
)
from rcopterx.vicon_gateway.rotations import matrix_from_quaternion
from rcopterx.vicon_gateway.segment_objects import GlobalSegments, Segment
from rcopterx.vicon_gateway.wire import WireError, encode_object, encode_packet, split_objects

OFFER = offer_packet(WANTED_TYPES | {42})
CONTENTS = (
    Contents({5: 1, 9: 2}, frozenset({1, 2, 37, 40})),
    Contents({5: 1, 9: 2}, frozenset({1, 2, 9, 26, 37, 40})),
    Contents({5: 1, 9: 2}, frozenset({1, 2})),
)
STATICS = (
    StreamInfo(2_700_000),
    SubjectInfo(1, "heli1", (SegmentInfo(0, 1, "heli1"), SegmentInfo(1, 2, "tail"))),
    SubjectInfo(2, "heli2", (SegmentInfo(0, 5, "heli2"),)),
    SubjectInfo(3, "odd", ()),
)
SEGMENTS = (((1, (2, 1)), (2, (5,))), ((1, (1,)),), ((2, (4,)), (2, (5, 5))), ((1, ()), (9, (1,))), ())
"""Subjects with the segments that a frame shows of them."""
NUMBERS = (0.0, 1.5, -250.0, 1e6, 2e6, math.nan)
TURNS = ((0.0, 0.0, 0.0, 1.0), (0.6, 0.0, 0.0, 0.8), (0.0, 0.0, 0.0, 3.0), (1.0, 0.0, 0.0, 1.0))


class Template(NamedTuple):
    """Which objects a packet holds."""

    contents: int | None
    statics: bool
    y_up: bool | None
    latencies: int
    quality: bool
    segments: int
    rates: bool
    unknown: int | None
    surplus: int
    ping: bool


def template_of(rng: Random) -> Template:
    """Any of the packets that a stream may consist of, and those it hardly will."""
    return Template(
        contents=rng.choice((0, 0, 1, 2, None)),
        statics=rng.random() < 0.3,
        y_up=rng.choice((None, None, False, True)),
        latencies=rng.choice((0, 1, 1, 2)),
        quality=rng.random() < 0.5,
        segments=rng.choice((0, 0, 0, 1, 2, 3, 4)),
        rates=rng.random() < 0.5,
        unknown=rng.choice((None, 0, 5)),
        surplus=rng.choice((0, 0, 0, 3)),
        ping=rng.random() < 0.1,
    )


def packet_of(rng: Random, template: Template, frame: int) -> bytes:
    """One packet with other numbers than the others of its template."""
    items = [] if template.contents is None else [CONTENTS[template.contents].encode()]
    items += [item.encode() for item in STATICS] * template.statics
    items += [] if template.y_up is None else [ApplicationInfo(template.y_up).encode()]
    if template.quality:
        items += [ObjectQuality(1, rng.choice((0.5, 1.0, 7.0))).encode()]
        items += [ObjectQuality(2, rng.choice((0.5, math.nan))).encode()]
    items.append(encode_object(5, struct.pack("<I", frame) + rng.randbytes(template.surplus)))
    for _ in range(template.latencies):
        items.append(LatencyInfo((("System", rng.choice((0.001, 0.002, 0.003, -1.0))),)).encode())
    items += [FrameRateInfo({"System": rng.choice((50.0, 100.0))}).encode()] * template.rates
    for subject, ids in SEGMENTS[template.segments]:
        shown = tuple(
            Segment(
                number,
                (rng.choice(NUMBERS), rng.random(), rng.random()),
                matrix_from_quaternion(rng.choice(TURNS)),
            )
            for number in ids
        )
        surplus = rng.choice((b"ab", b"ab", b"cd")) * template.surplus
        items.append(encode_object(9, GlobalSegments(subject, shown).payload() + surplus))
    if template.unknown is not None:
        items.append(encode_object(777, rng.randbytes(template.unknown)))
    items += [Ping(1).encode()] * template.ping
    return encode_packet(*items)


def stream_of(rng: Random) -> list[bytes]:
    """Packets of a few templates, often several of one in a row, pings between them, some damaged."""
    steady = Template(0, False, None, 1, False, 0, True, None, 0, False)
    templates = [steady, template_of(rng), template_of(rng)]
    packets = [packet(CONTENTS[0], *STATICS, FrameInfo(0), GlobalSegments(1, (Segment(1),)))]
    frame = 0
    for template in rng.choices(templates, k=4):
        for _ in range(rng.randint(1, 6)):
            frame += rng.choice((1, 1, 1, 1, 2, 0, -1))
            packets.append(packet_of(rng, template, frame % 2**32))
            if rng.random() < 0.1:
                packets.append(rng.choice((packet(Ping(1)), packet(), packet(CONTENTS[2]))))
    if rng.random() < 0.5:
        damaged = rng.randrange(len(packets))
        data = bytearray(packets[damaged])
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        packets[damaged] = bytes(data)
    return packets


def fed(session: DataStreamSession, parts: tuple[bytes, ...], now_s: float) -> str:
    """What is wrong with a packet."""
    try:
        for part in parts:
            session.feed(part, now_s)
    except WireError as error:
        return str(error)
    return ""


@settings(max_examples=300)
@given(st.integers(0, 2**32 - 1))
def test_packets_that_come_in_one_piece_say_what_they_say_in_pieces(seed: int) -> None:
    rng = Random(seed)
    whole, cut = DataStreamSession(), DataStreamSession()
    for number, data in enumerate((OFFER, *stream_of(rng))):
        now_s = 0.4 * number
        problem = fed(whole, (data,), now_s)
        # A packet that has begun is never read by a layout.
        assert fed(cut, (data[:8], data[8:]), now_s) == problem
        if problem:
            break
        if rng.random() < 0.8:
            assert whole.take_frame() == cut.take_frame()
        assert whole.counters == cut.counters
        assert whole.take_outgoing() == cut.take_outgoing()
        assert whole.network_latency_s == cut.network_latency_s


def steady(frame: int, x_mm: float, latency_s: float = 0.001) -> bytes:
    """Packet of a steady stream."""
    return packet(
        CONTENTS[0], FrameInfo(frame), LatencyInfo((("System", latency_s),)),
        GlobalSegments(1, (Segment(2), Segment(1, (x_mm, 0.0, 0.0)))), GlobalSegments(2, (Segment(5),)),
    )  # fmt: skip


def objects_of(data: bytes) -> list[tuple[int, bytes]]:
    return split_objects(data[8:])


def test_steady_stream_is_read_by_its_layout(monkeypatch: pytest.MonkeyPatch) -> None:
    session = DataStreamSession()
    for data in (OFFER, packet(*STATICS, FrameInfo(0)), steady(1, 1.0), steady(2, 2.0), steady(3, 3.0)):
        session.feed(data, 0.0)
    before = session.take_frame()
    assert isinstance(before, CapturedFrame)
    assert (before.frame, before.latency_s) == (3, 0.001)
    monkeypatch.setattr("rcopterx.vicon_gateway.datastream.split_objects", None)
    session.feed(steady(4, 4000.0, 0.002), 7.0)
    frame = session.take_frame()
    assert isinstance(frame, CapturedFrame)
    assert (frame.frame, frame.received_s, frame.latency_s) == (4, 7.0, 0.002)
    assert [subject.position_m for subject in frame.subjects] == [(4.0, 0.0, 0.0), (0.0, 0.0, 0.0), None]


def test_layout_tells_where_numbers_are_and_refuses_what_is_laid_out_otherwise() -> None:
    data = steady(7, 12.5)
    layout = FrameLayout(objects_of(data), [(1, 1), (2, 5), (2, 6), (3, 1), (4, None)])
    assert layout.size == len(data)
    numbers = layout.read(steady(8, -3.0))
    assert numbers is not None
    assert numbers[layout.frame] == 8
    first, second, *others = layout.roots
    assert first is not None
    assert second is not None
    assert numbers[first : first + 3] == (-3.0, 0.0, 0.0)
    assert numbers[second + 3 : second + 12] == (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    assert others == [None, None, None]
    for place in (0, 4, 8, 12, data.index(struct.pack("<II", 9, 208)) + 8):
        damaged = bytearray(data)
        damaged[place] ^= 1
        assert layout.read(bytes(damaged)) is None


@pytest.mark.parametrize(
    "data",
    [
        packet(CONTENTS[0], FrameInfo(1)),
        packet(GlobalSegments(1, (Segment(1),))),
        packet(FrameInfo(1), GlobalSegments(1, ())),
        packet(FrameInfo(1), GlobalSegments(1, (Segment(1),)), Ping(3)),
        packet(FrameInfo(1), GlobalSegments(1, (Segment(1),)), ObjectEnums(frozenset({1}))),
        packet(FrameInfo(1), *(GlobalSegments(number, (Segment(1),)) for number in range(MAX_BYTES // 100))),
    ],
)  # fmt: skip
def test_other_packets_have_no_layout(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"object by object|segments"):
        FrameLayout(objects_of(data), [(1, 1)])
