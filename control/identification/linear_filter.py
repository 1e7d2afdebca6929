"""Stationary Kalman predictor of a linear system over a whole flight at once.

The horizontal motion of a vehicle is isotropic (`rcopterx.vehicles.tilt`), so that the two components of
every vector become one complex number, x + i y. Height and heading are real systems.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.signal import lfilter

from rcopterx.control.models.linear import Complex, zero_order_hold
from rcopterx.vehicles.state import Array


@dataclass(frozen=True)
class LinearSystem:
    """Continuous system with one input, dx/dt = A x + B u, measured as y = C x.

    A, B and C have shapes (n, n), (n,) and (m, n); `process_variance`, shape (n,), is the squared density
    of the process noise, `measurement_variance` has shape (m,).
    """

    a: Complex
    b: Complex
    c: Complex
    process_variance: Array
    measurement_variance: Array


class StationaryPredictor:
    """Kalman predictor with the stationary gain.

    The input of a sample acts `delay_s` later, which need not be a whole number of periods.
    """

    def __init__(self, system: LinearSystem, period_s: float, delay_s: float) -> None:
        self.period_s = period_s
        self._whole_periods = int(delay_s / period_s)
        late_s = delay_s - self._whole_periods * period_s
        self._a, _ = zero_order_hold(system.a, system.b, period_s)
        self._c = system.c
        rest, self._newest = zero_order_hold(system.a, system.b, period_s - late_s)
        self._older = rest @ zero_order_hold(system.a, system.b, late_s)[1]
        process = period_s * np.diag(system.process_variance).astype(complex)
        noise = np.diag(system.measurement_variance).astype(complex)
        covariance = solve_discrete_are(self._a.conj().T, system.c.conj().T, process, noise)
        seen = covariance @ system.c.conj().T
        self._gain = seen @ np.linalg.inv(system.c @ seen + noise)

    def states(self, inputs: Complex, measured: Complex) -> Complex:
        """Return states predicted one period ahead, (K, n), for inputs (K,) and measurements (K, m)."""
        start = np.linalg.lstsq(self._c, measured[0], rcond=None)[0]
        correction = self._a @ self._gain
        driven = self._push(inputs) + measured @ correction.T
        # In its own modes the predictor is a handful of scalar recursions.
        values, vectors = np.linalg.eig(self._a - correction @ self._c)
        back = np.linalg.inv(vectors)
        modes, begun = (driven @ back.T).T, back @ start
        for mode, value in enumerate(values):
            modes[mode], _ = lfilter([0.0, 1.0], [1.0, -value], modes[mode], zi=[begun[mode]])
        return np.asarray(modes.T @ vectors.T)

    def innovations(self, inputs: Complex, measured: Complex) -> Complex:
        """Return measured minus predicted outputs, shape (K, m)."""
        return measured - self.states(inputs, measured) @ self._c.T

    def ahead(self, inputs: Complex, measured: Complex, periods: int) -> Complex:
        """Return outputs predicted `periods` ahead with the recorded inputs, shape (K - periods, m)."""
        states = self.states(inputs, measured)
        states = states + (measured - states @ self._c.T) @ self._gain.T
        push, count = self._push(inputs), len(inputs) - periods
        states = states[:count]
        for step in range(periods):
            states = states @ self._a.T + push[step : step + count]
        return np.asarray(states @ self._c.T)

    def _push(self, inputs: Complex) -> Complex:
        """Contribution of the inputs to the state in every period, shape (K, n)."""
        before = np.full(self._whole_periods + 1, inputs[0])
        delayed = np.concatenate((before, inputs))
        count = len(inputs)
        return np.outer(delayed[1 : count + 1], self._newest) + np.outer(delayed[:count], self._older)
