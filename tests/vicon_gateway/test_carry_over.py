import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.vicon_gateway.datastream import CarryOver
from rcopterx.vicon_gateway.objects import Contents
from rcopterx.vicon_gateway.wire import DYNAMIC_TYPES, STATIC_TYPES, WireError

STREAM, SUBJECT, HEALTH, QUALITY = 1, 2, 29, 40
FRAME, SEGMENTS, LATENCY = 5, 9, 26
CONTENTS = 100004


def contents(*unchanged: int) -> tuple[int, bytes]:
    return CONTENTS, Contents({}, frozenset(unchanged)).payload()


def after(*packets: list[tuple[int, bytes]]) -> dict[int, list[bytes]]:
    carry_over = CarryOver()
    for objects in packets:
        carry_over.apply(objects)
    return carry_over.payloads


FIRST = [contents(), (STREAM, b"s"), (SUBJECT, b"a"), (SUBJECT, b"b"), (FRAME, b"0"), (SEGMENTS, b"p")]


def test_static_set_stays_while_packets_carry_no_static_object() -> None:
    payloads = after(FIRST, [contents(), (FRAME, b"1")], [contents(), (FRAME, b"2")])
    assert payloads == {STREAM: [b"s"], SUBJECT: [b"a", b"b"], FRAME: [b"2"]}


def test_one_static_object_wipes_the_static_types_not_named_as_unchanged() -> None:
    payloads = after(FIRST, [contents(), (QUALITY, b"q"), (FRAME, b"1")])
    assert payloads == {QUALITY: [b"q"], FRAME: [b"1"]}


def test_types_are_replaced_as_a_whole_never_per_subject() -> None:
    payloads = after(FIRST, [contents(STREAM, SUBJECT), (SUBJECT, b"c"), (FRAME, b"1")])
    assert payloads[SUBJECT] == [b"c"]
    assert payloads[STREAM] == [b"s"]


def test_packet_without_contents_names_nothing() -> None:
    payloads = after(FIRST, [(HEALTH, b"h"), (FRAME, b"1")])
    assert payloads == {HEALTH: [b"h"], FRAME: [b"1"]}


@pytest.mark.parametrize("objects", [[], [(42, bytes(8))], [(100003, b"")], [contents()], [(64123, b"x")]])
def test_packet_without_dynamic_object_is_no_frame_and_changes_nothing(
    objects: list[tuple[int, bytes]],
) -> None:
    carry_over = CarryOver()
    assert carry_over.apply(FIRST)
    before = dict(carry_over.payloads)
    assert not carry_over.apply(objects)
    assert carry_over.payloads == before


def test_static_objects_alone_are_no_frame_and_leave_the_last_frame() -> None:
    carry_over = CarryOver()
    carry_over.apply(FIRST)
    assert not carry_over.apply([contents(SUBJECT), (STREAM, b"t")])
    assert carry_over.payloads == {
        STREAM: [b"t"],
        SUBJECT: [b"a", b"b"],
        FRAME: [b"0"],
        SEGMENTS: [b"p"],
    }


def test_contents_may_stand_anywhere_in_the_packet() -> None:
    assert after(FIRST, [(FRAME, b"1"), contents(SEGMENTS)])[SEGMENTS] == [b"p"]


def test_malformed_contents_is_refused() -> None:
    with pytest.raises(WireError):
        CarryOver().apply([(CONTENTS, b"\xff\xff\xff\xff"), (FRAME, b"1")])


def reference(packets: list[tuple[dict[int, bytes], frozenset[int]]]) -> dict[int, list[bytes]]:
    """The rules of section 5, written down once more, one class after the other."""
    static: dict[int, list[bytes]] = {}
    dynamic: dict[int, list[bytes]] = {}
    for present, unchanged in packets:
        now_static = {kind: [data] for kind, data in present.items() if kind in STATIC_TYPES}
        if now_static:
            for kind in unchanged & STATIC_TYPES:
                if kind in static and kind not in now_static:
                    now_static[kind] = static[kind]
            static = now_static
        now_dynamic = {kind: [data] for kind, data in present.items() if kind in DYNAMIC_TYPES}
        if now_dynamic:
            for kind in unchanged & DYNAMIC_TYPES:
                if kind in dynamic and kind not in now_dynamic:
                    now_dynamic[kind] = dynamic[kind]
            dynamic = now_dynamic
    return {**static, **dynamic}


kinds = st.sampled_from(sorted(STATIC_TYPES | DYNAMIC_TYPES))
packets = st.lists(
    st.tuples(st.dictionaries(kinds, st.binary(max_size=2), max_size=5), st.frozensets(kinds, max_size=6)),
    max_size=8,
)


@given(packets)
def test_any_sequence_of_packets_follows_the_rules(
    sequence: list[tuple[dict[int, bytes], frozenset[int]]],
) -> None:
    carry_over = CarryOver()
    for present, unchanged in sequence:
        carry_over.apply([contents(*unchanged), *present.items()])
    assert carry_over.payloads == reference(sequence)
