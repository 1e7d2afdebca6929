"""The scripting interface: one object per fleet, one per vehicle; every call is a request on the bus."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType

from agents.paths import FlightPath
from bus import channels
from bus.messages import FloatArray, Following, Kill, Plan, SetPoint, Setting
from bus.requests import (
    Arm,
    Disarm,
    Fly,
    Follow,
    GoTo,
    KillVehicle,
    Land,
    Lead,
    Request,
    ResetKill,
    StartVehicle,
    StopVehicle,
    TakeOff,
    Tune,
)
from bus.session import RequestFailedError
from deploy.fleet import Fleet as FleetFile
from deploy.fleet import load_fleet
from deploy.launcher import Launcher
from deploy.shipped import fleet_path
from ground_station.observer import Observer
from ground_station.regroup import RegroupError, head_of, regroup, swapped
from ground_station.state import AIRBORNE, VehicleState
from ground_station.waiting import NotReachedError

SOURCE = "operator"
KILL_REPEAT_S = 0.1
ARM_RETRY_S = 0.1
DISARM_S = 1.0
"""For the agents to tell that they are disarmed."""
RUN_IN_LIMIT_S = 30.0
TUNING_LIMIT_S = 10.0
"""Longest time to build a controller; the vehicle flies on with the present one."""
STAY_BEHIND_S = 5.0
"""How long everybody is waited for before those that are ready take off without the others."""


class RefusedError(RuntimeError):
    """A vehicle refused a request; the text is its reason."""


class Vehicle:
    """One vehicle of a running fleet."""

    def __init__(self, fleet: "Fleet", name: str) -> None:
        self._fleet = fleet
        self.name = name

    @property
    def state(self) -> VehicleState:
        """Present state."""
        return self._fleet.state_of(self.name)

    @property
    def plan(self) -> Plan | None:
        """Newest plan, None before the first."""
        return self.state.plan

    def arm(self) -> None:
        """Let the vehicle's agent command its transmitter."""
        self._ask(Arm(lease=self.name))

    def disarm(self) -> None:
        """Keep the throttle low."""
        self._ask(Disarm())

    def take_off(self, height_m: float = 1.0) -> None:
        """Climb to a height [m] above the floor where the vehicle stands."""
        self._ask(TakeOff(height_m=height_m))

    def land(self) -> None:
        """Descend and switch the rotor off."""
        self._ask(Land())

    def go_to(self, position_m: Sequence[float], yaw_rad: float = 0.0) -> None:
        """Set point in the inertial frame [m, rad]."""
        x, y, z = position_m
        self._ask(GoTo(set_point=SetPoint(position_m=(float(x), float(y), float(z)), yaw_rad=float(yaw_rad))))

    def fly(self, path: FlightPath, wait: bool = False) -> str:
        """Fly a trajectory, after a smooth way to its beginning.

        Parameters
        ----------
        path
            From `circle`, `figure_eight`, `spiral` or `through`.
        wait
            Return only when it has been flown.

        Returns
        -------
        str
            How long it takes.

        Raises
        ------
        RefusedError
            It leaves the flight volume or asks too much of the vehicle; the text says where.
        """
        answer = self._ask(Fly(knots=FloatArray.of(path.knots)))
        if wait:
            limit_s = path.duration_s + RUN_IN_LIMIT_S
            self._fleet.wait_until(lambda: self._path_left_s() > 0.0, 2.0, "it does not begin", [self.name])
            self._fleet.wait_until(
                lambda: self._path_left_s() == 0.0, limit_s, "the trajectory has not ended", [self.name]
            )
        return answer

    def _path_left_s(self) -> float:
        status = self.state.agent
        return 0.0 if status is None else status.path_left_s

    def follow(
        self,
        leader: str | Sequence[Following],
        offset_m: Sequence[float] = (0.0, 0.0, 0.0),
        yaw_offset_rad: float = 0.0,
        frame: str = "inertial",
        transition_s: float | None = None,
    ) -> str:
        """Follow one leader at an offset, or several given as a sequence of `Following`.

        Returns
        -------
        str
            The line of ancestors, for instance `h3 follows h2 follows h1`.
        """
        if isinstance(leader, str):
            x, y, z = offset_m
            following: tuple[Following, ...] = (
                Following(
                    leader=leader,
                    offset_m=(float(x), float(y), float(z)),
                    yaw_offset_rad=float(yaw_offset_rad),
                    frame=frame,
                ),
            )
        else:
            following = tuple(leader)
        return self._ask(Follow(following=following, transition_s=transition_s))

    def lead(self) -> None:
        """Follow nobody any more; hold the present place."""
        self._ask(Lead())

    def tune(
        self,
        /,
        controller: str | None = None,
        estimator: str | None = None,
        estimator_settings: Mapping[str, Setting] | None = None,
        **controller_settings: Setting,
    ) -> str:
        """Fly with another controller, another estimator or other settings, without a bump.

        Parameters
        ----------
        controller, estimator
            Names; by default the present ones.
        estimator_settings
            Settings of the estimator by name.
        **controller_settings
            Settings of the controller: `horizon`, `state_weights`, `input_min` and so on. They are added to
            the present ones; another controller takes only the horizon over.

        Returns
        -------
        str
            What flies now, and since which frame.

        Raises
        ------
        RefusedError
            A name or a value is not allowed; the text says which, and what is.
        """
        request = Tune(
            controller=controller,
            controller_settings=controller_settings,
            estimator=estimator,
            estimator_settings=dict(estimator_settings or {}),
        )
        return self._ask(request, TUNING_LIMIT_S)

    def wait_for_phase(self, phase: str, timeout_s: float = 15.0) -> None:
        """Wait for a flight phase; see `Fleet.wait_for_phase`."""
        self._fleet.wait_for_phase(phase, [self.name], timeout_s)

    def wait_for_formation(self, tolerance_m: float = 0.1, timeout_s: float = 20.0) -> None:
        """Wait until it is at its place beside its leaders; see `Fleet.wait_for_formation`."""
        self._fleet.wait_for_formation([self.name], tolerance_m, timeout_s)

    def wait_for_arrival(self, tolerance_m: float = 0.1, timeout_s: float = 15.0) -> None:
        """Wait until it is at its set point; see `Fleet.wait_for_arrival`."""
        self._fleet.wait_for_arrival([self.name], tolerance_m, timeout_s)

    def kill(self, reason: str = "operator") -> None:
        """Cut the motors now, latching."""
        self._ask(KillVehicle(cause=reason))

    def reset(self) -> None:
        """Leave KILLED."""
        self._ask(ResetKill())

    def start(self) -> str:
        """Let the vehicle take part: its agent is started and kept running. It stays on the floor."""
        return self._ask(StartVehicle())

    def stop(self) -> str:
        """Let the vehicle leave: its agent ends. It must be on the floor."""
        return self._ask(StopVehicle())

    def _ask(self, request: Request, timeout_s: float = 1.0) -> str:
        reply = self._fleet.session.request(self.name, request, timeout_s)
        if not reply.accepted:
            raise RefusedError(f"{self.name}: {reply.reason}")
        return reply.reason


class Fleet(Observer, AbstractContextManager["Fleet"]):
    """A running fleet. As a context manager it lands every vehicle when an exception leaves the block.

    Parameters
    ----------
    file
        The fleet file, loaded.
    host
        Host whose router is used; by default the first one of the file.
    timeout_s
        How long to look for the router.

    Attributes
    ----------
    launcher
        Launcher of this host's processes, if this program started them (`launched`).

    Raises
    ------
    BusUnreachableError
        No router answers: the fleet is not up.
    """

    def __init__(self, file: FleetFile, host: str | None = None, timeout_s: float = 3.0) -> None:
        super().__init__(file, host, timeout_s)
        self.launcher: Launcher | None = None
        self._vehicles = {name: Vehicle(self, name) for name in file.vehicles}

    @classmethod
    def connect(cls, path: str | Path, host: str | None = None, timeout_s: float = 3.0) -> "Fleet":
        """Join the running fleet of a fleet file, or of the shipped fleet of this name."""
        return cls(load_fleet(fleet_path(str(path))), host, timeout_s)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is not None:
                self.land()
        finally:
            self.close()

    def __getitem__(self, name: str) -> Vehicle:
        """Vehicle of this name."""
        try:
            return self._vehicles[name]
        except KeyError:
            raise KeyError(f"no vehicle {name!r}, known are {', '.join(self._vehicles)}") from None

    def __iter__(self) -> Iterator[Vehicle]:
        """All vehicles, in the order of the fleet file."""
        return iter(self._vehicles.values())

    def swap(self, first: str, second: str) -> list[str]:
        """Let two flying vehicles change roles at one frame; everybody keeps its place in space.

        Returns
        -------
        list of str
            Whom each vehicle that got other leaders follows now, in words.

        Raises
        ------
        RefusedError
            It cannot be done; nothing has changed.
        """
        self.hear([first, second])
        statuses = self.statuses()
        try:
            change, where = swapped(statuses, first, second)
            regroup(self, change, where, {name: statuses[name].assigned for name in change})
        except RegroupError as error:
            raise RefusedError(str(error)) from None
        return [
            f"{name} follows {', '.join(link.leader for link in links)}" if links else f"{name} leads"
            for name, links in change.items()
        ]

    def promote(self, name: str) -> list[str]:
        """Make a flying vehicle the leader of its whole formation, as `swap` with the present one."""
        self.hear([name])
        try:
            head = head_of(self.statuses(), name)
        except RegroupError as error:
            raise RefusedError(str(error)) from None
        return self.swap(head, name)

    def arm(self, names: Iterable[str] | None = None, timeout_s: float = 5.0) -> None:
        """Arm vehicles that are not armed yet and wait until their agents know."""
        vehicles = self.present() if names is None else list(names)
        deadline_s = time.monotonic() + timeout_s
        for name in vehicles:
            if self.state_of(name).phase not in ("armed", *AIRBORNE):
                self._arm_patiently(name, deadline_s)
        self.wait_until(
            lambda: all(self.state_of(name).phase in ("armed", *AIRBORNE) for name in vehicles),
            timeout_s,
            "not all vehicles are armed",
            vehicles,
        )

    def _arm_patiently(self, name: str, deadline_s: float) -> None:
        # The arbiter wants half a second of throttle-low commands first; a refusal for that reason passes.
        while True:
            try:
                self[name].arm()
                return
            except (RefusedError, RequestFailedError):
                if time.monotonic() > deadline_s:
                    raise
                self._bell.wait_until(lambda: False, ARM_RETRY_S)

    def take_off(
        self, names: Iterable[str] | None = None, height_m: float = 1.0, timeout_s: float = 15.0
    ) -> list[str]:
        """Arm and take off, and wait until all fly.

        Without names everybody who takes part does; who is not ready a while after the others stays behind.

        Returns
        -------
        list of str
            What keeps vehicles on the floor that stayed behind.
        """
        behind = self._wait_for_most() if names is None else {}
        vehicles = [name for name in self.present() if name not in behind] if names is None else list(names)
        if names is not None:
            self.wait_ready(vehicles)
        self.arm(vehicles)
        for name in vehicles:
            if self.state_of(name).phase == "armed":
                self[name].take_off(height_m)
        self.wait_until(
            lambda: all(self.state_of(name).phase == "flying" for name in vehicles),
            timeout_s,
            "not all vehicles have taken off",
            vehicles,
        )
        return [line for lines in behind.values() for line in lines]

    def _wait_for_most(self) -> dict[str, list[str]]:
        """Wait until everybody is ready, or for a while; what keeps the others, by vehicle."""
        try:
            self.wait_ready(timeout_s=STAY_BEHIND_S)
        except NotReachedError:
            behind = {name: self.problems([name]) for name in self.present()}
            if all(behind.values()):
                self.wait_ready()
                return {}
            return {name: lines for name, lines in behind.items() if lines}
        return {}

    def join(self, name: str, height_m: float = 1.0, timeout_s: float = 20.0) -> str:
        """Let a vehicle that does not take part yet take off and follow its leaders of the fleet file.

        Returns
        -------
        str
            Whom it follows, in words.

        Raises
        ------
        RefusedError, RequestFailedError, NotReachedError
            It could not be started, or something is missing; the others fly on.
        """
        self[name].start()
        started_s = self.session.clock()

        def here() -> bool:
            age_s = self.state_of(name).agent_age_s
            return name in self.present() and age_s is not None and self.session.clock() - age_s > started_s

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

        Raises
        ------
        RefusedError
            Others follow it; says who.
        """
        self.hear()
        followers = self.followers(name)
        if followers:
            others = ", ".join(followers)
            raise RefusedError(f"{name} leads {others}; let another vehicle lead them first, as promote does")
        self.land([name], timeout_s)
        self[name].stop()
        self.wait_until(lambda: name not in self.present(), timeout_s, f"{name} does not leave")

    def land(self, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Land and disarm vehicles, by default every one that is in the air.

        Raises
        ------
        RefusedError, RequestFailedError, NotReachedError
            A vehicle could not be told to land, or did not; all the others land first.
        """
        self.hear(names := None if names is None else list(names))
        vehicles = [self[name] for name in (self.present() if names is None else names)]
        problems: list[RefusedError | RequestFailedError] = []
        told = []
        for vehicle in vehicles:
            if vehicle.state.airborne or vehicle.state.agent is None:
                try:
                    vehicle.land()
                except (RefusedError, RequestFailedError) as error:
                    problems.append(error)
                    continue
            told.append(vehicle)
        self.wait_until(
            lambda: not any(vehicle.state.airborne for vehicle in told),
            timeout_s,
            "not all vehicles have landed",
            [vehicle.name for vehicle in told],
        )
        for vehicle in told:
            if vehicle.state.transmitter is not None and vehicle.state.transmitter.state != "killed":
                vehicle.disarm()
        # Whoever takes off next must not take the last words before disarming for the present.
        self._bell.wait_until(lambda: not any(vehicle.state.phase == "armed" for vehicle in told), DISARM_S)
        if problems:
            raise problems[0]

    def kill(self, names: Iterable[str] = (), reason: str = "operator", seconds: float = 1.0) -> None:
        """Cut the motors of some or all vehicles now; repeated for a while, as delivery is not assured."""
        message = Kill(source=SOURCE, reason=reason, vehicles=tuple(names))
        deadline_s = time.monotonic() + seconds
        while True:
            self.session.publish(channels.KILL, channels.FLEET_UNIT, message)
            if time.monotonic() >= deadline_s:
                return
            time.sleep(KILL_REPEAT_S)
