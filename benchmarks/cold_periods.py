"""Processor time of an agent's control period when the processor did something else, or nothing, before it.

    python -m rcopterx.benchmarks.cold_periods FLIGHT.mcap h2

replays the agent of a flight log, one control period right after the other and with a pause before each, as
in flight. What the second costs more is no arithmetic: caches, branch predictors and address translation have
been used by others, or were given up while the processor slept.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from rcopterx.flights.mcap_reading import FlightLogError
from rcopterx.ground_station.replay.agent_replay import control_periods
from rcopterx.ground_station.replay.recorded_agent import RecordedAgent, recorded_agent

PAUSE_S: Final = 0.01
SKIPPED: Final = 20
"""Periods in the beginning, in which what is kept for later ones is computed."""


def period_ms(recorded: RecordedAgent, before: Callable[[], None]) -> float:
    """Median of the processor time of a control period [ms]; `before` is called before each."""
    times_ms = []
    for life in recorded.lives:
        periods = control_periods(recorded.vehicle, recorded.fleet, life)
        while True:
            before()
            begun_s = time.thread_time()
            if next(periods, None) is None:
                break
            times_ms.append(1e3 * (time.thread_time() - begun_s))
    return statistics.median(times_ms[SKIPPED:])


def main() -> int:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("agent")
    arguments = parser.parse_args()
    try:
        recorded = recorded_agent([arguments.file], arguments.agent)
    except FlightLogError as error:
        print(error, file=sys.stderr)
        return 1
    at_once, paused = (period_ms(recorded, before) for before in (lambda: None, lambda: time.sleep(PAUSE_S)))
    print(f"right after the other: {at_once:.2f} ms")
    print(f"after {1e3 * PAUSE_S:.0f} ms of pause: {paused:.2f} ms, {paused / at_once:.1f} times as much")
    return 0


if __name__ == "__main__":
    sys.exit(main())
