"""The arena: schemes on the same tasks, reproducible, with those of other packages."""

import runpy
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.conditions import HELICOPTERS
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.control import plugins
from rcopterx.control.plugins import SCHEMES
from rcopterx_studies.arena import arena as arena_module
from rcopterx_studies.arena.arena import DEFAULT_SCHEMES, arena, digest, error_ratios, foreign_digests
from rcopterx_studies.arena.flying import FlownTask, arena_scheme, arena_schemes, fly_task
from rcopterx_studies.arena.page import ranked, write_arena
from rcopterx_studies.arena.tasks import HEAD, TASKS, wedge
from rcopterx_studies.experiments.events import GoToEvent
from rcopterx_studies.experiments.rig import RigOptions
from rcopterx_studies.experiments.runner import Options

EXAMPLE = Path(__file__).parents[3] / "examples" / "own_scheme"
SHORT = replace(
    TASKS["three"], duration_s=4.0, events=(GoToEvent(2.2, HEAD, (1.2, 0.3, 1.4)),), errors_from_s=2.0
)


@cache
def undisturbed(name: str) -> FlownTask:
    """A short flight of a scheme in which nothing fails."""
    return fly_task(arena_scheme(name), SHORT, HELICOPTERS, seed=100)


def flown(rms_mm: float = 20.0, **changes: Any) -> FlownTask:
    figures = FlownTask(
        rms_mm, 50.0, 10.0, 20.0, 600.0, 0.0, 50.0, 1000.0, 1.0, 2.0, 0, [], np.zeros((2, 5, 2))
    )  # fmt: skip
    return replace(figures, **changes)


@pytest.mark.parametrize("name", DEFAULT_SCHEMES)
def test_scheme_keeps_three_helicopters_together(name: str) -> None:
    figures = undisturbed(name)
    assert not figures.lost
    assert figures.violated_s == 0.0
    assert 0.0 < figures.rms_mm < 150.0
    assert figures.messages_per_s > 1.0
    assert figures.bytes_per_s > 100.0
    assert figures.step_mean_ms > 0.0


def test_same_seed_gives_the_same_figures() -> None:
    first, again = undisturbed("admm"), fly_task(arena_scheme("admm"), SHORT, HELICOPTERS, seed=100)
    assert np.array_equal(first.tracks_m, again.tracks_m)
    assert (first.rms_mm, first.bytes_per_s) == (again.rms_mm, again.bytes_per_s)


@pytest.mark.parametrize("name", ["cascade", "consensus"])
def test_formation_survives_an_agent_that_is_killed_and_one_that_is_slow(name: str) -> None:
    options = RigOptions(killed={"h2": (2.0, 3.0)}, slow={"h3": 3})
    figures = fly_task(arena_scheme(name), replace(SHORT, options=options), HELICOPTERS, seed=100)
    assert not figures.lost
    assert figures.messages_per_s < 0.8 * undisturbed(name).messages_per_s


def test_wedge_has_a_head_and_one_leader_for_each_other_vehicle() -> None:
    starts, links = wedge(8)
    assert len(starts) == 8
    assert set(links) == set(starts) - {"h1"}
    for name, (link,) in links.items():
        offset_m = np.subtract(starts[name], starts[link.leader])
        assert np.allclose(offset_m, link.offset_m)
        assert np.linalg.norm(offset_m) > 0.6


def test_every_event_concerns_a_vehicle_of_its_task() -> None:
    for task in TASKS.values():
        assert {event.vehicle for event in task.events} <= task.starts_m.keys()
        assert max((event.time_s for event in task.events), default=0.0) < task.duration_s


def test_flights_that_lost_a_vehicle_rank_last() -> None:
    rows = {
        "late": {"rms_mm": 30.0, "task_rms_mm": 0.0, "lost": {}, "violated_s": 0.0},
        "gone": {"rms_mm": 1.0, "task_rms_mm": 0.0, "lost": {"100": ["h2"]}, "violated_s": 0.0},
        "good": {"rms_mm": 20.0, "task_rms_mm": 0.0, "lost": {}, "violated_s": 0.0},
    }
    assert [name for name, _ in ranked(rows)] == ["good", "late", "gone"]


def test_digest_depends_on_figures_and_not_on_the_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    def document(**changes: Any) -> Any:
        monkeypatch.setattr(arena_module, "fly_task", lambda *_, **__: flown(**changes))
        options = Options((100, 101), preset="helicopters")
        return arena(["cascade"], ["three"]).fly(options, lambda *_: None).document

    assert digest(document()) == digest(document(step_mean_ms=9.0))
    assert digest(document()) != digest(document(rms_mm=21.0))


def test_ratios_compare_the_same_fleets() -> None:
    flights = {
        "three / cascade": {seed: flown(10.0 + seed, max_mm=50.0) for seed in range(9)},
        "three / paper": {seed: flown(20.0 + 2 * seed, max_mm=75.0) for seed in range(9)},
        "crossing / cascade": {seed: flown(0.0) for seed in range(9)},
        "crossing / paper": {seed: flown(0.0) for seed in range(9)},
    }
    ratios = error_ratios(flights, ("three", "crossing"), ("cascade", "paper"))
    assert list(ratios) == ["three"], "vehicles of a crossing follow no other one"
    paper = ratios["three"]["paper"]
    assert paper["rms"] == {"median": 2.0, "median_95%": [2.0, 2.0], "worst": 2.0}
    assert paper["max"]["median"] == 1.5


def test_page_shows_every_task_with_its_schemes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arena_module, "fly_task", lambda *_, **__: flown(lost=["h2"]))
    result = arena(["cascade", "admm"], ["three", "crossing"]).fly(Options((100,)), lambda *_: None)
    page = write_arena(tmp_path / "page", result).read_text("utf-8")
    for text in ('id="three"', 'id="crossing"', "admm", "100: h2", "<svg"):
        assert text in page


@pytest.fixture
def courier(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLE))
    added = EntryPoint("courier", "own_scheme:CourierScheme", SCHEMES.entry_point_group)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [added] if group == added.group else [])


@pytest.mark.usefixtures("courier")
def test_scheme_of_another_package_takes_part_by_its_name() -> None:
    assert "courier" in arena_schemes()
    assert set(foreign_digests(["courier", "cascade"])) == {"courier"}
    runpy.run_path(str(EXAMPLE / "test_own_scheme.py"))["test_followers_keep_their_places"]()


def test_example_of_a_scheme_is_short() -> None:
    lines = [line for file in EXAMPLE.iterdir() if file.is_file() for line in file.read_text().splitlines()]
    assert len(lines) <= 150


def test_command_lists_and_refuses() -> None:
    run = CliRunner().invoke
    listed = run(app, ["arena", "--list"]).output
    assert "distributed_lqr" in listed
    assert "crossing of 8" in listed
    for arguments, problem in (
        (["--schemes", "magic"], "magic"),
        (["--tasks", "tea"], "tea"),
        (["--conditions", "space"], "space"),
    ):
        refused = run(app, ["arena", *arguments])
        assert refused.exit_code == 2
        assert problem in refused.output


def test_command_prints_a_digest_and_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    count = []

    def fly(*_: Any, **__: Any) -> FlownTask:
        count.append(1)
        return flown()

    monkeypatch.setattr(arena_module, "fly_task", fly)
    arguments = ["arena", "--schemes", "cascade,admm", "--tasks", "three", "--resume", str(tmp_path / "kept")]
    outputs = [CliRunner().invoke(app, arguments).stdout for _ in range(2)]
    assert outputs[0] == outputs[1]
    assert "digest" in outputs[0]
    assert len(count) == 2
