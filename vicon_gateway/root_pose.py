"""Pose of a subject from the numbers of its root segment (Vicon DataStream SDK)."""

from typing import Final

from rcopterx.vicon_gateway.frame import Position, Quaternion
from rcopterx.vicon_gateway.rotations import quaternion_from_matrix, z_up_from_y_up

RootNumbers = tuple[float, ...]
"""Twelve: translation in mm (3), rotation matrix row by row (9)."""

MAX_POSITION_MM: Final = 1e6


def root_pose(root: RootNumbers, y_up: bool) -> tuple[Position, Quaternion] | None:
    """Position in metres and unit quaternion, Z up, of a root segment; None for numbers that are no pose."""
    x, y, z, *matrix = root
    limit = MAX_POSITION_MM
    if not (-limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit):
        return None
    quaternion = quaternion_from_matrix(matrix)
    if quaternion is None:
        return None
    position = (x / 1000.0, y / 1000.0, z / 1000.0)
    if y_up:
        return z_up_from_y_up(position), (*z_up_from_y_up(quaternion[:3]), quaternion[3])
    return position, quaternion
