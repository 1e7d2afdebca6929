"""A sampled feedback loop: plant with transport delay, steady-state Kalman filter, predictor and regulator.

One input. Two horizontal axes whose dynamics prefer no direction are one axis with complex numbers: forward
is real, left is imaginary, and every 2 x 2 block [[a, -b], [b, a]] is the number a + ib.
"""

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.models.linear import Complex
from rcopterx.vehicles.model import Uncertainty
from rcopterx.vehicles.state import Array

Dynamics = tuple[Array, Array]
"""Continuous x' = A x + B u, shapes (n, n) and (n,); real or complex."""

_STABLE: Final = 1.0 - 1e-9
_INSTANT_S: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Perturbation:
    """Departure of a true vehicle from its model."""

    gain: complex = 1.0
    """Factor of the input's gain; a complex one shifts the phase."""
    delay_s: float = 0.0
    """Added to the transport delay."""
    frequency: float = 1.0
    """Factor of the frequency of the tilt, or of the corner frequency of a first-order lag."""


NONE: Final = Perturbation()


@dataclass(frozen=True)
class FeedbackLoop:
    """The loop of one axis, or of both horizontal ones."""

    plant_step: Callable[[float, float], Dynamics]
    """Transition of the vehicle, with n states, given the factor of its frequency and a time."""
    measured: Array
    """Measured outputs of the vehicle's states, shape (p, n)."""
    filter_step: Callable[[float], Dynamics]
    """Transition that the filter assumes, with m states, given a time."""
    filter_measured: Array
    """Measured outputs of the filter's states, shape (p, m)."""
    filter_gain: Array
    """Steady gain of the filter, shape (m, p)."""
    feedback: Array
    """The input is minus these times the estimate, predicted to when the input begins to act; shape (m,)."""
    period_s: float
    """Control period."""
    delay_s: float
    """Transport delay of the model."""

    def stable(self, perturbation: Perturbation = NONE) -> bool:
        """Return whether the loop around a perturbed vehicle is stable."""
        return bool(np.abs(np.linalg.eigvals(self.closed_loop(perturbation))).max() < _STABLE)

    def closed_loop(self, perturbation: Perturbation = NONE) -> Array:
        """Return the transition over a period of the plant, of the inputs under way, and of the estimate."""
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
        innovation = self.measured @ reached - self.filter_measured @ expected
        return np.vstack((reached, acting[:under_way], expected + self.filter_gain @ innovation))

    def _split(self, delay_s: float) -> tuple[int, float]:
        """Whole periods of a delay, and the rest."""
        late = math.floor(delay_s / self.period_s + _INSTANT_S)
        return late, max(0.0, delay_s - late * self.period_s)


def _driven(step: Dynamics, state: Array, value: Array) -> Array:
    """Rows of the state after a step, of the state before it and of the input that acted."""
    return np.asarray(step[0] @ state + np.outer(step[1], value))


def regulator(step: Dynamics, state_weights: Sequence[float], effort: float) -> Array:
    """Return the feedback of the linear-quadratic regulator for a transition, shape (n,)."""
    a, b = step[0], step[1][:, None]
    cost = solve_discrete_are(a, b, np.diag(state_weights), np.array([[effort]]))
    back = b.conj().T @ cost
    row: Array = (back @ a / (effort + back @ b))[0]
    return row


def steady_filter_gain(transition: Array, measured: Array, process: Array | Complex, noise: Array) -> Array:
    """Return the steady gain K of the Kalman filter, shape (m, p).

    `transition` F and `process` Q have shape (m, m), `measured` H has (p, m), the variances `noise` (p,).
    """
    P = solve_discrete_are(transition.conj().T, measured.conj().T, process, np.diag(noise))
    PH = P @ measured.conj().T
    S = measured @ PH + np.diag(noise)
    return np.asarray(np.linalg.solve(S.conj().T, PH.conj().T).conj().T)


GAIN_LIMIT: Final = 10.0
PHASE_LIMIT_RAD: Final = math.pi / 2
DELAY_LIMIT_S: Final = 0.3
FREQUENCY_LIMIT: Final = 3.0
"""Margins are searched up to these limits; a larger one is returned as its limit."""

_COARSE: Final = 16
_FINE: Final = 7


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins of one loop; zero, and one for factors, if it is unstable around its own model."""

    gain_up: float
    gain_down: float
    """Factors by which the gain may rise, and fall (0.5 for half the gain)."""
    phase_rad: float
    """Shift of the phase, the smaller of both senses."""
    delay_s: float
    """Delay beyond the model's."""
    frequency_up: float
    frequency_down: float
    """Factors of the frequency (`Perturbation`)."""


def corners(rule: Uncertainty) -> Mapping[str, Perturbation]:
    """Return the perturbations under which a loop has to be stable, by name, the hardest ones first."""
    fraction = rule.frequency_fraction
    return {
        "gain up": Perturbation(gain=rule.gain_factor),
        "frequency down": Perturbation(frequency=1.0 - fraction),
        "delay": Perturbation(delay_s=rule.delay_s),
        "frequency up": Perturbation(frequency=1.0 + fraction),
        "gain down": Perturbation(gain=1.0 / rule.gain_factor),
    }


def bears(loop: FeedbackLoop, rule: Uncertainty) -> bool:
    """Return whether a loop is stable around its model and under each of the `corners`."""
    return loop.stable() and all(map(loop.stable, corners(rule).values()))


def shortfalls(loop: FeedbackLoop, rule: Uncertainty) -> tuple[str, ...]:
    """Return the names of the `corners` under which a loop is unstable."""
    return tuple(name for name, corner in corners(rule).items() if not loop.stable(corner))


def margins(loop: FeedbackLoop) -> Margins:
    """Return the margins of a loop, each with nothing else perturbed."""

    def reach(perturbed: Callable[[float], Perturbation]) -> float:
        return _reach(lambda share: loop.stable(perturbed(share)))

    def turned(share: float) -> Perturbation:
        return Perturbation(gain=cmath.rect(1.0, share * PHASE_LIMIT_RAD))

    phase = min(reach(turned), reach(lambda share: turned(-share)))
    return Margins(
        gain_up=GAIN_LIMIT ** reach(lambda share: Perturbation(gain=GAIN_LIMIT**share)),
        gain_down=GAIN_LIMIT ** -reach(lambda share: Perturbation(gain=GAIN_LIMIT**-share)),
        phase_rad=phase * PHASE_LIMIT_RAD,
        delay_s=DELAY_LIMIT_S * reach(lambda share: Perturbation(delay_s=share * DELAY_LIMIT_S)),
        frequency_up=FREQUENCY_LIMIT ** reach(lambda share: Perturbation(frequency=FREQUENCY_LIMIT**share)),
        frequency_down=FREQUENCY_LIMIT
        ** -reach(lambda share: Perturbation(frequency=FREQUENCY_LIMIT**-share)),
    )


def _reach(stable: Callable[[float], bool]) -> float:
    """Return the largest share of a limit up to which a loop is stable."""
    if not stable(0.0):
        return 0.0
    for step in range(1, _COARSE + 1):
        if not stable(step / _COARSE):
            low, high = (step - 1) / _COARSE, step / _COARSE
            for _ in range(_FINE):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if stable(middle) else (low, middle)
            return low
    return 1.0
