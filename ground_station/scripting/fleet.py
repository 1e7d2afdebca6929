"""The scripting interface of a fleet: every call is a request on the bus."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from rcopterx.bus.requests import Resume, Suspend
from rcopterx.bus.session import RequestFailedError
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.ground_station.scripting.joining import fleet_that_is_up
from rcopterx.ground_station.scripting.notes import capacity_notes
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.room import join_problem, present_room
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, RefusedError, Vehicle, lines_of
from rcopterx.ground_station.scripting.waiting import NotReachedError, StoppedError, arrived_after
from rcopterx.vehicles.phases import AIRBORNE

if TYPE_CHECKING:
    from rcopterx.bus.messages import Zone
    from rcopterx.deploy.hosts.launcher import Launcher

RETRY_S = 0.1
DISARM_S = 1.0  # for a vehicle to be disarmed after it has landed
FIRMWARE_DISARM_S = 5.0  # for firmware that has to detect the landing first
STATUS_S = 1.0  # by then every vehicle has reported its state
MEASURING_S = 60.0  # how long a take-off waits for hosts that measure how many vehicles they can fly
NOT_LIFTED = (
    "did not lift: charge the battery, see that motors run, then find the hover thrust by "
    "rcopterx calibrate --step throttle"
)
STAY_BEHIND_S = 5.0  # a take-off waits so long for all vehicles before it leaves others behind


class Fleet(Observer, AbstractContextManager["Fleet"]):
    """A running fleet. As a context manager it lands every vehicle when an exception leaves the block.

    Parameters and errors are those of `Observer`.
    """

    launcher: "Launcher | None" = None
    """Launcher of this host's processes, if this program started them (`launched`)."""

    @cached_property
    def _vehicles(self) -> dict[str, Vehicle]:
        return {name: Vehicle(self, name) for name in self.file.vehicles}

    @classmethod
    def connect(
        cls, path: str | Path | None = None, host: str | None = None, timeout_s: float = 3.0
    ) -> "Fleet":
        """Join the fleet that is up on this computer, or the running one of a fleet file or shipped fleet."""
        if path is None:
            file, here = fleet_that_is_up()
            return cls(file, host or here, timeout_s)
        return cls(load_fleet(fleet_path(str(path))), host, timeout_s)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is not None:
                self._land_after(error)
        finally:
            self.close()

    def _land_after(self, error: BaseException) -> None:
        """Land because of an error; a landing that fails is noted on the error."""
        try:
            self.land()
        except FLIGHT_ERRORS as problem:
            first, *others = lines_of(problem)
            for note in (f"landing failed as well: {first}", *others):
                error.add_note(note)

    def __getitem__(self, name: str) -> Vehicle:
        """Vehicle of this name; KeyError without one."""
        return self._vehicles[self._named([name])[0]]

    def __iter__(self) -> Iterator[Vehicle]:
        """All vehicles, in the order of the fleet file."""
        return iter(self._vehicles.values())

    def swap(self, first: str, second: str) -> list[str]:
        """Exchange the roles of two flying vehicles at one frame; all vehicles keep their places in space.

        Vehicles that follow one of them follow the other one afterwards. Returns a line for each vehicle with
        new leaders. Raises `RefusedError`: it cannot be done; nothing has changed.
        """
        # Imported here and below: few programs change leaders.
        from rcopterx.ground_station.scripting.regroup import regroup, role, swapped

        self.wait_for_status()  # of all vehicles, since links of all of them decide who gets other leaders
        statuses = self.statuses(*self.file.subjects)
        change, where = swapped(statuses, first, second)
        regroup(self, change, where, {name: statuses[name].assigned for name in change})
        return [
            f"{name} {role(links)} (before: {role(statuses[name].assigned)})"
            for name, links in change.items()
        ]

    def promote(self, name: str) -> list[str]:
        """Make a flying vehicle the leader of its whole formation, as `swap` with the present one."""
        from rcopterx.ground_station.scripting.regroup import formation_leader

        self.wait_for_status()
        return self.swap(formation_leader(self.statuses(), name), name)

    def form(self, shape: str, leader: str, spacing_m: float = 0.8, *, assign: bool = False) -> list[str]:
        """Bring all flying vehicles into a line, column, wedge or ring behind a vehicle that leads.

        They get places in the order of their names, or, with `assign`, those with the least longest way.
        Returns the line of ancestors of each. Raises `RefusedError`: a place is outside the volume or in a
        zone, and nothing has changed; a vehicle refuses its place although all others have left it; or
        `leader` does not fly, or follows; KeyError: no such shape.
        """
        from rcopterx.ground_station.scripting.regroup import shaped

        self.wait_for_status()
        statuses, room = self.statuses(*self.file.subjects.keys() & {leader}), present_room(self)
        waiting, lines = shaped(statuses, shape, leader, spacing_m, room, assign), []
        while waiting:
            refused: dict[str, RefusedError] = {}
            for name, link in waiting.items():
                try:
                    lines.append(self._vehicles[name].follow((link,)))
                except RefusedError as error:  # A place may become free when other vehicles have got theirs.
                    refused[name] = error
            if len(refused) == len(waiting):
                raise next(iter(refused.values()))
            waiting = {name: waiting[name] for name in refused}
        return lines

    def set_zone(self, name: str, zone: "Zone | None") -> None:
        """Add, change, or with None remove a keep-out zone, until all agents have ended.

        A way that it bars is suspended. Raises `RefusedError`: another program has changed zones meanwhile,
        or there is none of the name; `FleetError`: its corners are wrong.
        """
        from rcopterx.ground_station.scripting.zones import change_zone

        self.wait_for_status()
        change_zone(self, name, zone)

    def suspend(self) -> list[str]:
        """Let all vehicles in the air come to rest on their ways, at one frame; followers with their leaders.

        Trajectories and ways to set points wait for `resume`; a new task of a vehicle discards its own.
        Returns a line for each vehicle that leads. Raises `RefusedError`: none does, or all refuse.
        """
        return self._pause(Suspend)

    def resume(self) -> list[str]:
        """Let all vehicles go on from where they were suspended, at one frame; as `suspend`."""
        return self._pause(Resume)

    def _pause(self, kind: type[Suspend]) -> list[str]:
        from rcopterx.ground_station.scripting.regroup import pause

        self.wait_for_status()
        return pause(self, kind)

    def arm(self, names: Iterable[str] | None = None, timeout_s: float = 5.0) -> None:
        """Arm vehicles and wait until agents and firmware report it; those that do not are disarmed."""
        vehicles = self.present() if names is None else self._named(names)

        def active(name: str) -> bool:
            return self.state_of(name).phase in ("armed", *AIRBORNE)

        def armed(name: str) -> bool:
            return active(name) and self.state_of(name).firmware_armed is not False

        # The last status may be from before a kill or the end of a flight.
        self._renew(filter(active, vehicles))
        deadline_s = self.session.clock() + timeout_s
        for name in vehicles:
            if not active(name):
                # The arbiter requires half a second of throttle-low commands first.
                self._retry(self[name].arm, deadline_s)
        try:
            self.wait_until(
                lambda: all(map(armed, vehicles)), timeout_s, "not all vehicles are armed", vehicles
            )
        except NotReachedError:
            for name in vehicles:
                if not (armed(name) or self.state_of(name).airborne):
                    with suppress(RefusedError, RequestFailedError):
                        self[name].disarm()
            raise

    def _retry(self, request: Callable[[], None], deadline_s: float) -> None:
        """Repeat a request until it is accepted: some reasons for a refusal pass."""
        while True:
            try:
                request()
                return
            except (RefusedError, RequestFailedError):
                if self.session.clock() > deadline_s:
                    raise
                self.wait(RETRY_S)

    def take_off(
        self, names: Iterable[str] | None = None, height_m: float = 1.0, timeout_s: float = 15.0
    ) -> list[str]:
        """Arm and take off, and wait until all fly.

        Without names all vehicles that take part do; those that are not ready a while after the others stay
        behind. Returns the problems of vehicles that stayed behind. Raises `RefusedError`: a vehicle is
        killed, or returned to the floor, or a host can fly fewer vehicles than its agents are; says why.
        Raises `NotReachedError`: not all reached their height in time.
        """
        wanted = None if names is None else self._named(names)
        self._refuse_killed(wanted)
        if wanted is None:
            behind = self._wait_for_most()
            vehicles = [name for name in self.present() if name not in behind]
        else:
            behind, vehicles = {}, wanted
            self.wait_ready(vehicles)
        self._left_behind = (self._left_behind | behind.keys()) - set(vehicles)
        self._wait_for_capacity()
        self.arm(vehicles)
        for name in vehicles:
            if self.state_of(name).phase == "armed":
                self[name].take_off(height_m)
        self._wait_until_flying(vehicles, timeout_s)
        return [line for lines in behind.values() for line in lines]

    def _wait_until_flying(self, vehicles: list[str], timeout_s: float) -> None:
        """Wait until vehicles have reached their height; fail as soon as one is killed or on the floor."""
        climbing: set[str] = set()

        def failures() -> list[str]:
            states = [self.state_of(name) for name in vehicles]
            climbing.update(state.name for state in states if state.airborne)
            return [
                f"{state.name}: {state.remarks or NOT_LIFTED}" if state.phase == "armed" else state.summary()
                for state in states
                if state.transmitter_state == "killed" or (state.name in climbing and not state.airborne)
            ]

        self.wait_until(
            lambda: bool(failures()) or all(self.state_of(name).phase == "flying" for name in vehicles),
            timeout_s,
            "not all vehicles have taken off",
            vehicles,
        )
        if failed := failures():
            raise RefusedError(f"take-off failed: {'; '.join(failed)}")

    def _refuse_killed(self, names: list[str] | None) -> None:
        """Refuse at once if killed vehicles are named, or all are killed: only people may reset them."""
        self.wait_for_status(names)
        wanted = self.present() if names is None else names
        self._renew(self._killed(wanted))  # one that was just reset may have reported before
        killed = self._killed(wanted)
        if killed and (names is not None or len(killed) == len(wanted)):
            raise RefusedError(f"killed: {', '.join(killed)}; reset first (rcopterx reset)")

    def _killed(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if self.state_of(name).transmitter_state == "killed"]

    def _wait_for_most(self) -> dict[str, list[str]]:
        """Wait a while until all vehicles are ready; return the problems of those that are not."""
        killed = self._killed(self.present())
        others = [name for name in self.present() if name not in killed]
        try:
            self.wait_ready(others, timeout_s=STAY_BEHIND_S)
        except StoppedError:
            raise
        except NotReachedError:
            behind = {name: lines for name in self.present() if (lines := self.problems([name]))}
            if not behind.keys() >= set(others):
                return behind
            self.wait_ready(others)
        return {name: self.problems([name]) for name in killed}

    def _wait_for_capacity(self) -> None:
        """Wait a while until hosts know how many vehicles they can fly; refuse a take-off of more."""
        # A launcher that is late has not finished.
        self._notifier.wait_until(
            lambda: not any(status.measuring for status in self.last_launchers().values()),
            self._starting_s(MEASURING_S),
        )
        for host, status in self.last_launchers().items():
            if status.crowded or status.measuring:
                raise RefusedError("; ".join(capacity_notes(host, status)))

    def join(self, name: str, height_m: float = 1.0, timeout_s: float = 20.0) -> str:
        """Start a vehicle that does not take part yet, take off, and follow its leaders of the fleet file.

        Returns whom it follows, in words. Raises `RefusedError`, `RequestFailedError` or `NotReachedError`: a
        vehicle is above it or at its future place, its agent could not be started, or something is missing;
        the others fly on.
        """
        self.wait_for_status()
        if (problem := join_problem(self, name, height_m)) is not None:
            raise RefusedError(f"{name}: {problem}")
        self[name].start()
        started_s = self.session.clock()

        def here() -> bool:
            age_s = self.state_of(name).agent_age_s
            return name in self.present() and arrived_after(started_s, age_s, self.session.clock())

        self.wait_until(here, timeout_s, f"{name} is not started")
        self.wait_ready([name], timeout_s)
        self.take_off([name], height_m)
        leaders = [link.leader for link in self.file.vehicles[name].follow]
        if leaders and all(self.state_of(leader).phase == "flying" for leader in leaders):
            self.wait_for_formation([name], timeout_s=timeout_s)
            return f"{name} follows {', '.join(leaders)}"
        return f"{name} flies"

    def leave(self, name: str, timeout_s: float = 15.0) -> None:
        """Land a vehicle and end its agent; the others fly on.

        Raises `RefusedError`: other vehicles follow it; says which.
        """
        self.wait_for_status()
        followers = self.followers(name)
        if followers:
            others = ", ".join(followers)
            raise RefusedError(f"{name} leads {others}; let another vehicle lead them first, as promote does")
        self.land([name], timeout_s)
        self[name].stop()
        self.wait_until(lambda: name not in self.present(), timeout_s, f"{name} does not leave")

    def land(self, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Land and disarm vehicles, by default all, also those that stand armed.

        Raises `RefusedError`, `RequestFailedError` or `NotReachedError`: a vehicle refused, did not answer,
        did not land, or its firmware reports that it is still armed; the others land and are disarmed first.
        Failures of further vehicles are in the notes of the error.
        """
        self.wait_for_status(names := None if names is None else self._named(names))
        vehicles = [self[name] for name in (self.present() if names is None else names)]
        problems: list[Exception] = []
        landing, refusals = [], {}
        for vehicle in vehicles:
            with _collected(problems):
                try:
                    if vehicle.state.airborne or vehicle.state.agent is None:
                        vehicle.land()
                except RefusedError as refusal:
                    refusals[vehicle] = refusal
                else:
                    landing.append(vehicle)
        with _collected(problems):
            self.wait_until(
                lambda: not any(vehicle.state.airborne for vehicle in landing),
                timeout_s,
                "not all vehicles have landed",
                [vehicle.name for vehicle in landing],
            )
        # A vehicle that touched down after its last status refuses, since it is on the floor already.
        self._notifier.wait_until(lambda: not any(vehicle.state.airborne for vehicle in refusals), STATUS_S)
        problems += [refusal for vehicle, refusal in refusals.items() if vehicle.state.airborne]
        landing += refusals
        for vehicle in [vehicle for vehicle in landing if not vehicle.state.airborne]:
            if vehicle.state.transmitter is not None and vehicle.state.transmitter.state != "killed":
                with _collected(problems):
                    self._retry(vehicle.disarm, self.session.clock() + DISARM_S)
        with _collected(problems):
            self.wait_until(
                lambda: not any(vehicle.state.firmware_armed is True for vehicle in landing),
                FIRMWARE_DISARM_S,
                "not all vehicles have disarmed",
                [vehicle.name for vehicle in landing],
            )
        if problems:
            for other in problems[1:]:
                problems[0].add_note(str(other))
            raise problems[0]

    def home(self, names: Iterable[str] | None = None) -> None:
        """Let vehicles, by default all, fly back to where they took off, clear of each other, and land.

        A vehicle whose place is taken lands at the nearest free one. Trajectories end; vehicles that follow
        one of them, and do not come home, hold. Raises as `land` does, and `RefusedError`: no place or no way
        is free, or a vehicle refuses its way; all hover then.
        """
        from rcopterx.ground_station.scripting.homing import fly_home  # Few programs come home.

        self.wait_for_status()  # of all vehicles: also of those that follow, or are in the way
        fly_home(self, self._vehicles, self.present() if names is None else self._named(names), self.land)


@contextmanager
def _collected(problems: list[Exception]) -> Iterator[None]:
    """Collect errors of the block, so that one vehicle does not hold up the others."""
    try:
        yield
    except FLIGHT_ERRORS as error:
        problems.append(error)
