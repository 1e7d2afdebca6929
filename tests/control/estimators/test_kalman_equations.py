"""The update of the Kalman filter is the best linear estimate, and an impossible covariance is an error."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.control.estimators.kalman import predict_covariance, update


def positive(rng: np.random.Generator, size: int) -> np.ndarray:
    root = rng.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 4))
def test_an_update_weighs_estimate_and_measurement_by_their_information(
    seed: int, size: int, measured: int
) -> None:
    rng = np.random.default_rng(seed)
    x, P, H = rng.normal(size=size), positive(rng, size), rng.normal(size=(measured, size))
    R, z = rng.uniform(0.1, 2.0, measured), rng.normal(size=measured)
    found, covariance = x.copy(), P.copy()
    update(found, covariance, H, R, z, np.full(size, np.inf))
    information = np.linalg.inv(P) + H.T @ np.diag(1.0 / R) @ H
    expected = np.linalg.solve(information, np.linalg.solve(P, x) + H.T @ (z / R))
    np.testing.assert_allclose(found, expected, atol=1e-7)
    np.testing.assert_allclose(covariance @ information, np.eye(size), atol=1e-6)
    assert np.array_equal(covariance, covariance.T)


def test_a_prediction_adds_process_noise_to_the_moved_covariance() -> None:
    F = np.array([[1.0, 0.5], [0.0, 1.0]])
    found = predict_covariance(np.diag([1.0, 4.0]), F, np.diag([0.0, 0.25]))
    np.testing.assert_allclose(found, [[2.0, 2.0], [2.0, 4.25]])


def test_a_covariance_that_is_not_positive_is_an_error() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        update(np.zeros(2), np.diag([-1.0, 1.0]), np.eye(2), np.full(2, 0.01), np.zeros(2), np.ones(2))


def test_an_update_keeps_states_within_their_limits() -> None:
    z, limit = np.array([5.0, -5.0, 5.0]), np.array([1.0, 2.0, np.inf])
    found, unknown = np.zeros(3), np.zeros(3)
    update(found, np.eye(3), np.eye(3), np.ones(3), z, limit)
    np.testing.assert_array_equal(found, [1.0, -2.0, 2.5])
    update(unknown, np.eye(3), np.eye(3), np.ones(3), z * np.nan, limit)
    assert np.isnan(unknown).all()
