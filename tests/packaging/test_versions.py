"""Promises of a release: all files have the same version, and its notes are short."""

import re
import tomllib

from packaging_support import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
VERSION = PROJECT["version"]
STUDIES = tomllib.loads((ROOT / "studies" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
MOST_LINES = 40
RECIPE = (ROOT / "packaging" / "meta.yaml").read_text(encoding="utf-8")
NAMES_OF_CONDA = {"msgpack": "msgpack-python"}


def test_the_version_to_cite_is_that_of_the_software() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [VERSION]


def test_the_newest_dated_version_of_the_changelog_is_that_of_the_software() -> None:
    headings = re.findall(r"^## (.+)$", CHANGELOG, re.MULTILINE)
    assert headings[0] == "Unreleased"
    assert re.fullmatch(rf"{re.escape(VERSION)} \(\d{{4}}-\d\d-\d\d\)", headings[1])


def test_studies_have_the_version_of_the_software_and_need_it() -> None:
    assert STUDIES["version"] == VERSION
    assert f"rcopterx=={VERSION}" in STUDIES["dependencies"]
    assert STUDIES["requires-python"] == PROJECT["requires-python"]


def test_the_notes_of_a_release_are_short_enough_to_read() -> None:
    releases = CHANGELOG.split("\n## ")[2:]
    assert [notes.partition("\n")[0] for notes in releases if len(notes.splitlines()) > MOST_LINES] == []


def test_the_recipe_for_conda_has_the_version_and_the_requirements_of_the_software() -> None:
    assert re.findall(r'set version = "(.+?)"', RECIPE) == [VERSION]
    wanted = {f"python {PROJECT['requires-python']}"}
    for requirement in PROJECT["dependencies"]:
        name, limits = re.fullmatch(r"([\w-]+)(.*)", requirement).groups()
        wanted.add(f"{NAMES_OF_CONDA.get(name, name)} {limits}")
    run = RECIPE.partition("  run:\n")[2].partition("\ntest:")[0]
    assert set(re.findall(r"^    - (\w.+)$", run, re.MULTILINE)) - {"__linux"} == wanted
