"""What the battery of a vehicle permits, by its voltage, and how long it still carries it (docs/safety.md).

A firmware that compensates for the battery hides it: its hover thrust stays the same until the vehicle falls.
Voltages under load hardly show the charge until the last seconds; the one at rest does, before the flight.
"""

import math
from typing import Final

import numpy as np

from rcopterx.bus.message import MAX_MAGNITUDE
from rcopterx.bus.messages import Battery
from rcopterx.radios.battery import BatteryLimits
from rcopterx.transmitter_gateway.inputs import NEUTRAL, THRUST, Input

PATIENCE_S: Final = 5.0  # a manoeuvre lowers the voltage for a moment
CHARGED: Final = 0.95  # share of the bar from which a battery on the floor counts as full
CELL_V: Final = (3.0, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.0, 4.04, 4.1, 4.2)
"""Voltages of a resting cell with 0, 10, ... 100 % of its charge (crazyflie-firmware, pm_stm32f4.c)."""
SHARES: Final = np.linspace(0.0, 1.0, len(CELL_V))
CHARGE_ERROR, CAPACITY_ERROR = 0.05, 0.1  # of a charge by the voltage at rest; as a share: cells age
LAST_SHARE: Final = 0.1  # of the charge, at most, left once a voltage in flight is too low for a take-off
POWER_OF_THRUST: Final = 1.5  # momentum theory


def flight_left_s(limits: BatteryLimits, rest_v: float | None, used_s: float) -> tuple[float, float] | None:
    """Return the shortest and the longest remaining flight time; None if something is unknown.

    `rest_v`: voltage before the flight; `used_s`: time of hovering that uses as much as the flight has.
    """
    if rest_v is None or not limits.full_v or not limits.hover_s:
        return None
    charge = float(np.interp(rest_v * CELL_V[-1] / limits.full_v, CELL_V, SHARES))
    shortest_s = (1.0 - CAPACITY_ERROR) * max(charge - CHARGE_ERROR, 0.0) * limits.hover_s - used_s
    longest_s = (1.0 + CAPACITY_ERROR) * min(charge + CHARGE_ERROR, 1.0) * limits.hover_s - used_s
    return max(shortest_s, 0.0), max(longest_s, 0.0)


class BatteryWatch:
    """Judges the voltages that a vehicle reports: `problem` blocks take-off, or ends a flight."""

    def __init__(self, limits: BatteryLimits, hover_thrust: float = 1.0) -> None:
        self._limits, self._hover_thrust = limits, hover_thrust
        self._voltage_v: float | None = None
        self._weak_v: float | None = None  # too low for a take-off, until a higher one is reported
        self._low_since_s = math.inf
        self._empty = self._flying = False
        self._rest_v: float | None = None  # before the flight
        self._observed_s = self._used_s = 0.0

    def observe(
        self, voltage_v: float | None, now_s: float, *, there: bool, flying: bool, u: Input = NEUTRAL
    ) -> None:
        """Take the newest voltage, if known, and inputs; a vehicle not `there` may have another battery."""
        elapsed_s, self._observed_s = now_s - self._observed_s, now_s
        self._voltage_v, self._flying = voltage_v, flying
        self._used_s += elapsed_s * max(u[THRUST] / self._hover_thrust, 0.0) ** POWER_OF_THRUST
        if not flying:
            self._rest_v, self._used_s = voltage_v, 0.0
        if not flying and (not there or self._charged):
            self._empty, self._weak_v, self._low_since_s = False, None, math.inf
        if voltage_v is None:
            return
        self._weak_v = voltage_v if voltage_v < (self._limits.warn_v or 0.0) else None
        low = voltage_v < (self._limits.land_v or 0.0)
        self._low_since_s = min(self._low_since_s, now_s) if low else math.inf
        # On the floor `warn_v` is the limit, which is higher.
        self._empty = self._empty or (flying and now_s - self._low_since_s >= PATIENCE_S)

    def problem(self, *, flying: bool) -> str | None:
        """Return why the vehicle may not take off, or has to land; None if it may fly."""
        now = "" if self._voltage_v is None else f", {self._voltage_v:.2f} V now"
        if self._empty:
            return f"battery empty: below {self._limits.land_v:g} V for {PATIENCE_S:g} s{now}; charge it"
        if self._weak_v is not None and not flying:
            return f"battery at {self._weak_v:.2f} V, take-off needs {self._limits.warn_v:g} V: charge it"
        return None

    @property
    def status(self) -> Battery | None:
        """Return what is shown of it; None while the voltage is unknown."""
        if self._voltage_v is None:
            return None
        left_s = flight_left_s(self._limits, self._rest_v, self._used_s) if self._flying else None
        if left_s is not None and self._weak_v is not None:
            left_s = 0.0, min(left_s[1], LAST_SHARE * (self._limits.hover_s or 0.0))
        return Battery(
            voltage_v=min(max(self._voltage_v, 0.0), MAX_MAGNITUDE),  # a message with more would be rejected
            share=self._share,
            low=self._weak_v is not None or self._empty,
            charged=self._charged,
            left_s=left_s,
        )

    @property
    def _share(self) -> float | None:
        """Place of the voltage between those of landing and of a full battery, if all are known."""
        empty_v, full_v = self._limits.land_v or 0.0, self._limits.full_v
        if self._voltage_v is None or not full_v:
            return None
        return min(max((self._voltage_v - empty_v) / (full_v - empty_v), 0.0), 1.0)

    @property
    def _charged(self) -> bool:
        return not self._flying and (self._share or 0.0) >= CHARGED
