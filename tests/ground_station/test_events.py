"""Promises of events: a change is reported once, harmful ones are alarming."""

from dataclasses import replace

from support.statuses import flying_status

from rcopterx.bus.messages import LeaderLink, TransmitterStatus
from rcopterx.ground_station.events import KEPT, LoggedEvent, Timeline, changes
from rcopterx.ground_station.scripting.state import VehicleState

ARMED = TransmitterStatus(state="armed", reason="armed: by h1", link="open", module="ready", ready=True)
FLYING = VehicleState("h1", flying_status(), ARMED, 0.1, 0.1, 0.01)


def told(after: VehicleState) -> list[tuple[str, bool]]:
    return [(event.words, event.alarming) for event in changes(5.0, FLYING, after)]


def test_nothing_is_told_of_a_vehicle_that_goes_on() -> None:
    assert told(replace(FLYING, agent=flying_status(ticks=100), agent_age_s=0.2)) == []


def test_a_phase_a_leader_and_a_controller_are_told() -> None:
    link = LeaderLink(leader="h2")
    agent = flying_status(phase="landing", assigned=(link,), controller="lqr", client="matlab")
    assert told(replace(FLYING, agent=agent)) == [
        ("flying → landing", False),
        ("follows h2", False),
        ("controller lqr", False),
        ("flown by matlab", False),
    ]


def test_an_arbiter_that_intervenes_a_lost_leader_and_another_process_are_alarms() -> None:
    holding = TransmitterStatus(state="hold", reason="no command", link="open", module="ready", ready=True)
    agent = flying_status(following_mode="hold", process=7, missed_ticks=3)
    assert told(replace(FLYING, agent=agent, transmitter=holding)) == [
        ("transmitter hold: no command", True),
        ("another process of its agent took over", True),
        ("leader: hold", True),
        ("missed control period × 3", True),
    ]


def test_fallbacks_are_told_by_how_many_there_are_more() -> None:
    before = replace(FLYING, agent=flying_status(fallbacks={"shifted_plan": 2}))
    after = replace(FLYING, agent=flying_status(fallbacks={"shifted_plan": 5, "not_converged": 9}))
    assert [event.words for event in changes(1.0, before, after)] == ["shifted_plan × 3"]


def test_what_is_counted_goes_on_in_one_line_for_a_while_and_hides_nothing_else() -> None:
    timeline = Timeline()
    counted = [replace(FLYING, agent=flying_status(fallbacks={"leader_plan_late": n})) for n in range(80)]
    for number, state in enumerate(counted[:40]):
        timeline.compare(0.5 * number, {"h1": state})
    timeline.compare(20.0, {"h1": replace(counted[39], agent=flying_status(phase="landing"))})
    timeline.compare(20.5, {"h1": counted[40]})
    lines = [(line.text, line.counts) for line in timeline.lines]
    assert sorted(lines[:2]) == [("flying → landing", {"h1": 1}), ("landing → flying", {"h1": 1})]
    assert lines[2:] == [("leader_plan_late", {"h1": 79})]
    timeline.compare(60.0, {"h1": counted[42]})
    assert (timeline.lines[-1].text, timeline.lines[-1].counts) == ("leader_plan_late", {"h1": 2})


def test_an_event_of_several_vehicles_within_half_a_minute_is_one_line() -> None:
    timeline = Timeline()
    for time_s, name in ((1.0, "h1"), (40.0, "h1"), (41.0, "h2"), (42.0, "h1")):
        timeline.add(LoggedEvent(time_s, name, "poses lost"))
    assert [(line.newest_s, line.counts) for line in timeline.lines] == [
        (1.0, {"h1": 1}),
        (42.0, {"h1": 2, "h2": 1}),
    ]


def test_the_time_line_keeps_the_newest_events_and_begins_without_any() -> None:
    timeline = Timeline()
    landing = replace(FLYING, agent=flying_status(phase="landing"))
    for number in range(KEPT + 20):
        timeline.compare(100.0 * number, {"h1": landing if number % 2 else FLYING})
    assert len(timeline.lines) == KEPT
    assert timeline.lines[-1].newest_s == 100.0 * (KEPT + 19)
