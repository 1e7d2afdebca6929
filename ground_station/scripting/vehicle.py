"""The scripting interface of one vehicle: every call is a request on the bus."""

from collections.abc import Mapping, Sequence

from rcopterx.bus import requests
from rcopterx.bus.message import Colour, FloatArray, Parameters, Setting
from rcopterx.bus.messages import LeaderLink, Plan, SetPoint
from rcopterx.bus.session import RequestFailedError
from rcopterx.control.references.paths import FlightPath
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.scripting.waiting import NotReachedError

ANSWER_S = 2.0  # longer than the lease of a link: a request is sent again when its link was lost
RUN_IN_LIMIT_S = 30.0
HOST_PATIENCE_S = 3.0  # for a host whose link is being dialled again
TUNING_LIMIT_S = 10.0  # longest time to build a controller; the vehicle flies on with the present one


class RefusedError(RuntimeError):
    """A vehicle refused a request; the text is its reason."""


FLIGHT_ERRORS = (RefusedError, RequestFailedError, NotReachedError)  # errors of a request in flight


def lines_of(error: BaseException) -> tuple[str, ...]:
    """Text of an error and its notes, which describe what failed after it."""
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
        """Newest plan, None before the first; the first access subscribes to plans."""
        return self._fleet.plan_of(self.name)

    def arm(self) -> None:
        """Let the vehicle's agent command its transmitter."""
        self._request(requests.Arm())

    def disarm(self) -> None:
        """Keep the throttle low; refused while the vehicle may be in the air."""
        self._request(requests.Disarm())

    def take_off(self, height_m: float = 1.0) -> None:
        """Climb to a height above the floor where the vehicle stands."""
        self._request(requests.TakeOff(height_m=height_m))

    def land(self) -> None:
        """Descend and switch the rotor off."""
        self._request(requests.Land())

    def go_to(self, position_m: Sequence[float], yaw_rad: float = 0.0, turns: int = 0) -> None:
        """Fly to a set point in the inertial frame, turning the nearest way and `turns` whole turns more.

        Where keep-out zones bar the straight way, it flies round or over them, if there is a way.
        """
        x, y, z = map(float, position_m)
        set_point = SetPoint(position_m=(x, y, z), yaw_rad=float(yaw_rad))
        try:
            self._request(requests.GoTo(set_point=set_point, turns=turns))
        except RefusedError:
            from rcopterx.ground_station.scripting.room import way_round  # Needs numerical libraries.

            if turns or (way := way_round(self._fleet, self.name, (x, y, z, yaw_rad))) is None:
                raise
            self.fly(way)

    def fly(self, path: FlightPath, wait: bool = False) -> str:
        """Fly a trajectory from `circle`, `figure_eight`, `spiral` or `through`; returns how long it takes.

        The vehicle first moves smoothly to the beginning of the trajectory. With `wait` the call returns when
        the trajectory has ended. Raises `RefusedError`: it leaves the flight volume or exceeds the limits of
        the vehicle; the text says where.
        """
        answer = self._request(requests.Fly(knots=FloatArray.of(path.knots)))
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

    def light(self, colour: Colour) -> None:
        """Show a colour, red, green and blue of 0 to 255, on its LEDs; `RefusedError` if none are reached."""
        self._request(requests.SetLight(colour=colour))

    def follow(
        self,
        leader: str | Sequence[LeaderLink],
        offset_m: Sequence[float] = (0.0, 0.0, 0.0),
        yaw_offset_rad: float = 0.0,
        frame: str = "inertial",
        transition_s: float | None = None,
    ) -> str:
        """Follow one leader at an offset, or several given as a sequence of `LeaderLink`.

        Returns the line of ancestors, for instance `h3 follows h2 follows h1`.
        """
        if isinstance(leader, str):
            x, y, z = offset_m
            place, turn = (float(x), float(y), float(z)), float(yaw_offset_rad)
            leader = [LeaderLink(leader=leader, offset_m=place, yaw_offset_rad=turn, frame=frame)]
        return self._request(requests.Follow(following=tuple(leader), transition_s=transition_s))

    def lead(self) -> None:
        """Stop following and hold the present position."""
        self._request(requests.Lead())

    def tune(
        self,
        /,
        controller: str | None = None,
        estimator: str | None = None,
        estimator_settings: Mapping[str, Setting] | None = None,
        **controller_settings: Setting,
    ) -> str:
        """Fly with another controller, another estimator or other settings, without a bump.

        Settings of the controller are `horizon`, `state_weights`, `input_min` and so on. They are added to
        the present ones; another controller keeps only the horizon. Returns what flies now, and since which
        frame. Raises `RefusedError`: a name or a value is not allowed; the text says which, and what is
        allowed.
        """
        request = requests.Tune(
            controller=controller,
            controller_settings=controller_settings,
            estimator=estimator,
            estimator_settings=dict(estimator_settings or {}),
        )
        return self._request(request, TUNING_LIMIT_S)

    def use_model(self, parameters: Parameters) -> str:
        """Fly with identified parameters of the model, without a bump; returns as `tune` does.

        Parameters are those of the table `model` in the fleet file. Raises `RefusedError`: a parameter is
        unknown, or no vehicle can have it.
        """
        return self._request(requests.Tune(model=parameters), TUNING_LIMIT_S)

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
        """Cut the motors now; they stay off until `reset`. See `Fleet.kill`."""
        self._fleet.kill([self.name], reason)

    def reset(self) -> None:
        """Leave KILLED."""
        self._request(requests.ResetKill())

    def start(self) -> str:
        """Start its agent and keep it running: the vehicle takes part, and stays on the floor."""
        return self._request_host(
            self._fleet.file.vehicles[self.name].host, requests.StartVehicle(vehicle=self.name)
        )

    def stop(self) -> str:
        """End its agent: the vehicle leaves the fleet. It must be on the floor."""
        running = [host for host, status in self._fleet.launchers().items() if self.name in status.running]
        host = running[0] if running else self._fleet.file.vehicles[self.name].host
        return self._request_host(host, requests.StopVehicle(vehicle=self.name))

    def move(self, host: str, timeout_s: float = 20.0) -> None:
        """Move the agent to another host, also in flight: a new agent takes over when it is warm.

        Raises `RefusedError`: the fleet file does not let it run there. Raises `NotReachedError`: the new
        agent did not take over in time; it was stopped, and the old one flies on.
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
        self._request_host(host, requests.TakeVehicle(vehicle=name))
        try:
            fleet.wait_until(
                lambda: self.state.host == host, timeout_s, f"{host} does not take {name} over", [name]
            )
        except NotReachedError:
            self._request_host(host, requests.StopVehicle(vehicle=name))
            raise

    def _request_host(self, host: str, request: requests.Request) -> str:
        return self._accepted(self._fleet.session.request(host, request, HOST_PATIENCE_S, HOST_PATIENCE_S))

    def _request(self, request: requests.Request, timeout_s: float = ANSWER_S) -> str:
        return self._accepted(self._fleet.session.request(self.name, request, timeout_s))

    def _accepted(self, reply: requests.Reply) -> str:
        if not reply.accepted:
            raise RefusedError(f"{self.name}: {reply.reason}")
        return reply.reason
