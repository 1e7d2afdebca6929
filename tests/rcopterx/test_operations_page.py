"""Promises of the page about operating a fleet: it speaks of what the software does."""

import re
from pathlib import Path

import rcopterx
from rcopterx.bus.host_messages import SubjectState, TrackerStatus
from rcopterx.bus.messages import TransmitterStatus
from rcopterx.command_line import PLACES
from rcopterx.commands.extensions import STUDIES
from rcopterx.ground_station.scripting.notes import tracker_problems
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.terminal.live_table import COLUMNS
from rcopterx.radios.limits import ArbiterLimits, Fence, StandingLimits, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import PoseInput
from rcopterx.transmitter_gateway.standing import Standing
from rcopterx.vehicles.phases import TRANSITIONS

TEXT = (Path(rcopterx.__file__).parents[1] / "docs" / "operations.md").read_text(encoding="utf-8")


def rows_after(heading: str) -> list[list[str]]:
    table = TEXT.split(heading, 1)[1].split("\n\n|", 1)[1].split("\n\n", 1)[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def test_the_table_of_phases_is_that_of_the_agents() -> None:
    wanted = [[", ".join(row.phases), row.event, row.target, row.effect] for row in TRANSITIONS]
    assert rows_after("## Flight phases") == wanted


def test_every_problem_that_a_check_can_name_is_explained() -> None:
    explained = "\n".join(row[0] for row in rows_after("names everything that blocks"))
    subject = SubjectState(subject="heli2", vehicle="h2", listed=False)
    twice = SubjectState(subject="heli2", vehicle="h2", ambiguous=True)
    far = SubjectState(subject="heli2", vehicle="h2", shown_at_m=(1000.0, 500.0, 20.0))
    beside = SubjectState(subject="heli2", vehicle="h2", same_place_as="heli2_old")
    tracker = TrackerStatus(state="up", trying="", address="", subjects=(subject, twice, far, beside))
    named = tracker_problems(None, None, []) + tracker_problems(tracker, 0.0, ["h2"])
    named += VehicleState("h2").problems()
    for state, ready in (("disarmed", False), ("killed", True)):
        transmitter = TransmitterStatus(state=state, reason="", link="up", module="", ready=ready)
        named += VehicleState("h2", None, transmitter, None, 0.0, None).problems()[1:]
    named += implausible()
    assert len(named) == 17
    for problem in named:
        start = re.split(r" for |: \w*$| \(|, below|, \d|: one|: \d|: over| from h|, closer", problem)[0]
        assert start in explained, problem


def implausible() -> list[str]:
    """All that the transmitter gateway can find about a pose on the floor."""
    fence = Fence((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))
    surveillance = SurveillanceLimits(fence=fence, trust_repeated_poses=False)
    limits = ArbiterLimits(surveillance=surveillance, standing=StandingLimits())
    found = []
    for place in ((0.0, 0.0, -0.5), (0.0, 0.0, 0.5), (1.8, 0.5, 0.0)):
        standing = Standing("h2", limits, lambda _: {"h3": (1.8, 0.5, 0.0), "h4": (1.8, 0.3, 0.0)})
        standing.observe(PoseInput("h2", 1, 1, place, 1.0, tilt_rad=0.0), 0.0)
        found += standing.problems(0.0)
    standing.observe(PoseInput("h2", 1, 2, (0.0, 0.0, 0.0), 1.0), 0.0)
    standing.observe(PoseInput("h2", 1, 3, (0.0, 0.0, 0.0), 1.0, tilt_rad=1.5), 1.0)
    return found + standing.problems(0.5)


def test_every_command_is_on_the_page_and_every_command_of_the_page_exists() -> None:
    known = {*PLACES, *STUDIES} - {"import"}  # a group; the page names its commands
    listed = re.findall(r"`([\w-]+)`", " ".join(row[0] for row in rows_after("## All commands")))
    assert sorted(listed) == sorted(known)
    for used in re.findall(r"rcopterx (\w+)", TEXT):
        assert used in known, used


def test_every_column_but_the_name_is_explained() -> None:
    explained = [row[0] for row in rows_after("as a live table until Ctrl-C")]
    stages = [row[0].strip("`") for row in rows_after("how long commands take as well, stage by stage")]
    latencies = [f"latency {stage}, p50 / p99 / max" for stage in ("total", *stages)]
    assert [*explained, *latencies] == [column.name for column in COLUMNS[1:]]
