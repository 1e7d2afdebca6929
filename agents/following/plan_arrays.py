"""Plans as they travel, packed and unpacked by kernels: bit for bit what `TrajectoryArray` does.

An agent does both in every control period, and `TrajectoryArray` makes forty calls of numpy of it. The format
itself, and its reason, are there; other processes have no kernels.
"""

from functools import lru_cache
from typing import Final

import numpy as np

from rcopterx.bus.messages import Plan
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.native.plans import packed_plan, unpacked_plan
from rcopterx.vehicles.state import Array

_LARGEST: Final = TrajectoryArray.LARGEST


def packed(samples: Array, period_s: float) -> TrajectoryArray:
    """`TrajectoryArray.of` finite samples of at least two stages, shape (stages, 12)."""
    stages, columns = samples.shape
    octets = np.empty((4, stages * columns), np.uint8)
    rows = packed_plan(samples, _layout(period_s), _LARGEST, TrajectoryArray.TOLERANCE, octets)
    return TrajectoryArray((stages, columns), octets[:rows].tobytes())


def samples_of(plan: Plan) -> Array:
    """`Plan.samples` of a valid plan."""
    trajectory = plan.trajectory
    samples: Array = np.empty(trajectory.shape)
    unpacked_plan(np.frombuffer(trajectory.data, np.uint8), _layout(plan.period_s), _LARGEST, samples)
    return samples


@lru_cache(maxsize=64)
def _layout(period_s: float) -> Array:
    """Units and scales, as the kernels take them."""
    return np.vstack((TrajectoryArray.units(period_s), TrajectoryArray.scales(period_s)))
