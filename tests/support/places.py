"""What happens at the places of a formation, by the true positions of the simulated laboratory."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rcopterx.bus.host_messages import LaboratoryState
from rcopterx.bus.messages import TransmitterStatus

FILLED_M = 0.1
CLEAR_M = 0.3


@dataclass
class PlaceWatch:
    """Watches places once all of them are filled, until `end`: gaps, errors, distances and low batteries.

    A gap is a time without any vehicle within `FILLED_M` of a place. `lowest_v` is of vehicles in flight.
    """

    places_m: Sequence[Sequence[float]]
    gaps_s: list[float] = field(default_factory=list)
    squares_m2: list[float] = field(default_factory=list)
    nearest_m: float = np.inf
    lowest_v: float = np.inf
    low: set[str] = field(default_factory=set)
    watching: bool = False
    ended: bool = False
    begun_s: float = 0.0
    newest_s: float = 0.0
    _open_s: dict[int, float] = field(default_factory=dict)

    def take(self, state: LaboratoryState) -> None:
        """Take true positions."""
        flying = np.array([one.position_m for one in state.vehicles.values() if not one.on_floor])
        if self.ended or not len(flying):
            return
        away_m = np.linalg.norm(flying[:, None] - np.array(self.places_m)[None], axis=2).min(axis=0)
        if not self.watching:
            self.watching = bool((away_m < FILLED_M).all())
            self.begun_s = state.sent_s
        if not self.watching:
            return
        self.newest_s = state.sent_s
        apart_m = np.linalg.norm(flying[:, None] - flying[None], axis=2) + 9.0 * np.eye(len(flying))
        self.nearest_m = min(self.nearest_m, float(apart_m.min()))
        for place, distance_m in enumerate(away_m.tolist()):
            if distance_m > FILLED_M:
                self._open_s.setdefault(place, state.sent_s)
                continue
            self.squares_m2.append(distance_m**2)
            if place in self._open_s:
                self.gaps_s.append(state.sent_s - self._open_s.pop(place))

    def take_status(self, vehicle: str, status: TransmitterStatus) -> None:
        """Take the status of a transmitter."""
        if status.state == "armed" and status.battery is not None and self.watching:
            self.lowest_v = min(self.lowest_v, status.battery.voltage_v)
            if status.battery.low:
                self.low.add(vehicle)

    def end(self) -> None:
        """Watch no more; a place that is empty now counts as a gap until now."""
        self.gaps_s += [self.newest_s - since_s for since_s in self._open_s.values()]
        self._open_s.clear()
        self.ended = True

    def __str__(self) -> str:
        rms_mm = 1000.0 * float(np.sqrt(np.mean(self.squares_m2 or [0.0])))
        longest_s = max(self.gaps_s, default=0.0)
        hours, low = (self.newest_s - self.begun_s) / 3600.0, ", ".join(sorted(self.low)) or "none"
        return (
            f"{hours:.2f} h: {len(self.gaps_s)} gaps, the longest {longest_s:.1f} s; {rms_mm:.0f} mm rms "
            f"from them; nearest {self.nearest_m:.2f} m; lowest voltage in flight {self.lowest_v:.2f} V, "
            f"below the limit: {low}"
        )
