"""Promises of the pages of a host: there before gateways start, gone when its launcher has ended."""

from pathlib import Path

import pytest

import rcopterx.deploy.hosts.run_directory
from rcopterx.deploy.hosts.run_directory import states_directory
from rcopterx.deploy.hosts.vehicle_states import begin_states, remove_states
from rcopterx.fleet.schema import FleetError
from rcopterx.transmitter_gateway.state_page import NOT_FLYING, open_page


@pytest.fixture(autouse=True)
def states(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(rcopterx.deploy.hosts.run_directory, "SHARED_MEMORY", tmp_path)
    return states_directory(tmp_path / "run")


def test_vehicles_do_not_fly_before_the_first_gateway(states: Path, tmp_path: Path) -> None:
    begin_states(["h1", "h2"], tmp_path / "run")
    for name in ("h1", "h2"):
        page = open_page(states / name)
        assert page.last == NOT_FLYING
        page.close()


def test_two_run_directories_keep_apart(states: Path, tmp_path: Path) -> None:
    assert states_directory(tmp_path / "other") != states


def test_a_vehicle_that_another_gateway_serves_is_named(states: Path, tmp_path: Path) -> None:
    begin_states(["h1"], tmp_path / "run")
    page = open_page(states / "h1")
    with pytest.raises(FleetError, match=r"vehicles\.h1: another transmitter gateway or workbench command"):
        begin_states(["h1"], tmp_path / "run")
    page.close()


def test_a_directory_that_is_not_private_is_named(states: Path, tmp_path: Path) -> None:
    states.mkdir(0o755)
    with pytest.raises(FleetError, match=rf"vehicles\.h1: its state cannot be kept in {states}/h1"):
        begin_states(["h1"], tmp_path / "run")


def test_only_the_pages_of_the_own_vehicles_are_removed(states: Path, tmp_path: Path) -> None:
    begin_states(["h1", "h2"], tmp_path / "run")
    remove_states(["h1"], tmp_path / "run")
    assert not (states / "h1").exists()
    assert (states / "h2").exists()
    remove_states(["h1", "h2"], tmp_path / "run")
    assert not states.exists()


def test_pages_of_fleets_whose_run_directory_is_gone_are_removed_by_the_next_start(tmp_path: Path) -> None:
    runs = [tmp_path / name for name in ("killed", "landing", "killed_but_there", "next")]
    killed, landing, there, following = map(states_directory, runs)
    for run in runs[:3]:
        run.mkdir()
        begin_states(["h1", "h2"], run)
    page = open_page(landing / "h2")
    for run in runs[:2]:
        run.rmdir()
    begin_states(["h1"], runs[3])
    assert [states.exists() for states in (killed, landing, there, following)] == [False, True, True, True]
    assert (landing / "h2").exists()
    page.close()
    begin_states(["h1"], runs[3])
    assert not landing.exists()


def test_pages_of_a_fleet_with_a_relative_run_directory_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    relative, other = Path("relative"), tmp_path / "other"
    for run in (relative, other):
        run.mkdir()
        begin_states(["h1"], run)
    assert (states_directory(relative) / "h1").exists()
