"""Promises of a flight's files: parts by size, a limit of disk, and a full disk that ends nothing else."""

import errno
import os
from io import BufferedWriter, FileIO
from pathlib import Path

import pytest

from rcopterx.flights.flight_writing import (
    FREE_BYTES,
    KEPT_FLIGHTS,
    RETRY_WRITES,
    FlightSettings,
    FlightWriter,
)
from rcopterx.flights.flights import flights_in, part_path
from rcopterx.flights.listing import mend, summary_of
from rcopterx.flights.mcap_reading import contents_of, messages_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.flights.mcap_writing import LoggedMessage

FLIGHT = "lab-20261122-141500"
PLENTY = 10**12


def settings(directory: Path, part_bytes: int = PLENTY, keep_bytes: int = 2 * PLENTY) -> FlightSettings:
    return FlightSettings(
        directory, FLIGHT, {"fleet": "lab"}, b'{"vehicles": {"h1": {}}}', part_bytes, keep_bytes
    )


def writer(directory: Path, part_bytes: int = PLENTY, keep_bytes: int = 2 * PLENTY) -> FlightWriter:
    return FlightWriter(settings(directory, part_bytes, keep_bytes), free=lambda _: PLENTY)


def chunk(number: int) -> list[LoggedMessage]:
    return [LoggedMessage("h1/noise", os.urandom(500), 1_000 * number, number)]


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


def test_a_file_is_repaired_only_once_its_recorder_has_ended(tmp_path: Path) -> None:
    files = []

    def opened(path: Path) -> BufferedWriter:
        files.append(path.open("xb"))
        return files[-1]

    flight = FlightWriter(settings(tmp_path), opener=opened, free=lambda _: PLENTY)
    flight.write(chunk(1))
    path = part_path(tmp_path, FLIGHT, 0)
    with pytest.raises(FlightLogError, match=rf"{path}: is being recorded"):
        mend(path)
    flight.write(chunk(2))
    files[0].close()  # as the system does for a recorder that is killed
    mended = mend(path)
    assert mended.messages == 2
    assert contents_of(mended.path).complete


def test_every_chunk_is_on_disk_when_write_returns(tmp_path: Path) -> None:
    flight = writer(tmp_path)
    for number in range(3):
        flight.write(chunk(number))
        assert len(list(messages_of(part_path(tmp_path, FLIGHT, 0)))) == number + 1


def test_the_oldest_flights_make_room_for_the_new_one_and_the_own_parts_come_last(tmp_path: Path) -> None:
    for day in (20, 21):
        part_path(tmp_path, f"lab-202611{day}-120000", 0).write_bytes(bytes(1000))
    part_path(tmp_path, "other-20261101-120000", 0).write_bytes(bytes(1000))
    flight = writer(tmp_path, part_bytes=1000, keep_bytes=5000)
    for number in range(6):
        flight.write(chunk(number))
    flight.close()
    other, found = flights_in(tmp_path)
    assert (other.name, found.name) == ("other-20261101-120000", FLIGHT)
    assert len(found.parts) < 3
    assert found.size_bytes <= 5000
    assert [m.number for path in found.parts for m in messages_of(path)][-1] == 5


class FullDisk(FileIO):
    """A file of which only so many bytes can be written."""

    room = 2500

    def write(self, data: bytes) -> int:  # type: ignore[override]
        if self.tell() + len(data) > self.room:
            super().write(data[: self.room - self.tell()])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def full_disk(path: Path) -> BufferedWriter:
    return BufferedWriter(FullDisk(path, "xb"))


def test_a_full_disk_ends_the_recording_says_so_and_leaves_what_was_written(tmp_path: Path) -> None:
    flight = FlightWriter(settings(tmp_path), opener=full_disk, free=lambda _: PLENTY)
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
    assert flights_in(tmp_path) == []


class Disk:
    """A disk with `spare_bytes` more than what stays free, shared by flights and other files."""

    def __init__(self, spare_bytes: int) -> None:
        self.spare_bytes = spare_bytes

    def free(self, directory: Path) -> int:
        """See `free_bytes`."""
        return FREE_BYTES + self.spare_bytes - sum(path.stat().st_size for path in directory.iterdir())


def earlier_flights(directory: Path, fleet: str, count: int) -> None:
    for day in range(1, count + 1):
        part_path(directory, f"{fleet}-202611{day:02d}-120000", 0).write_bytes(bytes(10_000))


def names(directory: Path) -> list[str]:
    return [flight.name for flight in flights_in(directory)]


def test_the_oldest_flights_of_the_own_fleet_make_room_on_a_disk_that_is_almost_full(tmp_path: Path) -> None:
    earlier_flights(tmp_path, "lab", KEPT_FLIGHTS + 2)
    earlier_flights(tmp_path, "other", 2)
    before = names(tmp_path)
    disk = Disk(10_000 * len(before) + 3_000)
    flight = FlightWriter(settings(tmp_path), free=disk.free)
    for number in range(20):
        flight.write(chunk(number))
    assert not flight.problem
    assert names(tmp_path) == [*(name for name in before if name != "lab-20261101-120000"), FLIGHT]


def test_the_newest_flights_stay_whatever_fills_the_disk(tmp_path: Path) -> None:
    earlier_flights(tmp_path, "lab", KEPT_FLIGHTS + 2)
    before = names(tmp_path)
    flight = FlightWriter(settings(tmp_path), free=Disk(0).free)
    flight.write(chunk(0))
    assert "64 MiB" in flight.problem
    assert names(tmp_path) == before[-KEPT_FLIGHTS:]


def test_recording_resumes_in_another_part_when_there_is_space_again(tmp_path: Path) -> None:
    disk = Disk(PLENTY)
    flight = FlightWriter(settings(tmp_path), free=disk.free)
    flight.write(chunk(0))
    disk.spare_bytes = 0
    for number in range(1, 2 * RETRY_WRITES):
        flight.write(chunk(number))
    assert "128 MiB" in flight.problem
    disk.spare_bytes = PLENTY
    for number in range(2 * RETRY_WRITES, 3 * RETRY_WRITES + 1):
        flight.write(chunk(number))
    assert not flight.problem
    flight.close()
    (found,) = flights_in(tmp_path)
    assert len(found.parts) == 2
    assert [m.number for path in found.parts for m in messages_of(path)][-1] == 3 * RETRY_WRITES
    assert summary_of(found).complete
    assert flight.written_bytes == found.size_bytes


def test_tries_on_a_disk_that_stays_full_leave_no_empty_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FullDisk, "room", 600)
    flight = FlightWriter(settings(tmp_path), opener=full_disk, free=lambda _: PLENTY)
    for number in range(3 * RETRY_WRITES):
        flight.write(chunk(number))
    assert "No space left" in flight.problem
    assert flights_in(tmp_path) == []


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
