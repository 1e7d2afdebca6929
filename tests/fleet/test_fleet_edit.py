from dataclasses import replace
from pathlib import Path

import pytest
from support.fleets import PAIR
from support.vehicle_types import COAXIAL

from rcopterx.fleet.editing import check_own, write_calibration, write_model
from rcopterx.fleet.radios import calibration_of
from rcopterx.fleet.reading import load_fleet, shipped_fleets, write_snapshot
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.radios.calibration import Calibration
from rcopterx.vehicles.model import IDENTIFIED


def present(path: Path, name: str = "h1") -> Calibration:
    return calibration_of(load_fleet(path), name)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text("# mine\n" + PAIR)
    path.chmod(0o640)
    return path


def test_only_what_differs_is_written_and_the_rest_of_the_file_stays(path: Path) -> None:
    wanted = present(path).trimmed((0.1, -0.05, 0.55, 0.02))
    lines = write_calibration(path, "h1", wanted)
    assert present(path) == wanted
    assert lines == ["pitch.trim_us: 0 -> 40", "roll.trim_us: 0 -> -20", "yaw.trim_us: 0 -> 8"]
    assert path.read_text().startswith("# mine\n")
    assert present(path, "h2") == Calibration()
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(path.parent.iterdir()) == [path]


def test_a_second_change_overwrites_the_first(path: Path) -> None:
    first = present(path).trimmed((0.1, 0.0, 0.0, 0.0))
    write_calibration(path, "h1", first)
    second = replace(first, throttle=replace(first.throttle, us_hover=1512.5))
    assert write_calibration(path, "h1", second) == ["throttle.us_hover: 1540 -> 1512.5"]
    assert present(path) == second
    assert write_calibration(path, "h1", second) == []


def test_a_file_that_comes_with_the_package_is_not_changed() -> None:
    trio = shipped_fleets()["trio"]
    before = trio.read_text()
    with pytest.raises(FleetError, match="copy it and use the copy"):
        write_calibration(trio, "h1", present(trio).trimmed((0.1, 0.0, 0.0, 0.0)))
    assert trio.read_text() == before


def test_a_snapshot_is_refused_before_the_flight_whose_result_it_would_keep(path: Path) -> None:
    snapshot = path.with_suffix(".json")
    write_snapshot(load_fleet(path), snapshot)
    with pytest.raises(FleetError, match="a snapshot is not changed; name the fleet file"):
        check_own(snapshot)


def test_a_link_to_the_file_stays_a_link(path: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.toml"
    link.symlink_to(path)
    write_calibration(link, "h1", present(path).trimmed((0.1, 0.0, 0.0, 0.0)))
    assert link.is_symlink()
    assert present(path).pitch.trim_us == 40


FOUND = replace(
    COAXIAL,
    input_gain=(2.34567, 1.9, 17.2, 105.0),
    delay_s=0.031,
    tilt=replace(COAXIAL.tilt, frequency_rad_s=11.234567),
    uncertainty=replace(IDENTIFIED, tilt_damping=(0.24, 0.375)),
)


def test_a_model_is_written_beside_what_the_file_says(path: Path) -> None:
    lines = write_model(path, "h1", FOUND)
    written = model_of(load_fleet(path), "h1")
    assert written.input_gain == (2.346, 1.9, 17.2, 105.0)
    assert written.tilt is not None
    assert written.tilt.frequency_rad_s == 11.23
    assert written.tilt.upper_share == COAXIAL.tilt.upper_share
    assert written.uncertainty == FOUND.uncertainty
    assert "delay_s: 0.02 -> 0.031" in lines
    assert "tilt.frequency_rad_s: 12.7 -> 11.23" in lines
    assert not any(line.startswith("damping") for line in lines), "what did not change is not written"
    assert path.read_text().startswith("# mine\n")
    assert model_of(load_fleet(path), "h2").uncertainty == COAXIAL.uncertainty
    assert write_model(path, "h1", FOUND) == []


def test_a_second_identification_overwrites_the_first_and_keeps_comments(path: Path) -> None:
    path.write_text(path.read_text() + "\n[vehicles.h1.model]\ndelay_s = 0.05  # measured by hand\n")
    write_model(path, "h1", FOUND)
    write_model(path, "h1", replace(FOUND, input_gain=(2.0, 2.0, 17.2, 105.0)))
    assert model_of(load_fleet(path), "h1").input_gain == (2.0, 2.0, 17.2, 105.0)
    assert "delay_s = 0.031  # measured by hand" in path.read_text()


def test_models_of_shipped_fleets_are_not_changed() -> None:
    with pytest.raises(FleetError, match="comes with the package"):
        write_model(shipped_fleets()["trio"], "h1", FOUND)


def test_a_model_is_written_where_the_defaults_of_the_fleet_have_a_tilt(path: Path) -> None:
    tilt = "[defaults]\nmodel = { tilt = { frequency_rad_s = 12.0, damping_ratio = 0.7 } }\n"
    path.write_text(path.read_text() + tilt)
    found = model_of(load_fleet(path), "h1")
    assert found.tilt is not None
    lines = write_model(path, "h1", replace(found, tilt=replace(found.tilt, servo_lag_s=0.04)))
    assert lines == [f"tilt.servo_lag_s: {found.tilt.servo_lag_s:g} -> 0.04"]
