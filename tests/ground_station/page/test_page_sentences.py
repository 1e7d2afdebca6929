"""Promises of the page's words: the state of the fleet in one sentence, chips of vehicles."""

from dataclasses import replace

import pytest
from msgspec import structs
from support.statuses import flying_status

from rcopterx.bus.messages import Battery, LeaderLink, TransmitterStatus
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.page.sentences import (
    battery,
    chip,
    down_sentence,
    fleet_sentence,
    is_down,
    learned,
    radio,
)
from rcopterx.ground_station.page.view import fleet_shown
from rcopterx.ground_station.quantities import voltage
from rcopterx.ground_station.scripting.state import VehicleState

ARMED = TransmitterStatus(state="armed", reason="by h1", link="open", module="no module", ready=True)
LEADER = VehicleState("h1", flying_status(position_m=(1.0, 2.0, 0.5)), ARMED, 0.1, 0.1, 0.01, seen_age_s=0.01)


def follower(name: str, error_m: float) -> VehicleState:
    link = LeaderLink(leader="h1")
    agent = flying_status(assigned=(link,), following=(link,), error_m=error_m, position_m=(0.0, 0.0, 1.0))
    return replace(LEADER, name=name, agent=agent)


def phased(state: VehicleState, phase: str, transmitter: str = "disarmed", reason: str = "") -> VehicleState:
    assert state.agent is not None
    status = structs.replace(ARMED, state=transmitter, reason=f"{transmitter}: {reason}")
    return replace(state, agent=structs.replace(state.agent, phase=phase), transmitter=status)


FLYING = [LEADER, follower("h2", 0.021), follower("h3", 0.0324)]


@pytest.mark.parametrize(
    ("states", "problems", "text", "level"),
    [
        (FLYING, [], "3 fly, formation within 32 mm", "calm"),
        ([LEADER], [], "1 flies", "calm"),
        ([phased(one, "takeoff", "armed") for one in FLYING[:2]], [], "2 take off", "calm"),
        ([phased(one, "ground") for one in FLYING], [], "ready to take off", "calm"),
        ([phased(one, "ground") for one in FLYING], ["h2: no pose", "h3: x"],
         "not ready: h2: no pose (and 1 more)", "amber"),
        ([*FLYING[:2], phased(FLYING[2], "emergency", "land", "commands silent")], [],
         "h3 brought down, 2 fly, formation within 21 mm", "red"),
        ([phased(one, "ground", "killed", "x") for one in FLYING], [],
         "KILLED: all motors are cut; Reset before the next take-off", "red"),
        ([*FLYING[:2], phased(FLYING[2], "ground", "killed", "x")], [],
         "h3 KILLED, 2 fly, formation within 21 mm", "red"),
        ([*FLYING[:2], replace(FLYING[2], agent_age_s=1.0)], [], "3 fly, formation within 32 mm", "red"),
        ([phased(one, "emergency", "hold", "raw poses") for one in FLYING], [], "h1, h2, h3 held", "amber"),
        ([*FLYING[:2], phased(FLYING[2], "ground", "cut", "descent over")], [], "h3 motors cut", "red"),
        ([*FLYING[:2], phased(FLYING[2], "ground", "cut", "landed: raw poses")], [],
         "h3 was landed, 2 fly", "amber"),
    ],
)  # fmt: skip
def test_the_state_of_a_fleet_is_one_sentence(
    states: list[VehicleState], problems: list[str], text: str, level: str
) -> None:
    sentence = fleet_sentence(states, problems)
    assert sentence.text.startswith(text)
    assert sentence.level == level


def test_a_fleet_is_down_when_no_process_reports() -> None:
    silent = [replace(one, agent_age_s=5.0, transmitter_age_s=None) for one in FLYING]
    assert is_down(silent)
    assert not is_down([*silent, LEADER])
    assert down_sentence("trio").text == "trio is down; start it with rcopterx up trio"


@pytest.mark.parametrize(
    ("state", "text", "level"),
    [
        (LEADER, "flies", "calm"),
        (phased(LEADER, "ground"), "on the floor", "off"),
        (phased(LEADER, "flying", "hold", "raw poses"), "held", "amber"),
        (phased(LEADER, "ground", "cut", "landed"), "was landed", "amber"),
        (phased(LEADER, "ground", "killed"), "KILLED", "red"),
        (replace(LEADER, agent_age_s=1.0), "silent", "red"),
        (VehicleState("h1"), "silent", "off"),
        (phased(LEADER, "a_later_version", "armed"), "a_later_version", "off"),
    ],
)
def test_a_chip_is_the_state_of_a_vehicle_in_two_words(state: VehicleState, text: str, level: str) -> None:
    assert (chip(state).text, chip(state).level) == (text, level)


def test_a_battery_is_its_voltage_else_the_thrust_that_hovering_needs() -> None:
    assert battery(LEADER).text == ""
    assert battery(replace(LEADER, agent=flying_status(hover_thrust=0.5625))).text == "hover 56 %"
    low = structs.replace(ARMED, battery=Battery(voltage_v=3.1, share=0.08, low=True))
    shown = battery(replace(LEADER, transmitter=low))
    assert (shown.text, shown.level) == ("3.10 V", "red")


@pytest.mark.parametrize(
    ("known", "row", "details"),
    [
        (Battery(voltage_v=3.6), "3.60 V", "3.60 V"),
        (Battery(voltage_v=4.2, charged=True), "4.20 V, charged", "4.20 V, charged"),
        (
            Battery(voltage_v=3.6, left_s=(150.0, 200.0)),
            "3.60 V, 2.5 min",
            "3.60 V, 2.5 min left, at most 3.3",
        ),
    ],
)
def test_the_flight_time_that_is_left_is_shown_the_shortest_first(
    known: Battery, row: str, details: str
) -> None:
    state = replace(LEADER, transmitter=structs.replace(ARMED, battery=known))
    assert (battery(state).text, voltage(state)) == (row, details)
    assert str(state).endswith(details), "as rcopterx status shows it"


def test_a_radio_that_is_not_ready_says_why() -> None:
    assert radio(LEADER).text == "ready"
    assert radio(replace(LEADER, transmitter=structs.replace(ARMED, ready=False))).text == "no module"
    assert radio(replace(LEADER, transmitter_age_s=9.0)).text == "silent"


def test_a_vehicle_shows_what_it_has_learned_of_itself() -> None:
    agent = flying_status(hover_thrust=0.5, effort_factor=2.0, model={"hover_thrust": 0.5})
    assert len(learned(replace(LEADER, agent=agent))) == 3
    assert learned(LEADER) == []


def test_suggestions_name_a_leader_and_a_follower_of_the_fleet() -> None:
    alone = 'name = "lab"\n[vehicles.fox]\nsubject = "fox"\ntransmitter = { port = "/dev/ttyUSB0" }\n'
    shown = str(fleet_shown(parse_fleet(alone), steers=True)["suggestion"])
    assert "drag the handle of fox, or kill an agent" in shown
    assert "another leader" not in shown
    hen = (
        '[vehicles.hen]\nsubject = "hen"\ntransmitter = { port = "/dev/ttyUSB1" }\n'
        'follow = [{ leader = "fox", offset_m = [-0.5, 0.0, 0.0] }]\n'
    )
    assert "choose another leader for hen" in str(
        fleet_shown(parse_fleet(alone + hen), steers=True)["suggestion"]
    )
