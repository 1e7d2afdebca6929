"""A sampled feedback loop: plant with transport delay, steady-state Kalman filter, predictor and regulator.

One input. Two horizontal axes whose dynamics prefer no direction are one axis with complex numbers: forward
is real, left is imaginary, and every 2 x 2 block [[a, -b], [b, a]] is the number a + ib.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.models.linear import Complex
from rcopterx.vehicles.state import Array

Dynamics = tuple[Array, Array]
"""Continuous x' = A x + B u, shapes (n, n) and (n,); real or complex."""

_STABLE: Final = 1.0 - 1e-9
_INSTANT_S: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Perturbation:
    """How a true vehicle departs from its model.

    Attributes
    ----------
    gain
        Factor of the input's gain; a complex one shifts the phase.
    delay_s
        Added to the transport delay.
    frequency
        Factor of the frequency of the tilt, or of the corner frequency of a first-order lag.
    """

    gain: complex = 1.0
    delay_s: float = 0.0
    frequency: float = 1.0


NONE: Final = Perturbation()


@dataclass(frozen=True)
class FeedbackLoop:
    """The loop of one axis, or of both horizontal ones.

    Attributes
    ----------
    plant_step
        Transition of the vehicle, with n states, given the factor of its frequency and a time.
    measured
        What is measured of them, shape (p, n).
    filter_step
        Transition that the filter assumes, with m states, given a time.
    filter_measured
        What it expects to be measured, shape (p, m).
    filter_gain
        Its steady gain, shape (m, p).
    feedback
        The input is minus these times the estimate, predicted to when the input begins to act; shape (m,).
    period_s, delay_s
        Control period, and transport delay of the model.
    """

    plant_step: Callable[[float, float], Dynamics]
    measured: Array
    filter_step: Callable[[float], Dynamics]
    filter_measured: Array
    filter_gain: Array
    feedback: Array
    period_s: float
    delay_s: float

    def stable(self, perturbation: Perturbation = NONE) -> bool:
        """Whether the loop around a perturbed vehicle is stable."""
        return bool(np.abs(np.linalg.eigvals(self.closed_loop(perturbation))).max() < _STABLE)

    def closed_loop(self, perturbation: Perturbation = NONE) -> Array:
        """Transition over a period of the plant, of the inputs under way, and of the estimate."""
        late, part_s = self._split(self.delay_s + perturbation.delay_s)
        assumed_late, assumed_part_s = self._split(self.delay_s)
        under_way = max(late, assumed_late) + 1
        states = self.measured.shape[1]
        size = states + under_way + len(self.feedback)
        rows = np.eye(size, dtype=np.result_type(self.feedback, perturbation.gain))
        past = list(rows[states : states + under_way])
        estimate = rows[states + under_way :]
        first, second = (
            self.filter_step(time_s) for time_s in (assumed_part_s, self.period_s - assumed_part_s)
        )
        ahead = _driven(first, estimate, past[assumed_late])
        for value in past[:assumed_late][::-1]:
            ahead = _driven(self.filter_step(self.period_s), ahead, value)
        acting = [-(self.feedback @ ahead), *past]
        pushing = [perturbation.gain * value for value in acting]
        frequency = perturbation.frequency
        reached = _driven(self.plant_step(frequency, part_s), rows[:states], pushing[late + 1])
        reached = _driven(self.plant_step(frequency, self.period_s - part_s), reached, pushing[late])
        expected = _driven(first, estimate, acting[assumed_late + 1])
        expected = _driven(second, expected, acting[assumed_late])
        surprise = self.measured @ reached - self.filter_measured @ expected
        return np.vstack((reached, acting[:under_way], expected + self.filter_gain @ surprise))

    def _split(self, delay_s: float) -> tuple[int, float]:
        """Whole periods of a delay, and the rest."""
        late = math.floor(delay_s / self.period_s + _INSTANT_S)
        return late, max(0.0, delay_s - late * self.period_s)


def _driven(step: Dynamics, state: Array, value: Array) -> Array:
    """Rows of the state after a step, of the state before it and of the input that acted."""
    return np.asarray(step[0] @ state + np.outer(step[1], value))


def regulator(step: Dynamics, state_weights: Sequence[float], effort: float) -> Array:
    """Feedback of the linear-quadratic regulator for a transition, shape (n,)."""
    a, b = step[0], step[1][:, None]
    cost = solve_discrete_are(a, b, np.diag(state_weights), np.array([[effort]]))
    back = b.conj().T @ cost
    row: Array = (back @ a / (effort + back @ b))[0]
    return row


def steady_filter_gain(transition: Array, measured: Array, process: Array | Complex, noise: Array) -> Array:
    """Steady gain of the Kalman filter.

    Parameters
    ----------
    transition
        Of the states over a period, shape (m, m).
    measured
        Shape (p, m).
    process
        Covariance that a period adds, shape (m, m).
    noise
        Variances of what is measured, shape (p,).

    Returns
    -------
    Array
        Shape (m, p).
    """
    spread = solve_discrete_are(transition.conj().T, measured.conj().T, process, np.diag(noise))
    cross = spread @ measured.conj().T
    innovation = measured @ cross + np.diag(noise)
    return np.asarray(np.linalg.solve(innovation.conj().T, cross.conj().T).conj().T)
