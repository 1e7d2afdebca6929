"""Plans as they travel, packed and unpacked by kernels: bit for bit what `TrajectoryArray` does.

An agent does both in every control period, and `TrajectoryArray` makes forty calls of numpy of it. The format
itself, and its reason, are there; other processes have no kernels.
"""

import numpy as np

from rcopterx.bus.messages import Plan
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.native.plans import packed_plan, unpacked_plan
from rcopterx.vehicles.state import Array


def packed(samples: Array, period_s: float) -> TrajectoryArray:
    """`TrajectoryArray.of` finite samples of at least two stages, shape (stages, 12)."""
    layout = TrajectoryArray
    octets, rows = packed_plan(
        samples, layout.units(period_s), layout.scales(period_s), layout.LARGEST, layout.TOLERANCE
    )
    return layout((len(samples), layout.COLUMNS), octets[:rows].tobytes())


def samples_of(plan: Plan) -> Array:
    """`Plan.samples` of a valid plan."""
    layout, period_s = TrajectoryArray, plan.period_s
    trajectory = plan.trajectory
    octets = np.frombuffer(trajectory.data, dtype=np.uint8)
    stages, _ = trajectory.shape
    return unpacked_plan(octets, stages, layout.units(period_s), layout.scales(period_s), layout.LARGEST)
