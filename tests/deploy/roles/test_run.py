"""Promises of a single process: it ends with a line and an exit code that say what is wrong."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.bus import free_port
from support.fleets import PAIR

from rcopterx.deploy.roles.run import EXIT_UNREACHABLE, EXIT_USAGE, run_role
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetError


@pytest.fixture
def fleet_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "run"))
    path = tmp_path / "lab.toml"
    path.write_text(PAIR)
    return path


def role(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rcopterx.deploy.roles", *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | environment,
        check=False,
    )


@pytest.mark.parametrize(
    ("name", "unit", "words"),
    [
        (
            "pilot",
            "h1",
            "role: unknown role 'pilot', known are router, recorder, learner, simulator, tracker, "
            "transmitters, agent",
        ),
        ("agent", "h9", "agent: unknown unit 'h9', known are h1, h2"),
        ("router", "roof", "router: unknown unit 'roof', known are main"),
        ("transmitters", "roof", "transmitters: unknown unit 'roof', known are transmitters"),
    ],
)
def test_unknown_roles_and_units_are_refused(fleet_path: Path, name: str, unit: str, words: str) -> None:
    with pytest.raises(FleetError, match=words):
        run_role(name, unit, load_fleet(fleet_path))


def test_a_wrong_controller_is_refused_by_its_field_in_the_agents_process_too(fleet_path: Path) -> None:
    fleet_path.write_text(PAIR + 'control = { controller = "x" }')
    with pytest.raises(FleetError, match=r"^vehicles\.h2\.control: no controller is called 'x'"):
        run_role("agent", "h2", load_fleet(fleet_path))


def test_a_wrong_fleet_file_ends_a_process_with_a_line_and_the_usage_code(fleet_path: Path) -> None:
    fleet_path.write_text(PAIR.replace("radio-h2", "radio-h1"))
    done = role("agent", "h1", str(fleet_path))
    assert done.returncode == EXIT_USAGE
    assert done.stderr.startswith(f"{fleet_path}: vehicles.h2.transmitter.port")
    assert len(done.stderr.splitlines()) == 1


def test_a_recording_that_cannot_be_created_is_a_wrong_field_of_the_file(
    fleet_path: Path, tmp_path: Path
) -> None:
    fleet_path.write_text(PAIR + f'[tracker]\nrecord_raw = "{tmp_path}/nowhere/a.raw"')
    done = role("tracker", "main", str(fleet_path))
    assert done.returncode == EXIT_USAGE
    reason = f"{tmp_path}/nowhere/a.raw cannot be created: No such file or directory"
    assert done.stderr == f"tracker.record_raw: {reason}\n"


def test_a_router_starts_without_numerical_libraries() -> None:
    code = """
import sys
import rcopterx.deploy.roles.__main__
from rcopterx.deploy.roles.run import runner
runner("router")
ours = {f"rcopterx.{package}" for package in ("agents", "transmitter_gateway", "simulator")}
print(sorted((ours | {"numpy", "scipy", "osqp"}) & sys.modules.keys()))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True
    )
    assert done.stdout == "[]\n"


def test_wrong_arguments_show_the_usage() -> None:
    done = role("agent")
    assert done.returncode != 0
    assert "usage: python -m rcopterx.deploy.roles" in done.stderr


def test_a_router_that_cannot_listen_ends_with_a_line(fleet_path: Path) -> None:
    host = f'[hosts.main]\naddress = "192.0.2.77"\nrouter_port = {free_port()}'
    fleet_path.write_text(f"{PAIR}{host}\n[security]\ninsecure = true")
    done = role("router", "main", str(fleet_path))
    assert done.returncode == EXIT_UNREACHABLE
    assert done.stderr.startswith("router cannot listen on ")
    assert "192.0.2.77" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_process_whose_launcher_is_gone_ends_before_it_does_anything(fleet_path: Path) -> None:
    done = role("router", "main", str(fleet_path), RCOPTERX_PARENT="1")
    assert done.returncode == -15
