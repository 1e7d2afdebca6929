"""Promises of an agent about keep-out zones: what would lead into one is refused with its name."""

import pytest
from support.request_handling import SETTINGS, UP, HandlerBench, follow_at, go_to, say
from support.statuses import hovering

from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import LeaderLink, Zone, ZoneSet
from rcopterx.bus.requests import Excite, Fly, Land, Resume, SetZones, TakeOff
from rcopterx.control.references.path_shapes import circle, through
from rcopterx.formation.placement import Room
from rcopterx.vehicles.phases import Event, Phase

WORDS = "m is not 0.2 m clear of the keep-out zone table"


def bench_with(
    low: tuple[float, float, float], high: tuple[float, float, float], shape: str = "box"
) -> HandlerBench:
    zone = Zone(min_m=low, max_m=high, shape=shape)
    return HandlerBench(Room(SETTINGS.room.min_m, SETTINGS.room.max_m, zones={"table": zone}))


@pytest.fixture
def bench() -> HandlerBench:
    """A vehicle hovers at (0.1, 0.2, 1.0); a table of 1.1 m is in front of it."""
    made = bench_with((0.5, -0.2, 0.0), (0.7, 0.6, 1.1))
    made.fly()
    return made


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_a_set_point_in_a_zone_or_behind_it_is_refused_and_the_vehicle_stays(shape: str) -> None:
    bench = bench_with((0.4, 0.0, 0.0), (0.8, 0.4, 1.1), shape)
    bench.fly()
    for refused in (go_to(0.6, 0.2, 1.0), go_to(1.15, 0.2, 1.0), go_to(0.6, 0.2, 1.2)):
        assert WORDS in str(bench.ask(refused).refusal)
    assert bench.pilot.guidance.set_point()[0] == pytest.approx(UP)
    assert bench.ask(go_to(0.6, 0.2, 1.4)).refusal is not None, "the straight way cuts the corner"
    assert bench.ask(go_to(0.1, 0.2, 1.4)).refusal is None
    assert bench.ask(go_to(-1.0, 0.2, 1.0)).refusal is None


def test_a_follower_is_not_taken_through_a_zone_that_its_leader_passes_beside() -> None:
    bench = bench_with((0.5, 0.7, 0.0), (0.7, 1.1, 1.1))
    bench.fly()
    assert bench.ask(go_to(1.1, 0.2, 1.0)).refusal is None
    bench.pilot.guidance.hold_here(bench.pilot.estimate)
    say(bench, "h2", hovering((0.1, 1.0, 1.0), LeaderLink(leader="h9", offset_m=(0.0, 0.8, 0.0))))
    refusal = str(bench.ask(go_to(1.1, 0.2, 1.0)).refusal)
    assert refusal.startswith("no place for h2: (0.3")
    assert refusal.endswith(WORDS)


def test_trajectories_through_a_zone_and_ways_to_their_beginning_are_refused(bench: HandlerBench) -> None:
    round_it = Fly(knots=FloatArray.of(circle((0.0, 0.2, 1.0), 0.5, 10.0).knots))
    refusal = str(bench.ask(round_it).refusal)
    assert refusal.startswith("(0.")
    assert WORDS in refusal
    behind = Fly(knots=FloatArray.of(through([(0.0, 1.1, 0.2, 1.0, 0.0), (5.0, 1.1, -0.5, 1.0, 0.0)]).knots))
    assert str(bench.ask(behind).refusal).startswith("on the way to its beginning, (0.3")
    clear = Fly(knots=FloatArray.of(circle((-0.5, 0.2, 1.0), 0.4, 12.0).knots))
    assert bench.ask(clear).refusal is None


def test_a_vehicle_that_was_blown_into_a_zone_may_leave_it(bench: HandlerBench) -> None:
    bench.see((0.35, 0.2, 1.0))
    bench.pilot.guidance.hold_here(bench.pilot.estimate)
    assert WORDS in str(bench.ask(go_to(0.4, 0.2, 1.0)).refusal)
    assert bench.ask(go_to(0.0, 0.2, 1.0)).refusal is None


def test_a_trajectory_may_lead_out_of_a_zone_that_was_set_onto_the_vehicle_but_not_end_in_it() -> None:
    bench = bench_with((-0.1, 0.0, 0.0), (0.3, 0.4, 1.9))
    bench.fly()
    x, y, z = UP
    for end_x, refused in ((-0.8, False), (x + 0.1, True)):
        way = through([(0.0, x, y, z, 0.0), (5.0, end_x, y, z, 0.0)])
        refusal = bench.ask(Fly(knots=FloatArray.of(way.knots))).refusal
        assert (refusal is not None) is refused, refusal


@pytest.mark.parametrize(
    ("leader_m", "offset_m", "refused"),
    [
        ((-0.4, 0.2, 1.0), (1.0, 0.0, 0.0), True),
        ((1.1, -1.1, 1.0), (0.0, 1.3, 0.0), True),
        ((-0.4, 0.2, 1.0), (0.5, 0.5, 0.0), False),
    ],
)
def test_places_beside_leaders_in_a_zone_or_behind_one_are_refused(
    bench: HandlerBench,
    leader_m: tuple[float, float, float],
    offset_m: tuple[float, float, float],
    refused: bool,
) -> None:
    say(bench, "h1", hovering(leader_m))
    refusal = follow_at(bench, offset_m).refusal
    assert (WORDS in str(refusal)) is refused
    assert (refusal is None) is not refused


def test_a_vehicle_above_a_zone_lands_only_elsewhere_and_an_emergency_anywhere() -> None:
    bench = bench_with((-0.1, 0.0, 0.0), (0.3, 0.4, 0.5))
    bench.fly()
    refusal = bench.ask(Land()).refusal
    assert refusal == f"on its way down (0.10, 0.20, 0.69) {WORDS}"
    assert bench.pilot.guidance.phase is Phase.FLYING
    bench.pilot.guidance.on_event(Event.OVERRIDE, bench.pilot.estimate, 0.0)
    assert bench.pilot.guidance.phase is Phase.EMERGENCY
    assert bench.ask(Land()).refusal is None


@pytest.mark.parametrize(
    ("low_m", "high_m", "refused"),
    [
        ((-0.2, 0.0, 0.0), (0.0, 0.4, 0.1), True),
        ((0.0, 0.0, 0.8), (0.3, 0.4, 1.0), True),
        ((-0.5, 0.0, 0.0), (-0.2, 0.4, 1.0), False),
    ],
)
def test_nothing_takes_off_in_a_zone_or_into_one(
    low_m: tuple[float, float, float], high_m: tuple[float, float, float], refused: bool
) -> None:
    bench = bench_with(low_m, high_m)
    bench.arm()
    refusal = bench.ask(TakeOff(height_m=1.0)).refusal
    assert (refusal is not None) is refused
    if refused:
        assert str(refusal).startswith("on its way up (0.10, 0.20, ")


def test_an_excitation_needs_room_beside_zones(bench: HandlerBench) -> None:
    bench.pilot.guidance.hold_here(bench.pilot.estimate)
    excite = Excite(duration_s=60.0, amplitude=(0.1, 0.1, 0.02, 0.03), reach_m=0.3)
    assert "no room for 0.3 m around its set point: (0.10, 0.20, 1.00) m is not 0.5 m clear" in str(
        bench.ask(excite).refusal
    )


PILLAR = Zone(min_m=(0.5, -0.2, 0.0), max_m=(0.7, 0.6, 1.1))


def zones(revision: int, **named: Zone) -> SetZones:
    return SetZones(zones=ZoneSet(revision=revision, zones=named))


def test_a_zone_that_is_set_in_flight_counts_at_once_and_no_longer_once_it_is_removed() -> None:
    bench = HandlerBench()
    bench.fly()
    assert bench.ask(zones(1, table=PILLAR)).refusal is None
    assert WORDS in str(bench.ask(go_to(0.6, 0.2, 1.0)).refusal)
    assert bench.ask(zones(1, table=PILLAR)).refusal is None, "the request is repeated"
    assert "meanwhile" in str(bench.ask(zones(1)).refusal), "another program has changed them"
    assert bench.ask(zones(2)).refusal is None
    assert bench.ask(go_to(0.6, 0.2, 1.0)).refusal is None


def test_an_agent_adopts_the_zones_that_the_others_have_and_of_two_sets_the_later_one() -> None:
    bench = HandlerBench()
    bench.fly()
    say(bench, "h1", hovering((-1.0, 0.0, 1.0), zones=ZoneSet(revision=2, zones={"table": PILLAR})))
    say(bench, "h2", hovering((-1.0, 1.0, 1.0), zones=ZoneSet(revision=1, zones={})))
    bench.handler.adopt_zones()
    assert WORDS in str(bench.ask(go_to(0.6, 0.2, 1.0)).refusal)
    say(bench, "h2", hovering((-1.0, 1.0, 1.0), zones=ZoneSet(revision=2, zones={})))
    bench.handler.adopt_zones()
    assert WORDS in str(bench.ask(go_to(0.6, 0.2, 1.0)).refusal), "two programs at the same moment"
    bench.handler.adopt_zones(ZoneSet(revision=3, zones={}))
    assert bench.ask(go_to(0.6, 0.2, 1.0)).refusal is None


def test_a_trajectory_that_a_new_zone_bars_is_suspended_and_goes_on_once_it_is_removed() -> None:
    bench = HandlerBench()
    bench.fly()
    rows = [(0.0, 0.1, 0.2, 1.0, 0.0), (8.0, 0.9, 0.2, 1.0, 0.0)]
    assert bench.ask(Fly(knots=FloatArray.of(through(rows).knots))).refusal is None
    assert bench.ask(zones(1, table=PILLAR)).refusal is None
    guidance = bench.pilot.guidance
    assert guidance.suspended
    assert guidance.remark.startswith("suspended: (0.3")
    assert WORDS in guidance.remark
    for _ in range(150):
        bench.see()
    ahead = bench.frame + 10
    assert WORDS in str(bench.ask(Resume(epoch=1, frame=ahead)).refusal)
    assert bench.ask(zones(2)).refusal is None
    assert bench.ask(Resume(epoch=1, frame=ahead)).refusal is None


def test_a_trajectory_that_a_new_zone_does_not_bar_goes_on() -> None:
    bench = HandlerBench()
    bench.fly()
    rows = [(0.0, 0.1, 0.2, 1.0, 0.0), (8.0, -0.9, 0.2, 1.0, 0.0)]
    assert bench.ask(Fly(knots=FloatArray.of(through(rows).knots))).refusal is None
    assert bench.ask(zones(1, table=PILLAR)).refusal is None
    assert not bench.pilot.guidance.suspended
