"""Columns of the samples of a trajectory."""

from typing import Final

POSITION: Final = slice(0, 3)
YAW: Final = 3
X_RATE: Final = 4  # those of y, z and yaw follow
VELOCITY: Final = slice(4, 7)
YAW_RATE: Final = 7
X_ACCELERATION: Final = 8
ACCELERATION: Final = slice(8, 11)
YAW_ACCELERATION: Final = 11
COLUMNS: Final = 12
POSE: Final = slice(0, X_RATE)  # x, y, z and yaw
RATES: Final = slice(X_RATE, X_ACCELERATION)
ACCELERATIONS: Final = slice(X_ACCELERATION, COLUMNS)
