"""Promises of the request handler: answers to every request, reasons of refusals, tasks that go on."""

import math

import numpy as np
import pytest
from support.plans import plan_of
from support.request_handling import UP, Asked, HandlerBench, follow, follow_at, go_to, say
from support.statuses import hovering

from rcopterx.agents.following.leader_plans import followed_leader, link_message
from rcopterx.agents.requests.request_handler import DEFERRED, MOST_IN_A_STEP
from rcopterx.bus.message import FloatArray, Setting
from rcopterx.bus.messages import LeaderLink, SetPoint
from rcopterx.bus.requests import (
    Disarm,
    Excite,
    Fly,
    GoTo,
    Land,
    Lead,
    Request,
    TakeOff,
    Tune,
)
from rcopterx.control.references.path_shapes import through
from rcopterx.control.references.set_points import SetPointReference
from rcopterx.vehicles.phases import Phase


@pytest.fixture
def bench() -> HandlerBench:
    return HandlerBench()


@pytest.mark.parametrize("request_", [TakeOff(), Land(), go_to(0, 0, 1)])
def test_a_vehicle_that_was_never_seen_is_not_moved(bench: HandlerBench, request_: Request) -> None:
    assert bench.ask(request_).refusal == "the motion capture has not seen the vehicle"


def test_leaders_may_be_changed_before_the_vehicle_was_seen(bench: HandlerBench) -> None:
    assert bench.ask(Lead()).refusal is None
    asked = bench.ask(follow("h1"))
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert asked.refusal is None
    assert bench.plan_bus.open_names() == ["h1"]


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (TakeOff(), "take-off needs an armed vehicle on the floor, the phase is ground"),
        (Land(), "nothing to land, the phase is ground"),
        (go_to(0, 0, 1), "set points and trajectories are for flying vehicles, the phase is ground"),
        (Disarm(), "an agent does not serve verb"),
    ],
)
def test_what_makes_no_sense_on_the_floor_is_refused_with_the_phase(
    bench: HandlerBench, request_: Request, words: str
) -> None:
    bench.see((0.0, 0.0, 0.0))
    assert bench.ask(request_).refusal == words
    assert bench.pilot.guidance.phase is Phase.GROUND


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ((1.3, 0.0, 1.0), "x: 1.3 m is outside the flight volume -1.2 .. 1.2 m"),
        ((0.0, -9.0, 1.0), "y: -9 m is outside the flight volume -1.2 .. 1.2 m"),
        ((0.0, 0.0, 2.1), "z: 2.1 m is outside the flight volume 0 .. 2 m"),
    ],
)
def test_set_points_outside_the_volume_are_refused_by_axis(
    bench: HandlerBench, place: tuple[float, float, float], words: str
) -> None:
    bench.fly()
    assert bench.ask(go_to(*place)).refusal == words
    assert bench.pilot.guidance.set_point()[0] == pytest.approx(UP)


def test_a_good_set_point_is_taken(bench: HandlerBench) -> None:
    bench.fly()
    assert bench.ask(go_to(0.5, -0.5, 1.5)).refusal is None
    position_m, yaw_rad = bench.pilot.guidance.set_point()
    assert (*position_m, yaw_rad) == pytest.approx((0.5, -0.5, 1.5, 0.5))


@pytest.mark.parametrize(
    ("before_deg", "wanted_deg", "turns", "after_deg"),
    [(0, 170, 0, 170), (170, -170, 0, 190), (-170, 170, 0, -190), (1170, 0, 0, 1080), (1170, 90, 0, 1170),
     (0, 500, 0, 140), (0, 90, 2, 810), (10, 0, -1, -360)],
)  # fmt: skip
def test_a_heading_is_reached_the_nearest_way_and_whole_turns_are_asked_for(
    bench: HandlerBench, before_deg: float, wanted_deg: float, turns: int, after_deg: float
) -> None:
    bench.fly()
    guidance = bench.pilot.guidance
    guidance.go_to(guidance.way_to(np.array(UP), math.radians(before_deg)))
    wanted = SetPoint(position_m=UP, yaw_rad=math.radians(wanted_deg))
    assert bench.ask(GoTo(set_point=wanted, turns=turns)).refusal is None
    assert math.degrees(guidance.set_point()[1]) == pytest.approx(after_deg)


def test_take_off_above_the_volume_is_refused(bench: HandlerBench) -> None:
    bench.arm()
    refusal = bench.ask(TakeOff(height_m=2.5)).refusal
    assert refusal == "height_m: 2.5 m is above the flight volume, which ends at 2 m"
    assert bench.ask(TakeOff(height_m=1.0)).refusal is None
    assert bench.pilot.guidance.phase is Phase.TAKEOFF


def test_a_repeated_take_off_is_accepted_and_one_to_another_height_refused(bench: HandlerBench) -> None:
    bench.arm()
    assert bench.ask(TakeOff(height_m=1.0)).refusal is None
    assert bench.ask(TakeOff(height_m=1.0)).refusal is None
    refusal = bench.ask(TakeOff(height_m=1.2)).refusal
    assert refusal is not None
    assert "the phase is takeoff" in refusal


def test_land_is_accepted_in_the_air(bench: HandlerBench) -> None:
    bench.fly()
    assert bench.ask(Land()).refusal is None
    assert bench.pilot.guidance.phase is Phase.LANDING


def test_set_points_of_followers_are_refused_and_the_leader_named(bench: HandlerBench) -> None:
    bench.fly()
    bench.ask(follow("h1"))
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    refusal = bench.ask(go_to(0, 0, 1)).refusal
    assert refusal is not None
    assert "follows h1" in refusal


@pytest.mark.parametrize("frame", ["inertial", "heading"])
def test_links_survive_the_way_through_messages(frame: str) -> None:
    following = LeaderLink(leader="h1", offset_m=(0.1, 0.2, 0.3), yaw_offset_rad=0.4, frame=frame, weight=2.0)
    followed = followed_leader(following)
    assert link_message(followed, followed.offset_at(0.0)) == following


def test_a_set_point_that_would_take_a_follower_out_of_the_volume_is_refused(bench: HandlerBench) -> None:
    bench.fly()
    say(bench, "h2", hovering((0.7, 0.2, 1.0), LeaderLink(leader="h9", offset_m=(0.6, 0.0, 0.0))))
    words = "no place for h2: x: 1.4 m is outside the flight volume -1.2 .. 1.2 m"
    assert bench.ask(go_to(0.8, 0.0, 1.0)).refusal == words
    assert bench.pilot.guidance.set_point()[0] == pytest.approx(UP)
    assert bench.ask(go_to(0.5, 0.0, 1.0)).refusal is None


def test_a_follower_of_several_leaders_is_not_taken_out_of_the_volume(bench: HandlerBench) -> None:
    bench.fly()
    say(bench, "h1", hovering((0.9, 0.0, 1.0)))
    links = [LeaderLink(leader=name, offset_m=(0.4, 0.0, 0.0)) for name in ("h1", "h9")]
    say(bench, "h2", hovering((0.9, 0.1, 1.0), *links))
    words = "no place for h2: x: 1.3 m is outside the flight volume -1.2 .. 1.2 m"
    assert bench.ask(go_to(0.9, 0.5, 1.0)).refusal == words
    assert str(bench.ask(trajectory_to(0.9)).refusal).startswith("no place for h2: x: 1.3 m")
    assert bench.ask(go_to(0.5, 0.5, 1.0)).refusal is None


def test_turning_does_not_swing_a_follower_out_of_the_volume(bench: HandlerBench) -> None:
    bench.fly()
    abreast = LeaderLink(leader="h9", offset_m=(0.0, 0.6, 0.0), frame="heading")
    say(bench, "h2", hovering((0.8, 0.6, 1.0), abreast))
    turned = GoTo(set_point=SetPoint(position_m=(0.8, 0.0, 1.0), yaw_rad=-np.pi / 2))
    words = "no place for h2: x: 1.4 m is outside the flight volume -1.2 .. 1.2 m"
    assert bench.ask(turned).refusal == words
    assert bench.ask(go_to(0.8, 0.0, 1.0)).refusal is None


def test_a_trajectory_that_would_take_a_follower_out_of_the_volume_is_refused(bench: HandlerBench) -> None:
    bench.fly()
    say(bench, "h2", hovering((0.7, 0.2, 1.0), LeaderLink(leader="h9", offset_m=(0.6, 0.0, 0.0))))
    wide, narrow = (
        Fly(knots=FloatArray.of(through([(0.0, *UP, 0.0), (6.0, x, 0.2, 1.0, 0.0)]).knots))
        for x in (0.9, 0.4)
    )
    words = "no place for h2: x: 1.5 m"
    refusal = bench.ask(wide).refusal
    assert refusal is not None
    assert refusal.startswith(words)
    assert bench.ask(narrow).refusal is None


def trajectory_to(x: float, seconds: float = 6.0) -> Fly:
    return Fly(knots=FloatArray.of(through([(0.0, *UP, 0.0), (seconds, x, 0.2, 1.0, 0.0)]).knots))


def test_a_trajectory_is_checked_beside_the_loop_and_begins_where_the_vehicle_is_sent_then(
    bench: HandlerBench,
) -> None:
    bench.fly()
    asked = bench.begin(trajectory_to(0.4, 300.0))
    assert not asked.answers
    assert bench.pilot.guidance.path_left_s(bench.pilot.clock.time_s) == 0.0
    bench.handler.trajectories.wait()
    assert bench.handler.trajectories.finish()
    assert asked.refusal is None
    assert bench.pilot.guidance.path_left_s(bench.pilot.clock.time_s) > 300.0


def test_a_later_request_that_was_granted_overtakes_a_trajectory_that_is_still_checked(
    bench: HandlerBench,
) -> None:
    bench.fly()
    asked = bench.begin(trajectory_to(0.4))
    assert bench.begin(trajectory_to(0.3)).refusal == "another trajectory is being checked"
    assert bench.begin(go_to(9.0, 0.0, 1.0)).refusal is not None
    assert not asked.answers
    assert bench.begin(go_to(0.3, 0.0, 1.0)).refusal is None
    assert asked.refusal == "overtaken by a later request: verb"
    bench.handler.trajectories.wait()
    assert not bench.handler.trajectories.finish()
    assert bench.pilot.guidance.set_point()[0] == pytest.approx([0.3, 0.0, 1.0])


def test_a_trajectory_that_was_checked_is_refused_if_the_vehicle_lands_meanwhile(bench: HandlerBench) -> None:
    bench.fly()
    asked = bench.begin(trajectory_to(0.4))
    bench.pilot.guidance.land(bench.pilot.estimate, 0.0)
    bench.handler.trajectories.wait()
    bench.handler.trajectories.finish()
    assert asked.refusal is not None
    assert asked.refusal.endswith("the phase is landing")


def test_a_way_to_the_beginning_that_leads_out_is_refused(bench: HandlerBench) -> None:
    bench.fly()
    abreast = LeaderLink(leader="h9", offset_m=(0.0, 0.9, 0.0), frame="heading")
    say(bench, "h2", hovering((0.1, 0.2, 1.0), abreast))
    bench.pilot.guidance.task.source = SetPointReference(np.array([0.8, 0.2, 1.0]), -math.pi)
    assert bench.ask(trajectory_to(0.2)).refusal == (
        "on the way to its beginning, no place for h2: x: 1.378 m is outside the flight volume -1.2 .. 1.2 m"
    )


def test_a_flood_of_requests_is_handled_a_few_in_a_step_and_the_rest_is_counted(bench: HandlerBench) -> None:
    bench.fly()
    flood = [Asked(go_to(0.1 * index, 0.0, 1.0)) for index in range(5)]
    steps = 0
    assert not bench.handler.take([])
    while bench.handler.take(flood if steps == 0 else []):
        steps += 1
        assert sum(len(asked.answers) for asked in flood) == min(5, steps * MOST_IN_A_STEP)
        assert bool(bench.handler.waiting) is (steps * MOST_IN_A_STEP < 5)
    assert bench.pilot.events[DEFERRED] == 5 - MOST_IN_A_STEP
    assert bench.pilot.guidance.set_point()[0] == pytest.approx([0.4, 0.0, 1.0])


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ((0.1, 0.2, 0.8), "on its way up h9 and h2 would be 0 m apart, the minimum distance is 0.3 m"),
        ((0.3, 0.2, 0.4), "on its way up h9 and h2 would be 0.2 m apart, the minimum distance is 0.3 m"),
        ((0.1, 0.2, 1.2), "on its way up h9 and h2 would be 0.2 m apart, the minimum distance is 0.3 m"),
        ((0.1, 0.2, 1.4), None),
        ((0.5, 0.2, 0.5), None),
    ],
)
def test_nobody_takes_off_into_somebody_above(
    bench: HandlerBench, place: tuple[float, float, float], words: str | None
) -> None:
    bench.arm()
    say(bench, "h2", hovering(place))
    assert bench.ask(TakeOff(height_m=1.0)).refusal == words
    assert bench.pilot.guidance.phase is (Phase.TAKEOFF if words is None else Phase.ARMED)


def test_nobody_takes_off_to_a_place_that_is_taken(bench: HandlerBench) -> None:
    bench.arm()
    assert follow_at(bench, (0.5, 0.5, 0.0)).refusal is None
    say(bench, "h1", hovering((-0.5, 0.0, 1.0)))
    say(bench, "h2", hovering((0.0, 0.7, 1.0)))
    words = "h9 and h2 would be 0.2 m apart, the minimum distance is 0.3 m"
    assert bench.ask(TakeOff()).refusal == words
    say(bench, "h1", hovering((-0.5, 0.0, 0.0), phase="armed"))
    assert bench.ask(TakeOff()).refusal is None


def test_without_avoidance_set_points_at_the_places_of_others_are_refused(bench: HandlerBench) -> None:
    """The controller of these tests avoids no other vehicle."""
    bench.fly()
    say(bench, "h2", hovering((0.5, 0.5, 1.0)))
    say(bench, "h1", hovering((0.1, 0.6, 1.0), LeaderLink(leader="h9", offset_m=(0.0, 0.4, 0.0))))
    words = "h9 and h2 would be 0.1 m apart, the minimum distance is 0.3 m"
    assert bench.ask(go_to(0.4, 0.5, 1.0)).refusal == words
    words = "h1 and h2 would be 0.1 m apart, the minimum distance is 0.3 m"
    assert bench.ask(go_to(0.4, 0.1, 1.0)).refusal == words
    assert bench.ask(go_to(0.1, -0.3, 1.0)).refusal is None


def test_a_leader_goes_smoothly_and_turns_slowly_for_those_it_carries_round(
    bench: HandlerBench,
) -> None:
    bench.fly()
    turned = GoTo(set_point=SetPoint(position_m=(0.3, 0.0, 1.0), yaw_rad=1.5))
    durations_s = []
    for frame in (None, "inertial", "heading"):
        bench.pilot.guidance.go_to(bench.pilot.guidance.way_to(np.array([0.0, 0.0, 1.0]), 0.0))
        if frame is not None:
            abreast = LeaderLink(leader="h9", offset_m=(0.0, 0.6, 0.0), frame=frame)
            say(bench, "h2", hovering((0.0, 0.6, 1.0), abreast))
        assert bench.ask(turned).refusal is None
        source, time_s = bench.pilot.guidance.task.source, bench.pilot.clock.time_s
        start = source.sample(time_s, 0.02, 1).samples[0]
        assert start[:4] == pytest.approx([0.3, 0.0, 1.0, 1.5] if frame is None else [0.0, 0.0, 1.0, 0.0])
        assert bench.pilot.guidance.set_point()[1] == 1.5
        durations_s.append(next(t for t in np.arange(0.0, 9.0, 0.1) if source.finished(time_s + t)))
    assert 0.0 == durations_s[0] < durations_s[1] < durations_s[2]


@pytest.mark.parametrize("asked", [{"horizon": 30}, {"effort_factors": [1.0, 1.0, 1.0]}])
def test_who_tunes_a_vehicle_ends_what_the_guard_did_to_it(
    bench: HandlerBench, asked: dict[str, Setting]
) -> None:
    bench.fly()
    bench.tuning.begin(
        bench.tuning.configuration.changed(
            Tune(
                controller="cascade", controller_settings={"effort_factors": (27.0, 1.0, 1.0), "horizon": 20}
            )
        )
    )
    bench.tuning.wait()
    bench.handler.finish_tuning()
    assert bench.tuning.configuration.effort_factors == (27.0, 1.0, 1.0)
    request = bench.ask(Tune(controller_settings=asked))
    bench.tuning.wait()
    bench.handler.finish_tuning()
    assert request.refusal is None
    assert bench.tuning.configuration.effort_factors == (1.0, 1.0, 1.0)


GENTLE = (0.1, 0.1, 0.02, 0.03)


def test_a_hovering_vehicle_is_excited_until_its_time_or_a_request_ends_it(bench: HandlerBench) -> None:
    bench.fly()
    assert bench.ask(Excite(duration_s=60.0, amplitude=GENTLE)).refusal is None
    assert bench.pilot.exciter.outcome == "under way"
    assert bench.pilot.exciter.left_s(bench.pilot.clock.time_s) == pytest.approx(60.0)
    assert bench.ask(Excite(duration_s=0.0)).refusal is None
    assert bench.pilot.exciter.outcome == "ended by request"


def test_excitations_without_room_or_sense_are_refused(bench: HandlerBench) -> None:
    excite = Excite(duration_s=60.0, amplitude=GENTLE)
    bench.see()
    assert "are for flying vehicles" in str(bench.ask(excite).refusal)
    bench.fly()
    wide = Excite(duration_s=60.0, amplitude=GENTLE, reach_m=1.15)
    words = "no room for 1.15 m around its set point: y: 0.2 m is outside the flight volume -0.05 .. 0.05 m"
    assert bench.ask(wide).refusal == words
    short = Excite(duration_s=5.0, amplitude=GENTLE)
    assert "duration_s: must be from 20 to 600 s" in str(bench.ask(short).refusal)
    follow_at(bench, (0.5, 0.0, 0.0))
    assert "let this vehicle lead first" in str(bench.ask(excite).refusal)
