"""Leaders change in flight, with real processes: at once, without a bump, all together or not at all."""

from collections.abc import Callable

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth

from bus import channels
from bus.messages import Plan
from ground_station.recorder import Recorder, Recording
from ground_station.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]
BUMPLESS = 0.02
"""Largest step of a stick between two commands around a change of leaders, in undisturbed flight."""
PLACE_M = 0.05
CASCADE = 'controller = "cascade"\nhorizon = 30'
IDEAL = 'conditions = "ideal"'


def leaders(plan: Plan) -> tuple[str, ...]:
    return tuple(link.leader for link in plan.following)


def frames_by_leader(recording: Recording, name: str) -> list[tuple[int, tuple[str, ...]]]:
    return [(plan.frame, leaders(plan)) for plan, _ in recording.messages(channels.PLAN, name)]


def largest_step(recording: Recording, name: str, around: int, frames: int = 5) -> float:
    """Largest change of a stick from one command to the next, from just before a frame on."""
    commands = [
        command.input
        for command, _ in recording.messages(channels.COMMAND, name)
        if around - 2 <= command.frame <= around + frames
    ]
    assert len(commands) > frames
    return float(np.abs(np.diff(np.array(commands), axis=0)).max())


def settled(flying: Flying, truth: Truth) -> None:
    """Wait until everybody hovers where its plan ends."""

    def still() -> bool:
        vehicles = [truth(name) for name in NAMES]
        return all(
            vehicle is not None and np.linalg.norm(vehicle.velocity_m_s) < 0.01 for vehicle in vehicles
        ) and all(flying.fleet[name].state.phase == "flying" for name in NAMES)

    flying.fleet.wait_until(still, 20, "the formation does not come to rest", NAMES)


def places(truth: Truth) -> dict[str, np.ndarray]:
    found = {}
    for name in NAMES:
        vehicle = truth(name)
        assert vehicle is not None
        found[name] = np.array(vehicle.position_m)
    return found


def events(flying: Flying, name: str, kind: str) -> int:
    status = flying.fleet.state_of(name).agent
    assert status is not None
    return status.diagnostics.fallbacks.get(kind, 0)


def wait_for_frames(flying: Flying, name: str, count: int) -> None:
    first = flying.fleet[name].plan
    assert first is not None

    def passed() -> bool:
        plan = flying.fleet[name].plan
        return plan is not None and plan.frame >= first.frame + count

    flying.fleet.wait_until(passed, 10, f"fewer than {count} frames")


def test_new_leader_is_followed_two_frames_after_the_answer_and_without_a_bump(launch: Launch) -> None:
    flying = launch(control=CASCADE, simulator=IDEAL)
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    settled(flying, truth)
    before = events(flying, "h3", "leader_plan_missing")
    recorder = Recorder(flying.fleet.session)
    recorder.start()
    wait_for_frames(flying, "h3", 10)
    line = flying.fleet["h3"].follow("h2", (0.0, -1.0, 0.0))
    answered_s = flying.fleet.session.clock()
    wait_for_frames(flying, "h3", 30)
    recording = recorder.stop()
    assert line == "h3 follows h2 follows h1"
    poses = recording.messages(channels.POSE, "h3")
    answered = max(pose.frame for pose, arrived_s in poses if arrived_s <= answered_s)
    seen = frames_by_leader(recording, "h3")
    first_frame = next(frame for frame, names in seen if names == ("h2",))
    assert first_frame <= answered + 2
    assert sum(names == () for _, names in seen) <= 2
    assert largest_step(recording, "h3", first_frame) < BUMPLESS
    flying.fleet.wait_until(
        lambda: (
            flying.fleet["h3"].plan is not None and events(flying, "h3", "leader_plan_missing") <= before + 2
        ),
        3,
        "frames without a plan",
    )


def test_promoted_follower_leads_and_everybody_keeps_its_place(launch: Launch) -> None:
    flying = launch(control=CASCADE, simulator=IDEAL)
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    settled(flying, truth)
    before = places(truth)
    recorder = Recorder(flying.fleet.session)
    recorder.start()
    wait_for_frames(flying, "h3", 10)
    lines = flying.fleet.promote("h2")
    wait_for_frames(flying, "h3", 60)
    recording = recorder.stop()
    assert sorted(lines) == ["h1 follows h2", "h2 leads", "h3 follows h2"]
    new = {"h1": ("h2",), "h2": (), "h3": ("h2",)}
    frames = {
        name: next(frame for frame, names in frames_by_leader(recording, name) if names == new[name])
        for name in NAMES
    }
    assert len(set(frames.values())) == 1, "all change at the same frame"
    for name in NAMES:
        old = ("h1",) if name != "h1" else ()
        assert {names for _, names in frames_by_leader(recording, name)} == {old, new[name]}, (
            "no frame in between"
        )
        assert largest_step(recording, name, frames[name]) < BUMPLESS
    for name, place in places(truth).items():
        assert np.linalg.norm(place - before[name]) < PLACE_M
    x, y, z = before["h2"]
    flying.fleet["h2"].go_to((x + 0.3, y - 0.2, z))
    flying.fleet.wait_until(
        lambda: all(
            np.linalg.norm(place - before[name] - [0.3, -0.2, 0.0]) < PLACE_M
            for name, place in places(truth).items()
        ),
        15,
        "the formation does not follow its new leader",
    )
    assert sorted(flying.fleet.swap("h1", "h2")) == ["h1 leads", "h2 follows h1", "h3 follows h1"]
    truth.assert_nobody_touched_down()


def test_refused_or_failed_promotions_change_nobodys_leader(launch: Launch) -> None:
    flying = launch(control=CASCADE, simulator=IDEAL)
    truth = Truth(flying)
    flying.fleet.take_off(["h1", "h2"], height_m=0.8)
    with pytest.raises(RefusedError, match="h1 leads already"):
        flying.fleet.promote("h1")
    with pytest.raises(RefusedError, match="h3 does not fly, its phase is"):
        flying.fleet.swap("h1", "h3")
    with pytest.raises(
        RefusedError, match=r"h2 and h1 would be 0\.1 m apart, the minimum distance is 0\.3 m"
    ):
        flying.fleet["h2"].follow("h1", (0.1, 0.0, 0.0))
    with pytest.raises(RefusedError, match=r"h2 would leave: x: .* is outside the flight volume"):
        flying.fleet["h2"].follow("h1", (5.0, 0.0, 0.0))
    with pytest.raises(RefusedError, match="h3 is on the floor, its phase is"):
        flying.fleet["h2"].follow("h3", (0.5, 0.0, 0.0))
    with pytest.raises(RefusedError, match="a cycle: h1 follows h2 follows h1"):
        flying.fleet["h1"].follow("h2", (0.5, 0.0, 0.0))
    plans = {name: flying.fleet[name].plan for name in ("h1", "h2")}
    assert [leaders(plan) for plan in plans.values() if plan is not None] == [(), ("h1",)]
    assert truth.height_m("h1") > 0.5
