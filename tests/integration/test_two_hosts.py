"""A fleet on two hosts: a router each, agents on one of them, gateways and simulator on the other one."""

from collections.abc import Callable

import pytest
from integration_support import Flying, Truth, at, fleet_text, free_port, in_formation

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]


def test_trio_flies_spread_over_two_hosts_with_a_router_each(launch: Callable[..., Flying]) -> None:
    hosts = {"main": ("127.0.0.1", free_port()), "second": ("127.0.0.2", free_port("127.0.0.2"))}
    flying = launch(fleet_text(free_port(), hosts, agent_host="second"))
    assert "router" in flying.launchers["main"].supervisor.running()
    assert "router" in flying.launchers["second"].supervisor.running()
    assert "agent-h1" in flying.launchers["second"].supervisor.running()
    assert "transmitters" in flying.launchers["main"].supervisor.running()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.6, timeout_s=40)
    truth.start_watch()
    flying.fleet["h1"].go_to((0.2, 0.0, 0.7))
    flying.fleet.wait_until(lambda: at(truth, "h1", (0.2, 0.0, 0.7)), 30, "h1 does not obey")
    flying.fleet.wait_until(lambda: in_formation(flying, truth), 30, "no formation")
    truth.assert_none_touched_down()
