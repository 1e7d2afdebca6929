"""Promises of the page about real time: the permission it gives is enough for every process."""

import re
from pathlib import Path

from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.reading import parse_fleet

TEXT = (Path(__file__).parents[1] / "docs" / "real_time.md").read_text(encoding="utf-8")
FLEET = parse_fleet('name = "lab"\n[vehicles.h1]\nsubject = "h1"\ntransmitter = { port = "/dev/ttyUSB0" }\n')


def test_what_the_page_permits_is_enough_for_every_process() -> None:
    permitted = {int(number) for number in re.findall(r"(?:rtprio[ =]|LimitRTPRIO=)(\d+)", TEXT)}
    assert len(permitted) == 1
    assert permitted.pop() >= max(priority.of(FLEET) for priority in Priority)


def test_the_page_names_the_priorities_of_the_processes() -> None:
    used = [priority.of(FLEET) for priority in Priority]
    assert f"priorities {min(used)} to {max(used)}" in TEXT
