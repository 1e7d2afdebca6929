"""The course: what students get flies, better answers get more points, hostile ones none."""

import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from rcopterx.control import plugins
from rcopterx.control.plugins import CONTROLLERS, SCHEMES
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array
from rcopterx_studies.arena.tasks import TASKS, ArenaTask, wedge

EXAMPLE = Path(__file__).parents[2] / "examples" / "lab_class"
sys.path.insert(0, str(EXAMPLE))
import grade  # noqa: E402
import own_lqr  # noqa: E402

sys.path.remove(str(EXAMPLE))

ADDED = {
    "own_lqr": ("own_lqr:OwnLqr", CONTROLLERS),
    "own_mpc": ("own_mpc:OwnMpc", CONTROLLERS),
    "class_scheme": ("class_scheme:ClassScheme", SCHEMES),
    "hostile": ("support.hostile:HostileController", CONTROLLERS),
}


def short(task: ArenaTask) -> ArenaTask:
    return replace(task, duration_s=5.5)


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The package of the class is installed, and its tasks are short."""
    monkeypatch.syspath_prepend(str(EXAMPLE))
    points = [
        EntryPoint(name, value, registry.entry_point_group) for name, (value, registry) in ADDED.items()
    ]
    monkeypatch.setattr(
        plugins, "entry_points", lambda group: [point for point in points if point.group == group]
    )
    tasks: Mapping[str, ArenaTask] = {name: short(task) for name, task in TASKS.items()}
    monkeypatch.setattr(grade, "TASKS", tasks)


def riccati(model: Model, period_s: float) -> Array:
    """An answer of the first afternoon: each axis is a mass point."""
    gain = np.zeros((4, 8))
    for axis in range(4):
        a, b = np.array(((1.0, period_s), (0.0, 1.0))), np.array(((period_s**2 / 2,), (period_s,)))
        b = b * model.b[axis]
        q, r = np.diag((60.0, 20.0)), np.array(((4.0 * model.b[axis] ** 2,),))
        p = solve_discrete_are(a, b, q, r)
        gain[axis, [axis, 4 + axis]] = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)[0]
    return gain


@pytest.mark.parametrize(
    ("name", "task"),
    [("own_mpc", "three"), ("class_scheme", "three"), ("class_scheme", "loss_20")],
)
def test_what_students_get_flies_and_leaves_room_for_better(name: str, task: str) -> None:
    limit_mm = next(tasks[task] for tasks in grade.AFTERNOONS.values() if task in tasks)
    given = grade.mark(name, task, limit_mm, seed=100)
    assert 0.0 < given.points < 1.0


@pytest.mark.campaign
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("name", "afternoon"), [("lqr", "lqr"), ("cascade", "mpc"), ("admm", "scheme"), ("cascade", "race")]
)
def test_a_sound_answer_gets_nine_tenths_of_the_points(
    name: str, afternoon: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grade, "TASKS", TASKS)
    marks = grade.grade(name, afternoon, seed=210)
    assert sum(mark.points for mark in marks) >= 0.9 * len(marks), marks


def test_a_better_answer_gets_more_points(monkeypatch: pytest.MonkeyPatch) -> None:
    starts_m, links = wedge(2)
    pair = replace(TASKS["hover"], starts_m=starts_m, links=links, duration_s=3.5, errors_from_s=1.5)
    monkeypatch.setattr(grade, "TASKS", {"hover": pair})
    limit_mm = 20.0
    before = grade.mark("own_lqr", "hover", limit_mm, seed=100)
    monkeypatch.setattr(own_lqr, "gain", riccati)
    after = grade.mark("own_lqr", "hover", limit_mm, seed=100)
    assert 0.0 < before.points < after.points


def test_a_controller_that_had_to_be_replaced_gets_no_points() -> None:
    given = grade.mark("hostile", "three", 1000.0, seed=100)
    assert given.points == 0.0
    assert given.text == "lost: h1, h2, h3"


def test_every_task_of_an_afternoon_is_one_of_the_arena() -> None:
    assert {task for tasks in grade.AFTERNOONS.values() for task in tasks} <= TASKS.keys()


def test_points_are_entered_and_better_ones_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    board = tmp_path / "leaderboard.json"
    points = iter((0.5, 0.4, 0.9))
    monkeypatch.setattr(
        grade, "grade", lambda *_: [grade.Mark("three", next(points), "flown"), grade.Mark("hover", 0.0, "")]
    )
    for name in ("own_lqr", "own_lqr", "cascade"):
        grade.main([name, "lqr", "--leaderboard", str(board)])
    assert json.loads(board.read_text()) == {"own_lqr": {"lqr": 0.25}, "cascade": {"lqr": 0.45}}
    capsys.readouterr()
    grade.main(["--leaderboard", str(board)])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["cascade", "own_lqr"]


@pytest.mark.parametrize("arguments", [[], ["unknown", "lqr"], ["own_lqr"], ["own_lqr", "tea"]])
def test_mistakes_are_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        grade.main(arguments)
    assert "usage" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["{", "[]", '{"own_lqr": 1}', '{"own_lqr": {"lqr": "much"}}'])
def test_a_file_that_is_no_leaderboard_is_refused_and_stays(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    board = tmp_path / "leaderboard.json"
    board.write_text(text)
    with pytest.raises(SystemExit):
        grade.main(["own_lqr", "lqr", "--leaderboard", str(board)])
    assert f"{board}: " in capsys.readouterr().err
    assert board.read_text() == text
