"""Rotations as they appear in the DataStream protocol, and poses of root segments."""

import math
from collections.abc import Sequence
from typing import Final

from rcopterx.vicon_gateway.frame import Position, Quaternion
from rcopterx.vicon_gateway.objects import Matrix3, Segment

NORM_TOLERANCE = 1e-3  # a matrix whose quaternion's squared norm is further from one is not a rotation


def quaternion_from_matrix(matrix: Sequence[float]) -> Quaternion | None:
    """Convert a row-major rotation matrix to x, y, z, w >= 0 (Shepperd's method); None if it is none."""
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = matrix
    trace = m00 + m11 + m22
    # The divisor must be one of the larger components, so that nothing is lost to cancellation.
    if trace > 0.0:
        root = 1.0 + trace
        x, y, z, w = m21 - m12, m02 - m20, m10 - m01, root
    elif m00 >= m11 and m00 >= m22:
        root = 1.0 + m00 - m11 - m22
        x, y, z, w = root, m01 + m10, m02 + m20, m21 - m12
    elif m11 >= m22:
        root = 1.0 + m11 - m00 - m22
        x, y, z, w = m01 + m10, root, m12 + m21, m02 - m20
    else:
        root = 1.0 + m22 - m00 - m11
        x, y, z, w = m02 + m20, m12 + m21, root, m10 - m01
    # For a rotation the components so far are 2 sqrt(root) times the quaternion.
    squared = x * x + y * y + z * z + w * w
    expected = 4.0 * root
    if not (root > 0.0 and abs(squared - expected) <= NORM_TOLERANCE * expected):
        return None
    scale = 1.0 / math.sqrt(squared)
    if w < 0.0:
        scale = -scale
    return x * scale, y * scale, z * scale, w * scale


def matrix_from_quaternion(quaternion: Quaternion) -> Matrix3:
    """Convert a unit quaternion x, y, z, w to the row-major rotation matrix."""
    x, y, z, w = quaternion
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        2.0 * (x * y + z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        1.0 - 2.0 * (x * x + y * y),
    )


def z_up_from_y_up(vector: Position) -> Position:
    """Convert a vector, or a quaternion's vector part, from a Y-up world to Z up."""
    x, y, z = vector
    return x, -z, y


def y_up_from_z_up(vector: Position) -> Position:
    """Convert a vector, or a quaternion's vector part, from a Z-up world to Y up."""
    x, y, z = vector
    return x, z, -y


MAX_POSITION_MM: Final = 1e8
"""Far beyond any room also for a stream in other units, so that the gateway can report them."""


def root_pose(root: Segment, y_up: bool) -> tuple[Position, Quaternion] | None:
    """Position in metres and unit quaternion, Z up, of a root segment; None for numbers that are no pose."""
    x, y, z = root.translation_mm
    limit = MAX_POSITION_MM
    if not (-limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit):
        return None
    quaternion = quaternion_from_matrix(root.rotation)
    if quaternion is None:
        return None
    position = (x / 1000.0, y / 1000.0, z / 1000.0)
    if y_up:
        return z_up_from_y_up(position), (*z_up_from_y_up(quaternion[:3]), quaternion[3])
    return position, quaternion
