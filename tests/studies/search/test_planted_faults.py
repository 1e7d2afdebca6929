"""The search finds faults that are planted in the product, and nothing in the product as it is."""

import gc
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from rcopterx.bus.session import Session
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway import pose_monitor, radios, transitions
from rcopterx.transmitter_gateway.command_validator import Leases
from rcopterx.transmitter_gateway.inputs import State
from rcopterx.transmitter_gateway.output_limiter import HoverThrust, OutputLimiter
from rcopterx.transmitter_gateway.pose_monitor import PoseMonitor
from rcopterx.transmitter_gateway.state_page import NOT_FLYING, StatePage, page_of_process
from rcopterx.transmitter_gateway.transitions import TRANSITIONS, Condition, Transition
from rcopterx.vehicles import lift_off
from rcopterx.vicon_gateway.frame import EpochCounter
from rcopterx_studies.search.flights import drawn_flight, read_flight
from rcopterx_studies.search.flying import Flown, fly

pytestmark = pytest.mark.timeout(600)
FOUND = Path(__file__).parents[2] / "found"
Planted = Callable[[], AbstractContextManager[Any]]


def flown(seed: int) -> Flown:
    return fly(drawn_flight(seed, vehicles=[1]))


def with_rows(change: Callable[[Transition], Transition | None]) -> AbstractContextManager[Any]:
    rows = tuple(changed for row in TRANSITIONS if (changed := change(row)) is not None)
    return patch.object(transitions, "TRANSITIONS", rows)


def disarmed_in_the_air() -> AbstractContextManager[Any]:
    """A request to disarm counts although the vehicle is seen in the air."""
    asked = {Condition.DISARM, Condition.SEEN}
    return with_rows(lambda row: replace(row, unless=frozenset()) if row.needs == asked else row)


def kill_ignored() -> AbstractContextManager[Any]:
    """The arbiter has no row for a kill."""
    return with_rows(lambda row: None if row.target is State.KILLED else row)


def never_armed_again() -> AbstractContextManager[Any]:
    """After commands were late a vehicle lands, although they are fresh again."""
    return with_rows(lambda row: None if row.reason == "commands fresh again" else row)


def flight_forgotten() -> AbstractContextManager[Any]:
    """A transmitter gateway that is replaced in flight begins as if the vehicle stood."""

    def forgetful(_: Path) -> StatePage:
        page = page_of_process()
        page.save(NOT_FLYING)
        return page

    return patch.object(radios, "_page", forgetful)


def older_epoch() -> AbstractContextManager[Any]:
    """A Vicon gateway that is replaced after the clock was set back begins an older epoch."""
    stamp = EpochCounter.stamp
    return patch.multiple(
        EpochCounter,
        leave_behind=lambda *_: None,
        stamp=lambda self, frame, wall_s: stamp(self, frame, 1e4 - wall_s),
    )


def no_second_lease() -> AbstractContextManager[Any]:
    """The agent that replaces another one gets no lease."""
    bid = Leases.bid

    def first_only(self: Leases, agent: int, now_s: float, **how: bool) -> int:
        others = self.issued and agent not in self._of_agents
        return 0 if others else bid(self, agent, now_s, **how)

    return patch.object(Leases, "bid", first_only)


def late_poses_jump() -> AbstractContextManager[Any]:
    """Poses of a lift-off that have waited for a stopped gateway count as captured when they arrive."""
    return patch.object(lift_off, "WAITED_S", 0.1)


def unanswered_poses_teach() -> AbstractContextManager[Any]:
    """The hover thrust is learned from the pose of another body that stands."""
    return patch.object(PoseMonitor, "doubtful", False)


def low_is_the_floor() -> AbstractContextManager[Any]:
    """Below 0.1 m a vehicle counts as on the floor."""
    return patch.object(ArbiterLimits, "falls", lambda self, height_m, _: height_m >= self.airborne_m)


@contextmanager
def falls_unfinished() -> Iterator[None]:
    """There, a lift-off whose commands end keeps its thrust off when its climb has ended."""
    with low_is_the_floor(), patch.object(lift_off.LiftOffProof, "unfinished", False):
        yield


def jumped_heading_believed() -> AbstractContextManager[Any]:
    """A heading that jumps in flight counts at once."""
    return patch.object(pose_monitor, "JUMP_RAD", 9.0)


def newest_poses_trusted() -> AbstractContextManager[Any]:
    """A descent without poses begins with the hover thrust of the last second."""
    return patch.object(HoverThrust, "trusted", property(lambda self: self.value))


def doubt_begins_anew() -> AbstractContextManager[Any]:
    """A successor of a gateway forgets how well the hover thrust was known."""
    take_over = OutputLimiter.take_over
    return patch.object(
        OutputLimiter, "take_over", lambda self, u, hover_thrust, _: take_over(self, u, hover_thrust, 0.0)
    )


@pytest.mark.parametrize(
    ("planted", "found"),
    [
        (late_poses_jump, "touchdown-10052"),
        (jumped_heading_believed, "volume-30011"),
        pytest.param(unanswered_poses_teach, "volume-10014", marks=pytest.mark.campaign),
        pytest.param(falls_unfinished, "touchdown-10076", marks=pytest.mark.campaign),
        pytest.param(low_is_the_floor, "touchdown-70128", marks=pytest.mark.campaign),
        pytest.param(doubt_begins_anew, "touchdown-1004", marks=pytest.mark.campaign),
        pytest.param(newest_poses_trusted, "volume-80018", marks=pytest.mark.campaign),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_fault_that_the_search_found_is_found_again(planted: Planted, found: str) -> None:
    with planted():
        flight = read_flight(FOUND / f"{found}.json")
        assert found.partition("-")[0] in [finding.promise for finding in fly(flight).findings]


@pytest.mark.parametrize(
    ("planted", "seed", "promise"),
    [
        (flight_forgotten, 14, "touchdown"),
        (no_second_lease, 277, "flies on"),
        pytest.param(disarmed_in_the_air, 122, "touchdown", marks=pytest.mark.campaign),
        pytest.param(kill_ignored, 179, "kill", marks=pytest.mark.campaign),
        pytest.param(never_armed_again, 526, "flies on", marks=pytest.mark.campaign),
        pytest.param(older_epoch, 354, "flies on", marks=pytest.mark.campaign),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_planted_fault_is_found(planted: Planted, seed: int, promise: str) -> None:
    with planted():
        assert promise in [finding.promise for finding in flown(seed).findings]
    assert flown(seed).findings == []


def test_a_process_that_ends_with_an_exception_is_found_and_replaced() -> None:
    with patch.object(EpochCounter, "stamp", side_effect=ArithmeticError("planted")):
        findings = flown(354).findings
    assert [finding.promise for finding in findings] == ["exception"]


def test_flights_keep_nothing() -> None:
    def held() -> tuple[int, int]:
        gc.collect()
        sessions = [each for each in gc.get_objects() if isinstance(each, Session)]
        return len(os.listdir("/proc/self/fd")), len(sessions)

    flown(277)
    before = held()
    flown(277)
    assert held() == before


def test_a_flight_has_the_same_bits_again() -> None:
    assert flown(277).digest == flown(277).digest
