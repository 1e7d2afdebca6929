"""Promises about the start of a command: it imports what it needs, and nothing that takes long beside it."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NoReturn

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.commands import launch
from rcopterx.compiling.cache import MODULES
from rcopterx.control.identification.excitation import BASE_HZ
from rcopterx.control.references.path_shapes import HEADINGS
from rcopterx.deploy.hosts.running import RunningFleet
from rcopterx.fleet.schema import FleetError

ROOT = Path(__file__).parents[2]
NUMERICAL = {"numpy", "scipy", "osqp", "matplotlib", "numba"}


def imported_by(statement: str) -> set[str]:
    """Packages, ours without `rcopterx`, that are loaded after a statement in a fresh interpreter."""
    names = "name.removeprefix('rcopterx.').partition('.')[0] for name in sys.modules"
    script = f"import sys; {statement}; print(*{{{names}}})"
    return set(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True).stdout.split())


def test_declarations_of_all_commands_need_neither_the_bus_nor_numerical_libraries() -> None:
    loaded = imported_by("import rcopterx.command_line")
    assert "typer" in loaded
    assert not loaded & (
        NUMERICAL | {"zenoh", "msgspec", "rich", "agents", "ground_station", "rcopterx_studies"}
    )


@pytest.mark.parametrize(
    "statement",
    [
        "from rcopterx import Fleet",
        "import rcopterx.ground_station.terminal.status",
        "import rcopterx.ground_station.terminal.live_table",
    ],
)
def test_watching_and_steering_need_no_solver_no_simulator_and_no_scipy(statement: str) -> None:
    loaded = imported_by(statement)
    assert "zenoh" in loaded
    assert not loaded & {
        "scipy",
        "osqp",
        "numba",
        "serial",
        "simulator",
        "vicon_gateway",
        "rcopterx_studies",
        "matplotlib",
    }


@pytest.mark.parametrize(
    "module",
    [
        "ground_station.acceptance.demonstration",
        "ground_station.scripting.launched",
        "commands.new_lab, rcopterx.deploy.new_laboratory",
        "ground_station.report.logged_flight",
    ],
)
def test_launching_a_fleet_asking_for_one_and_reports_need_no_scipy_and_no_compiler(module: str) -> None:
    loaded = imported_by(f"import rcopterx.{module}")
    assert "msgspec" in loaded
    assert not loaded & {"scipy", "osqp", "numba", "matplotlib"}


def test_commands_use_one_thread_per_numerical_library_unless_the_user_says_otherwise() -> None:
    tell = """
import os, sys, rcopterx.cli
sys.argv = ["rcopterx", "--version"]
try:
    rcopterx.cli.main()
except SystemExit:
    print(os.environ["OMP_NUM_THREADS"], os.environ["OPENBLAS_NUM_THREADS"])
"""
    environment = {name: value for name, value in os.environ.items() if "NUM_THREADS" not in name}
    done = subprocess.run(
        [sys.executable, "-c", tell],
        capture_output=True,
        text=True,
        env=environment | {"OMP_NUM_THREADS": "3"},
    )
    assert done.stdout.splitlines()[-1] == "3 1", done.stderr


def test_help_texts_that_are_not_computed_agree_with_the_code() -> None:
    from rcopterx.commands.fleet_option import with_options
    from rcopterx.commands.trajectory import trajectory
    from rcopterx.commands.vehicles import identify

    (heading,) = with_options(trajectory).__annotations__["heading"].__metadata__
    assert heading.help == f"One of {', '.join(HEADINGS)}."
    (seconds,) = with_options(identify).__annotations__["seconds"].__metadata__
    assert seconds.min == pytest.approx(1 / BASE_HZ)


def test_the_version_is_told_with_its_commit(monkeypatch: pytest.MonkeyPatch) -> None:
    origin = {"rcopterx": "1.2.3", "commit": "abc123+", "python": "3.11.7"}
    monkeypatch.setattr("rcopterx.flights.provenance.provenance", lambda: origin)
    told = CliRunner().invoke(app, ["--version"])
    assert (told.exit_code, told.stdout) == (0, "rcopterx 1.2.3 (commit abc123+), Python 3.11.7\n")
    origin["commit"] = ""
    assert CliRunner().invoke(app, ["--version"]).stdout == "rcopterx 1.2.3, Python 3.11.7\n"


def test_the_page_of_a_demonstration_starts_when_nothing_is_left_to_compile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    began: list[str] = []

    def page(*_: object) -> NoReturn:
        began.append("page")
        raise FleetError("no page")

    monkeypatch.setattr(launch, "compile_all", lambda: began.append("compiler"))
    monkeypatch.setattr(launch, "page_of", page)
    with pytest.raises(FleetError):
        launch.demo()
    assert began == ["compiler", "page"]


def test_another_fleet_on_this_computer_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    up = [RunningFleet(name, "", None, "main", [], [], ["h1"], "") for name in ("trio", "ten")]
    monkeypatch.setattr("rcopterx.deploy.hosts.running.running_fleets", lambda: up)
    launch.warn_of_others("trio")
    assert "warning: ten is up on this computer, too" in capsys.readouterr().err
    monkeypatch.setattr("rcopterx.deploy.hosts.running.running_fleets", lambda: up[:1])
    launch.warn_of_others("trio")
    assert not capsys.readouterr().err


def test_make_compiles_kernels_with_the_packages_that_it_installs_first() -> None:
    (installed,) = re.findall(r"install,,(numba .*)\)", (ROOT / "Makefile").read_text(encoding="utf-8"))
    loaded = imported_by(f"import importlib; [importlib.import_module('rcopterx.' + m) for m in {MODULES}]")
    required = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    names = {re.split(r"[><=]", requirement)[0] for requirement in required}
    assert loaded & names == {*installed.split(), "numpy"}


@pytest.mark.parametrize(("version", "command"), [("uv 0.9", "uv"), ("", ".venv/bin/python -m uv")])
def test_make_installs_with_the_uv_of_the_computer_if_it_works(
    version: str, command: str, tmp_path: Path
) -> None:
    uv = tmp_path / "uv"
    uv.write_text(f"#!/bin/sh\necho {version}\n")
    uv.chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    words = ["make", "--dry-run", "--always-make", ".venv/.compiler"]
    plan = subprocess.run(words, cwd=ROOT, env=os.environ | {"PATH": path}, capture_output=True, text=True)
    assert f"\n{command} pip install" in plan.stdout, plan.stderr
