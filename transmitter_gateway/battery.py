"""What the voltage of a vehicle's battery permits (docs/safety.md).

A firmware that compensates for the battery hides it: its hover thrust stays the same until the vehicle falls.
"""

from typing import Final

from rcopterx.bus.message import MAX_MAGNITUDE
from rcopterx.bus.messages import Battery
from rcopterx.radios.battery import BatteryLimits
from rcopterx.transmitter_gateway.flight_time import FlightTime
from rcopterx.transmitter_gateway.inputs import NEUTRAL, THRUST, Input

PATIENCE_S: Final = 5.0  # a manoeuvre lowers the voltage for a moment
CHARGED: Final = 0.95  # share of the bar from which a battery on the floor counts as full


class BatteryWatch:
    """Judges the voltages that a vehicle reports: `problem` blocks take-off, or ends a flight."""

    def __init__(self, limits: BatteryLimits, hover_thrust: float = 1.0) -> None:
        self._limits, self._hover_thrust = limits, hover_thrust
        self._voltage_v: float | None = None
        self._weak_v: float | None = None  # too low for a take-off, until a higher one is reported
        self._low_since_s: float | None = None
        self._empty = self._flying = False
        self._flight_time = FlightTime(limits)

    def observe(
        self, voltage_v: float | None, now_s: float, *, there: bool, flying: bool, u: Input = NEUTRAL
    ) -> None:
        """Take the newest voltage, if known, and inputs; a vehicle not `there` may have another battery."""
        self._voltage_v, self._flying = voltage_v, flying
        thrust = u[THRUST] / self._hover_thrust if flying else None
        self._flight_time.observe(voltage_v, thrust, now_s)
        if not flying and (not there or self._charged):
            self._empty, self._weak_v, self._low_since_s = False, None, None
        if voltage_v is None:
            return
        self._weak_v = voltage_v if voltage_v < (self._limits.warn_v or 0.0) else None
        if voltage_v >= (self._limits.land_v or 0.0):
            self._low_since_s = None
            return
        if self._low_since_s is None:
            self._low_since_s = now_s
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
        return Battery(
            voltage_v=min(max(self._voltage_v, 0.0), MAX_MAGNITUDE),  # a message with more would be rejected
            share=self._share,
            low=self._weak_v is not None or self._empty,
            charged=self._charged,
            left_s=self._flight_time.left_s,
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
