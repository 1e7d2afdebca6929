"""The scripting interface of one vehicle: every call is a request on the bus."""

from collections.abc import Mapping, Sequence

from rcopterx.bus.message import FloatArray, Setting
from rcopterx.bus.messages import LeaderLink, Plan, SetPoint
from rcopterx.bus.requests import (
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
    TakeVehicle,
    Tune,
)
from rcopterx.bus.session import RequestFailedError
from rcopterx.control.references.paths import FlightPath
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.scripting.waiting import NotReachedError

ANSWER_S = 1.0
"""For a request that is answered in the next control period."""
RUN_IN_LIMIT_S = 30.0
HOST_PATIENCE_S = 3.0
"""For a host whose link is just being dialled again."""
TUNING_LIMIT_S = 10.0
"""Longest time to build a controller; the vehicle flies on with the present one."""


class RefusedError(RuntimeError):
    """A vehicle refused a request; the text is its reason."""


FLIGHT_ERRORS = (RefusedError, RequestFailedError, NotReachedError)
"""What may become of a request in flight."""


def lines_of(error: BaseException) -> tuple[str, ...]:
    """Text of an error, and what went wrong after it, which its notes tell."""
    return (str(error), *getattr(error, "__notes__", ()))


class Vehicle:
    """One vehicle of a running fleet."""

    def __init__(self, fleet: Observer, name: str) -> None:
        self._fleet = fleet
        self.name = name

    def __str__(self) -> str:
        return str(self.state)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}>"

    @property
    def state(self) -> VehicleState:
        """Present state."""
        return self._fleet.state_of(self.name)

    @property
    def plan(self) -> Plan | None:
        """Newest plan, None before the first; from the first question on plans are heard."""
        return self._fleet.plan_of(self.name)

    def arm(self) -> None:
        """Let the vehicle's agent command its transmitter."""
        self._ask(Arm())

    def disarm(self) -> None:
        """Keep the throttle low; refused while the vehicle may be in the air."""
        self._ask(Disarm())

    def take_off(self, height_m: float = 1.0) -> None:
        """Climb to a height [m] above the floor where the vehicle stands."""
        self._ask(TakeOff(height_m=height_m))

    def land(self) -> None:
        """Descend and switch the rotor off."""
        self._ask(Land())

    def go_to(self, position_m: Sequence[float], yaw_rad: float = 0.0) -> None:
        """Set point in the inertial frame [m, rad].

        The heading counts whole turns, beginning within half a turn of 0: a vehicle that looks back before it
        takes off may be at -pi, from where pi is a whole turn away.
        """
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
        leader: str | Sequence[LeaderLink],
        offset_m: Sequence[float] = (0.0, 0.0, 0.0),
        yaw_offset_rad: float = 0.0,
        frame: str = "inertial",
        transition_s: float | None = None,
    ) -> str:
        """Follow one leader at an offset, or several given as a sequence of `LeaderLink`.

        Returns
        -------
        str
            The line of ancestors, for instance `h3 follows h2 follows h1`.
        """
        if isinstance(leader, str):
            x, y, z = offset_m
            following: tuple[LeaderLink, ...] = (
                LeaderLink(
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
        return self._ask_host(self._fleet.file.vehicles[self.name].host, StartVehicle(vehicle=self.name))

    def stop(self) -> str:
        """Let the vehicle leave: its agent ends. It must be on the floor."""
        return self._ask_host(self._agent_host, StopVehicle(vehicle=self.name))

    def move(self, host: str, timeout_s: float = 20.0) -> None:
        """Let the agent run on another host, also in flight: a new one takes over when it is warm.

        Raises
        ------
        RefusedError
            The fleet file does not let it run there.
        NotReachedError
            The new agent did not take over in time; it was stopped, and the old one flies on.
        """
        name, fleet = self.name, self._fleet
        allowed = fleet.file.agent_hosts(name)
        if host not in allowed:
            raise RefusedError(
                f"{name}: its agent may run on {', '.join(allowed)}; vehicles.{name}.spares of the fleet "
                "file names further hosts"
            )
        if self.state.host == host:
            return
        self._ask_host(host, TakeVehicle(vehicle=name))
        try:
            fleet.wait_until(
                lambda: self.state.host == host, timeout_s, f"{host} does not take {name} over", [name]
            )
        except NotReachedError:
            self._ask_host(host, StopVehicle(vehicle=name))
            raise

    @property
    def _agent_host(self) -> str:
        """Where its agent runs, or would run by the fleet file."""
        running = [host for host, status in self._fleet.launchers().items() if self.name in status.running]
        return running[0] if running else self._fleet.file.vehicles[self.name].host

    def _ask_host(self, host: str, request: Request) -> str:
        reply = self._fleet.session.request(
            host, request, timeout_s=HOST_PATIENCE_S, patience_s=HOST_PATIENCE_S
        )
        if not reply.accepted:
            raise RefusedError(f"{self.name}: {reply.reason}")
        return reply.reason

    def _ask(self, request: Request, timeout_s: float | None = None) -> str:
        limit_s = ANSWER_S if timeout_s is None else timeout_s
        reply = self._fleet.session.request(self.name, request, limit_s)
        if not reply.accepted:
            raise RefusedError(f"{self.name}: {reply.reason}")
        return reply.reason
