"""Faults of the simulated laboratory: poses, radios, vehicles."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rcopterx.experiments.faults.bench import Bench, Injector
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.terminal.scenario import fault_from, inject_faults
from rcopterx.simulator.faults import BreakVehicle, Fault, Recover, TimedFault, fault_text

Value = str | int | float | tuple[float, ...]


@dataclass(frozen=True)
class Inject(Injector):
    """A fault of the laboratory, of a kind in `rcopterx.simulator.faults.FAULTS`, with further fields.

    `vehicle` is a name, also where the fault takes a subject. The fault takes `seconds`; None lasts until the
    flight is over.
    """

    launched = False

    kind: str
    vehicle: str | None = None
    values: tuple[tuple[str, Value], ...] = ()
    seconds: float | None = None

    def fault(self, file: FleetFile) -> Fault:
        """The fault with the subjects of a fleet."""
        values: dict[str, object] = dict(self.values)
        if self.vehicle is not None:
            broken = self.kind.startswith("break_")
            values["vehicle" if broken else "subject"] = (
                self.vehicle if broken else file.vehicles[self.vehicle].subject
            )
        if "other" in values:
            values["other"] = file.vehicles[str(values["other"])].subject
        if self.seconds is not None:
            values["duration_s"] = self.seconds
        return fault_from(self.kind, values)

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        fault = self.fault(bench.fleet.file)
        bench.say(f"laboratory: {fault_text(fault)}")
        inject_faults(bench.fleet.session, [TimedFault(0.0, fault)])
        if self.seconds is not None:
            bench.wait(self.seconds)
        try:
            yield
        finally:
            if self.seconds is None:
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
