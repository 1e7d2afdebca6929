"""Agents that move to another host in flight, and that run again elsewhere when their host dies."""

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hosts_support import Obeyed, kill_host, trio_in_flight
from integration_support import NAMES, Flying, Truth

from rcopterx.benchmarks.namespaces import Network

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(300)]

HOSTS = ("main", "compute1", "compute2", "ground")
MOVES = 4
FLYING_AGAIN_S = 1.0
NEAR_M = 0.15
"""Much more than is measured: other work may run beside the test."""
LONGEST_GAP_S = 0.1


@pytest.fixture
def on_four_hosts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Network, Flying]]:
    """A trio in formation at rest over four hosts with certificates; its agents run on the second one."""
    with trio_in_flight(tmp_path, HOSTS, monkeypatch, spares=("compute2",), certificates=True) as found:
        yield found


class Place:
    """Where a vehicle was when it rested, and how far it has been from there since."""

    def __init__(self, flying: Flying, truth: Truth, name: str) -> None:
        self._truth, self._name = truth, name
        self._at_m = self._now_m()
        self.off_m = 0.0
        self._flying = flying

    def _now_m(self) -> tuple[float, float, float]:
        vehicle = self._truth(self._name)
        assert vehicle is not None
        return vehicle.position_m

    def watch(self, condition: Callable[[], bool], timeout_s: float, what: str) -> None:
        """Wait for a condition and look where the vehicle is meanwhile."""

        def looked() -> bool:
            self.off_m = max(self.off_m, math.dist(self._now_m(), self._at_m))
            return condition()

        self._flying.fleet.wait_until(looked, timeout_s, what, [self._name])


def test_an_agent_moves_to_another_host_and_back_in_flight(
    on_four_hosts: tuple[Network, Flying],
) -> None:
    _, flying = on_four_hosts
    fleet, truth, obeyed = flying.fleet, Truth(flying), Obeyed(flying, NAMES)
    fleet.wait_until(truth.rested, 30, "the formation does not rest")
    truth.start_watch()
    place, began_s = Place(flying, truth, "h2"), time.monotonic()
    for number in range(MOVES):
        host = ("compute2", "compute1")[number % 2]
        fleet["h2"].move(host)
        moved_s = time.monotonic()
        place.watch(lambda since=moved_s: time.monotonic() > since + 1.0, 5, "time stands still")
        assert fleet["h2"].state.host == host
        assert [status.running for status in fleet.launchers().values()].count(NAMES) <= 1
    gap_s = obeyed.longest_gap_s("h2", began_s)
    print(f"moved {MOVES} times: longest gap {1e3 * gap_s:.0f} ms, at most {1e3 * place.off_m:.0f} mm off")
    assert obeyed.states("h2", began_s) == ["armed"]
    assert len(obeyed.leases("h2")) == 1 + MOVES
    assert gap_s < LONGEST_GAP_S
    assert place.off_m < NEAR_M
    # What was asked of one agent is known to the next one.
    fleet["h1"].go_to((0.1, 0.0, 1.0))
    fleet["h1"].move("compute2")
    fleet.wait_for_formation()
    assert fleet["h1"].state.agent is not None
    assert fleet["h1"].state.agent.set_point.position_m == (0.1, 0.0, 1.0)
    truth.assert_nobody_touched_down()
    fleet.land()


def test_agents_run_again_on_another_host_when_theirs_dies(on_four_hosts: tuple[Network, Flying]) -> None:
    net, flying = on_four_hosts
    fleet, truth, obeyed = flying.fleet, Truth(flying), Obeyed(flying, NAMES)
    fleet.wait_until(truth.rested, 30, "the formation does not rest")
    fleet.wait_until(lambda: fleet.launchers()["compute2"].spare_ready, 30, "no spare process")
    truth.start_watch()
    died_s = time.monotonic()
    kill_host(net, "compute1")
    fleet.wait_until(
        lambda: all(obeyed.since(name, died_s + 0.3) for name in NAMES), 10, "agents are not obeyed again"
    )
    again_s = {name: (obeyed.since(name, died_s + 0.3) or math.inf) - died_s for name in NAMES}
    print(f"flying again after {again_s}; states {[obeyed.states(name, died_s) for name in NAMES]}")
    fleet.wait_for_formation()
    truth.assert_nobody_touched_down()
    assert {fleet[name].state.host for name in NAMES} == {"compute2"}
    assert all(seconds < 3 * FLYING_AGAIN_S for seconds in again_s.values())
    fleet.land()
