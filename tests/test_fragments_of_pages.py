"""Promises of pages: parts of fleet files are accepted, figures are described with their commands."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from support.fleets import HARDWARE_PAIR

from rcopterx.fleet.reading import parse_fleet

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TOML = re.compile(r"^( *)```toml\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
NOT_OF_A_FLEET = ("[project.", "[[fault]]")
"""Of a package, and of a scenario."""
TRIO = HARDWARE_PAIR + '[vehicles.h3]\nsubject = "heli3"\ntransmitter = { port = "radio-h3" }\n'
PARTS = [
    pytest.param(re.sub(rf"^{indent}", "", text, flags=re.MULTILINE), id=f"{page.name}-{number}")
    for page in PAGES
    for number, (indent, text) in enumerate(TOML.findall(page.read_text(encoding="utf-8")))
    if not any(mark in text for mark in NOT_OF_A_FLEET)
]
FIGURE = re.compile(r"!\[([^\]]*)\]\((?:docs/)?figures/([^)]+)\)")
LINKED = re.compile(r"\]\((?:docs/)?figures/([^)]+)\)")
MADE = re.compile(r"^\| `([\w.]+)` \| (.+) \|$", re.MULTILINE)


def joined(base: dict[str, Any], part: dict[str, Any]) -> dict[str, Any]:
    """Tables of both; the part replaces entries of the base."""
    both = dict(base)
    for key, value in part.items():
        old = both.get(key)
        both[key] = joined(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return both


@pytest.mark.parametrize("text", PARTS)
def test_a_part_of_a_fleet_file_is_accepted(text: str) -> None:
    whole = joined(tomllib.loads(TRIO), tomllib.loads(text))
    named = {host for vehicle in whole["vehicles"].values() for host in vehicle.get("spares", [])}
    named |= {vehicle["host"] for vehicle in whole["vehicles"].values() if "host" in vehicle}
    hosts = {
        host: {"address": f"127.0.0.{number}"} for number, host in enumerate({"main", *sorted(named)}, 2)
    }
    parse_fleet(tomlkit.dumps(joined({"hosts": hosts}, whole)))


def figures_of(page: Path) -> list[tuple[str, str]]:
    return FIGURE.findall(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_figure_has_a_text_that_describes_it(page: Path) -> None:
    for words, name in figures_of(page):
        assert len(words.split()) >= 8, f"{name}: too short for readers who cannot see it: {words!r}"


def test_every_figure_is_on_a_page_and_its_origin_is_documented() -> None:
    shown = {name for page in PAGES for name in LINKED.findall(page.read_text(encoding="utf-8"))}
    there = {
        path.name
        for path in (ROOT / "docs" / "figures").iterdir()
        if path.suffix in (".svg", ".png", ".webp")
    }
    assert shown == there
    contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    made = dict(MADE.findall(contributing.partition("## Figures")[2].partition("\n## ")[0]))
    assert set(made) == there
    for name, how in made.items():
        assert how == "drawn by hand" or f"docs/figures/{name}" in how or name.startswith("ground.")
