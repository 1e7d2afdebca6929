"""Chaos: one fault after the other, of those that vehicles are promised to survive."""

import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx_studies.faults.bench import FaultFlight
from rcopterx_studies.faults.flying import FaultRange
from rcopterx_studies.faults.load import loaded
from rcopterx_studies.faults.promise import SeenFlight
from rcopterx_studies.faults.scenario import FaultRefusedError
from rcopterx_studies.faults.table import FAULT_FLIGHTS

PAUSE_S: Final = (2.0, 4.0)  # from the beginning of one fault to that of the next one, at least and at most
LAST_FAULTS: Final = 4
SURVIVABLE: Final = tuple(row for row in FAULT_FLIGHTS.values() if row.chaos)


def chances(seed: int) -> Iterator[tuple[float, FaultFlight]]:
    """Pauses [s] and the fault after each of them, from the seed."""
    chance = random.Random(seed)
    while True:
        yield chance.uniform(*PAUSE_S), chance.choice(SURVIVABLE)


@dataclass
class Chaos:
    """A flight with chaos."""

    place: FaultRange
    seed: int
    seconds: float
    busy: int = 0  # busy processes beside it; with any, bursts take all processors as well
    # faults with the time since the beginning [s]
    happened: list[tuple[float, str]] = field(default_factory=list)
    # faults that were not possible, for example because the process was just being replaced
    missed: Counter[str] = field(default_factory=Counter)

    @property
    def _clock(self) -> Callable[[], float]:
        return self.place.fleet.session.clock

    def fly(self) -> dict[str, Any]:
        """Fly until the time is over or a vehicle touches the floor; returns the report."""
        flown = self.place.observe(self._fly)
        problem = flown.problem or "; ".join(flown.broken) or None
        return chaos_report(self, flown.seen, problem, flown.seconds)

    def _fly(self) -> None:
        with loaded(self.busy, self.place.bench.say):
            self._inject_faults(self._clock())
        self.place.wait_until_flown()

    def _inject_faults(self, started_s: float) -> None:
        bench, due_s = self.place.bench, started_s
        for pause_s, row in chances(self.seed):
            due_s = max(due_s + pause_s, self._clock())
            if due_s - started_s > self.seconds:
                self._wait_aloft(started_s + self.seconds)
                return
            self._wait_aloft(due_s)
            at_s = round(self._clock() - started_s, 1)
            bench.say(f"{at_s:.1f} s: {row.name}")
            try:
                with row.injected(bench):
                    pass
                self.happened.append((at_s, row.name))
            except (NotReachedError, FaultRefusedError) as error:
                self.missed[row.name] += 1
                bench.say(f"not possible now: {error}")

    def _wait_aloft(self, until_s: float) -> None:
        """Wait, and check that no vehicle touches the floor meanwhile."""
        while (left_s := until_s - self._clock()) > 0.0:
            if down := self.place.on_floor():
                last = ", ".join(name for _, name in self.happened[-LAST_FAULTS:])
                raise NotReachedError(f"{', '.join(down)} on the floor after {last}")
            self.place.bench.wait(min(left_s, 0.1))


def chaos_report(
    chaos: Chaos, seen: dict[str, SeenFlight], problem: str | None, seconds: float
) -> dict[str, Any]:
    """Report of a flight; it passed if no vehicle came down and there was no problem."""
    down = [name for name, vehicle in seen.items() if vehicle.down]
    return {
        "name": "chaos",
        "seed": chaos.seed,
        "busy": chaos.busy,
        "seconds": round(seconds, 1),
        "verdict": "failed" if down or problem or not seen else "passed",
        "problem": problem,
        "down": down,
        "faults": len(chaos.happened),
        "happened": [{"at_s": at_s, "fault": name} for at_s, name in chaos.happened],
        "missed": dict(chaos.missed),
        "vehicles": {
            name: {
                "deviation_mm": vehicle.deviation_mm,
                "touchdown_m_s": vehicle.touchdown_m_s,
                "silence_ms": vehicle.silence_ms,
                "arbiter": dict(Counter(vehicle.states_of_arbiter)),
            }
            for name, vehicle in seen.items()
        },
    }
