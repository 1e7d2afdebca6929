"""Leaders change in flight, with real processes: at once, without a bump, all together or not at all."""

from collections.abc import Callable

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth, at

from rcopterx.bus import channels
from rcopterx.bus.messages import Plan
from rcopterx.ground_station.report.recorder import FlightSampler, Recording

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]

BUMPLESS = 0.02
"""By so much may a step of a stick between two commands be larger around a change of leaders than before.

Yaw makes steps of 0.01 all the time, and of 0.02 now and then, under any leader.
"""
CALM_FRAMES = 50
"""Before a change is requested, for comparison."""
PLACE_M = 0.08
HOME_M = (0.0, 0.0, 0.8)
SOON = 25
"""Frames; the exact one is tested in tests/agents/following, a busy machine may miss it."""


@pytest.fixture(scope="module")
def flown(launch_once: Callable[..., Flying]) -> tuple[Flying, Truth]:
    flying = launch_once(simulator='conditions = "ideal"')
    return flying, Truth(flying)


@pytest.fixture
def flying(flown: tuple[Flying, Truth]) -> Flying:
    """The fleet, in formation and at rest."""
    flying, truth = flown
    if not flying.fleet.state_of("h1").airborne:
        flying.fleet.take_off(height_m=0.8, timeout_s=40)
    flying.fleet["h1"].go_to(HOME_M)
    flying.fleet.wait_until(lambda: at(truth, "h1", HOME_M, 0.02), 30, "h1 is not at home", ["h1"])
    flying.fleet.wait_for_formation()
    settled(flying, truth)
    truth.start_watch()
    return flying


@pytest.fixture
def truth(flown: tuple[Flying, Truth]) -> Truth:
    return flown[1]


LATE_FRAMES = 3
"""An agent on a busy machine may miss the frame at which leaders change; it changes with its next one."""


def leaders(plan: Plan) -> tuple[str, ...]:
    return tuple(link.leader for link in plan.following)


def frames_by_leader(recording: Recording, name: str) -> list[tuple[int, tuple[str, ...]]]:
    return [(plan.frame, leaders(plan)) for plan, _ in recording.messages(channels.PLAN, name)]


def steps(recording: Recording, name: str, frames: range) -> np.ndarray:
    """Largest change of each stick from one command to the next, of commands for these frames."""
    commands = [
        command.input for command, _ in recording.messages(channels.COMMAND, name) if command.frame in frames
    ]
    assert len(commands) > 2
    largest: np.ndarray = np.abs(np.diff(np.array(commands), axis=0)).max(axis=0)
    return largest


def bump(recording: Recording, name: str, change: int) -> float:
    """By how much a stick's largest step is larger from just before a frame on than it was earlier."""
    around = steps(recording, name, range(change - 2, change + 6))
    earlier = steps(recording, name, range(change - 2 - CALM_FRAMES, change - 2))
    return float((around - earlier).max())


def settled(flying: Flying, truth: Truth) -> None:
    """Wait until all hover where their plans end."""

    def still() -> bool:
        vehicles = [truth(name) for name in NAMES]
        return all(
            vehicle is not None and np.linalg.norm(vehicle.velocity_m_s) < 0.01 for vehicle in vehicles
        ) and all(flying.fleet[name].state.phase == "flying" for name in NAMES)

    flying.fleet.wait_until(still, 30, "the formation does not come to rest", NAMES)


def places(truth: Truth) -> dict[str, np.ndarray]:
    found = {}
    for name in NAMES:
        vehicle = truth(name)
        assert vehicle is not None
        found[name] = np.array(vehicle.position_m)
    return found


def wait_for_frames(flying: Flying, name: str, count: int) -> None:
    first = flying.fleet[name].plan
    assert first is not None

    def passed() -> bool:
        plan = flying.fleet[name].plan
        return plan is not None and plan.frame >= first.frame + count

    flying.fleet.wait_until(passed, 30, f"fewer than {count} frames")


def test_new_leader_is_followed_soon_and_without_a_bump(flying: Flying, truth: Truth) -> None:
    fleet = flying.fleet
    recorder = FlightSampler(fleet.session)
    recorder.start()
    wait_for_frames(flying, "h3", CALM_FRAMES)
    asked = fleet["h3"].plan
    line = fleet["h3"].follow("h2", (0.0, -1.0, 0.0))
    wait_for_frames(flying, "h3", 2 * SOON)
    recording = recorder.stop()
    fleet["h3"].follow("h1", (-0.4, -0.5, 0.0))
    assert line == "h3 follows h2 follows h1"
    seen = frames_by_leader(recording, "h3")
    assert {names for _, names in seen} <= {("h1",), (), ("h2",)}
    first_frame = next(frame for frame, names in seen if names == ("h2",))
    assert asked is not None
    assert asked.frame < first_frame <= asked.frame + SOON
    assert all(names == ("h2",) for frame, names in seen if frame > first_frame)
    assert bump(recording, "h3", first_frame) < BUMPLESS
    truth.assert_none_touched_down()


def test_promoted_follower_leads_and_everybody_keeps_its_place(flying: Flying, truth: Truth) -> None:
    before = places(truth)
    recorder = FlightSampler(flying.fleet.session)
    recorder.start()
    wait_for_frames(flying, "h3", CALM_FRAMES)
    lines = flying.fleet.promote("h2")
    wait_for_frames(flying, "h3", 2 * SOON)
    recording = recorder.stop()
    assert sorted(lines) == [
        "h1 follows h2 (before: leads)",
        "h2 leads (before: follows h1)",
        "h3 follows h2 (before: follows h1)",
    ]
    new = {"h1": ("h2",), "h2": (), "h3": ("h2",)}
    frames = {
        name: next(frame for frame, names in frames_by_leader(recording, name) if names == new[name])
        for name in NAMES
    }
    assert max(frames.values()) - min(frames.values()) <= LATE_FRAMES, "all change at the same frame"
    for name in NAMES:
        old = ("h1",) if name != "h1" else ()
        assert {names for _, names in frames_by_leader(recording, name)} == {old, new[name]}, (
            "no frame in between"
        )
        assert bump(recording, name, frames[name]) < BUMPLESS
    for name, place in places(truth).items():
        assert np.linalg.norm(place - before[name]) < PLACE_M
    x, y, z = before["h2"]
    flying.fleet["h2"].go_to((x + 0.3, y - 0.2, z))
    flying.fleet.wait_until(
        lambda: all(
            np.linalg.norm(place - before[name] - [0.3, -0.2, 0.0]) < PLACE_M
            for name, place in places(truth).items()
        ),
        30,
        "the formation does not follow its new leader",
    )
    assert sorted(flying.fleet.swap("h1", "h2")) == [
        "h1 leads (before: follows h2)",
        "h2 follows h1 (before: leads)",
        "h3 follows h1 (before: follows h2)",
    ]
    truth.assert_none_touched_down()
