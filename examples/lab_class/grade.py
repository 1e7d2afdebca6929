"""Grade controllers and schemes by flights in the arena, and keep a leaderboard.

python grade.py NAME AFTERNOON [--seed N] [--leaderboard FILE]
python grade.py --leaderboard FILE
"""

import argparse
import json
import math
from dataclasses import dataclass
from pathlib import Path

import msgspec

from rcopterx.simulator.conditions import PRESETS
from rcopterx_studies.arena.flying import arena_scheme, arena_schemes, fly_task
from rcopterx_studies.arena.tasks import TASKS

AFTERNOONS = {
    "lqr": {"hover": 160.0, "three": 100.0, "gusts": 220.0},
    "mpc": {"three": 60.0, "figure_eight": 80.0, "slow": 80.0},
    "scheme": {"three": 80.0, "loss_20": 100.0, "delay_60": 190.0, "killed": 130.0},
    "race": {"geometry": 50.0, "figure_eight": 50.0, "gusts": 140.0, "loss_50": 50.0, "delay_100": 50.0},
}
"""Tasks of each afternoon with the error for full points: formation and task error together, rms [mm]."""


@dataclass(frozen=True)
class Mark:
    """Result of one flight."""

    task: str
    points: float
    text: str


def mark(name, task, limit_mm, seed):
    """Fly a task: full points up to the limit, less beyond and for violations, none for losses."""
    flown = fly_task(arena_scheme(name), TASKS[task], PRESETS["helicopters"], seed)
    error_mm = math.hypot(flown.rms_mm, flown.task_rms_mm)
    if flown.lost:
        return Mark(task, 0.0, f"lost: {', '.join(flown.lost)}")
    points = min(1.0, limit_mm / error_mm) * max(0.0, 1.0 - flown.violated_s)
    text = f"{error_mm:.0f} mm, full points {limit_mm:g} mm"
    if flown.violated_s > 0.0:
        text += f", too close or too fast for {flown.violated_s:g} s"
    return Mark(task, round(points, 2), text)


def grade(name, afternoon, seed):
    """Marks of a controller or scheme in all tasks of an afternoon."""
    return [mark(name, task, limit_mm, seed) for task, limit_mm in AFTERNOONS[afternoon].items()]


def read(file):
    """Points by name and afternoon; none before the first. Raises `ValueError`: it is no leaderboard."""
    if not file.exists():
        return {}
    return msgspec.json.decode(file.read_bytes(), type=dict[str, dict[str, float]])


def enter(board, name, afternoon, points):
    """Enter points into a leaderboard; better ones that are there stay."""
    row = board.setdefault(name, {})
    row[afternoon] = max(points, row.get(afternoon, 0.0))


def table(board):
    """The leaderboard as text, the best one first."""
    lines = [f"{'':20}" + "".join(f"{afternoon:>8}" for afternoon in AFTERNOONS) + f"{'sum':>8}"]
    for name, row in sorted(board.items(), key=lambda item: -sum(item[1].values())):
        points = [row.get(afternoon, 0.0) for afternoon in AFTERNOONS]
        lines.append(f"{name:20}" + "".join(f"{each:8.2f}" for each in (*points, sum(points))))
    return "\n".join(lines)


def main(arguments=None):
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Grade controllers and schemes by flights in the arena.")
    parser.add_argument("name", nargs="?", help="controller or scheme of an installed package")
    parser.add_argument("afternoon", nargs="?", choices=AFTERNOONS)
    parser.add_argument("--seed", type=int, default=100, help="of vehicles, weather and losses")
    parser.add_argument("--leaderboard", type=Path, help="file to enter the points into, and to print")
    given = parser.parse_args(arguments)
    if given.name is None and given.leaderboard is None:
        parser.error("give a name and an afternoon, or --leaderboard")
    try:
        board = {} if given.leaderboard is None else read(given.leaderboard)
    except (OSError, ValueError) as error:
        parser.error(f"{given.leaderboard}: {error}")
    if given.name is not None:
        if given.name not in arena_schemes() or given.afternoon is None:
            parser.error(f"give one of {', '.join(arena_schemes())}, and one of {', '.join(AFTERNOONS)}")
        marks = grade(given.name, given.afternoon, given.seed)
        for each in marks:
            print(f"{each.task:14} {each.points:5.2f}  {each.text}")
        points = round(sum(each.points for each in marks) / len(marks), 2)
        print(f"{given.afternoon:14} {points:5.2f}")
        if given.leaderboard is not None:
            enter(board, given.name, given.afternoon, points)
            given.leaderboard.write_text(json.dumps(board, indent=2) + "\n", encoding="utf-8")
    if given.leaderboard is not None:
        print(table(board))


if __name__ == "__main__":
    main()
