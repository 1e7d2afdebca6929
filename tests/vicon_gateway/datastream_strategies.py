"""Hypothesis strategies for DataStream objects, and the pure emulator to make streams from."""

import struct

from hypothesis import strategies as st

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
    WireObject,
)

u32 = st.integers(0, 2**32 - 1)
u64 = st.integers(0, 2**64 - 1)
i64 = st.integers(-(2**63), 2**63 - 1)
f64 = st.floats(allow_nan=False)
f32 = st.floats(width=32, allow_nan=False)
names = st.text(max_size=12)
vectors = st.tuples(f64, f64, f64)
matrices = st.tuples(*(f64,) * 9)
id_sets = st.frozensets(u32, max_size=6)


def tuples_of(items: st.SearchStrategy[object]) -> st.SearchStrategy[tuple[object, ...]]:
    return st.lists(items, max_size=4).map(tuple)


segments = tuples_of(st.builds(Segment, u32, vectors, matrices))
segment_infos = tuples_of(st.builds(SegmentInfo, u32, u32, names, st.tuples(*(f32,) * 6)))
subject_infos = st.builds(
    SubjectInfo, u32, names, segment_infos, tuples_of(st.tuples(u32, names)), tuples_of(st.tuples(u32, u32))
)

wire_objects: st.SearchStrategy[WireObject] = st.one_of(
    st.builds(ObjectEnums, id_sets),
    st.builds(RequestFrame, st.booleans()),
    st.builds(Contents, st.dictionaries(u32, u32, max_size=6), id_sets),
    st.builds(Ping, u64),
    st.builds(StreamInfo, i64),
    subject_infos,
    st.builds(FrameInfo, u32),
    st.builds(GlobalSegments, u32, segments),
    st.builds(LatencyInfo, tuples_of(st.tuples(names, f64))),
    st.builds(ApplicationInfo, st.booleans()),
    st.builds(ObjectQuality, u32, f64),
)

unit_quaternions = (
    st.tuples(*(st.floats(-1.0, 1.0),) * 4)
    .filter(lambda q: sum(c * c for c in q) > 1e-3)
    .map(lambda q: tuple(c / sum(d * d for d in q) ** 0.5 for c in q))
)
positions_m = st.tuples(*(st.floats(-50.0, 50.0),) * 3)


def float32(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
