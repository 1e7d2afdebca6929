"""Promises of a flight's files: parts by size, a limit of disk, and a full disk that ends nothing else."""

import errno
import os
from io import FileIO
from pathlib import Path

import pytest

from rcopterx.flights.flight_writing import FREE_BYTES, FlightSettings, FlightWriter
from rcopterx.flights.flights import flights_in, part_path
from rcopterx.flights.listing import summary_of
from rcopterx.flights.mcap_reading import contents_of, messages_of
from rcopterx.flights.mcap_writing import LoggedMessage

FLIGHT = "lab-20261122-141500"
PLENTY = 10**12


def settings(directory: Path, part_bytes: int = PLENTY, keep_bytes: int = 2 * PLENTY) -> FlightSettings:
    return FlightSettings(
        directory, FLIGHT, {"fleet": "lab"}, b'{"vehicles": {"h1": {}}}', {}, part_bytes, keep_bytes
    )


def writer(directory: Path, part_bytes: int = PLENTY, keep_bytes: int = 2 * PLENTY) -> FlightWriter:
    return FlightWriter(settings(directory, part_bytes, keep_bytes), free=lambda _: PLENTY)


def chunk(number: int) -> list[LoggedMessage]:
    return [LoggedMessage("h1/pose", os.urandom(500), 1_000 * number, number)]


def test_a_flight_continues_in_another_part_and_each_names_its_flight(tmp_path: Path) -> None:
    flight = writer(tmp_path / "flights", part_bytes=1200)
    for number in range(4):
        flight.write(chunk(number))
    flight.close()
    (found,) = flights_in(tmp_path / "flights")
    assert [[m.number for m in messages_of(path)] for path in found.parts] == [[0, 1], [2, 3]]
    assert [contents_of(path).metadata["flight"]["part"] for path in found.parts] == ["0", "1"]
    summary = summary_of(found)
    assert (summary.fleet, summary.vehicles, summary.complete, summary.problem) == ("lab", ("h1",), True, "")
    assert flight.written_bytes == found.size_bytes


def test_a_recorder_that_is_started_again_goes_on_with_its_flight(tmp_path: Path) -> None:
    first = writer(tmp_path)
    first.write(chunk(1))
    second = writer(tmp_path)
    second.write(chunk(2))
    second.close()
    (found,) = flights_in(tmp_path)
    assert [m.number for path in found.parts for m in messages_of(path)] == [1, 2]
    assert not summary_of(found).complete


def test_every_chunk_is_on_disk_when_write_returns(tmp_path: Path) -> None:
    flight = writer(tmp_path)
    for number in range(3):
        flight.write(chunk(number))
        assert len(list(messages_of(part_path(tmp_path, FLIGHT, 0)))) == number + 1


def test_the_oldest_flights_make_room_for_the_new_one_and_the_own_parts_come_last(tmp_path: Path) -> None:
    for day in (20, 21):
        part_path(tmp_path, f"lab-202611{day}-120000", 0).write_bytes(bytes(1000))
    flight = writer(tmp_path, part_bytes=1000, keep_bytes=4000)
    for number in range(6):
        flight.write(chunk(number))
    flight.close()
    (found,) = flights_in(tmp_path)
    assert found.name == FLIGHT
    assert len(found.parts) < 3
    assert found.size_bytes <= 4000
    assert [m.number for path in found.parts for m in messages_of(path)][-1] == 5


class FullDisk(FileIO):
    """A file of which only so many bytes can be written."""

    room = 2500

    def write(self, data: bytes) -> int:  # type: ignore[override]
        if self.tell() + len(data) > self.room:
            super().write(data[: self.room - self.tell()])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def test_a_full_disk_ends_the_recording_says_so_and_leaves_what_was_written(tmp_path: Path) -> None:
    flight = FlightWriter(settings(tmp_path), opener=lambda path: FullDisk(path, "xb"), free=lambda _: PLENTY)
    for number in range(8):
        flight.write(chunk(number))
    path = part_path(tmp_path, FLIGHT, 0)
    assert flight.problem == f"{path}: No space left on device"
    read = [m.number for m in messages_of(path)]
    assert read == list(range(len(read)))
    assert len(read) >= 2
    flight.close()


def test_a_disk_that_is_almost_full_is_left_to_others(tmp_path: Path) -> None:
    flight = FlightWriter(settings(tmp_path), free=lambda _: FREE_BYTES - 1)
    flight.write(chunk(1))
    assert "64 MiB" in flight.problem
    flight.write(chunk(2))
    assert list(messages_of(part_path(tmp_path, FLIGHT, 0))) == []


def test_a_directory_that_cannot_be_created_ends_the_recording_only(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    flight = writer(tmp_path / "file" / "flights")
    flight.write(chunk(1))
    assert "Not a directory" in flight.problem
    flight.close()
    assert flight.written_bytes == 0


@pytest.mark.parametrize("count", [0, 1])
def test_closing_twice_changes_nothing(tmp_path: Path, count: int) -> None:
    flight = writer(tmp_path)
    for number in range(count):
        flight.write(chunk(number))
    flight.close()
    size = flight.written_bytes
    flight.close()
    assert flight.written_bytes == size
