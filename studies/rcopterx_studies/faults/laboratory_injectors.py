"""Faults of the simulated laboratory: poses, radios, vehicles."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from msgspec.structs import replace

from rcopterx.bus.messages import Zone
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.acceptance.paper_sequence import leader_of
from rcopterx.simulator.faults import (
    AddSubject,
    BreakVehicle,
    Fault,
    Recover,
    RemoveSubject,
    TimedFault,
    fault_text,
)
from rcopterx_studies.faults.bench import Bench, Injector
from rcopterx_studies.faults.scenario import inject_faults

WAND_M: Final = (0.9, 0.0, 1.0)
BESIDE_WAND_M: Final = (-0.9, 0.0, 0.0)  # where the leader hovers anyway
SETTLING_S: Final = 1.5


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
class ZoneSetOnto(Injector):
    """A keep-out zone is set onto a vehicle, until the flight is over."""

    launched = False

    vehicle: str

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        x, y, z = bench.fleet.state_of(self.vehicle).place_m or (0.0, 0.0, 0.0)
        zone = Zone(min_m=(x - 0.1, y - 0.1, 0.0), max_m=(x + 0.1, y + 0.1, z + 0.1))
        bench.fleet.set_zone("fault", zone)
        try:
            yield
        finally:
            bench.fleet.set_zone("fault", None)


@dataclass(frozen=True)
class WandLost(Injector):
    """The leader follows a wand, which is not seen any more then."""

    launched = False

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        fleet, leader = bench.fleet, leader_of(bench.fleet)
        inject_faults(fleet.session, AddSubject(subject="wand", position_m=WAND_M))
        bench.wait(SETTLING_S)
        fleet[leader].follow("wand", BESIDE_WAND_M)
        fleet.wait_for_formation([leader])
        inject_faults(fleet.session, RemoveSubject(subject="wand"))
        try:
            yield
        finally:
            fleet[leader].lead()
            inject_faults(fleet.session, Recover())


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
