"""pytest examples/own_scheme: the scheme flies a task of the arena."""

from dataclasses import replace

from rcopterx.simulator.conditions import PRESETS
from rcopterx_studies.arena.flying import arena_scheme, fly_task
from rcopterx_studies.arena.tasks import TASKS


def test_followers_keep_their_places() -> None:
    task = replace(TASKS["three"], duration_s=7.0)
    flown = fly_task(arena_scheme("courier"), task, PRESETS["helicopters"], seed=100)
    assert not flown.lost
    assert flown.rms_mm < 120.0
