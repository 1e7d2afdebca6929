"""Promises of the directory of flights: found by name, in order of time, and never more than it may hold."""

from pathlib import Path

import pytest

from rcopterx.flights.flights import (
    NoFlightError,
    default_directory,
    flights_in,
    found_flight,
    missing_parts,
    new_flight_name,
    next_part,
    part_path,
    too_many,
)

OLDER, NEWER = "trio-20261121-120000", "lab-20261122-120000"


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    for flight, number in ((NEWER, 0), (OLDER, 0), (OLDER, 1)):
        part_path(tmp_path, flight, number).write_bytes(b"x" * 10)
    (tmp_path / "holiday.mcap").touch()
    return tmp_path


def test_flights_are_listed_by_their_start_with_all_their_parts(directory: Path) -> None:
    flights = flights_in(directory)
    assert [(flight.name, len(flight.parts), flight.size_bytes) for flight in flights] == [
        (OLDER, 2, 20), (NEWER, 1, 10),
    ]  # fmt: skip
    assert next_part(directory, OLDER) == 2
    assert next_part(directory, "trio-20261123-120000") == 0
    assert flights_in(directory / "absent") == []


def test_parts_beyond_a_thousand_stay_in_order(tmp_path: Path) -> None:
    for number in (1000, 2, 999):
        part_path(tmp_path, OLDER, number).touch()
    (flight,) = flights_in(tmp_path)
    assert [path.name.split(".")[1] for path in flight.parts] == ["002", "999", "1000"]


def test_a_flight_is_found_by_its_file_its_name_and_as_the_newest(directory: Path) -> None:
    file = part_path(directory, OLDER, 1)
    assert found_flight(str(file), directory).parts == (file,)
    assert len(found_flight(OLDER, directory).parts) == 2
    assert found_flight("latest", directory).name == NEWER
    with pytest.raises(NoFlightError, match=f"neither a file nor a flight 'x' in {directory}"):
        found_flight("x", directory)
    with pytest.raises(NoFlightError, match="no flights in"):
        found_flight("latest", directory / "absent")


def test_only_the_first_files_have_to_go_and_no_more_than_needed() -> None:
    sizes = [(Path(name), 10) for name in "abcd"]
    assert too_many(sizes, 40) == []
    assert too_many(sizes, 39) == [Path("a")]
    assert too_many(sizes, 20) == [Path("a"), Path("b")]
    assert too_many(sizes, 0) == [Path(name) for name in "abcd"]


def test_the_directory_is_where_the_user_says_else_among_the_users_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_FLIGHTS", str(tmp_path))
    assert default_directory() == tmp_path
    monkeypatch.delenv("RCOPTERX_FLIGHTS")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_directory() == tmp_path / "rcopterx" / "flights"
    monkeypatch.delenv("XDG_DATA_HOME")
    assert default_directory() == Path.home() / ".local" / "share" / "rcopterx" / "flights"


STARTED_S = 1_790_000_000.0


def test_the_name_of_a_flight_is_one_that_is_found_again(tmp_path: Path) -> None:
    name = new_flight_name("big_lab2", STARTED_S, tmp_path)
    part_path(tmp_path, name, 0).touch()
    assert found_flight("latest", tmp_path).name == name


def test_flights_keep_apart_and_in_order_whatever_the_wall_clock_does(tmp_path: Path) -> None:
    part_path(tmp_path, NEWER, 0).touch()  # of a version without numbers
    begun = []
    for fleet, started_s in [("lab", 12.0), ("lab", 12.0), ("trio", STARTED_S), ("lab", 3.0)]:
        begun.append(new_flight_name(fleet, started_s, tmp_path))
        part_path(tmp_path, begun[-1], 0).touch()
    assert [flight.name for flight in flights_in(tmp_path)] == [NEWER, *begun]
    assert len(set(begun)) == 4
    part_path(tmp_path, begun[0], 0).unlink()
    assert new_flight_name("lab", 12.0, tmp_path).endswith("-5")


def test_a_flight_begins_although_its_directory_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert new_flight_name("lab", STARTED_S, tmp_path / "file").endswith("-1")
    with pytest.raises(NotADirectoryError):
        flights_in(tmp_path / "file")


def test_parts_that_are_missing_are_named_but_not_those_of_a_single_file(tmp_path: Path) -> None:
    for number in (1, 3):
        part_path(tmp_path, OLDER, number).touch()
    (flight,) = flights_in(tmp_path)
    assert missing_parts(flight) == [0, 2]
    assert missing_parts(found_flight(str(part_path(tmp_path, OLDER, 3)), tmp_path)) == []
