"""Flights over two hosts whose link is cut: nobody falls, and agents fly again when the link is back."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hosts_support import HOSTS, Obeyed, trio_in_flight
from integration_support import NAMES, Flying, Truth, landed_gently

from rcopterx.benchmarks.namespaces import Network

pytestmark = pytest.mark.campaign

FLYING_AGAIN_S = 0.5


@pytest.fixture(params=[False, True], ids=["insecure", "certificates"])
def on_two_hosts(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[Network, Flying]]:
    """A trio in formation; the test is skipped where there are no network namespaces."""
    with trio_in_flight(tmp_path, HOSTS, monkeypatch, certificates=request.param) as found:
        yield found


def cut_for(net: Network, seconds: float) -> tuple[float, float]:
    """Cut the link of the agents' host; returns when, and when it was restored [monotonic s]."""
    began_s = time.monotonic()
    net.cut("second")
    time.sleep(seconds)
    net.restore("second")
    return began_s, time.monotonic()


@pytest.mark.parametrize("cut_s", [0.1, 1.0])
def test_everybody_flies_again_within_half_a_second_of_the_links_return(
    on_two_hosts: tuple[Network, Flying], cut_s: float
) -> None:
    net, flying = on_two_hosts
    truth, obeyed = Truth(flying), Obeyed(flying, NAMES)
    flying.fleet.wait_until(truth.rested, 30, "the formation does not rest")
    truth.start_watch()
    began_s, restored_s = cut_for(net, cut_s)
    flying.fleet.wait_until(
        lambda: all(obeyed.since(name, restored_s) for name in NAMES), 10, "agents are not obeyed again"
    )
    flying.fleet.wait_for_formation()
    truth.assert_nobody_touched_down()
    for name in NAMES:
        again_s = obeyed.since(name, restored_s)
        assert again_s is not None
        assert again_s - restored_s < FLYING_AGAIN_S, name
        assert "cut" not in obeyed.states(name, began_s)


def test_everybody_lands_in_a_long_cut_and_takes_off_again_after_it(
    on_two_hosts: tuple[Network, Flying],
) -> None:
    net, flying = on_two_hosts
    truth = Truth(flying)
    cut_for(net, 10.0)
    assert all(landed_gently(truth, name) for name in NAMES)
    flying.fleet.wait_ready(timeout_s=20)
    flying.fleet.take_off()
    flying.fleet.wait_for_formation()
