"""Promises of `demo`: Ctrl-C and the end of its time land at once; its figures are those of the flight."""

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus.session import BusAddress
from rcopterx.commands import launch
from rcopterx.commands.interruption import Interrupts
from rcopterx.fleet.reading import load_fleet
from rcopterx.ground_station.acceptance.demonstration import Demonstration
from rcopterx.ground_station.scripting.fleet import Fleet

Vehicles = dict[str, ScriptedVehicle]


@pytest.fixture
def fleet(up: str) -> Iterator[Fleet]:
    fleet = patient_fleet(load_fleet(Path(up)))
    yield fleet
    fleet.close()


def test_a_demonstration_that_is_stopped_before_take_off_arms_no_vehicle(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    vehicles["h2"].ready = False
    wait_for(lambda: "h2: transmitter not ready: module speaks" in fleet.problems(["h2"]), "h2 is ready")
    stop = threading.Event()
    stop.set()
    demonstration = Demonstration(fleet, stop, print)
    demonstration.fly(None)
    assert demonstration.problem is None
    assert not vehicles["h1"].verbs


@pytest.mark.parametrize("verb", ["go_to", "take_off"])
def test_a_demonstration_stays_up_when_its_flight_ends_and_says_how_to_go_on(
    fleet: Fleet, vehicles: Vehicles, verb: str
) -> None:
    vehicles["h1"].refusals[verb] = "killed"
    stop, said = threading.Event(), list[str]()
    demonstration = Demonstration(fleet, stop, said.append)
    flight = threading.Thread(target=demonstration.fly, args=(None,), daemon=True)
    flight.start()
    wait_for(lambda: bool(said), "says nothing")
    assert flight.is_alive()
    assert "killed; reset what is killed and take off again" in said[0]
    stop.set()
    flight.join(DEADLINE_S)
    assert not flight.is_alive()
    assert demonstration.problem is None


def test_a_demonstration_for_a_time_ends_with_the_error_of_its_flight(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    vehicles["h1"].refusals["go_to"] = "killed"
    demonstration = Demonstration(fleet, threading.Event(), print)
    demonstration.fly(60.0)
    assert demonstration.problem == "h1: killed"


def test_figures_of_a_demonstration_end_with_its_flight(fleet: Fleet, vehicles: Vehicles) -> None:
    demonstration = Demonstration(fleet, threading.Event(), print)
    demonstration.fly(1.0)
    assert demonstration.problem is None
    vehicles["h1"].counts = {"leader_plan_late": 5}

    def counted() -> bool:
        agent = fleet["h1"].state.agent
        return agent is not None and bool(agent.diagnostics.fallbacks)

    wait_for(counted, "the vehicle does not report what it counts")
    console = Console(width=80, file=io.StringIO(), record=True)
    console.print(demonstration.summary())
    assert "leader_plan_late" not in console.export_text()


def test_a_demonstration_lands_before_its_figures_are_computed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, bus_address: BusAddress
) -> None:
    done: list[str] = []

    @contextmanager
    def flight(*_: object, **__: object) -> Iterator[tuple[object, Interrupts]]:
        yield None, Interrupts()
        done.append("landing")

    def summary() -> str:
        done.append("figures")
        return ""

    flown = SimpleNamespace(fly=lambda _: None, problem=None, summary=summary)
    path = tmp_path / "fleet.toml"
    path.write_text(fleet_file_text(bus_address))
    monkeypatch.setattr(launch, "interruptible", flight)
    monkeypatch.setattr("rcopterx.ground_station.acceptance.demonstration.Demonstration", lambda *_: flown)
    launch.demo(str(path), browser=False)
    assert done == ["landing", "figures"]
