"""The examples as a user starts them, with a simulated fleet of real processes."""

import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from examples_support import fleet_file

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(300)]


@pytest.fixture
def run_directory() -> Iterator[str]:
    """A short path, because the router's socket lives in it."""
    with TemporaryDirectory(prefix="rcopterx-") as name:
        yield name


def flown(script: str, *arguments: str | Path, run_directory: str) -> str:
    """What an example prints until it ends."""
    command = [sys.executable, str(EXAMPLES / script), *map(str, arguments)]
    environment = os.environ | {"RCOPTERX_RUN": run_directory, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_formation_flies_while_its_leader_changes_twice(tmp_path: Path, run_directory: str) -> None:
    printed = flown("changing_leaders.py", fleet_file(tmp_path, "trio"), run_directory=run_directory)
    assert [line.split()[0] for line in printed.splitlines() if "has led" in line] == ["h1", "h2", "h3"]


def test_five_fly_a_figure_eight(tmp_path: Path, run_directory: str) -> None:
    printed = flown("figure_eight_of_five.py", fleet_file(tmp_path, "quintet"), run_directory=run_directory)
    assert [line.split()[0] for line in printed.splitlines() if " is at " in line] == [
        "h1",
        "h2",
        "h3",
        "h4",
        "h5",
    ]


def test_three_fly_a_show(tmp_path: Path, run_directory: str) -> None:
    drones = []
    for number in range(3):
        y = 6.0 * (number - 1)
        points = [
            [0, [-8, y, 0], []],
            [4, [-8, y, 12], []],
            [16, [8, y, 12], [[-8, y, 20], [8, y, 20]]],
            [20, [8, y, 4], []],
        ]
        trajectory = {"version": 1, "points": points, "takeoffTime": float(number)}
        drones.append({"type": "generic", "settings": {"name": f"Drone {number}", "trajectory": trajectory}})
    show = tmp_path / "show.skyc"
    with zipfile.ZipFile(show, "w") as archive:
        archive.writestr("show.json", json.dumps({"version": 1, "swarm": {"drones": drones}}))
    flown(
        "light_show/light_show.py", show, "--slower", "1.5", "--fleet", fleet_file(tmp_path, "trio"),
        run_directory=run_directory,
    )  # fmt: skip
