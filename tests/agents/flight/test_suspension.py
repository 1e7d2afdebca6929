"""Paths are suspended and resumed: smooth, on their curves, and discarded by every other task."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.flight import still
from support.guidance import ALOFT, STAGES, at, flying, reference
from support.request_handling import UP, HandlerBench, follow_at, go_to

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.pilot import SUSPENDED
from rcopterx.bus.requests import Request, Resume, Suspend
from rcopterx.control.references.path_shapes import circle, figure_eight
from rcopterx.control.references.paths import EASING_S, FlightPath, suspended
from rcopterx.control.references.set_points import ProfileLimits
from rcopterx.vehicles.phases import Event, Phase

STEP_S = 0.01
LIMITS = ProfileLimits(3 * (1.0,), 3 * (2.0,), 3 * (9.0,))

eights = st.builds(
    figure_eight,
    st.just((0.0, 0.0, 1.0)),
    st.tuples(st.floats(0.1, 1.0), st.floats(0.1, 0.5)),
    st.floats(4.0, 12.0),
    st.floats(1.0, 3.0),
    st.sampled_from(["fixed", "along"]),
)
rings = st.builds(circle, st.just((0.0, 0.0, 1.0)), st.floats(0.1, 1.0), st.floats(4.0, 12.0))


def sampled(path: FlightPath) -> np.ndarray:
    return path.sample(np.arange(0.0, path.duration_s, STEP_S))


@settings(max_examples=40)
@given(eights | rings, st.floats(0.0, 1.0), st.floats(0.0, 0.5))
def test_a_suspended_path_stays_on_its_curve_and_every_part_is_smooth(
    path: FlightPath, share: float, ahead_s: float
) -> None:
    now_s = share * path.duration_s
    parts = suspended(path, now_s, now_s + ahead_s)
    assert (parts is None) == (now_s + max(ahead_s, 0.01) + EASING_S + 0.01 >= path.duration_s)
    assume(parts is not None)
    assert parts is not None
    curve = path.sample(np.arange(0.0, path.duration_s, STEP_S))[:, :3]
    fastest = np.abs(sampled(path)[:, 4:]).max()
    for part in parts:
        assert (np.diff(part.knots[:, 0]) > 0.0).all()
        samples = sampled(part)
        gaps_m = np.linalg.norm(samples[::20, None, :3] - curve[None], axis=2).min(axis=1)
        assert gaps_m.max() < 0.02
        for value, rate in ((slice(0, 4), slice(4, 8)), (slice(4, 8), slice(8, 12))):
            differences = np.gradient(samples[:, value], STEP_S, axis=0)
            assert np.abs(differences - samples[:, rate])[3:-3].max() < 0.1 * (1.0 + fastest)
    stopping, rest = parts
    assert stopping.sample(np.zeros(1)) == pytest.approx(path.sample(np.array([now_s])))
    assert stopping.knots[-1, 1:5] == pytest.approx(rest.knots[0, 1:5])
    assert np.abs([stopping.knots[-1, 5:], rest.knots[0, 5:]]).max() < 1e-6
    assert rest.knots[-1, 1:] == pytest.approx(path.knots[-1, 1:])
    assert stopping.duration_s + rest.duration_s == pytest.approx(path.duration_s - now_s + EASING_S)


def on_an_eight() -> Guidance:
    guidance = flying()
    guidance.fly(figure_eight((0.0, 0.0, 1.0), (0.8, 0.4), 8.0, 2.0), 0.0)
    return guidance


def test_a_suspended_trajectory_waits_and_goes_on_where_it_stopped() -> None:
    guidance = on_an_eight()
    whole_s = guidance.path_left_s(0.0)
    assert guidance.suspend(ALOFT, 5.0, 5.2) == guidance.suspend(ALOFT, 5.1, 5.4) == "suspended"
    assert guidance.resume(6.0, 6.2) == "it still comes to rest"
    stopped = reference(guidance, time_s=60.0)
    assert np.ptp(stopped.samples, axis=0).max() < 1e-9
    left_s = guidance.path_left_s(60.0)
    assert guidance.resume(60.0, 60.2) is None
    assert not guidance.suspended
    assert reference(guidance, time_s=60.1).samples[0] == pytest.approx(stopped.samples[0])
    assert guidance.path_left_s(60.2) == pytest.approx(left_s)
    assert left_s < whole_s - 5.0
    assert guidance.resume(61.0, 61.2) == "nothing is suspended"


def test_a_way_to_a_set_point_is_suspended_too() -> None:
    guidance = flying()
    guidance.go_to(guidance.way_to(np.array([3.0, 0.1, 1.0]), 0.3, 0.0, LIMITS))
    assert guidance.suspend(ALOFT, 1.0, 1.2) == "suspended"
    x_m = float(guidance.set_point()[0][0])
    assert 0.3 < x_m < 2.9
    assert guidance.path_left_s(9.0) == 0.0
    assert guidance.resume(9.0, 9.2) is None
    assert guidance.set_point()[0] == pytest.approx([3.0, 0.1, 1.0])


def test_a_vehicle_that_a_set_point_has_moved_at_once_stops_on_its_way() -> None:
    guidance = flying()
    guidance.go_to(guidance.way_to(np.array([2.2, 0.1, 1.0]), 0.3))
    moving = at((0.5, 0.1, 1.0), 0.3)
    moving.motion[4] = 0.8
    assert guidance.suspend(moving, 1.0, 1.2) == "suspended"
    stopped_m, yaw_rad = guidance.set_point()
    assert 0.6 < stopped_m[0] < 1.6
    assert yaw_rad == pytest.approx(0.3)
    assert guidance.resume(9.0, 9.2) is None
    assert guidance.set_point()[0] == pytest.approx([2.2, 0.1, 1.0])


def test_what_rests_or_ends_soon_is_not_suspended() -> None:
    guidance = flying()
    assert guidance.suspend(ALOFT, 1.0, 1.2) == "holds its place, or is about to"
    guidance = on_an_eight()
    assert guidance.suspend(ALOFT, guidance.path_left_s(0.0) - 1.0, 17.0) != "suspended"
    assert guidance.resume(20.0, 20.2) == "nothing is suspended"


def test_another_task_discards_what_is_suspended() -> None:
    for discard in (
        lambda guidance: guidance.go_to(guidance.way_to(np.array([0.5, 0.1, 1.0]), 0.0, 9.0, LIMITS)),
        lambda guidance: guidance.lead(ALOFT),
        lambda guidance: guidance.land(ALOFT, 9.0),
    ):
        guidance = on_an_eight()
        guidance.suspend(ALOFT, 5.0, 5.2)
        discard(guidance)
        assert guidance.resume(10.0, 10.2) == "nothing is suspended"


def test_a_suspended_trajectory_is_kept_when_the_gateway_takes_over() -> None:
    guidance = on_an_eight()
    guidance.suspend(ALOFT, 5.0, 5.2)
    place_m, _ = guidance.set_point()
    guidance.on_event(Event.OVERRIDE, ALOFT, 9.0)
    guidance.on_event(Event.ARM, still((0.5, 0.5, 0.6)), 12.0)
    assert reference(guidance, time_s=12.0).position_m == pytest.approx(np.tile(place_m, (STAGES, 1)))
    assert guidance.resume(12.0, 12.2) is None
    assert guidance.set_point()[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


@pytest.fixture
def bench() -> HandlerBench:
    bench = HandlerBench()
    bench.fly()
    return bench


def ahead(bench: HandlerBench, kind: type[Suspend], frames: int = 10) -> Request:
    clock = bench.pilot.clock
    return kind(epoch=clock.epoch, frame=clock.current_frame + frames)


def test_requests_suspend_and_resume_at_a_frame(bench: HandlerBench) -> None:
    assert bench.ask(go_to(0.8, 0.0, 1.0)).refusal is None
    assert bench.ask(ahead(bench, Suspend)).refusal is None
    assert SUSPENDED in bench.pilot.remarks
    assert bench.ask(ahead(bench, Resume)).refusal == "it still comes to rest"
    assert bench.ask(go_to(*UP)).refusal is None
    assert bench.ask(ahead(bench, Resume)).refusal == "nothing is suspended"
    assert SUSPENDED not in bench.pilot.remarks


@pytest.mark.parametrize("kind", [Suspend, Resume])
def test_frames_that_have_passed_and_followers_are_refused(bench: HandlerBench, kind: type[Suspend]) -> None:
    refusal = bench.ask(ahead(bench, kind, frames=0)).refusal
    assert refusal is not None
    assert "has passed, the present one is" in refusal
    clock = bench.pilot.clock
    refusal = bench.ask(kind(epoch=clock.epoch + 1, frame=clock.current_frame + 10)).refusal
    assert refusal is not None
    assert refusal.startswith("the stream of frames is another one now")
    assert follow_at(bench, (-0.5, 0.0, 0.0)).refusal is None
    refusal = bench.ask(ahead(bench, kind)).refusal
    assert refusal is not None
    assert refusal.startswith("it follows h1")


def test_a_vehicle_on_the_floor_suspends_nothing() -> None:
    bench = HandlerBench()
    bench.see((0.0, 0.0, 0.0))
    assert bench.pilot.guidance.phase is Phase.GROUND
    refusal = bench.ask(ahead(bench, Suspend)).refusal
    assert refusal == "set points and trajectories are for flying vehicles, the phase is ground"
