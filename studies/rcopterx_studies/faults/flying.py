"""Flights of the rows of the table of faults on a fleet."""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final, NamedTuple

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LaboratoryVehicle
from rcopterx.deploy.processes.supervisor import STABLE_AFTER_S
from rcopterx.deploy.watchdog.watchdog import AGAIN_S
from rcopterx.ground_station.acceptance import steps
from rcopterx.ground_station.acceptance.paper_sequence import leader_of
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, lines_of
from rcopterx.ground_station.scripting.waiting import NotReachedError, StoppedError
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.faults.bench import Bench, FaultFlight
from rcopterx_studies.faults.observation import WATCHED, broken_in, seen_of
from rcopterx_studies.faults.promise import Promise, SeenFlight
from rcopterx_studies.faults.reports import Report, not_flown, report_of
from rcopterx_studies.faults.scenario import FaultRefusedError
from rcopterx_studies.faults.take_offs import attempt, fit_again

HOME_M: Final = (0.0, 0.0, 1.0)  # where the leader hovers
AT_HOME_M: Final = 0.06
REST_S: Final = 0.5
AWAY_M: Final = 0.15  # a fleet whose vehicles have hopped further away is started again
BEFORE_S: Final = 0.2  # recorded time before the first fault
AFTERWARDS_S: Final = 1.5  # recorded time after the last fault
FLOWN_AGAIN_S: Final = 20.0
LANDED_S: Final = 30.0
RECOVERED_S: Final = max(STABLE_AFTER_S, AGAIN_S)
"""Time after the last start of a process until the next fault."""
CALM_S: Final = 60.0  # limit for processes and spares to be ready, on a busy computer as well


class Observed(NamedTuple):
    """What was seen of a flight."""

    seen: dict[str, SeenFlight]
    problem: str | None  # what ended it early
    broken: list[str]  # promises of every flight that it breaks
    seconds: float  # recorded time


class FaultRange:
    """A fleet in the simulated laboratory, ready to take off, that flies one fault after the other."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.fleet = bench.fleet
        self._names = list(bench.fleet.file.vehicles)
        self._recorder = FlightSampler(self.fleet.session, only=WATCHED)
        self._stood_m: dict[str, Three] = {}  # where vehicles stood before the first take-off with a fault
        self._truth = self.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT)

    def saying(self, say: Callable[[str], None]) -> "FaultRange":
        """Show what happens through another function from now on."""
        self.bench = replace(self.bench, say=say)
        return self

    def fly(self, row: FaultFlight) -> Report:
        """Fly a row; returns the report, also of one that ended early or that the laboratory refused."""
        try:
            reported: list[str] = []
            if row.take_off is None:
                flown = self.observe(partial(self._fly, row), row.on_floor)
            else:
                flown = self.observe(partial(attempt, self.bench, row, row.take_off, reported), on_floor=True)
        except FaultRefusedError as error:
            return not_flown(row, str(error))
        return report_of(row, flown.seen, flown.problem, flown.seconds, flown.broken, reported)

    def observe(self, fly: Callable[[], None], on_floor: bool = False) -> Observed:
        """Have all vehicles hover, or stand on the floor, and record while a function flies them."""
        clock, problem = self.fleet.session.clock, None
        places_m: dict[str, Three] = {}
        began_s = clock()
        try:
            if on_floor:
                self._stand()
            else:
                self._hover()
            places_m = {name: self.truth(name).position_m for name in self._names}
            self._stood_m = self._stood_m or places_m
            self._recorder.start()
            began_s = clock()
            self.bench.wait(BEFORE_S)
            fly()
        except (StoppedError, FaultRefusedError):
            raise
        except FLIGHT_ERRORS as error:
            problem = "; ".join(lines_of(error))
            self.bench.say(f"ended early: {problem}")
        finally:
            seconds, recording = clock() - began_s, self._recorder.stop()
        return Observed(seen_of(recording, places_m), problem, broken_in(recording), seconds)

    def _fly(self, row: FaultFlight) -> None:
        with row.injected(self.bench):
            if row.on_floor:
                take_off = steps.refused("take-off", "", "take_off", height_m=HOME_M[2])
                take_off(self.fleet, self.bench.say, self.bench.wait)
            elif row.down:
                self._wait_until_down(row.down)
            else:
                self.wait_until_flown()
                self.bench.wait(AFTERWARDS_S)
                self.wait_until_flown()

    def survives(self, row: FaultFlight, report: Report) -> bool:
        """Whether the fleet is fit for the next row."""
        if report["verdict"] == "not flown":
            return True
        if row.take_off is not None:
            away_m = [math.dist(self.truth(name).position_m, place) for name, place in self._stood_m.items()]
            return fit_again(self.bench) and max(away_m) < AWAY_M
        return row.promise in (Promise.FLIES_ON, Promise.REFUSED) and report["verdict"] == "passed"

    def truth(self, name: str) -> LaboratoryVehicle:
        """Newest true state of a vehicle; `NotReachedError`: no state of it has arrived."""
        received = self._truth.latest()
        if received is None or name not in received.message.vehicles:
            raise NotReachedError(f"{name}: there is no simulated laboratory")
        return received.message.vehicles[name]

    def _hover(self) -> None:
        """Have all vehicles hover in formation, at rest, and wait for spare processes."""
        fleet, bench = self.fleet, self.bench
        if not all(fleet.state_of(name).phase == "flying" for name in self._names):
            fleet.wait_ready()
            fleet.take_off(height_m=HOME_M[2])
        self._wait_until_calm()
        fleet[leader_of(fleet)].go_to(HOME_M)
        fleet.wait_for_arrival(tolerance_m=AT_HOME_M)
        fleet.wait_for_formation(tolerance_m=AT_HOME_M)
        bench.wait(REST_S)

    def _stand(self) -> None:
        """Have all vehicles stand on the floor."""
        self.fleet.land()
        self.fleet.wait_ready()
        self.bench.wait_for(lambda: self._truth.latest() is not None, FLOWN_AGAIN_S)

    def _wait_until_calm(self) -> None:
        """Wait until spares are ready and the watchdog may kill every process: faults do not add up."""
        if self.fleet.launcher is None or self.fleet.file.clock.lockstep:
            return
        supervisor = self.bench.supervisor

        def calm() -> bool:
            youngest_s = max(child.started_s for child in supervisor.children.values())
            return supervisor.spares.complete and time.monotonic() - youngest_s > RECOVERED_S

        what = "processes are started again and again, or there is no spare one"
        self.fleet.wait_until(calm, CALM_S, what)

    def wait_until_flown(self) -> None:
        """Wait until agents fly all vehicles and arbiters let them; `NotReachedError` if not in time."""

        def flown(name: str) -> bool:
            state = self.fleet.state_of(name)
            return (
                state.phase == "flying"
                and state.transmitter_state == "armed"
                and state.agent_age_s is not None
                and state.agent_age_s < REST_S
            )

        what = "not all vehicles are flown"
        self.fleet.wait_until(lambda: all(map(flown, self._names)), FLOWN_AGAIN_S, what, self._names)

    def _wait_until_down(self, names: tuple[str, ...]) -> None:
        what = f"not down: {', '.join(names)}"
        self.fleet.wait_until(lambda: all(self.truth(name).on_floor for name in names), LANDED_S, what)
        self.bench.wait(REST_S)
