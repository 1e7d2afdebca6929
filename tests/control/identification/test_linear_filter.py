"""The predictor over a whole flight is the Kalman filter step by step, in its steady state."""

import numpy as np

from rcopterx.control.identification.motions import LinearSystem, StationaryPredictor


def oscillator(delay_s: float = 0.0) -> StationaryPredictor:
    a = np.array([[0.0, 1.0], [-9.0, -0.6 + 0.2j]])
    system = LinearSystem(
        a, np.array([0.0, 2.0 + 1.0j]), np.eye(1, 2, dtype=complex), np.array([0.0, 0.1]), np.array([1e-6])
    )
    return StationaryPredictor(system, 0.02, delay_s)


def sine(rows: int = 400) -> np.ndarray:
    return np.exp(0.1j * np.arange(rows)) * np.linspace(0.0, 1.0, rows)


def answer(predictor: StationaryPredictor, inputs: np.ndarray) -> np.ndarray:
    """Output of the undisturbed system from rest on: a prediction over the whole flight."""
    rest = np.zeros((len(inputs), 1), complex)
    ends = range(1, len(inputs) + 1)
    return np.array([predictor.ahead(inputs[:end], rest[:end], end - 1)[0] for end in ends])


def test_undisturbed_measurements_leave_no_innovations_once_settled() -> None:
    predictor, inputs = oscillator(), sine()
    assert predictor.ahead(inputs, np.zeros((400, 1), complex), 0).shape == (400, 1)
    measured = answer(predictor, inputs)
    assert np.abs(predictor.innovations(inputs, measured)[200:]).max() < 1e-9
    assert np.abs(predictor.ahead(inputs, measured, 25)[200:] - measured[225:]).max() < 1e-9


def step_answer(delay_s: float) -> np.ndarray:
    inputs = np.zeros(60, complex)
    inputs[10:] = 1.0
    return np.abs(answer(oscillator(delay_s), inputs)[:, 0])


def test_a_delay_of_whole_periods_shifts_the_answer() -> None:
    prompt = step_answer(0.0)
    for periods in (1, 3):
        assert np.allclose(step_answer(0.02 * periods)[periods:], prompt[:-periods], atol=1e-12)


def test_fractions_of_a_period_lie_between_whole_ones() -> None:
    early, half, late = (step_answer(delay_s)[12] for delay_s in (0.0, 0.01, 0.02))
    assert late < half < early
