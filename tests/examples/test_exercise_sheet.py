"""Promises of the exercise sheet: its checks distinguish right from wrong, and a solved sheet passes."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import nbformat
import pytest
from examples_support import fleet_file
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

from rcopterx import RefusedError

EXAMPLE = Path(__file__).parents[2] / "examples" / "lab_class"
sys.path.insert(0, str(EXAMPLE))
import checks  # noqa: E402

sys.path.remove(str(EXAMPLE))

RIGHT = {"h1": (0.0, 0.0, 1.0), "h2": (-0.693, 0.4, 1.0), "h3": (-0.693, -0.4, 1.0)}
SOLUTIONS = {
    "triangle": """
for name, y in (("h2", 0.4), ("h3", -0.4)):
    fleet[name].follow("h1", offset_m=(-0.693, y, 0.0))
fleet.wait_for_formation()
""",
    "circle": """
from rcopterx import RefusedError, circle

period_s = 1.0
while True:
    try:
        fleet["h1"].fly(circle((0, 0, 1), 0.4, period_s))
        break
    except RefusedError:
        period_s += 0.5
""",
    "handover": 'fleet.promote("h3")\nfleet.wait_for_formation()',
}


class Vehicle:
    """A vehicle that is somewhere and flies circles down to a period."""

    def __init__(self, name: str, position_m: tuple[float, ...], leaders: tuple[str, ...] = ()) -> None:
        self.name = name
        self.state = SimpleNamespace(position_m=position_m, leaders=leaders)
        self.shortest_s = 6.0

    def fly(self, path: Any) -> None:
        if path.duration_s < 1.5 * self.shortest_s:
            raise RefusedError("too fast")


def fleet(**changed: tuple[float, ...]) -> list[Vehicle]:
    return [Vehicle(name, changed.get(name, place)) for name, place in RIGHT.items()]


def test_a_triangle_of_the_right_size_passes(capsys: pytest.CaptureFixture[str]) -> None:
    checks.check_triangle(fleet())
    assert capsys.readouterr().out == "passed: triangle\n"


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"h2": (-0.4, 0.4, 1.0)}, "h1 and h2 are 0.57 m"),
        ({"h3": (-0.693, -0.4, 1.12)}, "heights differ by 0.12"),
    ],
)
def test_another_triangle_does_not(changed: dict[str, tuple[float, ...]], reason: str) -> None:
    with pytest.raises(checks.NotYetError, match=reason):
        checks.check_triangle(fleet(**changed))


def test_the_shortest_period_passes_and_no_other() -> None:
    checks.check_shortest_circle(fleet(), 6.0)
    with pytest.raises(checks.NotYetError, match=r"6 s is flown as well"):
        checks.check_shortest_circle(fleet(), 6.5)
    with pytest.raises(checks.NotYetError, match=r"5.5 s is refused"):
        checks.check_shortest_circle(fleet(), 5.5)


def test_a_hand_over_passes_if_everybody_follows_and_nobody_has_moved() -> None:
    def led(*leaders: tuple[str, ...], moved_m: float = 0.0) -> list[Vehicle]:
        return [
            Vehicle(name, (x + moved_m, y, z), leading)
            for (name, (x, y, z)), leading in zip(RIGHT.items(), leaders, strict=True)
        ]

    checks.check_handed_over(led(("h3",), ("h3",), ()), RIGHT)
    for vehicles, reason in (
        (led((), ("h1",), ("h1",)), "h3 still follows h1"),
        (led(("h3",), ("h1",), ()), "h2 does not follow h3"),
        (led(("h3",), ("h3",), (), moved_m=0.3), "h1 has moved 0.30 m"),
    ):
        with pytest.raises(checks.NotYetError, match=reason):
            checks.check_handed_over(vehicles, RIGHT)


def solved(path: Path, *solutions: str) -> nbformat.NotebookNode:
    """The sheet with some answers; raises where a check is not passed."""
    sheet = nbformat.read(EXAMPLE / "exercise_sheet.ipynb", as_version=4)
    for cell in sheet.cells:
        tags = cell.metadata.get("tags", [])
        if "parameters" in tags:
            cell.source = f"FLEET = {str(path)!r}"
        elif "answer" in tags and tags[1] in solutions:
            cell.source = SOLUTIONS[tags[1]]
    resources = {"metadata": {"path": str(EXAMPLE)}}
    NotebookClient(sheet, timeout=120, kernel_name="python3", resources=resources).execute()
    return sheet


@pytest.mark.integration
@pytest.mark.campaign
@pytest.mark.timeout(300)
@pytest.mark.parametrize("complete", [True, False])
def test_a_solved_sheet_passes_and_an_unsolved_one_is_told_why(
    complete: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A short path, because the router's socket lives in it.
    with TemporaryDirectory(prefix="rcopterx-") as run:
        monkeypatch.setenv("RCOPTERX_RUN", run)
        path = fleet_file(tmp_path, "trio")
        if not complete:
            with pytest.raises(CellExecutionError, match="NotYetError"):
                solved(path, "circle", "handover")
            return
        sheet = solved(path, *SOLUTIONS)
    printed = "".join(output.get("text", "") for cell in sheet.cells for output in cell.get("outputs", []))
    for task in ("triangle", "shortest circle", "handed over"):
        assert f"passed: {task}" in printed
