"""What tests of processes need on a busy machine."""

import pytest
from support.waiting import DEADLINE_S

import rcopterx.deploy.processes.forking


@pytest.fixture(autouse=True)
def _patience_with_fork_servers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of tests are ordinary processes, unlike those of fleets, and wait for a processor."""
    monkeypatch.setattr(rcopterx.deploy.processes.forking, "ANSWER_LIMIT_S", DEADLINE_S)
