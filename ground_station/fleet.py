"""The scripting interface: one object per fleet, one per vehicle; every call is a request on the bus."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from agents.neighbours import Neighbours
from bus import channels
from bus.messages import AgentStatus, Following, Kill, Message, Plan, SetPoint
from bus.requests import (
    Arm,
    Disarm,
    Follow,
    GoTo,
    KillVehicle,
    Land,
    Lead,
    Request,
    ResetKill,
    TakeOff,
)
from bus.session import RequestFailedError, Session
from bus.subscription import Inbox
from deploy.fleet import Fleet as FleetFile
from deploy.fleet import load_fleet
from deploy.role_settings import bus_address
from ground_station.regroup import RegroupError, head_of, regroup, swapped
from ground_station.state import AIRBORNE, VehicleState, tracker_problems
from ground_station.waiting import Bell, NotReachedError

M = TypeVar("M", bound=Message)

SOURCE = "operator"
KILL_REPEAT_S = 0.1
ARM_RETRY_S = 0.1
FIRST_WORDS_S = 1.5
"""Longest wait for a first status, which comes five times a second."""


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

    def kill(self, reason: str = "operator") -> None:
        """Cut the motors now, latching."""
        self._ask(KillVehicle(cause=reason))

    def reset(self) -> None:
        """Leave KILLED."""
        self._ask(ResetKill())

    def _ask(self, request: Request) -> str:
        reply = self._fleet.session.request(self.name, request)
        if not reply.accepted:
            raise RefusedError(f"{self.name}: {reply.reason}")
        return reply.reason


class Fleet(AbstractContextManager["Fleet"]):
    """A running fleet. As a context manager it lands every vehicle when an exception leaves the block.

    Parameters
    ----------
    file
        The fleet file, loaded.
    host
        Host whose router is used; by default the first one of the file.

    Raises
    ------
    BusUnreachableError
        No router answers: the fleet is not up.
    """

    def __init__(self, file: FleetFile, host: str | None = None, timeout_s: float = 3.0) -> None:
        self.file = file
        self._bell = Bell()
        address = bus_address(file, host or next(iter(file.hosts)))
        self.session = Session(address, wake=self._bell.ring, timeout_s=timeout_s)
        self._agents = self.session.subscribe_all(channels.AGENT_STATUS)
        self._transmitters = self.session.subscribe_all(channels.TRANSMITTER_STATUS)
        self._poses = self.session.subscribe_all(channels.POSE)
        self.plans = self.session.subscribe_all(channels.PLAN)
        self.tracker = self.session.subscribe(channels.TRACKER_STATUS, channels.TRACKER_UNIT)
        self._vehicles = {name: Vehicle(self, name) for name in file.vehicles}

    @classmethod
    def connect(cls, path: str | Path, host: str | None = None, timeout_s: float = 3.0) -> "Fleet":
        """Join the running fleet of a fleet file."""
        return cls(load_fleet(Path(path)), host, timeout_s)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is not None:
                self.land()
        finally:
            self.close()

    def close(self) -> None:
        """Leave the bus; the fleet goes on flying."""
        self.session.close()

    def __getitem__(self, name: str) -> Vehicle:
        try:
            return self._vehicles[name]
        except KeyError:
            raise KeyError(f"no vehicle {name!r}, known are {', '.join(self._vehicles)}") from None

    def __iter__(self) -> Iterator[Vehicle]:
        return iter(self._vehicles.values())

    def state_of(self, name: str) -> VehicleState:
        """Present state of a vehicle."""
        now_s = self.session.clock()
        agent, agent_age_s = _newest(self._agents.inboxes.get(name), now_s)
        transmitter, transmitter_age_s = _newest(self._transmitters.inboxes.get(name), now_s)
        pose, pose_age_s = _newest(self._poses.inboxes.get(name), now_s)
        plan, _ = _newest(self.plans.inboxes.get(name), now_s)
        seen_age_s = self._unseen_s(name, now_s) if pose is None or pose.occluded else pose_age_s
        return VehicleState(
            name, agent, transmitter, agent_age_s, transmitter_age_s, pose_age_s, seen_age_s, plan
        )

    def _unseen_s(self, name: str, now_s: float) -> float | None:
        """How long the motion capture has not seen a vehicle, as far as the Vicon gateway tells."""
        status, age_s = _newest(self.tracker, now_s)
        for subject in () if status is None else status.subjects:
            if subject.vehicle == name and subject.occluded_s is not None and age_s is not None:
                return subject.occluded_s + age_s
        return None

    def problems(self, names: Iterable[str] | None = None) -> list[str]:
        """What speaks against taking off, in words; empty when nothing does."""
        vehicles = list(self._vehicles if names is None else names)
        tracker, age_s = _newest(self.tracker, self.session.clock())
        found = tracker_problems(tracker, age_s, vehicles)
        return found + [line for name in vehicles for line in self.state_of(name).problems()]

    def statuses(self) -> dict[str, AgentStatus]:
        """Newest statuses of the agents that are not silent."""
        known = Neighbours("", self._agents.inboxes, self.session.clock).statuses()
        return {name: known[name] for name in self.file.vehicles if name in known}

    def frame_period_s(self, name: str) -> float:
        """Time between the frames of the motion capture [s]."""
        inbox = self._poses.inboxes.get(name)
        received = None if inbox is None else inbox.latest()
        return self.file.vehicles[name].control.period_s if received is None else received.message.period_s

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

    def wait_until(
        self, condition: Callable[[], bool], timeout_s: float, what: str, names: Iterable[str] = ()
    ) -> None:
        """Wait until a condition on the fleet's state holds.

        Raises
        ------
        NotReachedError
            It did not within `timeout_s`; the text names `what` and the state of the vehicles `names`.
        """
        if not self._bell.wait_until(condition, timeout_s):
            states = "; ".join(self.state_of(name).summary() for name in names)
            raise NotReachedError(f"after {timeout_s:g} s: {what}" + (f" ({states})" if states else ""))

    def wait_ready(self, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Wait until nothing speaks against taking off."""
        vehicles = list(self._vehicles if names is None else names)
        if not self._bell.wait_until(lambda: not self.problems(vehicles), timeout_s):
            found = "; ".join(self.problems(vehicles))
            raise NotReachedError(f"not ready after {timeout_s:g} s: {found}")

    def arm(self, names: Iterable[str] | None = None, timeout_s: float = 5.0) -> None:
        """Arm vehicles that are not armed yet and wait until their agents know."""
        vehicles = list(self._vehicles if names is None else names)
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
    ) -> None:
        """Arm and take off, and wait until all fly."""
        vehicles = list(self._vehicles if names is None else names)
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

    def land(self, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Land and disarm vehicles, by default every one that is in the air.

        Raises
        ------
        RefusedError, RequestFailedError, NotReachedError
            A vehicle could not be told to land, or did not; all the others land first.
        """
        vehicles = list(self) if names is None else [self[name] for name in names]
        problems: list[RefusedError | RequestFailedError] = []
        told = []
        self.hear(vehicle.name for vehicle in vehicles)
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
        if problems:
            raise problems[0]

    def hear(self, names: Iterable[str] | None = None, timeout_s: float = FIRST_WORDS_S) -> bool:
        """Wait for the first words after joining; False if somebody stayed silent.

        Without names all vehicles and the Vicon gateway are waited for.
        """
        vehicles = list(self._vehicles if names is None else names)
        everybody = names is None

        def heard() -> bool:
            states = [self.state_of(name) for name in vehicles]
            spoken = all(state.agent is not None and state.transmitter is not None for state in states)
            return spoken and (not everybody or self.tracker.latest() is not None)

        return self._bell.wait_until(heard, timeout_s)

    def kill(self, names: Iterable[str] = (), reason: str = "operator", seconds: float = 1.0) -> None:
        """Cut the motors of some or all vehicles now; repeated for a while, as delivery is not assured."""
        message = Kill(source=SOURCE, reason=reason, vehicles=tuple(names))
        deadline_s = time.monotonic() + seconds
        while True:
            self.session.publish(channels.KILL, channels.FLEET_UNIT, message)
            if time.monotonic() >= deadline_s:
                return
            time.sleep(KILL_REPEAT_S)


def _newest(inbox: Inbox[M] | None, now_s: float) -> tuple[M | None, float | None]:
    if inbox is None:
        return None, None
    received = inbox.latest()
    return (None, None) if received is None else (received.message, max(0.0, now_s - received.arrived_s))
