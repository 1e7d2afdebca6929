"""The arena with all processes of a fleet: the same figures as in the rig."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from support.arena_with_processes import fly_with_processes
from support.conditions import HELICOPTERS

from rcopterx_studies.arena.flying import arena_scheme, fly_task
from rcopterx_studies.arena.tasks import TASKS

pytestmark = [pytest.mark.integration, pytest.mark.timeout(300)]

RMS_SHARE = 0.25
"""Largest difference of formation errors, root mean square."""


@pytest.mark.parametrize(
    ("scheme", "task"),
    [
        ("cascade", "three"),
        pytest.param("admm", "three", marks=pytest.mark.campaign),
        pytest.param("cascade", "figure_eight", marks=pytest.mark.campaign),
        pytest.param("admm", "figure_eight", marks=pytest.mark.campaign),
        pytest.param("cascade", "formation", marks=pytest.mark.campaign),
    ],
)
def test_formation_errors_are_those_of_the_rig(
    scheme: str, task: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A short path, because the router's socket lives in it.
    with TemporaryDirectory(prefix="rcopterx-") as run:
        monkeypatch.setenv("RCOPTERX_RUN", run)
        monkeypatch.setenv("RCOPTERX_FLIGHTS", str(Path(run) / "flights"))
        real = fly_with_processes(arena_scheme(scheme), TASKS[task], HELICOPTERS, 100)
    rig = fly_task(arena_scheme(scheme), TASKS[task], HELICOPTERS, 100)
    print(f"{scheme}, {task}: {real.rms_mm:.1f} / {real.max_mm:.0f}, rig {rig.rms_mm:.1f} / {rig.max_mm:.0f}")
    print(f"task error {real.task_rms_mm:.1f}, rig {rig.task_rms_mm:.1f}")
    print(
        f"messages {real.messages_per_s} and {rig.messages_per_s}, bytes {real.bytes_per_s} {rig.bytes_per_s}"
    )
    assert not real.lost
    assert abs(real.rms_mm - rig.rms_mm) < RMS_SHARE * rig.rms_mm
    assert real.messages_per_s == pytest.approx(rig.messages_per_s, rel=0.05)
