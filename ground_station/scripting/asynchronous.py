"""The scripting interface for asyncio: the same calls, awaited.

Nothing is implemented twice: every call runs the synchronous method in a thread of its own. Cancelling a task
ends its waiting at once; what was asked of a vehicle stays asked.
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
"""Calls that wait at the same time; a further one waits for one of them to end."""


class Wrapped(Generic[T]):
    """Something synchronous whose calls run in threads."""

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
                # What the call came to is of no interest any more.
                future.exception()
            raise


def awaited(
    method: Callable[Concatenate[T, P], R],
) -> Callable[Concatenate[Wrapped[T], P], Coroutine[Any, Any, R]]:
    """Coroutine function of a synchronous method, with its parameters and documentation."""

    @functools.wraps(method)
    async def call(self: Wrapped[T], /, *arguments: P.args, **options: P.kwargs) -> R:
        return await self._run(lambda wrapped: method(wrapped, *arguments, **options))

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
        """Newest plan, None before the first; from the first question on plans are heard."""
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

    Every vehicle is landed when an exception leaves the block, also for cancellation and Ctrl-C.

    Parameters
    ----------
    entered
        Context manager that yields the fleet; `connect` and `launched` give the usual ones.
    """

    def __init__(self, entered: AbstractContextManager[Fleet]) -> None:
        self._entered = entered
        self._threads = ThreadPoolExecutor(THREADS, "fleet")
        self._vehicles: dict[str, AsyncVehicle] = {}

    @classmethod
    def connect(
        cls, path: str | Path | None = None, host: str | None = None, timeout_s: float = 3.0
    ) -> "AsyncFleet":
        """Join the fleet that is up on this computer, or the running one of a fleet file or shipped fleet."""
        return cls(_Joined(path, host, timeout_s))

    @classmethod
    def launched(cls, path: str | Path, host: str | None = None) -> "AsyncFleet":
        """Start the processes of a fleet, too; see `launched`."""
        return cls(launched(path, host))

    async def __aenter__(self) -> "AsyncFleet":
        loop = asyncio.get_running_loop()
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

    def state_of(self, name: str) -> VehicleState:
        """Present state of a vehicle."""
        return self._wrapped.state_of(name)

    def present(self) -> list[str]:
        """Vehicles of the fleet file that take part: all but those that are absent and run nowhere else."""
        return self._wrapped.present()

    def problems(self, names: list[str] | None = None) -> list[str]:
        """What blocks take-off, one line each; empty when nothing does."""
        return self._wrapped.problems(names)

    def notes(self) -> list[str]:
        """Remarks that do not block take-off: subjects, recordings, hosts, what failed in flight."""
        return self._wrapped.notes()

    def watch_latency(self) -> None:
        """From now on states tell latencies by stage; every command that is written is heard for that."""
        self._wrapped.watch_latency()

    def watch_motion(self) -> None:
        """From now on every pose and every plan is heard, and states tell them: for pages that draw.

        They are a hundred messages a second of each vehicle, from every host to this one.
        """
        self._wrapped.watch_motion()

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


class _Joined(AbstractContextManager[Fleet]):
    """Joins a running fleet when it is entered."""

    def __init__(self, path: str | Path | None, host: str | None, timeout_s: float) -> None:
        self._path, self._host, self._timeout_s = path, host, timeout_s

    def __enter__(self) -> Fleet:
        self._fleet = Fleet.connect(self._path, self._host, self._timeout_s)
        return self._fleet

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._fleet.__exit__(kind, error, trace)
