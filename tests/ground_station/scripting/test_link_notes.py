"""Promises of notes about hosts: missing links first, clocks relative to this host."""

from rcopterx.bus.host_messages import LinkState, RouterStatus
from rcopterx.ground_station.scripting.notes import link_notes


def linked(**fields: float) -> LinkState:
    return LinkState(**({"linked": True, "redials": 0, "late": 0} | fields))  # type: ignore[arg-type]


MISSING = LinkState(linked=False, redials=4, late=0)


def test_a_fleet_on_one_host_has_nothing_to_tell() -> None:
    assert link_notes({}, "main") == []


def test_the_clock_of_another_host_is_told_with_its_uncertainty() -> None:
    ahead = linked(round_trip_s=0.0004, clock_offset_s=0.0123)
    assert link_notes({"main": RouterStatus(links={"control": ahead})}, "main") == [
        "host control: clock 12.3 +- 0.2 ms ahead of that of main, round trip 0.4 ms"
    ]
    behind = linked(round_trip_s=0.002, clock_offset_s=-1.5)
    assert (
        "1500.0 +- 1.0 ms behind that of main"
        in link_notes({"main": RouterStatus(links={"control": behind})}, "main")[0]
    )


def test_clocks_are_compared_with_the_host_whose_router_is_used() -> None:
    statuses = {
        "main": RouterStatus(links={"control": linked(round_trip_s=0.001, clock_offset_s=0.5)}),
        "control": RouterStatus(links={"main": linked(round_trip_s=0.001, clock_offset_s=-0.5)}),
    }
    (line,) = link_notes(statuses, "control")
    assert line.startswith("host main: clock 500.0")
    assert "behind that of control" in line


def test_a_missing_link_is_told_once_whoever_tells_it() -> None:
    statuses = {
        "main": RouterStatus(links={"control": linked(), "spare": MISSING}),
        "control": RouterStatus(links={"main": linked(), "spare": MISSING}),
        "spare": RouterStatus(links={"main": MISSING, "control": MISSING}),
    }
    assert link_notes(statuses, "main") == [
        "hosts control and spare are not linked",
        "hosts main and spare are not linked",
        "host control: linked",
    ]


def test_what_happened_to_a_link_is_told() -> None:
    state = linked(redials=2, late=7)
    assert link_notes({"main": RouterStatus(links={"control": state})}, "main") == [
        "host control: linked, redials: 2, late beats: 7"
    ]
