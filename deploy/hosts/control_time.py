"""Processor time [s] of an agent's control period; `python -m` prints it for `capacity`."""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.pilot import Pilot
from rcopterx.bus.realtime import request_realtime
from rcopterx.control.interfaces import Measurement
from rcopterx.deploy.roles.agent import ready_pilot
from rcopterx.deploy.roles.run import end_with_parent, name_process
from rcopterx.fleet.reading import load_fleet

PERIODS: Final = 60
SKIPPED: Final = 20  # first periods, which compute what later ones reuse
PLACE_M: Final = (0.0, 0.0, 1.0)


def control_time_s(
    pilot: Pilot, period_s: float, wait: Callable[[float], None], processor_clock: Callable[[], float]
) -> float:
    """Return the median processor time [s] of a control period in hover; `wait` passes those between."""
    times_s = []
    for frame in range(PERIODS):
        wait(period_s)
        start_s = processor_clock()
        pilot.observe(StampedMeasurement(1, frame, period_s, Measurement(np.array(PLACE_M), 0.0)))
        if frame == 0:
            pilot.note_applied("armed", -1, pilot.model.hover_input)
        command = pilot.control({})
        pilot.note_applied("armed", pilot.sequence, command.input)
        times_s.append(processor_clock() - start_s)
    return statistics.median(times_s[SKIPPED:])


def main() -> int:
    """Print the processor time of a control period [s] of a vehicle of a fleet."""
    end_with_parent()
    name_process("capacity")
    fleet, vehicle = load_fleet(Path(sys.argv[1])), sys.argv[2]
    settings, pilot = ready_pilot(fleet, vehicle)
    # As an agent: take-offs wait for the result, also on a computer that does much else.
    request_realtime(settings.realtime_priority)
    period_s = fleet.vehicles[vehicle].control.period_s
    print(control_time_s(pilot, period_s, time.sleep, time.thread_time))
    return 0


if __name__ == "__main__":
    sys.exit(main())
