"""Measure this commit, append its figures to docs/figures/commits.jsonl, and draw all lines of that file.

    make measure ARGS="[--tests] [CHECKOUT ...]"

flies three vehicles for half a minute, here or in other checkouts; nothing else should run meanwhile.
`--tests` runs `make test` as well and adds its time. Figures of two computers do not compare, so each line
names the processor; those that were not measured are missing.
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from cost import TRIALS, measured
from imported_lines import flight_lines

ROOT = Path(__file__).parents[2]
DATA = ROOT / "docs" / "figures" / "commits.jsonl"
PLOT = DATA.with_suffix(".svg")
PLOTS = {
    "size of the code [lines of Python]": ("product_lines", "test_lines", "flight_lines"),
    "compiling all kernels, processor time [s]": ("kernels_s",),
    "three vehicles: processors in use, all processes": ("processors",),
    "three vehicles: from pose to command [ms]": ("pose_to_command_p50_ms", "pose_to_command_p99_ms"),
    "three vehicles: memory of all processes [MB]": ("memory_mb",),
    "control step, N = 110, mean [ms]": ("step_mean_ms",),
    "make test [min]": ("test_min",),
}
"""Quantities of each plot."""
VEHICLES = 3
COUNTED = re.compile(r"^HEAD:(.+):(\d+)$", re.MULTILINE)


def _git(checkout: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=checkout, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def _lines(checkout: Path) -> dict[str, int]:
    lines = {"product_lines": 0, "test_lines": 0}
    for path, count in COUNTED.findall(_git(checkout, "grep", "--count", "", "HEAD", "--", "*.py")):
        lines["test_lines" if path.startswith("tests/") else "product_lines"] += int(count)
    return lines


def _kernels_s(checkout: Path) -> float:
    """Processor time of compiling all kernels into an empty directory."""
    before = os.times()
    with tempfile.TemporaryDirectory() as kernels:
        environment = os.environ | {"RCOPTERX_KERNELS": kernels, "PYTHONPATH": str(checkout)}
        command = [sys.executable, "-m", "rcopterx.compiling"]
        subprocess.run(command, env=environment, cwd=checkout, check=True)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def _test_min(checkout: Path) -> float:
    """Time of `make test`, which has to pass."""
    began_s = time.monotonic()
    # Without arguments of its own it would get those of `make measure`.
    if subprocess.run(["make", "test", "ARGS="], cwd=checkout, check=False).returncode != 0:
        sys.exit(f"make test failed in {checkout}")
    return (time.monotonic() - began_s) / 60.0


def measure(checkout: Path) -> dict[str, Any]:
    """Figures of the commit of a checkout."""
    trio, step = (measured(TRIALS[name], checkout) for name in ("trio", "step"))
    commit, date = _git(checkout, "log", "-1", "--format=%h %cs").split()
    return {
        "commit": commit,
        "date": date,
        "processor": f"{os.cpu_count()} x {platform.processor() or platform.machine()}",
        **_lines(checkout),
        "flight_lines": flight_lines(checkout),
        "kernels_s": round(_kernels_s(checkout), 1),
        "processors": round(VEHICLES * trio["total_share"], 3),
        "pose_to_command_p50_ms": round(trio["pose_to_command_p50_ms"], 2),
        "pose_to_command_p99_ms": round(trio["pose_to_command_p99_ms"], 2),
        "memory_mb": round(trio["memory_mb"]),
        "step_mean_ms": round(step["mean_ms"], 3),
    }


def draw(rows: list[dict[str, Any]]) -> None:
    """Draw one plot for each entry of `PLOTS` that was measured, commits from left to right."""
    plots = [(title, names) for title, names in PLOTS.items() if any(names[0] in row for row in rows)]
    figure = Figure(figsize=(8, 2.5 * len(plots)), layout="constrained")
    commits = [f"{row['commit']}\n{row['date'][5:]}" for row in rows]
    for axes, (title, names) in zip(figure.subplots(len(plots), squeeze=False).flat, plots, strict=True):
        for name in names:
            axes.plot(commits, [row.get(name, float("nan")) for row in rows], marker="o", label=name)
        axes.set_title(title, fontsize="small")
        axes.tick_params(labelsize=6)
        axes.set_ylim(bottom=0.0)
        if len(names) > 1:
            axes.legend(fontsize="x-small")
    figure.savefig(PLOT, metadata={"Date": None})


def main() -> None:
    """Append a line for each checkout, and draw all."""
    parser = argparse.ArgumentParser(description="Measure commits and draw docs/figures/commits.svg.")
    parser.add_argument("checkouts", nargs="*", type=Path, default=[ROOT], metavar="CHECKOUT")
    parser.add_argument("--tests", action="store_true", help="run make test as well")
    arguments = parser.parse_args()
    for checkout in arguments.checkouts:
        if not (checkout / "Makefile").is_file():
            parser.error(f"{checkout} is no checkout of rcopterx")
    for checkout in arguments.checkouts:
        row = measure(checkout)
        if arguments.tests:
            row["test_min"] = round(_test_min(checkout), 1)
        with DATA.open("a", encoding="utf-8") as data:
            data.write(json.dumps(row) + "\n")
    draw([json.loads(line) for line in DATA.read_text(encoding="utf-8").splitlines()])


if __name__ == "__main__":
    main()
