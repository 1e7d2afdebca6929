"""Effect of the rotors of a vehicle on vehicles below it."""

import math
from collections.abc import Collection
from typing import Final

from rcopterx.simulator.plant import Plant

CLOSE_M: Final = 0.3
"""Distance below a rotor up to which its downwash is at full strength; beyond, it falls with 1 / distance."""
WIDTH_M: Final = 0.15
"""Horizontal distance at which it has fallen by e."""


def downwash_m_s2(below_m: float, aside_m: float, strength_m_s2: float) -> float:
    """Downward acceleration in the wake of a vehicle in flight; 0 at its height and above.

    `strength_m_s2` is the acceleration close below it.
    """
    if below_m <= 0.0:
        return 0.0
    return strength_m_s2 * min(CLOSE_M / below_m, 1.0) * math.exp(-((aside_m / WIDTH_M) ** 2))


def set_downwash(plants: Collection[Plant], strength_m_s2: float) -> None:
    """Set the downwash of every plant from all others that fly now."""
    if strength_m_s2 == 0.0:
        return
    places = [(plant, plant.position_m) for plant in plants]
    flying = [(plant, place) for plant, place in places if plant.motors_running and not plant.on_floor]
    for plant, (x, y, z) in places:
        plant.downwash_m_s2 = sum(
            [
                downwash_m_s2(above[2] - z, math.hypot(above[0] - x, above[1] - y), strength_m_s2)
                for other, above in flying
                if above[2] > z and other is not plant
            ],
            start=0.0,
        )
