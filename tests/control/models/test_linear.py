"""Promises of the zero-order hold, with real and with complex numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.control.models.linear import as_complex, noise_over, zero_order_hold

A = np.array([[0.0, 1.0, 0.0], [-4.0, -0.3, 2.0], [0.0, 0.0, -5.0]])
B = np.array([0.0, 0.5, 5.0])


@given(st.floats(0.001, 0.5), st.floats(0.0, 1.0))
def test_two_parts_of_a_time_are_the_whole(time_s: float, share: float) -> None:
    whole, pushed = zero_order_hold(A, B, time_s)
    first, second = zero_order_hold(A, B, share * time_s), zero_order_hold(A, B, (1.0 - share) * time_s)
    assert second[0] @ first[0] == pytest.approx(whole, abs=1e-9)
    assert second[0] @ first[1] + second[1] == pytest.approx(pushed, abs=1e-9)


def test_several_inputs_are_held_as_one_by_one() -> None:
    inputs = np.column_stack((B, 2.0 * B[::-1]))
    transition, pushed = zero_order_hold(A, inputs, 0.02)
    assert transition == pytest.approx(zero_order_hold(A, B, 0.02)[0])
    for column in range(2):
        assert pushed[:, column] == pytest.approx(zero_order_hold(A, inputs[:, column], 0.02)[1])


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_maps_that_commute_with_rotations_are_complex_numbers(real: float, imaginary: float) -> None:
    plane = np.kron(A, np.array([[real, -imaginary], [imaginary, real]]))
    assert as_complex(plane) == pytest.approx(complex(real, imaginary) * A)
    inputs = np.kron(B[:, None], np.eye(2))
    transition, pushed = zero_order_hold(plane, inputs, 0.02)
    of_complex = zero_order_hold(as_complex(plane), as_complex(inputs)[:, 0], 0.02)
    assert as_complex(transition) == pytest.approx(of_complex[0], abs=1e-9)
    assert as_complex(pushed)[:, 0] == pytest.approx(of_complex[1], abs=1e-9)


@given(st.floats(0.05, 2.0), st.floats(0.1, 3.0), st.floats(0.001, 0.5), st.floats(0.001, 0.5))
def test_noise_adds_up_over_times_and_is_that_of_a_coloured_noise(
    correlation_s: float, rms: float, first_s: float, second_s: float
) -> None:
    a = np.array([[0.0, 1.0], [0.0, -1.0 / correlation_s]])
    density = np.array([0.0, 2.0 * rms**2 / correlation_s])
    later = zero_order_hold(a, np.zeros(2), second_s)[0]
    together = later @ noise_over(a, density, first_s) @ later.T + noise_over(a, density, second_s)
    assert noise_over(a, density, first_s + second_s) == pytest.approx(together, rel=1e-6, abs=1e-9)
    stationary = rms**2 * -np.expm1(-2.0 * first_s / correlation_s)
    assert noise_over(a, density, first_s)[1, 1] == pytest.approx(stationary, rel=1e-6)
