"""A foreign controller that ends its process at once does not bring its vehicle down."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from integration_support import Flying, Truth, fleet_text

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(180)]

MODULE = """
import os
from pathlib import Path

from rcopterx_studies.baselines.lqr import LqrController


class Crashing(LqrController):
    steps = 0

    def step(self, estimate, reference, last_input, expired=lambda: False):
        self.steps += 1
        if self.steps > 5 and Path(os.environ["TEST_CRASH_WHEN"]).exists():
            os._exit(7)
        return super().step(estimate, reference, last_input, expired)
"""
ALONE = """
[vehicles.h1]
subject = "heli1"
transmitter = { port = "radio-h1", model_match = 1 }
"""

Launch = Callable[..., Flying]


def install(directory: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Install the plug-in for all processes; returns the file whose presence makes it crash."""
    metadata = directory / "crashing-0.1.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: crashing\nVersion: 0.1\n")
    (metadata / "entry_points.txt").write_text("[rcopterx.controllers]\ncrashing = crashing:Crashing\n")
    (directory / "crashing.py").write_text(MODULE)
    paths = [str(directory), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    trigger = directory / "crash"
    monkeypatch.setenv("TEST_CRASH_WHEN", str(trigger))
    return trigger


def wait_flown_by(flying: Flying, controller: str, remark: str) -> None:
    """Wait until a vehicle in the air is flown by a controller, and says why."""

    def flown() -> bool:
        status = flying.fleet["h1"].state.agent
        told = status is not None and any(remark in text for text in status.diagnostics.remarks)
        return (
            status is not None
            and told
            and (status.phase, status.diagnostics.controller) == ("flying", controller)
        )

    flying.fleet.wait_until(flown, 30, f"not flown by {controller}: {remark}")


def wait_stable(flying: Flying) -> None:
    """Wait until another death would not count as one of a crash loop."""
    supervisor = flying.launcher_of("agent-h1").supervisor
    since_s = flying.started_s("agent-h1")
    flying.fleet.wait_until(
        lambda: time.monotonic() - since_s > 3.0 and supervisor.spares.complete, 40, "no spare processes"
    )


def test_a_crash_loop_ends_with_what_flew_before_and_then_with_the_default_controller(
    launch: Launch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trigger = install(tmp_path / "plug-in", monkeypatch)
    flying = launch(fleet_text(vehicles=ALONE))
    truth, vehicle = Truth(flying), flying.fleet["h1"]
    flying.fleet.take_off(["h1"], height_m=1.0)
    begun = truth("h1")
    assert begun is not None
    vehicle.tune("lqr", horizon=20)
    wait_stable(flying)
    before = flying.restarts("agent-h1")
    trigger.touch()
    vehicle.tune("crashing", horizon=20)
    wait_flown_by(flying, "lqr", "the last change of controller or settings is withdrawn")
    assert flying.restarts("agent-h1") == before + 2
    trigger.unlink()
    wait_stable(flying)
    vehicle.tune("crashing", horizon=20)
    vehicle.tune(horizon=24)
    before = flying.restarts("agent-h1")
    trigger.touch()
    wait_flown_by(flying, "cascade", "the default controller flies until one is chosen")
    assert flying.restarts("agent-h1") == before + 3
    there = truth("h1")
    assert there is not None
    assert there.touchdowns == begun.touchdowns
    assert there.position_m[2] > 0.5
    flying.fleet.land(["h1"])
