"""Processor time of an agent's control period on this computer.

`python -m rcopterx.deploy.hosts.control_time SNAPSHOT VEHICLE` prints it in seconds; see `capacity`.
"""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from rcopterx.agents.pilot import Pilot, StampedMeasurement
from rcopterx.control.interfaces import Measurement
from rcopterx.deploy.processes.background import step_behind_others
from rcopterx.deploy.processes.prepared import fleet_of
from rcopterx.deploy.roles.agent import ready_pilot
from rcopterx.deploy.roles.run import end_with_parent, name_process

PERIODS: Final = 60
SKIPPED: Final = 20
"""Periods in the beginning, in which what is kept for later ones is computed."""
PLACE_M: Final = (0.0, 0.0, 1.0)


def control_time_s(
    pilot: Pilot, period_s: float, wait: Callable[[float], None], processor_clock: Callable[[], float]
) -> float:
    """Median of the processor time of a control period of a vehicle that is held where it should be.

    Parameters
    ----------
    pilot
        New; it sees the vehicle in the air.
    period_s
        Control period.
    wait
        Called before each period with how long to wait: in flight others use the processor in between, and
        their memory is in its caches then.
    processor_clock
        Processor time [s].
    """
    times_s = []
    for frame in range(PERIODS):
        wait(period_s)
        begun_s = processor_clock()
        pilot.observe(StampedMeasurement(1, frame, period_s, Measurement(np.array(PLACE_M), 0.0)))
        if frame == 0:
            pilot.note_applied("armed", -1, pilot.model.hover_input)
        told = pilot.control({})
        pilot.note_applied("armed", pilot.sequence, told.input)
        times_s.append(processor_clock() - begun_s)
    return statistics.median(times_s[SKIPPED:])


def main() -> int:
    """Print the processor time of a control period [s] of a vehicle of a fleet."""
    end_with_parent()
    name_process("capacity")
    step_behind_others()
    fleet, vehicle = fleet_of(Path(sys.argv[1])), sys.argv[2]
    _, pilot = ready_pilot(fleet, vehicle)
    period_s = fleet.vehicles[vehicle].control.period_s
    print(control_time_s(pilot, period_s, time.sleep, time.thread_time))
    return 0


if __name__ == "__main__":
    sys.exit(main())
