"""Promises of the page about motion capture: every fault is in it, and its commands and files are right."""

import re
import shlex
from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR

from rcopterx import ground_station
from rcopterx.deploy.roles.tracker import BRANDS, brand_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx_studies.faults.scenario import FAULTS, fault_from, field_from, read_scenario

PAGE = (Path(ground_station.__file__).resolve().parents[1] / "docs" / "motion_capture.md").read_text(
    encoding="utf-8"
)
TABLE = PAGE.split("<!-- faults: begin -->")[1].split("<!-- faults: end -->")[0]
COMMANDS = [
    command
    for row in TABLE.splitlines()[3:]
    if row
    for command in re.findall(r"`([^`]+)`", row.split("|")[2])
]


def test_every_fault_is_in_the_table() -> None:
    assert {command.split()[0] for command in COMMANDS} == set(FAULTS)


@pytest.mark.parametrize("command", COMMANDS)
def test_command_of_the_table_is_a_fault(command: str) -> None:
    kind, *words = shlex.split(command)
    fault_from(kind, dict(field_from(word) for word in words))


def blocks(language: str) -> list[str]:
    return re.findall(rf"^ *```{language}\n(.*?)^ *```", PAGE, flags=re.MULTILINE | re.DOTALL)


def test_scenario_of_the_page_can_be_read(tmp_path: Path) -> None:
    (text,) = (block for block in blocks("toml") if "[[fault]]" in block)
    path = tmp_path / "faults.toml"
    path.write_text(text)
    assert [line.at_s for line in read_scenario(path)] == [1.0, 4.0]


def test_brands_of_the_page_are_all_there_are_and_its_examples_are_right() -> None:
    table = PAGE.split("| brand | usual address | remarks |")[1].split("\n\n")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE) == list(BRANDS)
    trackers = [block.split("[vehicles")[0] for block in blocks("toml") if "brand =" in block]
    assert len(trackers) == 2
    for text in trackers:
        assert brand_of(parse_fleet(HARDWARE_PAIR + text)) is not None
