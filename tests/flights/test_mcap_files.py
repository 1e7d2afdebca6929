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
from rcopterx.flights.mcap_reading import Contents, FlightLogError, contents_of, messages_of
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
    assert [table.metadata for table in reader.iter_metadata()] == [{"fleet": "lab"}]


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
    path.write_bytes(written([[message(1)], [message(2)]], finish=False)[:-60])
    contents = contents_of(path)
    assert not contents.complete
    assert mend(path).messages == 1
    assert contents_of(path) == Contents(contents.metadata, contents.attachments, complete=True)
    reader = make_reader(BytesIO(path.read_bytes()), validate_crcs=True)
    assert [found.data for _, _, found in reader.iter_messages()] == [b"payload 1"]


def test_what_an_interrupted_repair_has_left_does_not_keep_the_next_one_from_its_work(path: Path) -> None:
    path.write_bytes(written([[message(1)], [message(2)]], finish=False)[:-60])
    path.with_name(path.name + ".new").write_bytes(b"half a file")
    assert mend(path).messages == 1
    assert contents_of(path).complete
    assert list(path.parent.iterdir()) == [path]


def test_a_damaged_chunk_is_left_out_and_counted(path: Path) -> None:
    data = bytearray(written([[message(1)], [message(2)], [message(3)]]))
    data[data.index(b"zstd", data.index(b"zstd") + 1) + 40] ^= 0xFF
    path.write_bytes(data)
    contents = Contents()
    assert [found.number for found in messages_of(path, contents)] == [1, 3]
    assert contents.damaged_chunks == 1
    assert contents.complete


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
    contents = Contents()
    tracemalloc.start()
    assert [found.payload for found in messages_of(path, contents)] == [b"payload 1"]
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert contents.damaged_chunks == 1
    assert peak_bytes < 10_000_000


def test_a_chunk_with_a_length_beyond_any_file_is_left_out(path: Path) -> None:
    body = struct.pack("<QQQII4sQ", 0, 0, 8, 0, 4, b"zstd", 2**63) + bytes(8)
    whole = written([[message(1)]])
    start = written([], finish=False)
    path.write_bytes(start + struct.pack("<BQ", 6, len(body)) + body + whole[len(start) :])
    contents = Contents()
    assert [found.payload for found in messages_of(path, contents)] == [b"payload 1"]
    assert contents.damaged_chunks == 1


def test_an_attachment_with_a_length_beyond_any_file_is_refused(path: Path) -> None:
    body = struct.pack("<QQI1sI1sQ", 0, 0, 1, b"a", 1, b"b", 2**63)
    path.write_bytes(written([], finish=False) + struct.pack("<BQ", 9, len(body)) + body)
    with pytest.raises(FlightLogError, match="not a flight log"):
        contents_of(path)


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
