"""Agents that move to another host in flight, and that run again elsewhere when their host dies."""

import math
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import numpy as np
import pytest
from hosts_support import NEAR_S, Obeyed, kill_host, trio_in_flight
from integration_support import NAMES, Flying, Truth
from support.namespaces import NetworkNamespaces
from typer.testing import CliRunner

from rcopterx.agents.takeover import WARM_S
from rcopterx.command_line import app

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(300)]

HOSTS = ("main", "compute1", "compute2", "ground")
MOVES = 20
WATCHED_S = 1.0
"""After each of them."""
FLYING_AGAIN_S = 1.0
MOST_OFF_M = 0.02
"""Without wind, so that it is the moves that do it."""
LONGEST_GAP_MS = 100.0


@pytest.fixture(params=["laboratory"])
def on_four_hosts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Iterator[tuple[NetworkNamespaces, Flying]]:
    """A trio in formation at rest over four hosts with certificates; its agents run on the second one.

    The parameter names the conditions.
    """
    with trio_in_flight(
        tmp_path,
        HOSTS,
        monkeypatch,
        spares=("compute2",),
        certificates=True,
        simulator=f'conditions = "{request.param}"',
    ) as found:
        yield found


class Place:
    """The place of a follower beside a leader that rests, and how far from it the follower has been."""

    def __init__(self, flying: Flying, truth: Truth, name: str) -> None:
        self._flying, self._truth, self._name = flying, truth, name
        (link,) = flying.fleet.file.vehicles[name].follow
        leader = flying.fleet[link.leader].state.agent
        assert leader is not None
        self._at_m = np.add(leader.set_point.position_m, link.offset_m)
        self.off_m = 0.0

    def _off_m(self) -> float:
        vehicle = self._truth(self._name)
        assert vehicle is not None
        return float(np.linalg.norm(np.subtract(vehicle.position_m, self._at_m)))

    def watch_for(self, seconds: float) -> None:
        """Look where the vehicle is for a while."""
        until_s = time.monotonic() + seconds

        def looked() -> bool:
            self.off_m = max(self.off_m, self._off_m())
            return time.monotonic() > until_s

        self._flying.fleet.wait_until(looked, 2 * seconds, "time stands still", [self._name])


def watched(flying: Flying, truth: Truth, name: str) -> list[float]:
    """Distances of a vehicle from its place at several times without requests [m]."""
    places = [Place(flying, truth, name) for _ in range(MOVES)]
    for place in places:
        place.watch_for(WATCHED_S + WARM_S)
    return [place.off_m for place in places]


# Where there is no wind, what a move adds can be seen.
@pytest.mark.parametrize("on_four_hosts", ["ideal", "laboratory"], indirect=True)
def test_an_agent_moves_to_another_host_and_back_in_flight(
    on_four_hosts: tuple[NetworkNamespaces, Flying],
) -> None:
    _, flying = on_four_hosts
    fleet, truth, obeyed = flying.fleet, Truth(flying), Obeyed(flying, NAMES)
    fleet.wait_for_formation(tolerance_m=0.02, timeout_s=60)
    truth.start_watch()
    began_s = time.monotonic()
    still_m = watched(flying, truth, "h2")
    still_s, still_missed = time.monotonic() - began_s, obeyed.missed("h2", began_s)
    off_m = []
    for number in range(MOVES):
        host = ("compute2", "compute1")[number % 2]
        place = Place(flying, truth, "h2")
        fleet["h2"].move(host)
        place.watch_for(WATCHED_S)
        off_m.append(place.off_m)
        assert fleet["h2"].state.host == host
        assert sum("h2" in status.running for status in fleet.launchers().values()) == 1
    changes = obeyed.changes("h2", began_s)
    gaps_ms = [1e3 * change.gap_s for change in changes]
    missed = sum(change.missed for change in changes)
    print(
        f"moved {len(changes)} times: from the last command of one agent to the first of the next "
        f"{min(gaps_ms):.0f} to {max(gaps_ms):.0f} ms; missed {missed} periods at changes, "
        f"{obeyed.missed('h2', began_s)} in {time.monotonic() - began_s:.0f} s of flight, of them "
        f"{still_missed} in {still_s:.0f} s without moves; {obeyed.lost()} frames not heard; "
        f"{1e3 * median(off_m):.0f} mm off, at most {1e3 * max(off_m):.0f} mm; without moves "
        f"{1e3 * median(still_m):.0f} and {1e3 * max(still_m):.0f} mm"
    )
    assert obeyed.lost() == 0, "the test was too slow to hear everything"
    assert obeyed.states("h2", began_s) == ["armed"]
    assert len(changes) == MOVES
    assert max(gaps_ms) < LONGEST_GAP_MS
    # Where other work makes the fleet miss periods without a move as well, moves add none.
    assert missed <= still_missed / still_s * 2 * NEAR_S * MOVES
    # With wind a vehicle is off its place anyway.
    assert max(off_m) < max(MOST_OFF_M, 1.5 * max(still_m))
    # What was asked of one agent is known to the next one.
    fleet["h1"].go_to((0.1, 0.0, 1.0))
    fleet["h1"].move("compute2")
    fleet.wait_for_formation()
    assert fleet["h1"].state.agent is not None
    assert fleet["h1"].state.agent.set_point.position_m == (0.1, 0.0, 1.0)
    truth.assert_none_touched_down()
    fleet.land()


def test_agents_run_again_on_another_host_when_theirs_dies(
    on_four_hosts: tuple[NetworkNamespaces, Flying],
) -> None:
    net, flying = on_four_hosts
    fleet, truth, obeyed = flying.fleet, Truth(flying), Obeyed(flying, NAMES)
    fleet.wait_until(truth.rested, 30, "the formation does not rest")
    fleet.wait_until(lambda: fleet.launchers()["compute2"].spare_ready, 30, "no spare process")
    truth.start_watch()
    died_s = time.monotonic()
    kill_host(net, "compute1")
    fleet.wait_until(
        lambda: all(obeyed.since(name, died_s + 0.3) for name in NAMES), 30, "agents are not obeyed again"
    )
    again_s = {name: (obeyed.since(name, died_s + 0.3) or math.inf) - died_s for name in NAMES}
    print(f"flying again after {again_s}; states {[obeyed.states(name, died_s) for name in NAMES]}")
    fleet.wait_for_formation()
    truth.assert_none_touched_down()
    assert {fleet[name].state.host for name in NAMES} == {"compute2"}
    assert all(seconds < 3 * FLYING_AGAIN_S for seconds in again_s.values())
    fleet.land()


def test_agents_of_a_host_that_dies_on_the_floor_run_elsewhere_and_take_off(
    on_four_hosts: tuple[NetworkNamespaces, Flying],
) -> None:
    net, flying = on_four_hosts
    fleet = flying.fleet
    fleet.land()
    kill_host(net, "compute1")
    fleet.wait_until(
        lambda: {fleet[name].state.host for name in NAMES} == {"compute2"}, 30, "agents do not run elsewhere"
    )
    fleet.take_off()
    fleet.wait_for_formation()
    shown = CliRunner().invoke(app, ["logs", "-f", str(flying.path)]).output.splitlines()
    assert any("compute2" in line and "its agent runs here now" in line for line in shown)
    assert any(line.split()[1:2] == ["main"] for line in shown)
    assert "note: host compute1 does not answer: its logs are not here" in shown
    fleet.land()
