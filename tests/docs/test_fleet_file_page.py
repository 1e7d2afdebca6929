"""Promises of the fleet-file reference: complete, up to date, and its example is a valid file."""

import re
from pathlib import Path

import pytest

from fleet_file_page import SECTIONS, reference
from messages_page import meanings_of
from rcopterx import deploy
from rcopterx.fleet.reading import parse_fleet

PAGE = Path(deploy.__file__).resolve().parents[1] / "docs" / "fleet_file.md"
ROW = re.compile(r"^\| `(\w+)` \| ([^|]+) \| ([^|]*) \| ([^|]+) \| ([^|]+) \|$")


@pytest.fixture(scope="module")
def made() -> str:
    """The page as it is now."""
    return reference()


def test_the_page_is_what_the_types_say_now(made: str) -> None:
    command = "python docs/generators/fleet_file_page.py > docs/fleet_file.md"
    assert PAGE.read_text(encoding="utf-8") == made, f"run: {command}"


def test_every_key_has_a_type_a_default_and_a_meaning(made: str) -> None:
    rows = [line for line in made.splitlines() if line.startswith("| `")]
    assert len(rows) > 150
    for row in rows:
        assert ROW.match(row), f"say below the field what it means: {row}"


@pytest.mark.parametrize(
    ("key", "cells"),
    [
        (
            "router_port",
            "| `router_port` | integer, 1 to 65535 |  | none | TCP port of the bus router. Default: 7447, "
            "but none in a fleet of one computer without certificates. |",
        ),
        ("max_m", "| `max_m` | 3 times float | m | `[1.2, 1.2, 2.0]` | Highest x, y, z."),
        ("then", '| `then` | `hold` or `land` or `promote` |  | `"hold"` | Keep the place;'),
        ("subject", "| `subject` | text |  | **needed** | Name of the vehicle's subject"),
        ("gain_us", "| `gain_us` | float | µs | `400.0` | Pulse width per unit of input"),
        ("braking_m_s2", "| `braking_m_s2` | 3 times float | m/s² | `[2.0, 2.0, 2.0]` | Deceleration"),
    ],
)
def test_types_units_defaults_limits_and_meanings_come_from_the_source(
    key: str, cells: str, made: str
) -> None:
    found = [line for line in made.splitlines() if line.startswith(f"| `{key}` |")]
    assert any(line.startswith(cells) for line in found), found


def test_parameters_that_share_an_entry_of_a_docstring_share_its_meaning() -> None:
    (calibration,) = (section for section in SECTIONS if section.path.endswith(".throttle"))
    meanings = meanings_of(calibration.kind)
    assert meanings["us0"] == meanings["us1"] == "Pulse widths [us] at thrust 0, `u_hover` and 1."


def test_every_link_leads_to_a_page_and_the_example_is_a_valid_file(made: str) -> None:
    for page in re.findall(r"\]\(([\w-]+\.md)", made):
        assert (PAGE.parent / page).exists(), page
    _, _, example = made.partition("```toml\n")
    assert list(parse_fleet(example.partition("```")[0]).vehicles) == ["h1", "h2"]
