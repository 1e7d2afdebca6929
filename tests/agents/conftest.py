"""Fixtures for tests of the agent's process."""

import pytest
from agent_bench import Bench, Join

from rcopterx.bus.session import BusAddress


@pytest.fixture
def bench(join: Join, bus_address: BusAddress) -> Bench:
    return Bench(join, bus_address)
