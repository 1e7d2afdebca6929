"""Promises of what people install: one top-level name in each wheel, everything in it, nothing else."""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

import pytest
from packaging_support import BUILD_S, ROOT, Built

PACKAGE = ROOT / "rcopterx"
STUDIES = ROOT / "studies"
pytestmark = pytest.mark.timeout(BUILD_S + 100.0)


def files_of_the_package() -> set[str]:
    """Everything below `rcopterx/`, its links followed."""
    folders = [PACKAGE, *(entry for entry in PACKAGE.iterdir() if entry.is_symlink())]
    found = {path for folder in folders for path in folder.rglob("*") if path.is_file()}
    return {str(path.relative_to(ROOT)) for path in found if "__pycache__" not in path.parts}


def names_in(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_each_wheel_installs_one_name_only(built: Built) -> None:
    for wheel, package in ((built.wheel, "rcopterx"), (built.studies_wheel, "rcopterx_studies")):
        top = {PurePosixPath(name).parts[0] for name in names_in(wheel)}
        assert {name for name in top if not name.endswith(".dist-info")} == {package}


def test_the_wheel_of_studies_holds_every_file_of_its_package(built: Built) -> None:
    found = (STUDIES / "rcopterx_studies").rglob("*")
    wanted = {
        str(path.relative_to(STUDIES)) for path in found if path.is_file() and "__pycache__" not in path.parts
    }
    assert {name for name in names_in(built.studies_wheel) if ".dist-info/" not in name} == wanted


def test_the_wheel_holds_every_file_of_the_package(built: Built) -> None:
    packed = {name for name in names_in(built.wheel) if name.startswith("rcopterx/")}
    assert packed == files_of_the_package()
    assert {"rcopterx/agents/pilot.py", "rcopterx/fleet/fleets/trio.toml", "rcopterx/py.typed"} <= packed


def test_the_source_archive_holds_files_instead_of_links(built: Built) -> None:
    with tarfile.open(built.archive) as archive:
        members = archive.getmembers()
    assert not [member.name for member in members if member.issym() or member.islnk()]
    inside = {PurePosixPath(*PurePosixPath(member.name).parts[1:]).as_posix() for member in members}
    assert files_of_the_package() <= inside
    assert {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md"} <= inside
    assert not [name for name in inside if name.startswith(("tests/", "studies/"))]


@pytest.mark.parametrize("checker", ["twine", "check_wheel_contents"])
def test_the_tools_of_packagers_have_nothing_to_say(checker: str, built: Built) -> None:
    pytest.importorskip(checker, reason="pip install 'rcopterx[package]', as make wheel does")
    arguments = (
        ["check", "--strict", *built.files] if checker == "twine" else [built.wheel, built.studies_wheel]
    )
    command = [sys.executable, "-m", checker, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
