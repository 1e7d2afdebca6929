"""The state of a running fleet, read from the bus, and waiting for it; observing needs nothing else."""

from collections.abc import Callable, Iterable

from rcopterx.bus import channels
from rcopterx.bus.messages import Kill, Plan
from rcopterx.bus.session import Session
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.joining import WrongFleetError, as_running, check_identity
from rcopterx.ground_station.scripting.reader import Reader
from rcopterx.ground_station.scripting.state import VehicleState, arrival_problem, formation_problem
from rcopterx.ground_station.scripting.waiting import Notifier, NotReachedError, arrived_after, begin_turns
from rcopterx.vehicles.phases import Phase

STARTED_S = 30.0  # until a fleet that was just started is ready; ArduCopter accepts arming after 20 s
FIRST_STATUS_S = 1.5  # longest wait for a first status; statuses come five times a second
UNDER_WAY_S = 0.05  # a status that arrives this soon after a call may have been sent before it
SOURCE = "operator"
KILL_REPEAT_S = 0.1  # between two copies of a kill; one that is lost costs a vehicle this much time
FIRST_MOTION_S = 0.5  # longest wait for a first plan or pose; they come every control period


class Observer(Reader):
    """Reads the messages of a running fleet, waits for them, and cuts motors.

    `host` is the host whose router is used, by default the first one of the file; `timeout_s` is how long to
    look for the router; `clock` is monotonic [s], for ages and waits, by default that of the fleet. With a
    name as a `process` it takes turns in lockstep: time stands still while it does not wait. Raises
    `BusUnreachableError`: no router answers, so the fleet is not up. Raises `WrongFleetError`: the router
    belongs to another fleet, or to one that was started from another version of the file. Raises
    `NotReachedError`: processes of a fleet in lockstep did not start.
    """

    def __init__(
        self,
        file: FleetFile,
        host: str | None = None,
        timeout_s: float = 3.0,
        clock: Callable[[], float] | None = None,
        process: str = "",
    ) -> None:
        self._host, self._process = host or next(iter(file.hosts)), process
        self.file = as_running(file)
        self._join(clock, timeout_s)
        if self.file is not (running := as_running(self.file)):
            # It was not up yet before its router answered.
            self.session.close()
            self.file = running
            self._join(clock, timeout_s)
        try:
            check_identity(self.session, self.file)
        except WrongFleetError:
            self.session.close()
            raise
        super().__init__(self.file, self._host, self.session)
        self._left_behind: frozenset[str] = frozenset()  # by a take-off, on the floor

    def _join(self, clock: Callable[[], float] | None, timeout_s: float) -> None:
        address = bus_address(self.file, self._host, self._process)
        self._notifier = Notifier(clock or address.clock.now)
        self.session = Session(address, self._notifier, clock=clock, timeout_s=timeout_s, begin=False)
        begin_turns(self.session)

    def wait(self, seconds: float) -> None:
        """Wait in the time of the fleet, which passes at another speed than real time in slow motion."""
        self._notifier.wait_until(lambda: False, seconds)

    def _starting_s(self, real_s: float) -> float:
        """Return how long processes may take that need real time, however fast that of the fleet passes."""
        return max(1.0, self.file.clock.speed) * real_s

    def close(self) -> None:
        """Leave the bus; the fleet flies on."""
        self.session.close()

    def moving_state_of(self, name: str, complete: Callable[[VehicleState], bool]) -> VehicleState:
        """State of a vehicle with its motion; waits until it is complete if the subscription is new."""
        left_s = self.watch_motion().since_s + FIRST_MOTION_S - self.session.clock()
        if left_s > 0:
            self._notifier.wait_until(lambda: complete(self.state_of(name)), left_s)
        return self.state_of(name)

    def plan_of(self, name: str) -> Plan | None:
        """Newest plan of a vehicle, None before the first; the first call subscribes to plans."""
        return self.moving_state_of(name, lambda state: state.plan is not None).plan

    def followers(self, name: str) -> list[str]:
        """Vehicles that follow a vehicle now, by plans that are newer than this call."""
        from_s = self.session.clock() + UNDER_WAY_S
        inboxes = self.watch_motion().plans.inboxes

        def new_plans() -> dict[str, Plan]:
            return {
                other: received.message
                for other, inbox in tuple(inboxes.items())
                if (received := inbox.latest()) is not None and received.arrived_s >= from_s
            }

        self._notifier.wait_until(lambda: set(self.statuses()) <= new_plans().keys(), FIRST_STATUS_S)
        return [
            other for other, plan in new_plans().items() if name in [link.leader for link in plan.following]
        ]

    def wait_for_status(self, names: Iterable[str] | None = None, timeout_s: float = FIRST_STATUS_S) -> bool:
        """Wait for a first status of vehicles after joining; False if one is missing.

        Without names it waits for all vehicles and the Vicon gateway.
        """
        wanted = None if names is None else self._named(names)

        def complete() -> bool:
            states = [self.state_of(name) for name in (self.present() if wanted is None else wanted)]
            reported = all(state.agent is not None and state.transmitter is not None for state in states)
            return reported and (wanted is not None or self.tracker.latest() is not None)

        return self._notifier.wait_until(complete, timeout_s)

    def _renew(self, names: Iterable[str]) -> None:
        """Wait a while for statuses of vehicles that are newer than this call."""
        from_s, vehicles = self.session.clock() + UNDER_WAY_S, list(names)

        def renewed() -> bool:
            states, now_s = map(self.state_of, vehicles), self.session.clock()
            ages_s = [age_s for state in states for age_s in (state.agent_age_s, state.transmitter_age_s)]
            return all(arrived_after(from_s, age_s, now_s) for age_s in ages_s)

        self._notifier.wait_until(renewed, FIRST_STATUS_S)

    def kill(self, names: Iterable[str] = (), reason: str = "operator", timeout_s: float = 3.0) -> None:
        """Cut the motors of some or all vehicles until `Vehicle.reset`; repeated until all arbiters confirm.

        Raises `NotReachedError`: an arbiter is not KILLED after the copies of `timeout_s`; says which.
        """
        message = Kill(source=SOURCE, reason=reason, vehicles=tuple(self._named(names)))
        wanted = message.vehicles or tuple(self.file.vehicles)
        from_s = self.session.clock()
        confirmed: set[str] = set()

        def missing() -> list[str]:
            # A vehicle that has confirmed once may have been reset since.
            for state in map(self.state_of, wanted):
                # Earlier reports may be outdated.
                recent = arrived_after(from_s, state.transmitter_age_s, self.session.clock())
                if recent and state.transmitter_state == "killed":
                    confirmed.add(state.name)
            return [name for name in wanted if name not in confirmed]

        for _ in range(max(1, round(timeout_s / KILL_REPEAT_S))):  # also after a stall of any length
            self.session.publish(channels.KILL, channels.FLEET_UNIT, message)
            if self._notifier.wait_until(lambda: not missing(), KILL_REPEAT_S):
                return
        states = "; ".join(self.state_of(name).summary() for name in missing())
        raise NotReachedError(f"after {timeout_s:g} s: not killed: {states}")

    def wait_until(
        self, condition: Callable[[], bool], timeout_s: float, what: str, names: Iterable[str] = ()
    ) -> None:
        """Wait until a condition on the fleet's state holds.

        Raises `NotReachedError` after `timeout_s`, which names `what` and the state of the vehicles `names`.
        """
        vehicles = self._named(names)
        if not self._notifier.wait_until(condition, timeout_s):
            states = "; ".join(self.state_of(name).summary() for name in vehicles)
            raise NotReachedError(f"after {timeout_s:g} s: {what}" + (f" ({states})" if states else ""))

    def _wait_for_none(self, missing: Callable[[], list[str]], timeout_s: float, what: str) -> None:
        """Wait until a list is empty; the error has the lines that are left."""
        if not self._notifier.wait_until(lambda: not missing(), timeout_s):
            raise NotReachedError(f"after {timeout_s:g} s: {what}: {'; '.join(missing())}")

    def wait_ready(self, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Wait until nothing blocks take-off, for processes that start never less than in real time."""
        vehicles = None if names is None else self._named(names)
        self._wait_for_none(lambda: self.problems(vehicles), self._starting_s(timeout_s), "not ready")

    def wait_for_phase(self, phase: str, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Wait until vehicles, by default all, are in a flight phase.

        Raises `NotReachedError`: they were not within `timeout_s`; names those that are not and the state of
        each. Raises `ValueError`: there is no such phase.
        """
        wanted = Phase(phase)
        vehicles = None if names is None else self._named(names)

        def missing() -> list[str]:
            states = [self.state_of(name) for name in (self.present() if vehicles is None else vehicles)]
            return [state.summary() for state in states if state.phase != wanted]

        self._wait_for_none(missing, timeout_s, f"not {phase}")

    def wait_for_formation(
        self, names: Iterable[str] | None = None, tolerance_m: float = 0.1, timeout_s: float = 20.0
    ) -> None:
        """Wait until followers, by default all, are at their places and their offsets at rest.

        Raises `NotReachedError` after `timeout_s`, which says what is missing of each.
        """
        self._wait_for_places(
            names, lambda state: formation_problem(state, tolerance_m), timeout_s, followers=True
        )

    def wait_for_arrival(
        self, names: Iterable[str] | None = None, tolerance_m: float = 0.1, timeout_s: float = 15.0
    ) -> None:
        """Wait until vehicles, by default all that do not follow, are at their set points.

        Raises `NotReachedError` after `timeout_s`, which says how far each one is away.
        """
        self._wait_for_places(
            names, lambda state: arrival_problem(state, tolerance_m), timeout_s, followers=False
        )

    def _wait_for_places(
        self,
        names: Iterable[str] | None,
        problem: Callable[[VehicleState], str],
        timeout_s: float,
        followers: bool,
    ) -> None:
        """Wait until new states show no problem of any vehicle, or of all followers, or of all others."""
        what = "no formation" if followers else "not there"
        wanted = self.present() if names is None else self._named(names)
        from_s = self.session.clock() + UNDER_WAY_S

        def problem_of(name: str) -> str:
            state = self.state_of(name)
            if names is None and name in self._left_behind and not state.airborne:
                return ""
            if not arrived_after(from_s, state.agent_age_s, self.session.clock()):
                return f"{name}: agent not responding"
            return "" if names is None and bool(state.assigned) != followers else problem(state)

        self._wait_for_none(lambda: [line for name in wanted if (line := problem_of(name))], timeout_s, what)
