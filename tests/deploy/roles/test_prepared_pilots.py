"""Promises of what a fork server prepares: found by those it forks, never in place of another fleet."""

from pathlib import Path

import pytest
from support.fleets import PAIR

from rcopterx.deploy.roles import agent
from rcopterx.deploy.roles.agent import pilot_of, prepare, prepared_pilot, ready_pilot
from rcopterx.fleet.reading import load_fleet, parse_fleet, write_snapshot
from rcopterx.fleet.schema import FleetError


@pytest.fixture(autouse=True)
def nothing_prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agent, "_prepared", None)


@pytest.fixture
def snapshot(tmp_path: Path) -> Path:
    path = tmp_path / "fleet.json"
    write_snapshot(parse_fleet(PAIR), path)
    return path


def test_pilots_are_those_that_an_agent_would_build(snapshot: Path) -> None:
    prepare(snapshot, "main", ["h1", "h2"])
    fleet = load_fleet(snapshot)
    for name in fleet.vehicles:
        found = prepared_pilot(fleet, name)
        assert found is not None
        settings, pilot = found
        expected, built = pilot_of(load_fleet(snapshot), name)
        assert settings == expected
        assert type(pilot.controller) is type(built.controller)
        assert ready_pilot(fleet, name) is found
        assert prepared_pilot(fleet, name, fleet.vehicles[name].host) is found


def test_nothing_is_found_before_it_is_prepared(snapshot: Path) -> None:
    fleet = load_fleet(snapshot)
    assert prepared_pilot(fleet, "h1") is None
    settings, _ = ready_pilot(fleet, "h1")
    assert settings.vehicle == "h1"


def test_nothing_is_found_for_a_file_that_has_changed(snapshot: Path) -> None:
    prepare(snapshot, "main", ["h1"])
    other = PAIR.replace("[simulator]", '[bus]\nnamespace = "another"\n[simulator]')
    write_snapshot(parse_fleet(other), snapshot)
    fleet = load_fleet(snapshot)
    assert fleet.bus.namespace == "another"
    assert prepared_pilot(fleet, "h1") is None


def test_a_pilot_on_another_host_is_another_one(snapshot: Path) -> None:
    prepare(snapshot, "main", ["h1"])
    assert prepared_pilot(load_fleet(snapshot), "h1", "elsewhere") is None
    assert prepared_pilot(load_fleet(snapshot), "h2") is None


def test_controllers_of_other_packages_are_not_built(tmp_path: Path) -> None:
    path = tmp_path / "fleet.json"
    text = PAIR + 'control = { controller = "another_packages" }'
    write_snapshot(parse_fleet(text), path)
    prepare(path, "main", ["h1", "h2"])
    fleet = load_fleet(path)
    assert [name for name in fleet.vehicles if prepared_pilot(fleet, name) is None] == ["h2"]


def test_what_cannot_be_prepared_leaves_nothing_prepared(snapshot: Path, tmp_path: Path) -> None:
    prepare(snapshot, "main", ["h1"])
    broken = tmp_path / "broken.json"
    broken.write_text("{}")
    with pytest.raises(FleetError):
        prepare(broken, "main", ["h1"])
    assert prepared_pilot(load_fleet(snapshot), "h1") is None
    with pytest.raises(FleetError, match="cannot be read"):
        prepare(tmp_path / "nothing.json", "main", [])
