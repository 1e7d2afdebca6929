"""Prediction and correction of a Kalman filter as kernels, in the usual symbols (docs/formulas.md)."""

import math

import numpy as np

from rcopterx.compiling.compiled import MATRIX, VECTOR, compiled
from rcopterx.vehicles.state import Array


@compiled(MATRIX, MATRIX, MATRIX)
def predict_covariance(P: Array, F: Array, Q: Array) -> Array:
    """Return F P F' + Q."""
    size = len(P)
    FP, predicted = np.zeros((size, size)), Q.copy()
    for i in range(size):
        for m in range(size):
            # Most entries of a transition are zero.
            if F[i, m] != 0.0:
                for j in range(size):
                    FP[i, j] += F[i, m] * P[m, j]
    for i in range(size):
        for j in range(i + 1):
            for m in range(size):
                predicted[i, j] += FP[i, m] * F[j, m]
            predicted[j, i] = predicted[i, j]
    return predicted


@compiled(VECTOR, MATRIX, MATRIX, *3 * [VECTOR])
def update(x: Array, P: Array, H: Array, R: Array, z: Array, limit: Array) -> float:
    """Update state and covariance by measurements z = H x + noise; return their log likelihood.

    The noises are independent, so one measurement after another is used, each with a scalar S = H P H' + R.

    `R` and `z`: variances of the noise, and measured values, shape (m,). `limit`: each state is cut to plus
    and minus this, shape (n,). Raises `numpy.linalg.LinAlgError`: the covariance of the innovation is not
    positive definite.
    """
    size = len(x)
    PH = np.empty(size)
    likelihood = 0.0  # without its constant
    for row in range(len(H)):
        S, innovation = R[row], z[row]
        for i in range(size):
            PH[i] = 0.0
            for j in range(size):
                PH[i] += P[i, j] * H[row, j]
            S += H[row, i] * PH[i]
            innovation -= H[row, i] * x[i]
        if not S > 0.0:
            raise np.linalg.LinAlgError("the covariance of the innovation is not positive definite")
        likelihood -= 0.5 * (math.log(S) + innovation * innovation / S)
        for i in range(size):
            x[i] += PH[i] / S * innovation
            for j in range(i + 1):
                P[i, j] -= PH[i] * PH[j] / S
                P[j, i] = P[i, j]
    for i in range(size):
        x[i] = min(max(x[i], -limit[i]), limit[i])
    return likelihood
