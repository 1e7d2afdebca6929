"""docs/safety.md says what the arbiter does."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcopterx.radios.limits import LONGEST_DESCENT_S, ArbiterLimits, Fence, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import State
from rcopterx.transmitter_gateway.landing import HURRY
from rcopterx.transmitter_gateway.output_limiter import FADE_PER_S
from rcopterx.transmitter_gateway.radios import COMMANDED_TURN_S, TURN_S
from rcopterx.transmitter_gateway.transitions import TRANSITIONS, Condition, find_transition
from rcopterx.transmitter_gateway.transmitter import THROTTLE_LOW_FRAMES

SCRIPT = Path(__file__).parents[2] / "docs" / "figures" / "arbiter.js"
TESTS = Path(__file__).parents[1]
PAGE = (Path(__file__).parents[2] / "docs" / "safety.md").read_text(encoding="utf-8")


def table() -> str:
    """The page's table; copy it from the failing comparison when the transitions have changed."""
    lines = [
        "| # | in | if all of | and none of | then | reason |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for number, row in enumerate(TRANSITIONS, 1):
        states = ", ".join(state for state in State if state in row.states)
        needs, unless = (", ".join(sorted(names)) or "-" for names in (row.needs, row.unless))
        lines.append(f"| {number} | {states} | {needs} | {unless} | {row.target} | {row.reason} |")
    return "\n".join(lines)


def test_table_of_the_page_is_the_arbiters() -> None:
    shown = PAGE.partition("<!-- table: begin -->\n")[2].partition("\n<!-- table: end -->")[0]
    assert shown == table()


@pytest.mark.skipif(shutil.which("node") is None, reason="apt-get install nodejs")
@given(st.lists(st.tuples(st.sampled_from(State), st.frozensets(st.sampled_from(Condition))), min_size=200))
@settings(max_examples=5)
def test_the_table_to_try_out_finds_the_row_of_the_arbiter(
    cases: list[tuple[State, frozenset[Condition]]],
) -> None:
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table().splitlines()[2:]]
    program = f"""{SCRIPT.read_text(encoding="utf-8")}
    const [lines, cases] = JSON.parse(require("fs").readFileSync(0));
    const rows = lines.map(rowOf);
    const numberOf = ([state, conditions]) => Number(firstRow(rows, state, conditions)?.number ?? 0);
    console.log(JSON.stringify(cases.map(numberOf)));"""
    given_cases = [(state, sorted(conditions)) for state, conditions in cases]
    result = subprocess.run(
        ["node", "-e", program],
        input=json.dumps([lines, given_cases]),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    found = [find_transition(*case) for case in cases]
    numbers = [0 if row is None else TRANSITIONS.index(row) + 1 for row in found]
    assert json.loads(result.stdout) == numbers


def test_figures_of_the_page_are_the_defaults() -> None:
    limits, poses = ArbiterLimits(), SurveillanceLimits()
    words = " ".join(PAGE.split())
    landing = limits.landing
    fence = Fence((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    for line in (
        f"from 1.5 periods on, for at most {limits.bridge_s * 1e3:.0f} ms",
        f"captured more than {limits.command_age_s * 1e3:.0f} ms ago",
        f"HOLD | {limits.hold_after_s * 1e3:.0f} ms",
        f"not seen | {limits.descend_after_s * 1e3:.0f} ms",
        f"CUT | commands older than {limits.cut_after_s:.1f} s",
        f"at most {limits.hold_limit_s} s, then LAND or DESCEND",
        f"at most {limits.descents_s(0.11)[1]:.1f} s, longer from more than 0.11 m",
        f"at most {LONGEST_DESCENT_S} s; then CUT;",
        f"the thrust falls by {FADE_PER_S}/s",
        f"at {landing.descent_m_s} m/s, from {landing.flare_m} m on at {landing.touchdown_m_s} m/s",
        f"raw poses are judged | within {TURN_S * 1e3:.0f} ms; while commands fly all vehicles",
        f"with each command, within {COMMANDED_TURN_S * 1e3:.0f} ms",
        f"older than {landing.pose_age_s * 1e3:.0f} ms",
        f"at most {landing.longest_s:.0f} s, then DESCEND",
        f"HOLD after {(poses.tracking_hold_s or 0) * 1e3:.0f} ms",
        f"DESCEND after {(poses.tracking_descend_s or 0) * 1e3:.0f} ms",
        f"| {poses.maximum_jump_m} m and {poses.maximum_speed_m_s} m/s; after {poses.jump_descend_s} s",
        f"closer than {poses.minimum_distance_m} m",
        f"outside the fence by {fence.margin_m} m",
        f"does not obey its sticks, and outside the fence by {fence.cut_m} m | CUT",
        f"at once, at {HURRY * landing.descent_m_s} m/s until {HURRY * landing.flare_m} m above the floor",
        f"commanded low for {limits.arm_low_s} s",
        f"on the floor | disarmed after {limits.disarm_after_s:.0f} s",
        f"thrust low for {limits.arm_low_s} s, or seen where it falls with at most {limits.fall_m_s} m/s",
        f"CUT, {THROTTLE_LOW_FRAMES} throttle-low frames",
        f"younger than {limits.take_over_s} s",
    ):
        assert line in words, line


def test_tests_that_the_page_names_exist() -> None:
    named = re.findall(r"`tests/([\w/]+\.py)::(\w+)`", PAGE)
    assert len(named) > 30
    for path, name in named:
        assert f"def {name}(" in (TESTS / path).read_text(encoding="utf-8"), name
