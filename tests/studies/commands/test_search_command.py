"""The command `search`: flights of files are flown again, and what cannot be flown is refused in a line."""

import logging
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx_studies.search.flights import Flight, Happening

TAKE_OFF = Happening(0.0, "up", fields={"names": ["v1"], "height_m": 0.6})


@pytest.fixture(autouse=True)
def logging_again() -> Iterator[None]:
    """Let other tests log again, which the command prevents in its process."""
    yield
    logging.disable(logging.NOTSET)


def run(*words: str) -> Result:
    return CliRunner().invoke(app, ["search", *words], env={"COLUMNS": "200"})


def flight(*happenings: Happening, types: tuple[str, ...] = ("coaxial",)) -> Flight:
    return Flight(1, types, "ideal", 50, 3.0, happenings)


def test_a_file_is_flown_again_with_the_same_bits(tmp_path: Path) -> None:
    flight(TAKE_OFF).save(tmp_path / "flight.json")
    first, second = (run(str(tmp_path / "flight.json")) for _ in range(2))
    assert first.exit_code == second.exit_code == 0
    assert "flight.json: all promises hold (digest " in first.stdout
    assert first.stdout == second.stdout


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("nonsense", "JSON is malformed"),
        ("{}", "missing required field"),
        ('{"seeds": 1}', "unknown field"),
    ],
)
def test_a_file_that_is_no_flight_is_refused_with_the_reason(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "flight.json"
    path.write_text(text)
    result = run(str(path))
    assert result.exit_code == 2
    assert "no searched flight" in result.stderr
    assert reason in result.stderr


def test_a_request_that_there_is_not_is_refused_before_anything_is_flown(tmp_path: Path) -> None:
    for happening, reason in (
        (Happening(1.0, "somersault", "v1"), "no happening 'somersault'"),
        (Happening(1.0, "take_off", "v1", {"height_m": "high"}), "Expected `float`"),
    ):
        flight(TAKE_OFF, happening).save(tmp_path / "flight.json")
        result = run(str(tmp_path / "flight.json"))
        assert result.exit_code == 2
        assert reason in result.stderr


@pytest.mark.parametrize("vehicles", ["9", "0..2", "2..1", "two", ""])
def test_numbers_of_vehicles_that_have_no_places_are_refused(vehicles: str) -> None:
    result = run("--vehicles", vehicles, "--hours", "0")
    assert result.exit_code == 2
    assert "1 to 6 vehicles" in result.stderr


@pytest.mark.parametrize(
    ("name", "reason"), [("somersault", "unknown type"), ("mavlink_quadrotor", "udp://")]
)
def test_types_that_cannot_be_flown_are_refused_with_the_reason(name: str, reason: str) -> None:
    result = run("--types", name, "--vehicles", "1", "--hours", "0")
    assert result.exit_code == 2
    assert reason in result.stderr
