import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.vicon_gateway.wire import (
    HEADER,
    MAGIC,
    MAX_OBJECTS,
    PacketReader,
    PayloadReader,
    WireError,
    encode_object,
    encode_packet,
    encode_string,
    split_objects,
)

objects = st.lists(st.tuples(st.integers(0, 2**32 - 1), st.binary(max_size=40)), max_size=8)


def bodies_of(reader: PacketReader) -> list[bytes]:
    found = []
    while (body := reader.next_body()) is not None:
        found.append(body)
    return found


@given(objects)
def test_objects_survive_packet_and_split(items: list[tuple[int, bytes]]) -> None:
    packet = encode_packet(*(encode_object(kind, payload) for kind, payload in items))
    reader = PacketReader()
    reader.feed(packet)
    body = reader.next_body()
    assert body is not None
    assert split_objects(body) == items


@given(st.lists(st.binary(max_size=60), max_size=6), st.data())
def test_packets_are_the_same_however_the_stream_is_cut(payloads: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(encode_packet(payload) for payload in payloads)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    reader = PacketReader()
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        reader.feed(stream[start:end])
        found += bodies_of(reader)
    assert found == payloads
    reader.feed(encode_packet(b"next"))
    assert bodies_of(reader) == [b"next"]


def test_empty_packet_has_eight_bytes_and_an_empty_body() -> None:
    assert encode_packet().hex(" ") == "01 00 2b 1a 00 00 00 00"
    reader = PacketReader()
    reader.feed(encode_packet())
    assert reader.next_body() == b""


@pytest.mark.parametrize("stream", [b"v", b"\x01\x00\x2c", b"vrpn: ver. 07.35", b"\x00" * 8])
def test_wrong_magic_is_refused_from_the_first_wrong_byte_on_and_for_ever(stream: bytes) -> None:
    reader = PacketReader()
    reader.feed(stream)
    for _ in range(2):
        with pytest.raises(WireError, match="packet starts with"):
            reader.next_body()
        reader.feed(encode_packet())


def test_body_above_the_limit_is_refused_before_it_is_there() -> None:
    reader = PacketReader()
    reader.feed(HEADER.pack(MAGIC, 64 * 1024 * 1024 + 1))
    with pytest.raises(WireError, match="exceeds the limit"):
        reader.next_body()


def test_body_at_the_limit_is_waited_for() -> None:
    reader = PacketReader(max_body_bytes=16)
    reader.feed(HEADER.pack(MAGIC, 16) + bytes(15))
    assert reader.next_body() is None
    reader.feed(b"\0")
    assert reader.next_body() == bytes(16)


@pytest.mark.parametrize(
    "body", [b"\x05", bytes(7), HEADER.pack(5, 1), HEADER.pack(5, 2**32 - 1) + bytes(20)]
)
def test_object_that_does_not_fit_the_body_is_refused(body: bytes) -> None:
    with pytest.raises(WireError):
        split_objects(body)


def test_packet_full_of_empty_objects_is_refused() -> None:
    with pytest.raises(WireError, match="more than"):
        split_objects(encode_object(77, b"") * (MAX_OBJECTS + 1))


@pytest.mark.parametrize("count", [2, 1000, 2**32 - 1])
def test_count_larger_than_the_bytes_left_is_refused(count: int) -> None:
    payload = struct.pack("<I", count) + bytes(4)
    with pytest.raises(WireError):
        PayloadReader(payload).count(4)
    with pytest.raises(WireError):
        PayloadReader(payload).count(8)


def test_string_longer_than_the_payload_is_refused() -> None:
    with pytest.raises(WireError):
        PayloadReader(b"\x05\0\0\0heli").string()


@given(st.text())
def test_strings_pass_through_in_utf_8(text: str) -> None:
    assert PayloadReader(encode_string(text)).string() == text


def test_name_in_latin_1_is_readable() -> None:
    assert PayloadReader(b"\x04\0\0\0M\xfcll").string() == "M\\xfcll"
