"""Promises of `rcopterx new-plugin`: its package is found once it is installed, and the test in it passes."""

import runpy
import site
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.fleet.vehicle_types import type_names
from rcopterx_studies.commands.new_plugin import Kind

INSTALL = "from setuptools.build_meta import build_editable; build_editable('.')"
"""What `pip install --no-build-isolation -e` does before it unpacks the wheel."""


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def new_plugin(kind: str, name: str) -> Result:
    result = CliRunner().invoke(app, ["new-plugin", kind, name], env={"COLUMNS": "300", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def install(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a package in editable mode into a directory of its own."""
    subprocess.run([sys.executable, "-c", INSTALL], cwd=package, check=True, capture_output=True, timeout=60)
    installed = package.parent / "site-packages"
    with zipfile.ZipFile(next(package.glob("*.whl"))) as wheel:
        wheel.extractall(installed)
    monkeypatch.setattr(sys, "path", list(sys.path))
    site.addsitedir(str(installed))


@pytest.mark.parametrize("kind", list(Kind))
def test_a_new_package_is_found_by_its_entry_point_and_its_test_flies_it(
    kind: str, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"own_{kind.replace('-', '_')}"
    result = new_plugin(kind, name)
    assert result.exit_code == 0, result.stderr
    assert f"pip install -e '{name}[test]'" in result.stdout
    install(directory / name, monkeypatch)
    assert name in {*CONTROLLERS.available(), *ESTIMATORS.available(), *type_names()}
    runpy.run_path(f"{name}/test_{name}.py")["test_it_hovers"]()
    sys.modules.pop(name, None)


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        ("controller", "My-Own", "is no name"),
        ("controller", "pid", "controller 'pid' exists already"),
        ("estimator", "extended_kalman", "estimator 'extended_kalman' exists already"),
        ("vehicle-type", "coaxial", "vehicle-type 'coaxial' exists already"),
        ("controller", "numpy", "of an installed module"),
        ("controller", "there", "exists already"),
    ],
)
def test_a_name_that_cannot_be_used_is_refused_and_nothing_is_written(
    kind: str, name: str, message: str, directory: Path
) -> None:
    (directory / "there").mkdir()
    result = new_plugin(kind, name)
    assert (result.exit_code, message in result.stderr) == (2, True), result.stderr
    assert list(directory.rglob("*")) == [directory / "there"]
