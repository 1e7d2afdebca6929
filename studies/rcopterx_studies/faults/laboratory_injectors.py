"""Faults of the simulated laboratory: poses, radios, vehicles."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from msgspec.structs import replace

from rcopterx.fleet.schema import FleetFile
from rcopterx.simulator.faults import BreakVehicle, Fault, Recover, TimedFault, fault_text
from rcopterx_studies.faults.bench import Bench, Injector
from rcopterx_studies.faults.scenario import inject_faults


@dataclass(frozen=True)
class LaboratoryFault(Injector):
    """A fault of the laboratory, with names of vehicles also where it takes subjects.

    Without a duration it lasts until the flight is over.
    """

    launched = False

    fault: Fault

    def of(self, file: FleetFile) -> Fault:
        """The fault with the subjects of a fleet."""
        names = {field: getattr(self.fault, field, None) for field in ("subject", "other")}
        subjects = {field: file.vehicles[name].subject for field, name in names.items() if name is not None}
        return replace(self.fault, **subjects)

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        fault = self.of(bench.fleet.file)
        seconds = getattr(fault, "duration_s", None)
        bench.say(f"laboratory: {fault_text(fault)}")
        inject_faults(bench.fleet.session, fault)
        if seconds is not None:
            bench.wait(seconds)
        try:
            yield
        finally:
            if seconds is None:
                inject_faults(bench.fleet.session, Recover())


@dataclass(frozen=True)
class Draining(Injector):
    """The battery of a vehicle empties within `seconds`, in steps, to a share `left` of its thrust."""

    launched = False

    vehicle: str
    left: float
    seconds: float
    steps: int = 40

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        bench.say(f"{self.vehicle}: the battery falls to {self.left:g} of its thrust in {self.seconds:g} s")
        inject_faults(bench.fleet.session, self.steps_of_battery())
        try:
            yield
        finally:
            inject_faults(bench.fleet.session, Recover())

    def steps_of_battery(self) -> list[TimedFault]:
        """Thrust after each step."""
        shares = [number / self.steps for number in range(1, self.steps + 1)]
        return [
            TimedFault(
                share * self.seconds,
                BreakVehicle(vehicle=self.vehicle, thrust_factor=1.0 - share * (1.0 - self.left)),
            )
            for share in shares
        ]
