"""Promises of MCAP files: the library of the format reads them, and a cut-off one loses its last chunk."""

import struct
import tracemalloc
from io import BytesIO
from pathlib import Path

import msgspec
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from rcopterx.bus.channels import CHANNELS
from rcopterx.flights.flight_writing import FLEET_ATTACHMENT
from rcopterx.flights.flights import Flight
from rcopterx.flights.listing import mend, summary_of
from rcopterx.flights.mcap_reading import LogContents, contents_of, messages_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.flights.mcap_writing import LoggedMessage, McapFile, schemas


def message(number: int, topic: str = "h1/pose") -> LoggedMessage:
    return LoggedMessage(topic, f"payload {number}".encode(), 1_000 * number, number)


def written(chunks: list[list[LoggedMessage]], finish: bool = True) -> bytes:
    file = BytesIO()
    mcap = McapFile(file)
    mcap.add_metadata("flight", {"fleet": "lab"})
    mcap.add_attachment("fleet.json", b'{"vehicles": {"h1": {}}}', 1)
    for chunk in chunks:
        mcap.add_chunk(chunk)
    if finish:
        mcap.finish()
    assert mcap.written_bytes == len(file.getvalue())
    return file.getvalue()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "lab-20261122-141500.000.mcap"


def test_the_library_of_the_format_reads_what_was_written() -> None:
    chunks = [[message(1), message(2, "tracker/status")], [message(3), message(4, "h1/unknown")]]
    reader = make_reader(BytesIO(written(chunks)), validate_crcs=True)
    read = [(channel.topic, found.data, found.log_time, found.sequence, schema and schema.name)
            for schema, channel, found in reader.iter_messages()]  # fmt: skip
    names = ["rcopterx.Pose", "rcopterx.TrackerStatus", "rcopterx.Pose", None]
    expected = [
        (m.topic, m.payload, m.time_ns, m.number, name)
        for m, name in zip([m for chunk in chunks for m in chunk], names, strict=True)
    ]
    assert read == expected
    only = [found.data for _, _, found in reader.iter_messages(topics=["tracker/status"])]
    assert only == [b"payload 2"]
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert (summary.statistics.message_count, summary.statistics.chunk_count) == (4, 2)
    assert next(iter(reader.iter_attachments())).name == "fleet.json"
    assert [table.metadata for table in reader.iter_metadata()] == 2 * [{"fleet": "lab"}]  # at both ends


@given(cut=st.integers(0, 2000))
def test_a_file_that_was_cut_off_gives_its_whole_chunks(
    tmp_path_factory: pytest.TempPathFactory, cut: int
) -> None:
    chunks = [[message(10 * number + i) for i in range(5)] for number in range(4)]
    whole = written(chunks, finish=False)
    path = tmp_path_factory.mktemp("cut") / "a.mcap"
    path.write_bytes(whole[: max(8, len(whole) - cut)])
    read = list(messages_of(path))
    expected = [m for chunk in chunks for m in chunk]
    assert read == expected[: len(read)]
    assert len(read) % 5 == 0
    if cut == 0:
        assert read == expected


def test_a_mended_file_is_complete_and_holds_everything_that_was_left(path: Path) -> None:
    damaged = written([[message(1)], [message(2)]], finish=False)[:-60]
    path.write_bytes(damaged)
    contents = contents_of(path)
    assert not contents.complete
    mended = mend(path)
    assert mended.messages == 1
    assert "after 0.00 s" in mended.missing[0]
    assert contents_of(mended.path) == LogContents(contents.metadata, contents.attachments, complete=True)
    reader = make_reader(BytesIO(mended.path.read_bytes()), validate_crcs=True)
    assert [found.data for _, _, found in reader.iter_messages()] == [b"payload 1"]
    assert path.read_bytes() == damaged


def test_a_mended_file_is_never_overwritten(path: Path) -> None:
    path.write_bytes(written([[message(1)], [message(2)]], finish=False)[:-60])
    content = mend(path).path.read_bytes()
    with pytest.raises(FlightLogError, match=r"\.recovered\.mcap: exists already"):
        mend(path)
    assert path.with_name(path.stem + ".recovered.mcap").read_bytes() == content


def test_what_an_interrupted_repair_has_left_does_not_keep_the_next_one_from_its_work(path: Path) -> None:
    path.write_bytes(written([[message(1)], [message(2)]], finish=False)[:-60])
    path.with_name(path.stem + ".recovered.mcap.new").write_bytes(b"half a file")
    mended = mend(path)
    assert mended.messages == 1
    assert contents_of(mended.path).complete
    assert sorted(path.parent.iterdir()) == sorted([path, mended.path])


def test_a_damaged_chunk_is_left_out_and_counted(path: Path) -> None:
    data = bytearray(written([[message(1)], [message(2)], [message(3)]]))
    data[data.index(b"zstd", data.index(b"zstd") + 1) + 40] ^= 0xFF
    path.write_bytes(data)
    contents = LogContents()
    assert [found.number for found in messages_of(path, contents)] == [1, 3]
    assert len(contents.missing) == 1
    assert not contents.complete
    assert "1 of 3 messages are missing" in mend(path).missing


CHUNKS = 20
WHOLE = written([[message(10 * number + i) for i in range(5)] for number in range(CHUNKS)])


def numbers_in(path: Path, data: bytes, contents: LogContents) -> list[int]:
    path.write_bytes(data)
    return [found.number for found in messages_of(path, contents)]


@given(bit=st.integers(0, 8 * len(WHOLE) - 1))
def test_a_flipped_bit_is_noticed_wherever_it_is_and_costs_one_chunk_at_most(
    tmp_path_factory: pytest.TempPathFactory, bit: int
) -> None:
    path = tmp_path_factory.mktemp("flipped") / "a.mcap"
    data = bytearray(WHOLE)
    data[bit // 8] ^= 1 << bit % 8
    contents = LogContents()
    assert len(numbers_in(path, data, contents)) >= 5 * (CHUNKS - 1)
    assert not contents.complete
    assert contents.missing
    assert contents.metadata["flight"] == {"fleet": "lab"}
    assert contents.attachments["fleet.json"] == b'{"vehicles": {"h1": {}}}'
    assert path.read_bytes() == data


@given(start=st.integers(0, len(WHOLE) - 1), length=st.integers(300, 800), zeroed=st.booleans())
def test_a_block_that_is_zeroed_or_lost_costs_no_more_than_the_chunks_it_touches(
    tmp_path_factory: pytest.TempPathFactory, start: int, length: int, zeroed: bool
) -> None:
    path = tmp_path_factory.mktemp("block") / "a.mcap"
    end = min(len(WHOLE), start + length)
    data = WHOLE[:start] + bytes(end - start if zeroed else 0) + WHOLE[end:]
    summary = make_reader(BytesIO(WHOLE)).get_summary()
    assert summary is not None
    spans = [
        (each.chunk_start_offset, each.chunk_start_offset + each.chunk_length)
        for each in summary.chunk_indexes
    ]
    intact = [number for number, (first, last) in enumerate(spans) if last <= start or first >= end]
    # Another 9 bytes before a chunk are its head, which is not needed.
    contents = LogContents()
    # Without the summary nothing else names the channel that the first chunk declares.
    named = intact if 0 in intact or (end <= spans[-1][1] and zeroed) else []
    read = numbers_in(path, data, contents)
    assert set(read) >= {10 * number + i for number in named for i in range(5)}
    assert not contents.complete


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04", b"\x89MCAP0\r"])
def test_what_is_no_flight_log_is_refused_by_its_name(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    with pytest.raises(FlightLogError, match=rf"{path}: not a flight log: not an MCAP file"):
        list(messages_of(path))
    with pytest.raises(FlightLogError, match=r"absent.mcap: cannot be read: No such file"):
        contents_of(path.with_name("absent.mcap"))


@pytest.mark.parametrize("declared", [1 << 30, 1 << 60])
@pytest.mark.parametrize("at", ["in the chunk", "in its compressed frame"])
def test_a_chunk_that_declares_gigabytes_is_left_out_and_costs_no_memory(
    path: Path, declared: int, at: str
) -> None:
    frame = bytes.fromhex("28b52ffde0") + declared.to_bytes(8, "little") + bytes.fromhex("010000")
    size = declared if at == "in the chunk" else 8
    compressed = zstandard.compress(bytes(8)) if at == "in the chunk" else frame
    body = struct.pack("<QQQII4sQ", 0, 0, size, 0, 4, b"zstd", len(compressed)) + compressed
    whole = written([[message(1)]])
    start = written([], finish=False)
    path.write_bytes(start + struct.pack("<BQ", 6, len(body)) + body + whole[len(start) :])
    contents = LogContents()
    tracemalloc.start()
    assert [found.payload for found in messages_of(path, contents)] == [b"payload 1"]
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(contents.missing) == 1
    assert peak_bytes < 10_000_000


def test_a_chunk_with_a_length_beyond_any_file_is_left_out(path: Path) -> None:
    body = struct.pack("<QQQII4sQ", 0, 0, 8, 0, 4, b"zstd", 2**63) + bytes(8)
    whole = written([[message(1)]])
    start = written([], finish=False)
    path.write_bytes(start + struct.pack("<BQ", 6, len(body)) + body + whole[len(start) :])
    contents = LogContents()
    assert [found.payload for found in messages_of(path, contents)] == [b"payload 1"]
    assert len(contents.missing) == 1


def test_an_attachment_with_a_length_beyond_any_file_is_left_out(path: Path) -> None:
    body = struct.pack("<QQI1sI1sQ", 0, 0, 1, b"a", 1, b"b", 2**63)
    path.write_bytes(written([], finish=False) + struct.pack("<BQ", 9, len(body)) + body)
    contents = contents_of(path)
    assert list(contents.attachments) == ["fleet.json"]
    assert len(contents.missing) == 1


@pytest.mark.parametrize("fleet", [b"[]", b"no fleet", b'{"vehicles": 3}'])
def test_the_list_of_flights_names_a_flight_whose_fleet_is_unreadable(path: Path, fleet: bytes) -> None:
    with path.open("wb") as file:
        mcap = McapFile(file)
        mcap.add_attachment(FLEET_ATTACHMENT, fleet, 0)
        mcap.finish()
    summary = summary_of(Flight("lab", (path,)))
    assert summary.vehicles == ()
    assert "fleet" in summary.problem


def test_every_recorded_channel_has_a_schema() -> None:
    shapes = schemas()
    for channel in CHANNELS:
        name, shape = shapes.get(f"{channel.unit}/{channel.topic}") or shapes[channel.topic]
        assert name == f"rcopterx.{channel.message.__name__}"
        assert "$defs" in msgspec.json.decode(shape)
