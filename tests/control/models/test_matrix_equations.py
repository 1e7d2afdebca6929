"""Matrix exponential and Riccati equation, against scipy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm, solve_discrete_are

from rcopterx.control.models.matrix_equations import Matrix, matrix_exponential, riccati_solution

seeds = st.integers(0, 2**32 - 1)


def random_matrix(rng: np.random.Generator, shape: tuple[int, int], is_complex: bool) -> Matrix:
    real = rng.normal(size=shape)
    return real + 1j * rng.normal(size=shape) if is_complex else real


@given(seed=seeds, size=st.integers(1, 24), exponent=st.floats(-6.0, 1.0), is_complex=st.booleans())
def test_exponential_is_that_of_scipy(seed: int, size: int, exponent: float, is_complex: bool) -> None:
    matrix = 10.0**exponent * random_matrix(np.random.default_rng(seed), (size, size), is_complex)
    expected = expm(matrix)
    np.testing.assert_allclose(matrix_exponential(matrix), expected, atol=1e-11 * np.abs(expected).max())


def test_exponential_of_nothing_is_the_unit_matrix() -> None:
    assert np.array_equal(matrix_exponential(np.zeros((4, 4))), np.eye(4))


def test_exponential_of_integrators_is_exact() -> None:
    np.testing.assert_array_equal(
        matrix_exponential(np.array([[0.0, 0.5], [0.0, 0.0]])), [[1.0, 0.5], [0.0, 1.0]]
    )


@given(seed=seeds, size=st.integers(1, 12), inputs=st.integers(1, 3), is_complex=st.booleans())
def test_riccati_solution_is_that_of_scipy(seed: int, size: int, inputs: int, is_complex: bool) -> None:
    rng = np.random.default_rng(seed)
    a = random_matrix(rng, (size, size), is_complex)
    a /= np.abs(np.linalg.eigvals(a)).max()
    b = random_matrix(rng, (size, inputs), is_complex)
    q, r = np.diag(10.0 ** rng.uniform(-2, 2, size)), np.diag(10.0 ** rng.uniform(-2, 2, inputs))
    expected = solve_discrete_are(a, b, q, r)
    solution = riccati_solution(a, b, q, r)
    np.testing.assert_allclose(solution, expected, atol=1e-8 * np.abs(expected).max())
    assert np.array_equal(solution, solution.conj().T)


@given(seed=seeds, size=st.integers(1, 8))
def test_riccati_feedback_stabilizes_what_grows(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(size, size))
    a *= 1.1 / np.abs(np.linalg.eigvals(a)).max()
    b = np.eye(size)[:, : max(1, size - 1)] + 0.1 * rng.normal(size=(size, max(1, size - 1)))
    cost = riccati_solution(a, b, np.eye(size), np.eye(b.shape[1]))
    feedback = np.linalg.solve(np.eye(b.shape[1]) + b.T @ cost @ b, b.T @ cost @ a)
    assert np.abs(np.linalg.eigvals(a - b @ feedback)).max() < 1.0


def test_a_state_that_costs_nothing_and_stays_has_no_cost() -> None:
    solution = riccati_solution(np.eye(2), np.array([[1.0], [0.0]]), np.diag([1.0, 0.0]), np.eye(1))
    assert solution[0, 0] == pytest.approx((1.0 + 5.0**0.5) / 2.0)
    assert not solution[1].any()


@pytest.mark.parametrize("growth", [1.0, 1.5])
def test_a_cost_without_end_is_told(growth: float) -> None:
    with pytest.raises(np.linalg.LinAlgError, match="no end"):
        riccati_solution(growth * np.eye(2), np.array([[1.0], [0.0]]), np.eye(2), np.eye(1))
