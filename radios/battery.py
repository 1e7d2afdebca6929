"""What a vehicle's battery permits: voltages of take-off and landing, and how long it lasts."""

import math
from dataclasses import dataclass, fields
from typing import Final


class BatteryLimitsError(ValueError):
    """Voltages that contradict each other; the message names the field."""


@dataclass(frozen=True, slots=True)
class BatteryLimits:
    """Voltages of the whole battery [V]; None or 0: no such limit, or unknown."""

    warn_v: float | None = None  # below it there is no take-off, and a warning in flight
    land_v: float | None = None  # below it for some seconds the vehicle lands
    full_v: float | None = None  # of a full battery: where the bar that shows the voltage ends
    hover_s: float | None = None  # for which the vehicle hovers with a full battery until it lands [s]

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise BatteryLimitsError(f"{item.name}: {value} must not be negative")
        land_v, warn_v, full_v = self.land_v or 0.0, self.warn_v or math.inf, self.full_v or math.inf
        if warn_v < land_v:
            raise BatteryLimitsError(f"warn_v: {warn_v:g} must be at least land_v = {land_v:g}")
        if full_v <= max(land_v, self.warn_v or 0.0):
            raise BatteryLimitsError(f"full_v: {full_v:g} must be above warn_v and land_v")


NO_LIMITS: Final = BatteryLimits()
