"""The equations of the Kalman filter, in the usual symbols."""

import numpy as np

from rcopterx.compiling.compiled import MATRIX, VECTOR, compiled
from rcopterx.vehicles.state import Array


@compiled(MATRIX, MATRIX, MATRIX)
def predict_covariance(P: Array, F: Array, Q: Array) -> Array:
    """Return F P F' + Q."""
    predicted = F @ P @ F.T + Q
    return 0.5 * (predicted + predicted.T)


@compiled(VECTOR, MATRIX, MATRIX, VECTOR, VECTOR)
def update(x: Array, P: Array, H: Array, R: Array, innovation: Array) -> tuple[Array, Array]:
    """Return state and covariance after a measurement z = H x + noise.

    Parameters
    ----------
    R
        Variances of the noise, shape (m,).
    innovation
        Measured minus expected, z - H x, shape (m,).

    Raises
    ------
    numpy.linalg.LinAlgError
        The covariance of the innovation is not positive definite.
    """
    S = H @ P @ H.T + np.diag(R)
    np.linalg.cholesky(S)  # checks that it is positive definite
    K = np.ascontiguousarray(np.linalg.solve(S, H @ P).T)
    # Joseph's form: the covariance stays positive whatever the rounding.
    rest = np.eye(len(x)) - K @ H
    P = rest @ P @ rest.T + (K * R) @ K.T
    return x + K @ innovation, 0.5 * (P + P.T)
