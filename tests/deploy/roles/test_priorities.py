"""Promises of the priorities of processes."""

from pathlib import Path

import pytest
from support.fleets import PAIR

from rcopterx.deploy.roles.agent import agent_settings
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.reading import parse_fleet


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


def test_what_others_wait_for_runs_at_the_higher_priority_and_simulated_hardware_is_never_late() -> None:
    fleet = parse_fleet(PAIR)
    router, gateway = Priority.ROUTER.of(fleet), Priority.GATEWAY.of(fleet)
    leader, follower = (agent_settings(fleet, name).realtime_priority for name in ("h1", "h2"))
    simulator = Priority.SIMULATOR.of(fleet)
    assert Priority.RECORDER.of(fleet) < fleet.bus.realtime_priority < follower
    assert Priority.SUPERVISOR.of(fleet) > simulator > router > gateway > leader > follower
    without = parse_fleet(PAIR + "[bus]\nrealtime_priority = 0")
    assert {priority.of(without) for priority in Priority} == {0}
    highest = parse_fleet(PAIR + "[bus]\nrealtime_priority = 90")
    assert max(priority.of(highest) for priority in Priority) <= 99
    lowest = parse_fleet(PAIR + "[bus]\nrealtime_priority = 1")
    assert min(priority.of(lowest) for priority in Priority) == 1
