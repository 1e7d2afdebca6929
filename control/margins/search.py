"""Margins of a feedback loop: how far each perturbation may go before the loop becomes unstable."""

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from rcopterx.control.margins.loop import FeedbackLoop, Perturbation
from rcopterx.vehicles.model import Uncertainty

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
