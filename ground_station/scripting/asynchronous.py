"""The scripting interface for asyncio: the calls of `Fleet` and `Vehicle` as coroutines.

Every call that may wait runs the synchronous method in a thread. Cancelling a task ends its waiting at once;
a request that was sent to a vehicle stays in effect.
"""

import asyncio
import functools
import threading
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

from rcopterx.bus.messages import Plan
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.scripting.vehicle import Vehicle
from rcopterx.ground_station.scripting.waiting import stopped_by

T = TypeVar("T")
P = ParamSpec("P")
R = TypeVar("R")

THREADS = 64
"""Calls that wait at the same time; a further call waits until one of them ends."""


class Wrapped(Generic[T]):
    """A synchronous object whose calls run in threads."""

    def __init__(self, wrapped: T, threads: ThreadPoolExecutor) -> None:
        self._wrapped = wrapped
        self._threads = threads

    async def _run(self, call: Callable[[T], R]) -> R:
        stop = threading.Event()

        def body() -> R:
            with stopped_by(stop):
                return call(self._wrapped)

        future = asyncio.wrap_future(self._threads.submit(body))
        try:
            return await asyncio.shield(future)
        except asyncio.CancelledError:
            stop.set()
            await asyncio.wait([future])
            if not future.cancelled():
                # Retrieve the outcome, so that asyncio does not report it as lost.
                future.exception()
            raise


def awaited(
    method: Callable[Concatenate[T, P], R],
) -> Callable[Concatenate[Wrapped[T], P], Coroutine[Any, Any, R]]:
    """Coroutine function that runs a synchronous method in a thread."""

    @functools.wraps(method)
    async def call(self: Wrapped[T], /, *arguments: P.args, **options: P.kwargs) -> R:
        return await self._run(lambda wrapped: method(wrapped, *arguments, **options))

    return call


def immediate(method: Callable[Concatenate[T, P], R]) -> Callable[Concatenate[Wrapped[T], P], R]:
    """Method of the wrapper that calls a synchronous method, which does not wait."""

    @functools.wraps(method)
    def call(self: Wrapped[T], /, *arguments: P.args, **options: P.kwargs) -> R:
        return method(self._wrapped, *arguments, **options)

    return call


class AsyncVehicle(Wrapped[Vehicle]):
    """One vehicle of a running fleet; see `Vehicle`."""

    @property
    def name(self) -> str:
        """Name in the fleet file."""
        return self._wrapped.name

    @property
    def state(self) -> VehicleState:
        """Present state."""
        return self._wrapped.state

    @property
    def plan(self) -> Plan | None:
        """Newest plan, None before the first; see `Vehicle.plan`."""
        return self._wrapped.plan

    arm = awaited(Vehicle.arm)
    disarm = awaited(Vehicle.disarm)
    take_off = awaited(Vehicle.take_off)
    land = awaited(Vehicle.land)
    go_to = awaited(Vehicle.go_to)
    follow = awaited(Vehicle.follow)
    lead = awaited(Vehicle.lead)
    fly = awaited(Vehicle.fly)
    tune = awaited(Vehicle.tune)
    start = awaited(Vehicle.start)
    stop = awaited(Vehicle.stop)
    move = awaited(Vehicle.move)
    wait_for_phase = awaited(Vehicle.wait_for_phase)
    wait_for_formation = awaited(Vehicle.wait_for_formation)
    wait_for_arrival = awaited(Vehicle.wait_for_arrival)
    kill = awaited(Vehicle.kill)
    reset = awaited(Vehicle.reset)


class AsyncFleet(Wrapped[Fleet], AbstractAsyncContextManager["AsyncFleet"]):
    """A running fleet for asyncio; see `Fleet`. Use it with `async with`.

    Every vehicle lands when an exception leaves the block, also for cancellation and Ctrl-C. `connect` and
    `launched` make a fleet; `opened` returns the context manager of the synchronous one.
    """

    def __init__(self, opened: Callable[[], AbstractContextManager[Fleet]]) -> None:
        self._opened = opened
        self._threads = ThreadPoolExecutor(THREADS, "fleet")
        self._vehicles: dict[str, AsyncVehicle] = {}

    @classmethod
    def connect(
        cls, path: str | Path | None = None, host: str | None = None, timeout_s: float = 3.0
    ) -> "AsyncFleet":
        """Join the fleet that is up on this computer, or the running one of a fleet file or shipped fleet."""
        return cls(lambda: Fleet.connect(path, host, timeout_s))

    @classmethod
    def launched(cls, path: str | Path, host: str | None = None) -> "AsyncFleet":
        """Start the processes of a fleet as well; see `launched`."""
        return cls(lambda: launched(path, host))

    async def __aenter__(self) -> "AsyncFleet":
        loop = asyncio.get_running_loop()
        self._entered = await loop.run_in_executor(self._threads, self._opened)
        self._wrapped = await loop.run_in_executor(self._threads, self._entered.__enter__)
        self._vehicles = {vehicle.name: AsyncVehicle(vehicle, self._threads) for vehicle in self._wrapped}
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        loop = asyncio.get_running_loop()
        try:
            await loop.run_in_executor(self._threads, self._entered.__exit__, kind, error, trace)
        finally:
            self._threads.shutdown(wait=False)

    def __getitem__(self, name: str) -> AsyncVehicle:
        """Vehicle of this name."""
        return self._vehicles[self._wrapped[name].name]

    def __iter__(self) -> Iterator[AsyncVehicle]:
        """All vehicles, in the order of the fleet file."""
        return iter(self._vehicles.values())

    @property
    def file(self) -> FleetFile:
        """The fleet file."""
        return self._wrapped.file

    @property
    def synchronous(self) -> Fleet:
        """The same fleet for code that may block, for instance recorders."""
        return self._wrapped

    state_of = immediate(Fleet.state_of)
    present = immediate(Fleet.present)
    problems = immediate(Fleet.problems)
    notes = immediate(Fleet.notes)
    watch_latency = immediate(Fleet.watch_latency)
    watch_motion = immediate(Fleet.watch_motion)
    arm = awaited(Fleet.arm)
    take_off = awaited(Fleet.take_off)
    land = awaited(Fleet.land)
    kill = awaited(Fleet.kill)
    swap = awaited(Fleet.swap)
    promote = awaited(Fleet.promote)
    join = awaited(Fleet.join)
    leave = awaited(Fleet.leave)
    wait_for_status = awaited(Fleet.wait_for_status)
    wait_until = awaited(Fleet.wait_until)
    wait_ready = awaited(Fleet.wait_ready)
    wait_for_phase = awaited(Fleet.wait_for_phase)
    wait_for_formation = awaited(Fleet.wait_for_formation)
    wait_for_arrival = awaited(Fleet.wait_for_arrival)
