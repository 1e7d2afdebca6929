"""Promises of snapshots: the same fleet, whatever becomes of the file."""

from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.fleet.reading import (
    digest_of,
    load_fleet,
    parse_fleet,
    shipped_fleets,
    write_snapshot,
)
from rcopterx.fleet.schema import FleetError

CALIBRATED = PAIR.replace("model_match = 1 }", "model_match = 1, calibration = { yaw = { us0 = 1510.0 } } }")


@pytest.mark.parametrize("text", [PAIR, HARDWARE_PAIR, CALIBRATED])
def test_a_snapshot_is_the_fleet_it_was_taken_of(text: str, tmp_path: Path) -> None:
    fleet, path = parse_fleet(text), tmp_path / "fleet.json"
    write_snapshot(fleet, path)
    assert load_fleet(path) == fleet
    assert [item.name for item in tmp_path.iterdir()] == ["fleet.json"]


@pytest.mark.parametrize("path", shipped_fleets().values(), ids=lambda path: path.stem)
def test_shipped_fleets_survive_a_snapshot(path: Path, tmp_path: Path) -> None:
    fleet = load_fleet(path)
    write_snapshot(fleet, tmp_path / "fleet.json")
    assert load_fleet(tmp_path / "fleet.json") == fleet


def test_a_broken_snapshot_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "fleet.json"
    with pytest.raises(FleetError, match=r"fleet\.json: cannot be read: No such file"):
        load_fleet(path)
    path.write_text("{")
    with pytest.raises(FleetError, match=r"fleet\.json: not a snapshot of a fleet file: "):
        load_fleet(path)


def test_the_digest_is_that_of_the_meaning() -> None:
    digest = digest_of(parse_fleet(PAIR))
    assert digest == digest_of(parse_fleet("# a comment\n" + PAIR + "\n[avoidance]\nenabled = true\n"))
    assert digest == digest_of(parse_fleet(CALIBRATED)), "calibrations may be written while the fleet is up"
    modelled = PAIR + "\n[vehicles.h1.model]\ndelay_s = 0.03\n"
    assert digest == digest_of(parse_fleet(modelled)), "so may models"
    for other in (HARDWARE_PAIR, PAIR.replace("heli2", "heli3"), PAIR + "[avoidance]\nenabled = false\n"):
        assert digest_of(parse_fleet(other)) != digest
