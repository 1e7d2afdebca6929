"""The predictor over a whole flight is the Kalman filter step by step, in its steady state."""

import numpy as np

from rcopterx.control.identification.motions import LinearSystem, Motion


def oscillator(inputs: np.ndarray, measured: np.ndarray, delay_s: float = 0.0) -> Motion:
    a = np.array([[0.0, 1.0], [-9.0, -0.6 + 0.2j]])
    system = LinearSystem(
        a, np.array([0.0, 2.0 + 1.0j]), np.eye(1, 2, dtype=complex), np.array([0.0, 0.1]), np.array([1e-6])
    )
    return Motion(system, 0.02, delay_s, inputs, measured)


def sine(rows: int = 400) -> np.ndarray:
    return np.exp(0.1j * np.arange(rows)) * np.linspace(0.0, 1.0, rows)


def answer(inputs: np.ndarray, delay_s: float = 0.0) -> np.ndarray:
    """Output of the undisturbed system from rest on: a prediction over the whole flight."""
    rest = np.zeros((len(inputs), 1), complex)
    ends = range(1, len(inputs) + 1)
    return np.array([oscillator(inputs[:end], rest[:end], delay_s).ahead(end - 1)[0] for end in ends])


def test_undisturbed_measurements_leave_no_innovations_once_settled() -> None:
    inputs = sine()
    assert oscillator(inputs, np.zeros((400, 1), complex)).ahead(0).shape == (400, 1)
    measured = answer(inputs)
    motion = oscillator(inputs, measured)
    assert np.abs(motion.innovations()[200:]).max() < 1e-9
    assert np.abs(motion.ahead(25)[200:] - measured[225:]).max() < 1e-9


def step_answer(delay_s: float) -> np.ndarray:
    inputs = np.zeros(60, complex)
    inputs[10:] = 1.0
    return np.abs(answer(inputs, delay_s)[:, 0])


def test_a_delay_of_whole_periods_shifts_the_answer() -> None:
    prompt = step_answer(0.0)
    for periods in (1, 3):
        assert np.allclose(step_answer(0.02 * periods)[periods:], prompt[:-periods], atol=1e-12)


def test_fractions_of_a_period_lie_between_whole_ones() -> None:
    early, half, late = (step_answer(delay_s)[12] for delay_s in (0.0, 0.01, 0.02))
    assert late < half < early
