"""One fleet for all tests of this folder: which is in formation when a test begins.

A test may leave vehicles on the floor, killed, or without their processes; `bring_up` repairs that. Other
changes, such as leaders or controllers, it reverts itself. A new fleet follows a failed test, and
one after which vehicles stand too close to each other to take off.
"""

from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth, fleets, in_lockstep, not_killed, transmitter_state

from rcopterx.simulator.faults import Recover
from rcopterx_studies.faults.scenario import inject_faults

HEIGHT_M = 0.8
HOME_M = (0.0, 0.0, HEIGHT_M)
ROOM_M = 0.4
"""Beside a vehicle on the floor: with less than 0.3 m on its way up, take-offs are refused."""
# There are more tests than a battery lasts.
SIMULATOR = "condition_overrides = { battery_endurance_s = 36000.0 }"

FAILED = pytest.StashKey[bool]()


class Hangar:
    """Starts the fleet when the first test asks for it."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._stack = ExitStack()
        self._present: tuple[Flying, Truth] | None = None
        self._lockstep = False

    def fleet(self, lockstep: bool) -> tuple[Flying, Truth]:
        """The fleet, in lockstep or in real time, and its true states."""
        if self._lockstep != lockstep:
            self.close()
        if self._present is None:
            self._lockstep = lockstep
            patch = self._stack.enter_context(pytest.MonkeyPatch.context())
            start = self._stack.enter_context(fleets(self._directory, patch, lockstep=lockstep))
            flying = start(simulator=SIMULATOR)
            self._present = flying, Truth(flying)
        return self._present

    def fleet_with_room(self, lockstep: bool) -> tuple[Flying, Truth]:
        """The fleet, or a new one where vehicles that came down by themselves stand too close together."""
        _, truth = self.fleet(lockstep)
        if room_m(truth) < ROOM_M:
            self.close()
        return self.fleet(lockstep)

    def close(self) -> None:
        """Stop the fleet; the next test gets a new one."""
        self._present = None
        self._stack.close()


HANGAR = pytest.StashKey[Hangar]()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests of this folder in real time last: a change between them and lockstep needs a new fleet."""
    items.sort(key=lambda item: Path(__file__).parent in item.path.parents and not in_lockstep(item))


@pytest.fixture(scope="session")
def hangar(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Iterator[Hangar]:
    hangar = Hangar(tmp_path_factory.mktemp("fleet"))
    request.config.stash[HANGAR] = hangar
    yield hangar
    hangar.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, None, None]:
    """Stop the fleet after the last test of this folder, so that it does not fly beside others."""
    yield
    hangar = item.config.stash.get(HANGAR, None)
    if hangar is not None and (nextitem is None or Path(__file__).parent not in nextitem.path.parents):
        hangar.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.failed:
        item.stash[FAILED] = True
    return report


@contextmanager
def closed_on_failure(hangar: Hangar, request: pytest.FixtureRequest) -> Iterator[None]:
    """A fleet that cannot be prepared, or whose test failed, is not used again."""
    try:
        yield
    except BaseException:
        hangar.close()
        raise
    if request.node.stash.get(FAILED, False):
        hangar.close()


@pytest.fixture
def flying(hangar: Hangar, request: pytest.FixtureRequest) -> Iterator[Flying]:
    """The fleet, in formation at `HOME_M` and at rest."""
    with closed_on_failure(hangar, request):
        flying, truth = hangar.fleet_with_room(in_lockstep(request.node))
        bring_up(flying, truth)
        yield flying
        flying.check_promises()


@pytest.fixture
def grounded(hangar: Hangar, request: pytest.FixtureRequest) -> Iterator[Flying]:
    """The fleet on the floor, for tests that start there."""
    with closed_on_failure(hangar, request):
        flying, _ = hangar.fleet_with_room(in_lockstep(request.node))
        restore(flying)
        flying.fleet.land(timeout_s=30)
        yield flying
        flying.check_promises()


@pytest.fixture
def truth(flying: Flying, hangar: Hangar, request: pytest.FixtureRequest) -> Truth:
    """True states of the fleet, with touchdowns counted from now on."""
    return hangar.fleet(in_lockstep(request.node))[1]


def room_m(truth: Truth) -> float:
    """Smallest distance, seen from above, from a vehicle on the floor to another one, flying or not."""
    vehicles = [vehicle for name in NAMES if (vehicle := truth(name)) is not None]
    distances_m = [
        float(np.linalg.norm(np.subtract(one.position_m, other.position_m)[:2]))
        for one, other in combinations(vehicles, 2)
        if one.on_floor or other.on_floor
    ]
    return min(distances_m, default=np.inf)


def restore(flying: Flying) -> None:
    """Undo what a test left: faults, processes that were stopped, kills, vehicles between two states."""
    fleet = flying.fleet
    inject_faults(fleet.session, Recover())
    for launcher in flying.launchers.values():
        for process, child in launcher.supervisor.children.items():
            if not child.wanted:
                flying.want(process, True)
    fleet.wait_until(lambda: fleet.present() == list(NAMES), 30, "not all vehicles take part", NAMES)
    for name in NAMES:
        fleet.wait_until(lambda name=name: not_killed(flying, name), 30, "not reset", [name])  # type: ignore[misc]
    fleet.wait_ready(timeout_s=30)
    fleet.wait_until(lambda: all(settled(flying, name) for name in NAMES), 30, "not settled", NAMES)


def bring_up(flying: Flying, truth: Truth) -> None:
    """Have all vehicles fly in formation."""
    restore(flying)
    fleet = flying.fleet
    grounded = [name for name in NAMES if not fleet.state_of(name).airborne]
    if grounded:
        fleet.take_off(grounded, height_m=HEIGHT_M, timeout_s=30)
    fleet["h1"].go_to(HOME_M)
    fleet.wait_for_arrival(["h1"], timeout_s=30)
    fleet.wait_for_formation()
    truth.start_watch()
    fleet.wait_until(truth.rested, 30, "no rest", NAMES)


def settled(flying: Flying, name: str) -> bool:
    """Whether a vehicle stands on the floor or flies, and its transmitter agrees."""
    state = flying.fleet.state_of(name)
    return state.phase in ("ground", "armed") or (
        (state.phase, transmitter_state(flying, name)) == ("flying", "armed")
    )
