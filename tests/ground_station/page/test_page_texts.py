"""Promises of the page's texts: alarms first, units everywhere, nothing from the bus is markup."""

from dataclasses import replace

from msgspec import structs
from support.statuses import flying_status

from rcopterx.bus.messages import Battery, TransmitterStatus
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.events import LoggedEvent
from rcopterx.ground_station.page.controls import banner, event_list, suggestions, vehicle_table
from rcopterx.ground_station.quantities import QUANTITIES
from rcopterx.ground_station.scripting.state import VehicleState

ARMED = TransmitterStatus(state="armed", reason="by h1", link="open", module="<b>", ready=True)
AGENT = flying_status(position_m=(1.0, 2.0, 0.5), yaw_rad=3.14159265, solve_ms_p50=1.5, client="fly.m",
                      hover_thrust=0.5625, position_deviation_m=(0.0005, 0.0005, 0.001))  # fmt: skip
STATE = VehicleState("h1", AGENT, ARMED, 0.1, 0.1, 0.01, seen_age_s=0.01)


def test_a_table_has_units_and_escapes_what_others_say() -> None:
    table = vehicle_table(STATE)
    for text in (
        "by h1",
        "1.00, 2.00, 0.50 m",
        "180°",
        "1.50 / 0.00 ms",
        "10 ms",
        "1.0, 1.0, 2.0 mm",
        "hovers at 56 % of the thrust",
        "&lt;b&gt;",
    ):
        assert text in table, text
    assert "fly.m (external)" in table
    assert "<b>" not in table


def test_a_banner_tells_who_is_not_flown_by_its_agent_and_what_blocks_take_off() -> None:
    held = TransmitterStatus(state="land", reason="land: no command", link="open", module="ready", ready=True)
    shown = banner("lab", [STATE, replace(STATE, name="h2", transmitter=held)], ["h3: <no> pose"])
    assert "h2: land: no command" in shown
    assert "h3: &lt;no&gt; pose" in shown
    assert "h1 flying · h2 flying" in shown
    assert "h1:" not in shown


def test_what_people_should_know_of_a_vehicle_catches_the_eye() -> None:
    warned = replace(STATE, agent=flying_status(remarks=("the battery is nearly empty",)))
    assert "h1: the battery is nearly empty" in banner("lab", [warned], [])
    assert "the battery is nearly empty" in vehicle_table(warned)


def test_the_voltage_of_a_battery_is_a_bar_and_a_low_one_an_alarm() -> None:
    (voltage,) = [quantity for quantity in QUANTITIES if quantity.name == "voltage"]
    for share, low, text in ((0.5, False, "████░░░░ 3.60 V"), (None, True, "3.60 V")):
        battery = Battery(voltage_v=3.6, share=share, low=low)
        state = replace(STATE, transmitter=structs.replace(ARMED, battery=battery))
        assert voltage.text(state) == text
        assert voltage.alarming(state) is low
        assert text in vehicle_table(state)
    assert voltage.text(STATE) == ""


def test_a_low_voltage_in_flight_is_in_the_banner() -> None:
    battery = Battery(voltage_v=3.1, share=0.08, low=True)
    low = replace(STATE, transmitter=structs.replace(ARMED, battery=battery))
    assert "h1: low voltage: █░░░░░░░ 3.10 V" in banner("lab", [low], [])
    fresh = replace(low, transmitter=structs.replace(ARMED, battery=structs.replace(battery, low=False)))
    assert "voltage" not in banner("lab", [fresh], [])


def test_events_are_listed_newest_first() -> None:
    shown = event_list([LoggedEvent(1.0, "h1", "first"), LoggedEvent(2.0, "h2", "second", True)], 300.0)
    assert shown.index("second") < shown.index("first")
    assert "5 min" in shown
    assert "nothing has happened yet" in event_list([], 0.0)


def test_a_table_tells_where_commands_spend_their_time() -> None:
    figures = {"p50": 1.24, "p99": 2.5, "max": 3.0}
    table = vehicle_table(replace(STATE, latency_ms={"solver": figures, "total": figures}))
    assert "1.2 / 2.5 / 3.0 ms" in table
    assert "latency solver, p50 / p99 / max" in table
    assert "latency total" in table
    assert "latency radio" not in table


def test_suggestions_name_a_leader_and_a_follower_of_the_fleet() -> None:
    alone = 'name = "lab"\n[vehicles.fox]\nsubject = "fox"\ntransmitter = { port = "/dev/ttyUSB0" }\n'
    shown = suggestions(parse_fleet(alone))
    assert "drag the handle of <b>fox</b>, or kill an agent" in shown
    assert "another leader" not in shown
    hen = (
        '[vehicles.hen]\nsubject = "hen"\ntransmitter = { port = "/dev/ttyUSB1" }\n'
        'follow = [{ leader = "fox", offset_m = [-0.5, 0.0, 0.0] }]\n'
    )
    assert "choose another leader in the tab of <b>hen</b>" in suggestions(parse_fleet(alone + hen))
