"""Processes of a host as a watchdog sees them."""

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.deploy.watchdog.watchdog import Duty, Excuse, Hung, ProcessObservation, Watchdog
from rcopterx.fleet.schema import WatchdogConfig
from support.records import replace

LIMITS = WatchdogConfig(flight_s=0.15, floor_s=1.0, start_s=30.0)
STEP_S = 0.02
DEAF, OTHER, THIRD = 1, 2, 3
NONE = Excuse()


def seen(number: int, phase: LoopPhase, duty: Duty = Duty.FLIGHT, beats: int = 1) -> ProcessObservation:
    return ProcessObservation(f"process {number}", duty, beats, phase)


class Host:
    """Processes that beat at every check, except for silent ones."""

    def __init__(
        self, *phases: LoopPhase, duty: Duty = Duty.FLIGHT, others: Duty = Duty.FLIGHT, blind: bool = False
    ) -> None:
        self.watchdog = Watchdog(LIMITS, blind)
        self.now_s = 50.0
        self.looks = {
            number: seen(number, phase, duty if number == DEAF else others)
            for number, phase in enumerate(phases, 1)
        }
        self.watchdog.check(self.now_s, self.looks)

    def look(self, *silent: int, after_s: float = STEP_S, **excuses: Excuse) -> list[Hung]:
        """Let time pass and check; `excuses` are those of `deaf`, `other` and `third`."""
        self.now_s += after_s
        for number, name in ((DEAF, "deaf"), (OTHER, "other"), (THIRD, "third")):
            if number in self.looks:
                self.looks[number] = replace(self.looks[number], excuse=excuses.get(name, NONE))
        self.looks = {
            number: look if number in silent else replace(look, beats=look.beats + 1)
            for number, look in self.looks.items()
        }
        return self.watchdog.check(self.now_s, self.looks)

    def found_after_s(self, *silent: int, limit_s: float = 100.0, **excuses: Excuse) -> float | None:
        """How long it takes until the first of the silent ones is found; None if it is not."""
        from_s = self.now_s
        while self.now_s < from_s + limit_s:
            if self.look(*silent, **excuses):
                return self.now_s - from_s
        return None
