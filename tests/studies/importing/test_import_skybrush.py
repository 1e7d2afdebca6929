"""Promises of `rcopterx import-skybrush`: a show becomes a fleet file; bad shows are refused."""

import zipfile
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.fleet.reading import load_fleet
from rcopterx_studies.importing.skybrush import read_show

SHOWS = Path(__file__).parents[2] / "fixtures" / "import_skybrush"


def imported(*arguments: Path) -> Result:
    words = ["import-skybrush", *map(str, arguments)]
    result = CliRunner().invoke(app, words, env={"COLUMNS": "300", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def show(path: Path, *names: str) -> Path:
    """Drones that fly 2 m to the front beside each other."""
    with zipfile.ZipFile(path, "w") as archive:
        for number, name in enumerate(names):
            archive.writestr(f"{name}.csv", f"t,x,y,z\n0,0,{number},1\n8000,2,{number},1\n")
    return path


def test_drones_of_a_show_become_simulated_vehicles_that_stand_apart(tmp_path: Path) -> None:
    path = tmp_path / "show.toml"
    result = imported(show(tmp_path / "show.zip", "Drone 1", "2", "third"), path)
    assert result.exit_code == 0, result.stderr
    fleet = load_fleet(path)
    assert [*fleet.vehicles] == ["drone_2_csv", "drone_1_csv", "third_csv"]
    assert fleet.simulator is not None
    places = [np.array(place[:2]) for place in fleet.simulator.start.values()]
    assert min(np.linalg.norm(one - other) for one, other in combinations(places, 2)) > 0.5
    assert "calibrate" not in path.read_text()


@pytest.mark.parametrize(
    ("names", "words"),
    [((), "neither show.json nor CSV"), (("a-b", "a_b"), "only in capital letters")],
)
def test_show_that_cannot_be_used_is_refused(tmp_path: Path, names: tuple[str, ...], words: str) -> None:
    path = tmp_path / "show.toml"
    result = imported(show(tmp_path / "show.zip", *names), path)
    assert result.exit_code == 2
    assert words in result.stderr
    assert not path.exists()


@pytest.mark.parametrize(
    ("name", "vehicle"),
    [("poly4d.skyc", "cf1"), ("skyc_in_folder.skyc", "drone_1"), ("csv_mac.zip", "drone_1_csv"),
     ("csv_blank_end.zip", "drone_1_csv")],
)  # fmt: skip
def test_shows_as_programs_write_them_are_read(name: str, vehicle: str, tmp_path: Path) -> None:
    path = tmp_path / "show.toml"
    result = imported(SHOWS / name, path)
    assert result.exit_code == 0, result.stderr
    assert [*load_fleet(path).vehicles] == [vehicle]


def test_a_straight_line_of_degree_seven_is_flown_straight() -> None:
    (drone,) = read_show(SHOWS / "poly4d.skyc")
    assert np.allclose(drone.positions_m[:, 2], 0.5 * drone.times_s / 3.0)
    assert drone.times_s[-1] == 3.0


@pytest.mark.parametrize("separator", [";", "\t"])
def test_tables_of_a_show_may_have_other_separators_marks_and_line_ends(
    separator: str, tmp_path: Path
) -> None:
    text = "\ufefft,x,y,z\r\n\r\n0,0,0.5,1\r\n8000,2,0.5,1\r\n\r\n".replace(",", separator)
    with zipfile.ZipFile(tmp_path / "show.zip", "w") as archive:
        archive.writestr("show\\a.csv", text)
        archive.writestr(".DS_Store", "x")
    (drone,) = read_show(tmp_path / "show.zip")
    assert drone.positions_m.tolist() == [[0.0, 0.5, 1.0], [2.0, 0.5, 1.0]]
    assert drone.name == "a.csv"


def test_decimal_commas_of_a_show_are_refused_with_their_line(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "show.zip", "w") as archive:
        archive.writestr("a.csv", "t;x;y;z\n0;0;0;1\n\n8000;0,4;0;1\n")
    result = imported(tmp_path / "show.zip", tmp_path / "show.toml")
    assert "a.csv: line 4: '0,4' has a decimal comma, write 0.4" in result.stderr


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [("a.skyb", b"skyb\x01", "a .skyb file"), ("show.json", b'{"version": 1}', "a JSON file"),
     ("a.csv", b"t,x,y,z\n", "the CSV file of one drone")],
)  # fmt: skip
def test_other_files_of_a_show_are_refused_with_what_to_export(
    name: str, content: bytes, words: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    result = imported(tmp_path / name, tmp_path / "show.toml")
    assert result.exit_code == 2
    assert words in result.stderr
    assert "export the whole show as .skyc" in result.stderr


@pytest.mark.parametrize(
    ("offset", "value"),
    [(6, 1), (8, 99), (40, 0x55)],  # encrypted, compressed by an unknown method, with damaged content
)
def test_damaged_archive_is_an_error_line(tmp_path: Path, offset: int, value: int) -> None:
    source, path = tmp_path / "show.zip", tmp_path / "show.toml"
    with zipfile.ZipFile(source, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.csv", 9 * "0,0,0,1\n")
    content = bytearray(source.read_bytes())
    # Methods and flags are also in the directory at the end.
    for start in (0, content.rindex(b"PK\x01\x02") + 2) if offset < 40 else (0,):
        content[start + offset] = value
    source.write_bytes(content)
    result = imported(source, path)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith(f"error: {source}: ")


def test_table_with_a_field_that_is_too_long_is_an_error_line(tmp_path: Path) -> None:
    source = tmp_path / "show.zip"
    with zipfile.ZipFile(source, "w") as archive:
        archive.writestr("a.csv", "t,x,y,z\n0," + 200_000 * "1")
    result = imported(source, tmp_path / "show.toml")
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith(f"error: {source}: a.csv: line 2: field larger than field limit")
