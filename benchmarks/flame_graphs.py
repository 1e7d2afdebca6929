"""Flame graphs of the processes of a fleet in flight, one for each role (py-spy).

    python -m rcopterx.benchmarks.flame_graphs docs/figures --vehicles 6

The fleet is that of `rcopterx bench scale`. Agents and gateways may be real-time processes; so that samples
are not only taken while they rest, py-spy has a higher priority than all of them, which takes root.
"""

import argparse
import re
import subprocess
import sys
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Final

from rcopterx.benchmarks.scale import HORIZON, LEGS_M, in_formation
from rcopterx.deploy.hosts.launcher import Launcher

PRIORITY: Final = 60
RATE_HZ: Final = 100
_TITLE: Final = re.compile(r'(<text id="title"[^>]*>)[^<]*')


def record(directory: Path, vehicles: int, horizon: int, seconds: float) -> list[Path]:
    """Fly a fleet and draw where its processes spend their time.

    Parameters
    ----------
    directory
        Where `flame_ROLE.svg` go.
    vehicles, horizon
        The fleet; the last vehicle's agent stands for all.
    seconds
        How long samples of each process are taken.

    Returns
    -------
    list[Path]
        The figures.
    """
    directory.mkdir(parents=True, exist_ok=True)
    figures = []
    with in_formation(vehicles, horizon) as (fleet, launcher):
        # One after the other: samplers of all processes at once would take the time that they look for.
        for leg_m, (role, process) in zip(cycle(LEGS_M), one_of_each_role(launcher).items(), strict=False):
            fleet["h1"].go_to(leg_m)
            figures.append(directory / f"flame_{role}.svg")
            sample(process, figures[-1], seconds)
            entitle(figures[-1], f"{role}, {vehicles} vehicles, N = {horizon}")
    return figures


def one_of_each_role(launcher: Launcher) -> dict[str, int]:
    """Process of each role; of several the last one."""
    supervisor = launcher.supervisor
    pids = {child.spec.role: supervisor.pid(name) for name, child in supervisor.children.items()}
    return {role: pid for role, pid in pids.items() if pid is not None}


def command(process: int, figure: Path, seconds: float) -> list[str]:
    """What samples a process."""
    py_spy = Path(sys.executable).with_name("py-spy")
    return [
        "chrt", "-f", str(PRIORITY), str(py_spy), "record", "--pid", str(process),
        "--duration", f"{seconds:.0f}", "--rate", str(RATE_HZ), "--nonblocking", "--threads",
        "--output", str(figure),
    ]  # fmt: skip


def sample(process: int, figure: Path, seconds: float) -> None:
    """Draw where a process spends its time.

    Raises
    ------
    SystemExit
        py-spy cannot look at it; says why.
    """
    sampler = subprocess.run(
        command(process, figure, seconds),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    if sampler.returncode != 0:
        said = sampler.stderr.strip().splitlines()
        raise SystemExit(f"py-spy: {said[-1] if said else sampler.returncode}")


def entitle(figure: Path, title: str) -> None:
    """Give a figure of py-spy a title in the place of its command line."""
    text = figure.read_text(encoding="utf-8")
    figure.write_text(_TITLE.sub(rf"\g<1>{title}", text), encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the figures and print where they are."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("directory", type=Path, help="Where the figures go.")
    parser.add_argument("--vehicles", type=int, default=6, metavar="N")
    parser.add_argument("--horizon", type=int, default=HORIZON, metavar="N")
    parser.add_argument("--seconds", type=float, default=8.0, metavar="S")
    options = parser.parse_args(arguments)
    for figure in record(options.directory, options.vehicles, options.horizon, options.seconds):
        print(figure)


if __name__ == "__main__":
    main()
