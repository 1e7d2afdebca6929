"""Remaining flight time of a battery: its charge before the flight, less what the thrust has used.

Voltages under load hardly show the charge until the battery is nearly empty, and then fall within seconds
(docs/safety.md).
"""

from collections import deque
from typing import Final

import numpy as np

from rcopterx.radios.battery import BatteryLimits

CELL_V: Final = (3.0, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.0, 4.04, 4.1, 4.2)
"""Voltages of a resting cell with 0, 10, ... 100 % of its charge (crazyflie-firmware, pm_stm32f4.c)."""
SHARES: Final = np.linspace(0.0, 1.0, len(CELL_V))
CHARGE_ERROR: Final = 0.05  # of a charge by its resting voltage: cells differ
CAPACITY_ERROR: Final = 0.1  # as a share: cells age
POWER_OF_THRUST: Final = 1.5  # momentum theory
SAMPLE_S: Final = 1.0  # between the voltages that show how fast a nearly empty battery falls
SAMPLES: Final = 15
LEAST_SAMPLES: Final = 5
Interval = tuple[float, float]  # shortest and longest time [s]


def charge_at_rest(voltage_v: float, full_v: float) -> float:
    """Return the share of its charge that a resting battery has, by the voltage of a full one."""
    return float(np.interp(voltage_v * CELL_V[-1] / full_v, CELL_V, SHARES))


def time_by_charge(charge: float, used_s: float, hover_s: float) -> Interval:
    """Return the remaining flight time of a battery that hovers for `hover_s` when it is full.

    `charge`: its share before the flight; `used_s`: time of hovering that uses as much as this flight has.
    """
    low, high = max(charge - CHARGE_ERROR, 0.0), min(charge + CHARGE_ERROR, 1.0)
    shortest_s, longest_s = (1.0 - CAPACITY_ERROR) * hover_s * low, (1.0 + CAPACITY_ERROR) * hover_s * high
    return max(shortest_s - used_s, 0.0), max(longest_s - used_s, 0.0)


def time_by_fall(voltages_v: list[float], land_v: float) -> float | None:
    """Return when voltages, `SAMPLE_S` apart, have fallen to `land_v` [s]; None if they do not fall."""
    if len(voltages_v) < LEAST_SAMPLES:
        return None
    slope_v_s, now_v = np.polyfit(SAMPLE_S * np.arange(1.0 - len(voltages_v), 1.0), voltages_v, 1)
    return max(float((now_v - land_v) / -slope_v_s), 0.0) if slope_v_s < 0.0 else None


class FlightTime:
    """Predicts the remaining flight time: `left_s` is None on the floor, and where nothing is known."""

    def __init__(self, limits: BatteryLimits) -> None:
        self._limits = limits
        self.left_s: Interval | None = None
        self._charge: float | None = None  # share before the flight
        self._used_s = self._now_s = 0.0
        self._falling: deque[float] = deque(maxlen=SAMPLES)
        self._sampled_s = 0.0

    def observe(self, voltage_v: float | None, thrust: float | None, now_s: float) -> None:
        """Take the newest voltage, if known, and thrust, relative to that of a hover; None on the floor."""
        limits, elapsed_s, self._now_s = self._limits, now_s - self._now_s, now_s
        if thrust is None:
            full_v = limits.full_v
            self._charge = None if voltage_v is None or not full_v else charge_at_rest(voltage_v, full_v)
            self._used_s, self.left_s = 0.0, None
            self._falling.clear()
            return
        self._used_s += elapsed_s * max(thrust, 0.0) ** POWER_OF_THRUST
        if self._charge is None or not limits.hover_s:
            return
        shortest_s, longest_s = time_by_charge(self._charge, self._used_s, limits.hover_s)
        if voltage_v is not None and voltage_v < (limits.warn_v or 0.0) and limits.land_v:
            if not self._falling or now_s >= self._sampled_s + SAMPLE_S:
                self._falling.append(voltage_v)
                self._sampled_s = now_s
            by_fall_s = time_by_fall(list(self._falling), limits.land_v)
            shortest_s, longest_s = 0.0, longest_s if by_fall_s is None else min(longest_s, by_fall_s)
        self.left_s = shortest_s, longest_s
