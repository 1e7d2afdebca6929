"""The kernel that packs a trajectory; see `rcopterx.bus.trajectory_array`."""

import numpy as np

from rcopterx.compiling.compiled import ANY_MATRIX, MATRIX, NUMBER, VECTOR, Array, compiled


@compiled(ANY_MATRIX, VECTOR, NUMBER, VECTOR, VECTOR, MATRIX)
def pack(samples: Array, resolution: Array, most: float, offset: Array, scale: Array, counts: Array) -> None:
    """Write offset and scale of each column, and its counts of at most `most`, shape (columns, stages)."""
    stages, columns = samples.shape
    for column in range(columns):
        unit = resolution[column]
        start = np.rint(samples[0, column] / unit) * unit
        reach = 0.0
        for stage in range(stages):
            reach = max(reach, abs(samples[stage, column] - start))
        unit = max(unit, reach / most)
        offset[column], scale[column] = start, unit
        for stage in range(stages):
            counts[column, stage] = np.rint((samples[stage, column] - start) / unit)
