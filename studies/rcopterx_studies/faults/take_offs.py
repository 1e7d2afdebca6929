"""A take-off with a fault, until its motors are off again."""

from contextlib import ExitStack
from typing import Final

from rcopterx.agents.flight.lift_off import FAILED_S
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, lines_of
from rcopterx.ground_station.scripting.waiting import StoppedError
from rcopterx_studies.faults.bench import Bench, FaultFlight, TakeOff
from rcopterx_studies.faults.promise import OFF

HEIGHT_M: Final = 1.0
NOTICED_S: Final = 1.5  # from a fault on the floor until `check` shows it
OVER_S: Final = FAILED_S + 2.0  # by then a take-off has ended, in the air or on the floor
AFTERWARDS_S: Final = 1.0
RESTED_S: Final = 1.5  # after a fault, until a pose that jumped back counts as at rest and is reported so
FIT_S: Final = 15.0  # receivers search for a module that was away


def attempt(bench: Bench, row: FaultFlight, take_off: TakeOff, reported: list[str]) -> None:
    """Take off with the faults of a row, and add to `reported` the lines that users see."""
    fleet, name = bench.fleet, take_off.vehicle
    with ExitStack() as faults:
        if take_off.after_s is None:
            faults.enter_context(row.injected(bench))
            bench.wait(NOTICED_S)
        reported += fleet.problems([name])
        try:
            # A problem blocks take-offs of the fleet; the arbiter has to refuse by itself as well.
            fleet[name].arm() if reported else fleet.arm([name])
            fleet[name].take_off(HEIGHT_M)
        except StoppedError:
            raise
        except FLIGHT_ERRORS as error:
            reported += lines_of(error)
        else:
            if take_off.after_s is not None:
                bench.wait(take_off.after_s)
                faults.enter_context(row.injected(bench))
            bench.wait_for(lambda: _over(fleet, name), OVER_S)
        bench.wait(AFTERWARDS_S)
        state = fleet.state_of(name)
        reported += [*fleet.problems([name]), *fleet.notes(), state.reason]


def _over(fleet: Fleet, name: str) -> bool:
    state = fleet.state_of(name)
    return state.phase == "flying" or (state.phase != "takeoff" and state.transmitter_state in OFF)


def fit_again(bench: Bench) -> bool:
    """Land, reset kills, and return whether all vehicles can take off."""
    fleet = bench.fleet
    try:
        fleet.land()
        bench.wait(RESTED_S)
        for vehicle in fleet:
            if vehicle.state.transmitter_state == "killed":
                vehicle.reset()
        fleet.wait_ready(timeout_s=FIT_S)
    except StoppedError:
        raise
    except FLIGHT_ERRORS:
        return False
    return True
