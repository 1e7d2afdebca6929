"""Flights over hosts whose link delays, stalls and loses its connections: no vehicle falls."""

import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hosts_support import Obeyed, trio_in_flight
from integration_support import NAMES, Flying, Truth
from support.bad_links import reset, slow
from support.namespaces import NetworkNamespaces

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(400)]

HOSTS = ("main", "compute1", "compute2", "ground")
DELAY_S, JITTER_S = 0.02, 0.01
FLOWN_S = 10.0
TIMES = 5
FLYING_AGAIN_S = 0.5


@pytest.fixture
def on_four_hosts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[NetworkNamespaces, Flying]]:
    """A trio in formation over four hosts with certificates; its agents run on the second one."""
    with trio_in_flight(tmp_path, HOSTS, monkeypatch, certificates=True) as found:
        yield found


def test_a_fleet_flies_over_a_link_that_delays_stalls_and_resets(
    on_four_hosts: tuple[NetworkNamespaces, Flying],
) -> None:
    net, flying = on_four_hosts
    fleet, truth, obeyed = flying.fleet, Truth(flying), Obeyed(flying, NAMES)
    fleet.wait_until(truth.rested, 60, "the formation does not rest")
    truth.start_watch()

    def flown_again_s(what: str, disturb: Callable[[], object]) -> float:
        """Disturb the link; returns the time until all are commanded again after the longest silence."""
        began_s = time.monotonic()
        disturb()
        time.sleep(2.0)
        fleet.wait_for_formation()
        silences = {name: obeyed.longest_silence_s(name, began_s) for name in NAMES}
        states = [obeyed.states(name, began_s) for name in NAMES]
        print(f"{what}: longest silence {max(silences.values()):.3f} s, states {states}")
        assert all("cut" not in told for told in states)
        return max(silences.values())

    with slow(net, "compute1", DELAY_S, JITTER_S) as cable:
        fleet.wait_for_formation()
        began_s = time.monotonic()
        fleet["h1"].go_to((0.2, 0.0, 1.0))
        time.sleep(FLOWN_S)
        fleet.wait_for_formation()
        print(f"delayed: states {[obeyed.states(name, began_s) for name in NAMES]}")
        for _ in range(TIMES):
            stalled_s = flown_again_s("stalled for 200 ms", lambda: cable.send_signal(signal.SIGUSR1))
            assert stalled_s < 0.2 + FLYING_AGAIN_S
    fleet.wait_for_formation()
    for _ in range(TIMES):
        assert flown_again_s("reset", lambda: reset(net, "compute1")) < FLYING_AGAIN_S
    truth.assert_none_touched_down()
    fleet.land()
