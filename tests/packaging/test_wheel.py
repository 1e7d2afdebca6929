"""Promises of what people install: one top-level name, everything in it, nothing else."""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import PurePosixPath

import pytest
from packaging_support import BUILD_S, ROOT, Built

PACKAGE = ROOT / "rcopterx"
pytestmark = pytest.mark.timeout(BUILD_S + 100.0)


def files_of_the_package() -> set[str]:
    """Everything below `rcopterx/`, its links followed."""
    folders = [PACKAGE, *(entry for entry in PACKAGE.iterdir() if entry.is_symlink())]
    found = {path for folder in folders for path in folder.rglob("*") if path.is_file()}
    return {str(path.relative_to(ROOT)) for path in found if "__pycache__" not in path.parts}


def test_the_wheel_installs_one_name_only(built: Built) -> None:
    with zipfile.ZipFile(built.wheel) as wheel:
        top = {PurePosixPath(name).parts[0] for name in wheel.namelist()}
    assert {name for name in top if not name.endswith(".dist-info")} == {"rcopterx"}


def test_the_wheel_holds_every_file_of_the_package(built: Built) -> None:
    with zipfile.ZipFile(built.wheel) as wheel:
        packed = {name for name in wheel.namelist() if name.startswith("rcopterx/")}
    assert packed == files_of_the_package()
    assert {"rcopterx/agents/pilot.py", "rcopterx/deploy/fleets/trio.toml", "rcopterx/py.typed"} <= packed


def test_the_source_archive_holds_files_instead_of_links(built: Built) -> None:
    with tarfile.open(built.archive) as archive:
        members = archive.getmembers()
    assert not [member.name for member in members if member.issym() or member.islnk()]
    inside = {PurePosixPath(*PurePosixPath(member.name).parts[1:]).as_posix() for member in members}
    assert files_of_the_package() <= inside
    assert {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md"} <= inside
    assert not [name for name in inside if name.startswith("tests/")]


@pytest.mark.parametrize("checker", ["twine", "check_wheel_contents"])
def test_the_tools_of_packagers_have_nothing_to_say(checker: str, built: Built) -> None:
    pytest.importorskip(checker, reason="pip install 'rcopterx[package]', as make wheel does")
    options = ["check", "--strict", str(built.archive)] if checker == "twine" else []
    command = [sys.executable, "-m", checker, *options, str(built.wheel)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
