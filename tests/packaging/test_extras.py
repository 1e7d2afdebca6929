"""Promises of the extras: what pages and errors name can be installed, and every extra is named somewhere."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging_support import ROOT

PROJECTS = {"rcopterx": ROOT, "rcopterx-studies": ROOT / "studies"}
EXTRAS = {
    f"{project}[{extra}]"
    for project, directory in PROJECTS.items()
    for extra in tomllib.loads((directory / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
}
NAMED = re.compile(r"rcopterx(?:-studies)?\[\w+\]")
FOR_THIS_TREE = {"browser", "docs", "fuzz", "mutation", "package", "test"}
"""Installed by targets of the Makefile."""
PAGES = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
SOURCES = [*(ROOT / "rcopterx").glob("*/**/*.py"), *(ROOT / "studies" / "rcopterx_studies").rglob("*.py")]


def named_in(paths: list[Path]) -> set[str]:
    return {extra for path in paths for extra in NAMED.findall(path.read_text(encoding="utf-8"))}


def test_extras_that_pages_and_errors_name_are_those_there_are() -> None:
    named = named_in(PAGES) | named_in(SOURCES)
    assert named == EXTRAS - {f"rcopterx[{extra}]" for extra in FOR_THIS_TREE}


@pytest.mark.parametrize("extra", sorted(FOR_THIS_TREE))
def test_extras_for_this_tree_are_installed_by_make(extra: str) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (listed,) = re.findall(r"^EXTRAS := (.+)$", makefile, re.MULTILINE)
    assert extra in listed.split()
