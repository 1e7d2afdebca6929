"""Promises of an installation from the wheels alone, without this tree; run by `make wheel`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from packaging_support import Built, outside_environment

PYTHONS = ("3.11", "3.12", "3.13")
pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]


def interpreter(version: str) -> str | None:
    """Path of a Python of this version: on the path, or among those of pyenv."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    candidates = [*sorted(pyenv.glob(f"{version}.*/bin/python")), shutil.which(f"python{version}")]
    for candidate in candidates:
        if candidate and subprocess.run([candidate, "--version"], capture_output=True).returncode == 0:
            return str(candidate)
    return None


def run(*command: str | Path, directory: Path) -> str:
    """What a command prints; its directory and environment know nothing of this tree."""
    words = [str(word) for word in command]
    done = subprocess.run(
        words, cwd=directory, env=outside_environment(), capture_output=True, text=True, timeout=400
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.integration
@pytest.mark.parametrize("version", PYTHONS)
def test_the_demonstration_flies_from_an_installed_wheel(version: str, built: Built, tmp_path: Path) -> None:
    python = interpreter(version)
    if python is None:
        pytest.skip(f"no Python {version} on this computer")
    run(python, "-m", "venv", "environment", directory=tmp_path)
    scripts = tmp_path / "environment" / "bin"
    run(scripts / "pip", "install", "--quiet", "--disable-pip-version-check", built.wheel, directory=tmp_path)
    assert f"Python {version}" in run(scripts / "rcopterx", "--version", directory=tmp_path)
    flown = run(scripts / "rcopterx", "demo", "--no-browser", "--seconds", "15", directory=tmp_path)
    assert "flown for 15 s" in flown, flown


@pytest.mark.integration
def test_studies_are_installed_beside_the_product_that_flies_without_them(
    built: Built, tmp_path: Path
) -> None:
    run(sys.executable, "-m", "venv", "environment", directory=tmp_path)
    scripts = tmp_path / "environment" / "bin"
    pip = (scripts / "pip", "install", "--quiet", "--disable-pip-version-check")
    run(*pip, built.wheel, directory=tmp_path)
    missing = subprocess.run(
        [scripts / "rcopterx", "arena", "--list"], cwd=tmp_path, env=outside_environment(),
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert missing.returncode == 2
    assert missing.stderr == "error: rcopterx arena: part of rcopterx-studies: pip install rcopterx-studies\n"
    run(*pip, built.studies_wheel, directory=tmp_path)
    assert "consensus" in run(scripts / "rcopterx", "arena", "--list", directory=tmp_path)
    task = ("arena", "--quick", "--tasks", "three", "--schemes", "consensus", "--json")
    assert '"digest"' in run(scripts / "rcopterx", *task, directory=tmp_path)
    flown = run(scripts / "rcopterx", "faults", "leader-killed", "--up", directory=tmp_path)
    assert flown.startswith("passed"), flown
