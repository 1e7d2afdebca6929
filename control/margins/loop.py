"""A sampled feedback loop: plant with transport delay, steady-state Kalman filter, predictor and regulator.

One input. Two horizontal axes whose dynamics prefer no direction are one axis with complex numbers: forward
is real, left is imaginary, and every 2 x 2 block [[a, -b], [b, a]] is the number a + ib.
"""

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.vehicles.model import Departures
from rcopterx.vehicles.state import Array

Dynamics = tuple[Array, Array]  # continuous x' = A x + B u, shapes (n, n) and (n,); real or complex
Flags = NDArray[np.bool_]

SENSITIVITY_LIMIT: Final = 2.0  # largest allowed M_s, for margins of 2 in gain and 29 degrees in phase
CORNER_SENSITIVITY_LIMIT: Final = 5.0  # the same at the corners of the uncertainty

_STABLE: Final = 1.0 - 1e-9
_INSTANT_S: Final = 1e-9
_LOWEST_HZ: Final = 0.02
_FREQUENCIES: Final = 300


@dataclass(frozen=True, slots=True)
class Perturbation:
    """Departure of a true vehicle from its model."""

    gain: complex = 1.0  # factor of the input's gain; a complex one shifts the phase
    delay_s: float = 0.0  # added to the transport delay
    frequency: float = 1.0  # factor of the frequency of the tilt, or of a lag's corner frequency
    damping: float | None = None  # damping ratio of the tilt; None for the nearest possible to the model's


NONE: Final = Perturbation()


@dataclass(frozen=True)
class FeedbackLoop:
    """The loop of one axis, or of both horizontal ones."""

    plant_step: Callable[[float, float | None, float], Dynamics]
    """Transition of the vehicle, with n states, given the factor of its frequency, its damping ratio
    (`Perturbation`) and a time."""
    measured: Array  # measured outputs of the vehicle's states, shape (p, n)
    filter_step: Callable[[float], Dynamics]  # transition that the filter assumes, with m states, in a time
    filter_measured: Array  # measured outputs of the filter's states, shape (p, m)
    filter_gain: Array  # steady gain of the filter, shape (m, p)
    feedback: Array  # of the estimate, predicted to when the input acts, on minus the input; shape (m,)
    period_s: float  # control period
    delay_s: float  # transport delay of the model
    rule: Departures  # how far the vehicle may be from its model
    dampings: Sequence[float | None] = (None,)  # damping ratios at the ends of what is possible
    measured_tilt: bool = True  # whether the filter uses the tilt, where there is one

    @property
    def corner_limit(self) -> float:
        """Largest allowed M_s at the joint corners of the rule; infinite where they only need to be stable.

        These are fitted models, whose damping is known, and loops without the tilt: what bounds M_s there
        flies several times as far off.
        """
        bounded = self.measured_tilt and not self.rule.identified
        return CORNER_SENSITIVITY_LIMIT if bounded else math.inf

    def stable(self, perturbation: Perturbation = NONE) -> bool:
        """Return whether the loop around a perturbed vehicle is stable."""
        return bool(self.all_stable((perturbation,))[0])

    def all_stable(self, perturbations: Sequence[Perturbation]) -> Flags:
        """Return whether the loop is stable around each of some perturbed vehicles, shape (k,)."""
        poles = np.linalg.eigvals(self.closed_loops(perturbations))
        return np.asarray(np.abs(poles).max(axis=1) < _STABLE)

    def peak_sensitivities(self, perturbations: Sequence[Perturbation] = (NONE,)) -> Array:
        """Return M_s around each of some perturbed vehicles, shape (k,); infinite where unstable.

        It is the peak of the sensitivity |1 / (1 + L)| over all frequencies, one over the least distance of
        the loop's frequency response L from the critical point. With the poles of the loop, closed and open,
        1 + L is the ratio of their characteristic polynomials.
        """
        angles = np.geomspace(_LOWEST_HZ * self.period_s, 0.5, _FREQUENCIES) * math.tau
        z = np.exp(1j * np.concatenate((-angles, angles)))[:, None]
        plants = list(dict.fromkeys(replace(each, gain=0.0, delay_s=0.0) for each in perturbations))
        open_ = np.linalg.eigvals(self.closed_loops(plants))
        peaks = []
        for perturbation, closed in zip(
            perturbations, np.linalg.eigvals(self.closed_loops(perturbations)), strict=True
        ):
            poles = open_[plants.index(replace(perturbation, gain=0.0, delay_s=0.0))]
            above, below = (np.abs(z - each).prod(axis=1) for each in (poles, closed))
            stable = np.abs(closed).max() < _STABLE
            peaks.append(float((above / below).max()) if stable else math.inf)
        return np.array(peaks)

    def closed_loops(self, perturbations: Sequence[Perturbation]) -> Array:
        """Return the transitions over a period of plant, inputs under way and estimate, shape (k, s, s)."""
        delays = [self._split(self.delay_s + perturbation.delay_s) for perturbation in perturbations]
        assumed_late, assumed_part_s = self._split(self.delay_s)
        under_way = max(assumed_late, *(late for late, _ in delays)) + 1
        states = self.measured.shape[1]
        size = states + under_way + len(self.feedback)
        rows = np.eye(size, dtype=np.result_type(self.feedback, self.filter_gain, complex))
        past = list(rows[states : states + under_way])
        first, second = (
            self.filter_step(time_s) for time_s in (assumed_part_s, self.period_s - assumed_part_s)
        )
        ahead = _driven(first, rows[states + under_way :], past[assumed_late])
        for value in past[:assumed_late][::-1]:
            ahead = _driven(self.filter_step(self.period_s), ahead, value)
        acting = [-(self.feedback @ ahead), *past]
        expected = _driven(first, rows[states + under_way :], acting[assumed_late + 1])
        expected = _driven(second, expected, acting[assumed_late])
        estimate = expected - self.filter_gain @ (self.filter_measured @ expected)
        loops = []
        for perturbation, (late, part_s) in zip(perturbations, delays, strict=True):
            before, newest = (perturbation.gain * acting[late + 1], perturbation.gain * acting[late])
            reached = _driven(self._plant(perturbation, part_s), rows[:states], before)
            reached = _driven(self._plant(perturbation, self.period_s - part_s), reached, newest)
            corrected = estimate + self.filter_gain @ (self.measured @ reached)
            loops.append(np.vstack((reached, acting[:under_way], corrected)))
        return np.array(loops)

    def _plant(self, perturbation: Perturbation, time_s: float) -> Dynamics:
        return self.plant_step(perturbation.frequency, perturbation.damping, time_s)

    def _split(self, delay_s: float) -> tuple[int, float]:
        """Whole periods of a delay, and the rest."""
        late = math.floor(delay_s / self.period_s + _INSTANT_S)
        return late, max(0.0, delay_s - late * self.period_s)


def _driven(step: Dynamics, state: Array, value: Array) -> Array:
    """Rows of the state after a step, of the state before it and of the input that acted."""
    return np.asarray(step[0] @ state + np.outer(step[1], value))


GAIN_LIMIT: Final = 10.0
PHASE_LIMIT_RAD: Final = math.pi / 2
DELAY_LIMIT_S: Final = 0.3
FREQUENCY_LIMIT: Final = 3.0  # margins are searched up to these limits; a larger one is returned as its limit

_COARSE: Final = 16
_FINE: Final = 7


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins of one loop; zero, and one for factors, if it is unstable around its own model."""

    gain_up: float
    gain_down: float  # factors by which the gain may rise, and fall (0.5 for half the gain)
    phase_rad: float  # shift of the phase, the smaller of both senses
    delay_s: float  # delay beyond the model's
    frequency_up: float
    frequency_down: float  # factors of the frequency (`Perturbation`)


SENSITIVITY: Final = "sensitivity"
CORNERS: Final = "corners"


@dataclass(frozen=True, slots=True)
class Robustness:
    """What a loop bears of the uncertainty of a model."""

    peak_sensitivity: float  # M_s around the model; infinite if the loop is unstable
    unstable_alone: tuple[str, ...]  # single departures under which it is unstable
    corner_sensitivities: tuple[float, ...]  # M_s at the joint corners of all departures
    corner_limit: float  # largest allowed one

    @property
    def weak_corners(self) -> int:
        """Number of joint corners with a larger M_s than allowed."""
        return sum(not peak < self.corner_limit for peak in self.corner_sensitivities)

    @property
    def shortfalls(self) -> tuple[str, ...]:
        """Names of what falls short of the rule; empty if the loop bears the uncertainty."""
        joint = (CORNERS,) if self.weak_corners else ()
        peak = (SENSITIVITY,) if not self.peak_sensitivity <= SENSITIVITY_LIMIT else ()
        return (*self.unstable_alone, *joint, *peak)

    @property
    def shortage(self) -> int:
        """How much falls short: departures and corners, and the peak of the sensitivity."""
        return len(self.shortfalls) + self.weak_corners


def robustness(loop: FeedbackLoop) -> Robustness:
    """Return how a loop bears departures within its rule, each alone and all at once."""
    factor, delay_s, fraction = loop.rule
    alone = {
        "gain up": Perturbation(gain=factor),
        "frequency down": Perturbation(frequency=1.0 - fraction),
        "delay": Perturbation(delay_s=delay_s),
        "frequency up": Perturbation(frequency=1.0 + fraction),
        "gain down": Perturbation(gain=1.0 / factor),
    }
    corners = [
        Perturbation(gain, later_s, frequency, damping)
        for gain in (factor, 1.0 / factor)
        for later_s in (delay_s, 0.0)
        for frequency in (1.0 - fraction, 1.0 + fraction)
        for damping in loop.dampings
    ]
    stable = loop.all_stable(tuple(alone.values())).tolist()
    peak, *at_corners = loop.peak_sensitivities((NONE, *corners)).tolist()
    unstable = tuple(name for name, kept in zip(alone, stable, strict=True) if not kept)
    return Robustness(peak, unstable, tuple(at_corners), loop.corner_limit)


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
