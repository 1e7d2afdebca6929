"""Promises of `rcopterx trajectory`: files of way points of other programs."""

from pathlib import Path

import numpy as np
import pytest
from support.scripted import ScriptedVehicle
from test_command_line import plain, run

from rcopterx.bus.requests import Fly

TABLES = Path(__file__).parents[1] / "fixtures" / "text_files"


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"t,x,y\n", b"1,2,3,4,five\n", None])
def test_a_waypoint_file_that_is_none_is_a_usage_error(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "tour.csv"
    if content is not None:
        path.write_bytes(content)
    result = run("trajectory", "h1", "waypoints", str(path))
    assert result.exit_code == 2
    assert "tour.csv" in plain(result)


@pytest.mark.parametrize("name", ["bom.csv", "blank_tail.csv"])
def test_a_waypoint_file_reads_the_same_whatever_program_has_written_it(name: str, tmp_path: Path) -> None:
    result = run("trajectory", "h1", "waypoints", str(TABLES / name), "--plot", str(tmp_path / "tour.svg"))
    assert result.exit_code == 0, result.output
    assert "7.0 s" in result.stdout


def test_decimal_commas_of_a_waypoint_file_are_refused_with_their_line() -> None:
    result = run("trajectory", "h1", "waypoints", str(TABLES / "german.csv"))
    assert result.exit_code == 2
    assert "line 3: '0,4' has a decimal comma, write 0.4" in plain(result)


def test_headings_of_a_waypoint_file_turn_the_nearest_way(
    up: str, vehicles: dict[str, ScriptedVehicle]
) -> None:
    file = str(TABLES / "wrap.csv")
    assert run("trajectory", "--fleet", up, "h1", "waypoints", file).exit_code == 0
    (request,) = vehicles["h1"].requests
    assert isinstance(request, Fly)
    yaw_deg = np.degrees(request.knots.to_numpy()[:, 4])
    assert 19.0 < yaw_deg.max() - yaw_deg.min() < 25.0
