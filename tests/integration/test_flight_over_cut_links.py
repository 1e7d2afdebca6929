"""Flights over four hosts whose links are cut: no vehicle falls, and agents fly again when a link is back."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hosts_support import Obeyed, trio_in_flight
from integration_support import NAMES, Flying, Truth, landed_gently
from support.namespaces import NetworkNamespaces

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(400)]

HOSTS = ("main", "compute1", "compute2", "ground")
CROSSED = ("compute1", "main")
"""Hosts whose link poses and commands cross: that of the agents, that of the gateways."""
FLYING_AGAIN_S = 0.5
SHORT_S, SHORT_CUTS = 0.1, 10
APART_S = 0.5
"""Between two short cuts, so that what is counted belongs to one."""
MOST_MISSED = 12
"""Control periods, for a short cut on a busy computer."""


@pytest.fixture(params=[False, True], ids=["insecure", "certificates"])
def on_four_hosts(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[NetworkNamespaces, Flying]]:
    """A trio in formation; the test is skipped where there are no network namespaces."""
    with trio_in_flight(tmp_path, HOSTS, monkeypatch, certificates=request.param) as found:
        yield found


def cut_for(net: NetworkNamespaces, host: str, seconds: float) -> tuple[float, float]:
    """Cut the link of a host to all others; returns when, and when it was restored [monotonic s]."""
    began_s = time.monotonic()
    net.cut(host)
    time.sleep(seconds)
    net.restore(host)
    return began_s, time.monotonic()


def flown_again_s(flying: Flying, obeyed: Obeyed, restored_s: float) -> float:
    """Time until all are commanded by agents again; formation is reached then."""
    flying.fleet.wait_until(
        lambda: all(obeyed.since(name, restored_s) for name in NAMES), 30, "agents are not obeyed again"
    )
    flying.fleet.wait_for_formation()
    return max((obeyed.since(name, restored_s) or 0.0) - restored_s for name in NAMES)


def test_links_are_cut_and_everybody_flies_again_when_they_are_back(
    on_four_hosts: tuple[NetworkNamespaces, Flying],
) -> None:
    net, flying = on_four_hosts
    truth, obeyed = Truth(flying), Obeyed(flying, NAMES)
    flying.fleet.wait_until(truth.rested, 60, "the formation does not rest")
    truth.start_watch()
    began_s, restored_s = cut_for(net, "ground", 1.0)
    flown_again_s(flying, obeyed, restored_s)
    assert all(obeyed.states(name, began_s) == ["armed"] for name in NAMES)
    short = []
    for number in range(SHORT_CUTS):
        began_s, restored_s = cut_for(net, CROSSED[number % 2], SHORT_S)
        flown_again_s(flying, obeyed, restored_s)
        apart_s = restored_s + APART_S
        flying.fleet.wait_until(
            lambda apart_s=apart_s: all(obeyed.since(name, apart_s) for name in NAMES), 30, "flight ends"
        )
        missed = max(obeyed.missed(name, began_s) for name in NAMES)
        short.append((missed, [obeyed.states(name, began_s) for name in NAMES]))
        print(f"{CROSSED[number % 2]} cut off for {SHORT_S} s: {missed} periods missed, {short[-1][1]}")
    assert obeyed.lost() == 0, "the test was too slow to hear everything"
    for host in CROSSED:
        began_s, restored_s = cut_for(net, host, 1.0)
        again_s = flown_again_s(flying, obeyed, restored_s)
        print(f"{host} cut off for 1 s: flown again {again_s:.3f} s after it is back")
        assert again_s < FLYING_AGAIN_S
        assert all("cut" not in obeyed.states(name, began_s) for name in NAMES)
    truth.assert_none_touched_down()
    assert all(missed <= MOST_MISSED for missed, _ in short)
    assert not any("cut" in state for _, states in short for state in states)
    cut_for(net, "compute1", 10.0)
    assert all(landed_gently(truth, name) for name in NAMES)
    flying.fleet.wait_ready(timeout_s=20)
    flying.fleet.take_off()
    flying.fleet.wait_for_formation()
