"""Promises of the asynchronous interface: the same calls at the same time, and no vehicle left in the air."""

import asyncio
import inspect
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, scripted
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus.requests import Arm, GoTo, TakeOff
from rcopterx.bus.session import BusAddress, Session
from rcopterx.fleet.reading import load_fleet
from rcopterx.ground_station.scripting.asynchronous import AsyncFleet, AsyncVehicle
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError, Vehicle
from rcopterx.ground_station.scripting.waiting import NotReachedError

Vehicles = dict[str, ScriptedVehicle]


@pytest.fixture
def vehicles(join: Callable[..., Session]) -> Iterator[Vehicles]:
    with scripted(join(), "h1", "h2") as running:
        yield running


@pytest.fixture
def path(
    bus_address: BusAddress, vehicles: Vehicles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    path = tmp_path / "lab.toml"
    path.write_text(fleet_file_text(bus_address))
    monkeypatch.setattr(Fleet, "connect", lambda path, host, _: patient_fleet(load_fleet(path), host))
    return path


def airborne(vehicles: Vehicles) -> None:
    for vehicle in vehicles.values():
        vehicle.phase, vehicle.state = "flying", "armed"


def run(script: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(script, 2 * DEADLINE_S))


def test_vehicles_fly_and_land_at_the_same_time(path: Path, vehicles: Vehicles) -> None:
    async def script() -> None:
        async with AsyncFleet.connect(path) as fleet:
            await fleet.take_off(height_m=0.7)
            assert [vehicle.state.phase for vehicle in fleet] == ["flying", "flying"]
            await asyncio.gather(*(vehicle.go_to((0.0, 0.0, 1.0)) for vehicle in fleet))
            await asyncio.gather(*(vehicle.wait_for_arrival() for vehicle in fleet))
            assert fleet["h2"].plan is not None
            await fleet.land()

    run(script())
    for vehicle in vehicles.values():
        assert vehicle.requests[:2] == [Arm(), TakeOff(height_m=0.7)]
        assert isinstance(vehicle.requests[2], GoTo)
        assert vehicle.phase == "ground"


def test_other_tasks_run_while_one_waits(path: Path) -> None:
    async def script() -> None:
        async with AsyncFleet.connect(path) as fleet:
            waiting = asyncio.create_task(fleet.wait_for_phase("flying", timeout_s=DEADLINE_S))
            for _ in range(3):
                await asyncio.sleep(0)
            await fleet.wait_for_phase("ground")
            assert not waiting.done()
            await fleet.take_off()
            await waiting

    run(script())


def test_errors_are_those_of_the_synchronous_calls(path: Path, vehicles: Vehicles) -> None:
    vehicles["h1"].refusals["land"] = "no"

    async def script() -> None:
        async with AsyncFleet.connect(path) as fleet:
            with pytest.raises(RefusedError, match="h1: no"):
                await fleet["h1"].land()
            with pytest.raises(NotReachedError, match="not flying: h1: ground"):
                await fleet.wait_for_phase("flying", timeout_s=0.05)
            with pytest.raises(KeyError, match="no vehicle 'h9'"):
                fleet["h9"]

    run(script())


def test_an_error_in_the_block_lands_the_fleet(path: Path, vehicles: Vehicles) -> None:
    async def script() -> None:
        async with AsyncFleet.connect(path) as fleet:
            await fleet.take_off()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(script())
    assert [vehicle.phase for vehicle in vehicles.values()] == ["ground", "ground"]


def test_a_cancelled_task_stops_waiting_and_lands_the_fleet(path: Path, vehicles: Vehicles) -> None:
    async def fly() -> None:
        async with AsyncFleet.connect(path) as fleet:
            await fleet.take_off()
            await fleet.wait_until(lambda: False, 1000, "for ever")

    async def script() -> None:
        task = asyncio.create_task(fly())
        await asyncio.to_thread(
            wait_for, lambda: all(vehicle.phase == "flying" for vehicle in vehicles.values()), "not flying"
        )
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    run(script())
    assert [vehicle.phase for vehicle in vehicles.values()] == ["ground", "ground"]


def test_a_script_that_ends_well_leaves_the_fleet_in_the_air(path: Path, vehicles: Vehicles) -> None:
    airborne(vehicles)

    async def script() -> None:
        async with AsyncFleet.connect(path) as fleet:
            assert await fleet.wait_for_status()
            assert fleet.problems() == []
            assert fleet.state_of("h1").airborne

    run(script())
    assert [vehicle.phase for vehicle in vehicles.values()] == ["flying", "flying"]


@pytest.mark.parametrize(("asynchronous", "synchronous"), [(AsyncVehicle, Vehicle), (AsyncFleet, Fleet)])
def test_every_call_that_waits_is_there_with_the_same_parameters(
    asynchronous: type, synchronous: type
) -> None:
    own = {
        "close",
        "connect",
        "launched",
        "synchronous",
        "plan_of",
        "statuses",
        "followers",
        "launchers",
        "frame_period_s",
        "clock_differences",
        "crowded_hosts",
    }
    for name, method in inspect.getmembers(synchronous, inspect.isfunction):
        if name.startswith("_") or name in own:
            continue
        twin = getattr(asynchronous, name)
        assert twin.__doc__ == method.__doc__
        if name not in ("state_of", "problems", "watch_latency", "watch_motion", "notes", "present"):
            assert inspect.iscoroutinefunction(twin), name
            assert inspect.signature(twin) == inspect.signature(method), name
