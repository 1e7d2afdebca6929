"""The predictor over a whole flight is the Kalman filter step by step, in its steady state."""

import numpy as np
import pytest

from rcopterx.control.identification.linear_filter import LinearSystem, StationaryPredictor


def oscillator(delay_s: float = 0.0) -> StationaryPredictor:
    a = np.array([[0.0, 1.0], [-9.0, -0.6 + 0.2j]])
    system = LinearSystem(
        a, np.array([0.0, 2.0 + 1.0j]), np.eye(1, 2, dtype=complex), np.array([0.0, 0.1]), np.array([1e-6])
    )
    return StationaryPredictor(system, 0.02, delay_s)


def sine(rows: int = 400) -> np.ndarray:
    return np.exp(0.1j * np.arange(rows)) * np.linspace(0.0, 1.0, rows)


def test_undisturbed_measurements_leave_no_innovations_once_settled() -> None:
    predictor, inputs = oscillator(), sine()
    free = predictor.ahead(inputs, np.zeros((400, 1), complex), 0)
    assert free.shape == (400, 1)
    state, measured = np.zeros(2, complex), np.zeros((400, 1), complex)
    push = predictor._push(inputs)
    for row in range(400):
        measured[row, 0] = state[0]
        state = predictor._a @ state + push[row]
    assert np.abs(predictor.innovations(inputs, measured)[200:]).max() < 1e-9
    assert np.abs(predictor.ahead(inputs, measured, 25)[200:] - measured[225:]).max() < 1e-9


@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.05])
def test_a_delay_shifts_what_inputs_do(delay_s: float) -> None:
    inputs = np.zeros(100, complex)
    inputs[10:] = 1.0
    push = np.abs(oscillator(delay_s)._push(inputs))
    first = int(np.flatnonzero(push.any(axis=1))[0])
    assert first == 10 + int(delay_s / 0.02)
    assert push[first].sum() <= push[-1].sum() + 1e-12


def test_fractions_of_a_period_lie_between_whole_ones() -> None:
    inputs = np.zeros(100, complex)
    inputs[10:] = 1.0
    early, half, late = (np.abs(oscillator(delay)._push(inputs)[10, 1]) for delay in (0.0, 0.01, 0.02))
    assert late < half < early
