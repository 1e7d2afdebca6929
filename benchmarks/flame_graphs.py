"""Flame graphs of the processes of a fleet in flight, one for each role (py-spy).

    python -m rcopterx.benchmarks.flame_graphs docs/figures --vehicles 6

The fleet is that of `rcopterx bench scale`. Agents and gateways may be real-time processes; so that samples
are not only taken while they rest, py-spy has a higher priority than all of them, which takes root.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from rcopterx.benchmarks.scale import HORIZON, LEGS_M, SETTLE_S, fleet_text
from rcopterx.deploy.launcher import Launcher
from rcopterx.ground_station.launched import launched

PRIORITY: Final = 60
RATE_HZ: Final = 200
STARTING_S: Final = 3.0
"""Until py-spy has read the symbols of a process."""


def record(directory: Path, vehicles: int, horizon: int, seconds: float) -> list[Path]:
    """Fly a fleet and draw where its processes spend their time.

    Parameters
    ----------
    directory
        Where `flame_ROLE.svg` go.
    vehicles, horizon
        The fleet; the last vehicle's agent stands for all.
    seconds
        How long samples are taken.

    Returns
    -------
    list[Path]
        The figures.
    """
    directory.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="rcopterx-") as scratch:
        path = Path(scratch) / "scale.toml"
        path.write_text(fleet_text(vehicles, horizon), encoding="utf-8")
        with launched(path, record=False) as fleet:
            assert fleet.launcher is not None
            fleet.take_off()
            fleet.wait_for_formation()
            time.sleep(SETTLE_S)
            with ExitStack() as samplers:
                figures = [
                    samplers.enter_context(_sampled(process, directory / f"flame_{role}.svg", seconds))
                    for role, process in one_of_each_role(fleet.launcher).items()
                ]
                for leg_m in LEGS_M:
                    fleet["h1"].go_to(leg_m)
                    time.sleep((seconds + STARTING_S) / len(LEGS_M))
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
        "--duration", f"{seconds:.0f}", "--rate", str(RATE_HZ), "--threads", "--output", str(figure),
    ]  # fmt: skip


@contextmanager
def _sampled(process: int, figure: Path, seconds: float) -> Iterator[Path]:
    with subprocess.Popen(
        command(process, figure, seconds), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as sampler:
        yield figure
        _, said = sampler.communicate()
    if sampler.returncode != 0:
        raise SystemExit(f"py-spy: {said.strip().splitlines()[-1] if said.strip() else sampler.returncode}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the figures and print where they are."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("directory", type=Path, help="Where the figures go.")
    parser.add_argument("--vehicles", type=int, default=6, metavar="N")
    parser.add_argument("--horizon", type=int, default=HORIZON, metavar="N")
    parser.add_argument("--seconds", type=float, default=20.0, metavar="S")
    options = parser.parse_args(arguments)
    for figure in record(options.directory, options.vehicles, options.horizon, options.seconds):
        print(figure)


if __name__ == "__main__":
    main()
