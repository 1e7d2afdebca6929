"""Promises of a release: all files have the same version."""

import re
import tomllib

from packaging_support import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
VERSION = PROJECT["version"]
RECIPE = (ROOT / "packaging" / "meta.yaml").read_text(encoding="utf-8")
NAMES_OF_CONDA = {"msgpack": "msgpack-python"}


def test_the_version_to_cite_is_that_of_the_software() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [VERSION]


def test_the_newest_dated_version_of_the_changelog_is_that_of_the_software() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.+)$", changelog, re.MULTILINE)
    assert headings[0] == "Unreleased"
    assert re.fullmatch(rf"{re.escape(VERSION)} \(\d{{4}}-\d\d-\d\d\)", headings[1])


def test_the_recipe_for_conda_has_the_version_and_the_requirements_of_the_software() -> None:
    assert re.findall(r'set version = "(.+?)"', RECIPE) == [VERSION]
    wanted = {f"python {PROJECT['requires-python']}"}
    for requirement in PROJECT["dependencies"]:
        name, limits = re.fullmatch(r"([\w-]+)(.*)", requirement).groups()
        wanted.add(f"{NAMES_OF_CONDA.get(name, name)} {limits}")
    run = RECIPE.partition("  run:\n")[2].partition("\ntest:")[0]
    assert set(re.findall(r"^    - (\w.+)$", run, re.MULTILINE)) - {"__linux"} == wanted
