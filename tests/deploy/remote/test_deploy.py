"""Deploying over an ssh that runs everything on this computer, in a home of its own."""

import os
import stat
from datetime import UTC, datetime
from pathlib import Path

import pytest
from click.testing import Result
from support.fleets import PAIR
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.deploy.processes.supervisor import STOP_LIMIT_S
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.vehicle_models import longest_shutdown_s

PROGRAMS = {
    "ssh": 'for last; do :; done; case "$*" in *192.0.2.9*) echo "no route" >&2; exit 255;; esac\n'
    'cd "$REMOTE_HOME" && exec sh -c "$last"',
    "sudo": 'shift; [ "$1" = install ] && exec cp "$4" "$REMOTE_HOME/unit"; exit 0',
    "cmp": 'exec diff -q "$2" "$REMOTE_HOME/unit" >/dev/null',
    "python3": 'mkdir -p "$3/bin" && cd "$3/bin" && cp "$(command -v pip_of_tests)" pip',
    "pip_of_tests": 'echo installed >> "$REMOTE_HOME/pip.log"',
}


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    programs, home = tmp_path / "bin", tmp_path / "home"
    programs.mkdir()
    home.mkdir()
    for name, text in PROGRAMS.items():
        (programs / name).write_text(f"#!/bin/sh\n{text}\n")
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.setenv("REMOTE_HOME", str(home))
    monkeypatch.setenv("HOME", str(tmp_path / "here"))
    return home


@pytest.fixture
def lab(tmp_path: Path, home: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text(PAIR + '[security]\ncertificates = "~/certs"\n')
    make_certificates(load_fleet(path), datetime.now(UTC), 100)
    (tmp_path / "new.whl").write_bytes(b"wheel")
    return path


def deploy(lab: Path, *options: str) -> Result:
    return CliRunner().invoke(app, ["deploy", str(lab), "--wheel", str(lab.parent / "new.whl"), *options])


def test_a_dry_run_says_everything_and_changes_nothing(lab: Path, home: Path) -> None:
    result = deploy(lab, "--dry-run")
    assert result.exit_code == 0, result.output
    assert result.output.count("main: to do: ") == 8
    assert list(home.iterdir()) == []


def test_everything_is_brought_once_and_nothing_twice(lab: Path, home: Path) -> None:
    first = deploy(lab)
    assert first.exit_code == 0, first.output
    assert first.output.count("main: done: ") == 8
    assert "sudo systemctl restart rcopterx-lab.service" in first.output
    assert (home / "rcopterx" / "lab.toml").read_bytes() == lab.read_bytes()
    assert stat.S_IMODE((home / "certs" / "host.main.key").stat().st_mode) == 0o600
    assert not (home / "certs" / "authority.key").exists()
    unit = (home / "unit").read_text()
    assert f"ExecStart={home}/rcopterx/venv/bin/rcopterx host lab.toml --host main" in unit
    again = deploy(lab)
    assert again.output.count("main: there: ") == 8
    assert "restart" not in again.output
    assert (home / "pip.log").read_text() == "installed\n"


def test_only_what_has_changed_is_brought_again(lab: Path, home: Path) -> None:
    deploy(lab)
    lab.write_text(lab.read_text() + "# a remark\n")
    (home / "certs" / "host.main.key").chmod(0o644)
    done = [line for line in deploy(lab).output.splitlines() if ": done: " in line]
    assert done == ["main: done: rcopterx/lab.toml", "main: done: certs/host.main.key"]


def test_a_host_that_cannot_be_reached_is_reported_and_the_others_go_on(lab: Path) -> None:
    lab.write_text(lab.read_text() + '[hosts.far]\naddress = "192.0.2.9"\n[hosts.main]\n')
    result = deploy(lab)
    assert result.exit_code == 1
    assert "error: far: 192.0.2.9: no route" in result.output
    assert result.output.count("main: done: ") == 8


def test_the_unit_lets_gateways_land_and_permits_every_priority(lab: Path, home: Path) -> None:
    lab.write_text(lab.read_text() + "[bus]\nrealtime_priority = 60\n[volume]\nmax_m = [2.0, 2.0, 30.0]\n")
    deploy(lab)
    unit = (home / "unit").read_text().splitlines()
    fleet = load_fleet(lab)
    assert {
        "KillMode=process",
        "RestartSec=5",
        f"LimitRTPRIO={max(each.of(fleet) for each in Priority)}",
    } <= {*unit}
    (stop,) = (line for line in unit if line.startswith("TimeoutStopSec="))
    assert int(stop.partition("=")[2]) >= 2 * STOP_LIMIT_S + longest_shutdown_s(fleet, "main") > 100.0
    assert unit.index("StartLimitIntervalSec=0") < unit.index("[Service]")


def test_files_of_vehicle_types_are_brought_with_the_fleet_file(lab: Path, home: Path) -> None:
    (lab.parent / "types").mkdir()
    (lab.parent / "types" / "mine.toml").write_text('base = "coaxial"\ntext = "mine"\n')
    lab.write_text(lab.read_text().replace("[vehicles.h2]", '[vehicles.h2]\ntype = "types/mine.toml"'))
    result = deploy(lab)
    assert result.exit_code == 0, result.output
    load_fleet(home / "rcopterx" / "lab.toml")


@pytest.mark.parametrize("place", ["{directory}/mine.toml", "../mine.toml"])
def test_a_vehicle_type_that_the_hosts_would_not_find_is_refused(place: str, lab: Path, home: Path) -> None:
    place = place.format(directory=lab.parent)
    (lab.parent / place).write_text('base = "coaxial"\ntext = "mine"\n')
    lab.write_text(lab.read_text().replace("[vehicles.h2]", f'[vehicles.h2]\ntype = "{place}"'))
    result = deploy(lab)
    assert result.exit_code == 2
    assert f"error: {place}: a type file must be in or below the directory of the fleet file" in result.stderr
    assert list(home.iterdir()) == []
