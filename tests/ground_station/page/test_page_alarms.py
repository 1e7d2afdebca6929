"""Promises of the page's alarms: words with a remedy, one line for each cause, gone after their cause."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs
from support.statuses import flying_status

from rcopterx.bus.messages import Battery, TransmitterStatus
from rcopterx.ground_station.page.alarms import GONE_S, SLOW, AlarmBoard, Cause, causes_of
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.transmitter_gateway.inputs import NAMES
from rcopterx.transmitter_gateway.transitions import TRANSITIONS

ARMED = TransmitterStatus(state="armed", reason="by h1", link="open", module="ready", ready=True)
STATE = VehicleState("h1", flying_status(position_m=(1.0, 2.0, 0.5)), ARMED, 0.1, 0.1, 0.01, seen_age_s=0.01)
LATE = Cause("commands late", "amber", "wait", "h1")


def remarked(name: str, *remarks: str) -> VehicleState:
    return replace(STATE, name=name, agent=flying_status(remarks=remarks))


def test_a_vehicle_that_flies_as_it_should_has_no_cause() -> None:
    assert list(causes_of(STATE)) == []


@pytest.mark.parametrize(
    "row", [row for row in TRANSITIONS if NAMES[row.target] in ("hold", "land", "descend", "cut")]
)
def test_every_way_of_the_arbiter_to_take_a_vehicle_over_has_a_remedy(row: object) -> None:
    reason, state = row.reason, NAMES[row.target]  # type: ignore[attr-defined]
    status = structs.replace(ARMED, state=state, reason=f"{state}: {reason}")
    (cause,) = causes_of(replace(STATE, transmitter=status))
    assert reason in cause.text
    assert cause.remedy or reason in (
        "taken over",
        "hold lasted too long",
        "landing lasted too long",
        "descent over",
    )
    assert cause.level == ("amber" if state == "hold" or reason == "landed" else "red")


def test_a_vehicle_that_the_arbiter_has_landed_shows_why_on_the_floor() -> None:
    why = "transmitter not ready: battery empty: below 3 V for 5 s"
    status = structs.replace(ARMED, state="cut", reason=f"cut: landed: {why}")
    (cause,) = causes_of(replace(STATE, transmitter=status))
    assert (cause.text, cause.level) == (f"was landed: {why}", "amber")
    assert cause.remedy == "charge its battery"


def test_a_slow_computer_is_one_sentence_without_names_of_classes() -> None:
    causes = [
        cause
        for number in range(20)
        for cause in causes_of(
            remarked(f"h{number}", "ExtendedKalmanEstimator: a call took longer than 6 ms")
        )
    ]
    (alarm,) = AlarmBoard().update(1.0, causes)
    assert (alarm.text, alarm.vehicles) == (SLOW, [])
    assert alarm.remedy


def test_vehicles_with_the_same_cause_share_a_line() -> None:
    board = AlarmBoard()
    causes = [cause for name in ("h1", "h2") for cause in causes_of(remarked(name, "it lands: sticks"))]
    (alarm,) = board.update(1.0, causes)
    assert (alarm.vehicles, alarm.level) == (["h1", "h2"], "red")
    (alarm,) = board.update(2.0, causes[1:])
    assert alarm.vehicles == ["h2"]


def test_a_cause_whose_numbers_change_keeps_its_line_and_shows_the_newest() -> None:
    board = AlarmBoard()
    for number, text in enumerate(
        ("own pose lost for 0.1 s", "own pose lost for 0.2 s", "own pose lost for 12 s")
    ):
        (alarm,) = board.update(float(number), [Cause(text, "amber", "", "h1")])
    assert (alarm.text, alarm.count) == ("own pose lost for 12 s", 1)


def test_a_low_battery_in_flight_and_a_lost_leader_are_alarms() -> None:
    battery = Battery(voltage_v=3.1, share=0.08, low=True)
    low = replace(STATE, transmitter=structs.replace(ARMED, battery=battery))
    assert [cause.text for cause in causes_of(low)] == ["low voltage: █░░░░░░░ 3.10 V"]
    assert list(causes_of(replace(low, agent=flying_status(phase="ground")))) == []
    lost = replace(STATE, agent=flying_status(following_mode="use_last_plan"))
    assert [cause.text for cause in causes_of(lost)] == ["its leader is lost: use last plan"]
    assert [cause.level for cause in causes_of(replace(STATE, agent_age_s=1.0))] == ["red"]
    assert [cause.level for cause in causes_of(replace(STATE, seen_age_s=0.5))] == ["amber"]


def test_an_alarm_stays_ten_seconds_after_its_cause_and_counts_how_often_it_began() -> None:
    board = AlarmBoard()
    for begin_s in (0.0, 5.0, 9.0):
        (alarm,) = board.update(begin_s, [LATE])
        assert not alarm.over
        (alarm,) = board.update(begin_s + 1.0, [])
        assert alarm.over
    assert alarm.count == 3
    assert len(board.update(9.0 + GONE_S, [])) == 1
    assert board.update(9.1 + GONE_S, []) == []


@given(st.lists(st.tuples(st.floats(0.0, 5.0), st.sets(st.sampled_from("abc"))), max_size=30))
def test_present_alarms_come_first_and_none_outlives_its_cause(steps: list[tuple[float, set[str]]]) -> None:
    board, now_s, seen_s = AlarmBoard(), 0.0, {}
    for passed_s, texts in steps:
        now_s += passed_s
        seen_s |= dict.fromkeys(texts, now_s)
        alarms = board.update(now_s, [Cause(text, "red" if text == "a" else "amber") for text in texts])
        assert {alarm.text for alarm in alarms if not alarm.over} == texts
        assert {alarm.text for alarm in alarms} == {t for t, s in seen_s.items() if now_s - s <= GONE_S}
        assert [alarm.over for alarm in alarms] == sorted(alarm.over for alarm in alarms)
