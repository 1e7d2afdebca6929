import math

import numpy as np
import pytest
from datastream_strategies import unit_quaternions
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rcopterx.vicon_gateway.frame import Quaternion
from rcopterx.vicon_gateway.rotations import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    y_up_from_z_up,
    z_up_from_y_up,
)


@given(unit_quaternions)
def test_quaternion_comes_back_from_its_matrix(quaternion: Quaternion) -> None:
    found = quaternion_from_matrix(matrix_from_quaternion(quaternion))
    assert found is not None
    assert found[3] >= 0.0
    sign = 1.0 if np.dot(found, quaternion) >= 0.0 else -1.0
    assert np.allclose(sign * np.array(found), quaternion, atol=2e-15, rtol=0.0)


@given(unit_quaternions)
def test_matrix_is_that_of_scipy(quaternion: Quaternion) -> None:
    expected = Rotation.from_quat(quaternion).as_matrix().ravel()
    assert np.allclose(matrix_from_quaternion(quaternion), expected, atol=1e-14)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_half_turns_are_exact(axis: tuple[float, float, float]) -> None:
    found = quaternion_from_matrix(matrix_from_quaternion((*axis, 0.0)))
    assert found is not None
    assert np.allclose(np.abs(found), (*axis, 0.0))


@pytest.mark.parametrize(
    "matrix",
    [
        (0.0,) * 9,
        (math.nan,) * 9,
        (1.0, 0.0, 0.0, 0.0, 1.0, math.nan, 0.0, 0.0, 1.0),
        (math.inf, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        (-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0),
        (2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0),
        (1e308,) * 9,
    ],
)
def test_matrix_that_is_no_rotation_is_refused(matrix: tuple[float, ...]) -> None:
    assert quaternion_from_matrix(matrix) is None


@given(st.tuples(*(st.floats(-1e3, 1e3),) * 3))
def test_axis_conversions_undo_each_other(vector: tuple[float, float, float]) -> None:
    assert z_up_from_y_up(y_up_from_z_up(vector)) == vector
    x, y, z = vector
    assert z_up_from_y_up(vector) == (x, -z, y)
    assert y_up_from_z_up(vector) == (x, z, -y)


@given(unit_quaternions, st.tuples(*(st.floats(-5.0, 5.0),) * 3))
def test_conversion_of_the_vector_part_rotates_converted_vectors(
    quaternion: Quaternion, vector: tuple[float, float, float]
) -> None:
    in_y_up = Rotation.from_quat(quaternion).apply(vector)
    converted = (*z_up_from_y_up(quaternion[:3]), quaternion[3])
    in_z_up = Rotation.from_quat(converted).apply(z_up_from_y_up(vector))
    assert np.allclose(in_z_up, z_up_from_y_up(tuple(in_y_up)), atol=1e-12)
