"""Processor time of a formation in flight, of this checkout and of another one, in alternating runs.

    python -m rcopterx.benchmarks.pilot_time --against DIRECTORY

Alternating, because a machine is not equally fast from minute to minute. The laboratory is part of it
(about a sixth); processes, bus and messages are not.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

from rcopterx.experiments.formation import SLOTS, events, formation
from rcopterx.experiments.rig import Rig
from rcopterx.experiments.schemes import CASCADE
from rcopterx.simulator.conditions import PRESETS

HORIZON: Final = 30
FLIGHT_S: Final = 20.0
SETTLE_S: Final = 1.0
CONDITIONS: Final = ("helicopters", "laboratory")


def processor_ms(preset: str, flight_s: float) -> float:
    """Processor time per vehicle and second of flight [ms] of a leader and two followers."""
    vehicles = formation(CASCADE, PRESETS[preset], 0, HORIZON)
    rig = Rig(vehicles, PRESETS[preset])
    rig.fly(SETTLE_S)
    started_s = time.process_time()
    rig.fly(flight_s, events(SLOTS[:2]))
    return 1e3 * (time.process_time() - started_s) / (flight_s * len(vehicles))


def measured_in(checkout: Path, preset: str, flight_s: float) -> float:
    """`processor_ms` of the code in a checkout, in a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, str(Path(__file__).resolve()), "--once", preset, str(flight_s)]
    return float(
        subprocess.run(command, cwd=checkout, env=environment, stdout=subprocess.PIPE, check=True).stdout
    )


def compared(own: Path, other: Path, preset: str, rounds: int, flight_s: float) -> tuple[float, float]:
    """Medians of alternating runs in two checkouts [ms per vehicle and second]."""
    pairs = [
        (measured_in(own, preset, flight_s), measured_in(other, preset, flight_s)) for _ in range(rounds)
    ]
    return statistics.median(pair[0] for pair in pairs), statistics.median(pair[1] for pair in pairs)


def main() -> None:
    """Print the medians and their ratio."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", type=Path, metavar="DIRECTORY", help="Other checkout.")
    parser.add_argument("--rounds", type=int, default=5, metavar="N")
    parser.add_argument("--once", nargs=2, metavar=("PRESET", "SECONDS"), help="One run, here.")
    options = parser.parse_args()
    if options.once:
        print(processor_ms(options.once[0], float(options.once[1])))
        return
    if options.against is None:
        parser.error("--against: which checkout to compare with")
    own = Path(__file__).resolve().parents[1]
    for preset in CONDITIONS:
        here, there = compared(own, options.against.resolve(), preset, options.rounds, FLIGHT_S)
        print(f"{preset:12} {here:.1f} ms here, {there:.1f} ms there, ratio {here / there:.2f}")


if __name__ == "__main__":
    main()
