"""`rcopterx kill`: cuts the motors of every fleet that is up, and reports whether the arbiters confirm it.

It must work a tenth of a second after it was typed, so nothing here imports the command line, message types
or numerical libraries: the message is packed from a plain table.
"""

import os
import sys
import threading
import time
from collections.abc import Sequence
from typing import NamedTuple

import msgpack
import zenoh
from zenoh.handlers import Callback

from rcopterx.bus.endpoints import Credentials, client_config, open_session
from rcopterx.bus.keys import EVERY_FLEET, FLEET_UNIT, KILL_TOPIC, ROOT, TRANSMITTER_TOPIC, key
from rcopterx.deploy.hosts.running import RunningFleet, running_fleets

SOURCE = "operator"
SCHEMA_VERSION = 2
REPEAT_S = 0.05  # between two copies of a kill; a lost copy costs a vehicle this much time
CONFIRM_S = 2.0  # longest wait for confirmations, and for statuses from unknown fleets
FIRST_RECORD_S = 0.3  # a router that was just replaced has no record for a moment
ATTEMPT_S = 0.2  # to connect to one endpoint; repeated until the end
USUAL_ROUTER = "tcp/127.0.0.1:7447"  # tried as well, for other run directories than `RCOPTERX_RUN`
LISTEN_S = 0.5  # for statuses from a router without a record; they come five times a second
EXIT_FAILED = 1
EXIT_USAGE = 2


class KillVerdict(NamedTuple):
    """Outcome for one vehicle; `reason` is empty if its arbiter is KILLED."""

    fleet: str
    vehicle: str
    reason: str


class States:
    """Newest states of arbiters by fleet and vehicle, from all routers."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._states: dict[tuple[str, str], str] = {}

    def store(self, sample: zenoh.Sample) -> None:
        """Store the state in a transmitter's status; called on receive threads."""
        chunks = str(sample.key_expr).split("/")
        try:
            state = str(msgpack.unpackb(sample.payload.to_bytes())["state"])
        except (ValueError, TypeError, KeyError):
            return
        with self._changed:
            self._states[chunks[1], chunks[2]] = state
            self._changed.notify_all()

    def now(self) -> dict[tuple[str, str], str]:
        """All states that have arrived."""
        with self._changed:
            return dict(self._states)

    def wait(self, seconds: float) -> None:
        """Wait for the next state, at most for a time."""
        with self._changed:
            self._changed.wait(seconds)


class Router:
    """One router through which the kill is published."""

    def __init__(
        self,
        endpoints: Sequence[str],
        namespace: str | None,
        states: States,
        stop: threading.Event,
        credentials: Credentials | None = None,
    ) -> None:
        self._endpoints, self._namespace, self._credentials = endpoints, namespace, credentials
        self._states, self._stop = states, stop
        self._linked_s: float | None = None
        self._refused = False

    def complete(self) -> bool:
        """Whether there is no router, or all vehicles behind it have had the time to report."""
        if self._linked_s is None:
            return self._refused
        return time.monotonic() > self._linked_s + LISTEN_S

    def repeat(self, target: str, payload: bytes) -> None:
        """Publish the kill again and again until the stop event; retry while the router does not answer."""
        if (session := self._opened()) is None:
            return
        session.put(target, payload, priority=zenoh.Priority.REAL_TIME)
        pattern = f"{ROOT}/*/*/{TRANSMITTER_TOPIC}"
        subscriber = session.declare_subscriber(pattern, Callback(self._states.store, indirect=False))
        self._linked_s = time.monotonic()
        while not self._stop.wait(REPEAT_S):
            session.put(target, payload, priority=zenoh.Priority.REAL_TIME)
        subscriber.undeclare()
        session.close()

    def _opened(self) -> zenoh.Session | None:
        while not self._stop.is_set():
            for endpoint in self._endpoints:
                config = client_config([endpoint], self._namespace, ATTEMPT_S, self._credentials)
                try:
                    return open_session(config)
                except zenoh.ZError:
                    self._refused = True
                    self._stop.wait(0.01)
        return None


def fleets_to_kill() -> list[RunningFleet]:
    """Every fleet with a router on this computer."""
    give_up_s = time.monotonic() + FIRST_RECORD_S
    while not (found := running_fleets()) and time.monotonic() < give_up_s:
        time.sleep(0.01)
    known = {endpoint for running in found for endpoint in running.endpoints}
    if "RCOPTERX_RUN" not in os.environ and USUAL_ROUTER not in known:
        # Only the address of this router is known.
        found.append(RunningFleet("", "", None, "", [USUAL_ROUTER], [], [], ""))
    return found


def kill(
    fleets: Sequence[RunningFleet], vehicles: Sequence[str] = (), *, only: str | None = None
) -> list[KillVerdict]:
    """Cut the motors, again and again, until every arbiter reports KILLED or the time is over.

    `fleets` are those whose routers are used; without `vehicles`, or `only` a fleet, all behind them obey.
    """
    states, stop = States(), threading.Event()
    target = key(only or EVERY_FLEET, FLEET_UNIT, KILL_TOPIC)
    payload = msgpack.packb(
        {"schema_version": SCHEMA_VERSION, "source": SOURCE, "reason": SOURCE, "vehicles": list(vehicles)}
    )
    threads, unknown = [], []
    for running in fleets:
        credentials = Credentials(*running.credentials) if running.credentials else None
        for endpoints in (running.endpoints, *([other] for other in running.others)):
            router = Router(endpoints, running.namespace, states, stop, credentials)
            threads.append(threading.Thread(target=router.repeat, args=(target, payload)))
            threads[-1].start()
            if not running.vehicles:
                unknown.append(router)
    wanted = {(one.fleet, name) for one in fleets for name in one.vehicles if _meant(name, vehicles)}
    give_up_s = time.monotonic() + CONFIRM_S
    while True:
        reported = states.now()
        if only is None:
            wanted |= {pair for pair in reported if _meant(pair[1], vehicles)}
        left_s = give_up_s - time.monotonic()
        killed = all(reported.get(pair) == "killed" for pair in wanted)
        if left_s <= 0 or (killed and all(router.complete() for router in unknown)):
            break
        states.wait(min(left_s, REPEAT_S))
    stop.set()
    # Sessions must be closed before the interpreter ends.
    for thread in threads:
        thread.join()
    return [KillVerdict(*pair, _problem(reported.get(pair))) for pair in sorted(wanted)]


def _meant(name: str, vehicles: Sequence[str]) -> bool:
    return not vehicles or name in vehicles


def _problem(state: str | None) -> str:
    if state == "killed":
        return ""
    return "its transmitter gateway does not respond" if state is None else f"its arbiter is {state.upper()}"


def report(
    verdicts: Sequence[KillVerdict], vehicles: Sequence[str], fleets: Sequence[RunningFleet]
) -> list[str]:
    """A line for each vehicle, beginning with `error:` if it was not killed."""
    lines = [
        f"error: {one.fleet}: {one.vehicle} not killed: {one.reason}"
        if one.reason
        else f"{one.fleet}: {one.vehicle} killed"
        for one in verdicts
    ]
    known = {one.vehicle for one in verdicts}
    names = ", ".join(running.fleet for running in fleets if running.fleet)
    lines += [f"error: {name} is no vehicle of {names}" for name in vehicles if names and name not in known]
    if not verdicts and not names:
        lines.append("error: no fleet is up on this computer; name the file of another one (-f FLEET)")
    return lines


def parsed(arguments: Sequence[str]) -> tuple[list[str], str | None] | None:
    """Vehicles and fleet of a command line; None if it has anything else than names and -f."""
    vehicles: list[str] = []
    fleet = None
    rest = iter(arguments)
    for word in rest:
        if word in ("-f", "--fleet"):
            if (fleet := next(rest, None)) is None:
                return None
        elif word.startswith("-"):
            return None
        else:
            vehicles.append(word)
    return vehicles, fleet


def run(vehicles: Sequence[str], fleet: str | None) -> int:
    """Kill vehicles, by default all, of one fleet or of every one here; print and return the exit code."""
    if fleet is None:
        fleets, only = fleets_to_kill(), None
    else:
        # A named file must be read and checked first, which takes longer.
        from rcopterx.deploy.roles.addresses import record_of
        from rcopterx.fleet.reading import fleet_path, load_fleet
        from rcopterx.fleet.schema import FleetError

        try:
            file = load_fleet(fleet_path(fleet))
            named = record_of(file, next(iter(file.hosts)))
        except (FleetError, OSError) as error:
            print(f"error: {error}", file=sys.stderr)
            return EXIT_USAGE
        fleets, only = [named], named.fleet
    lines = report(kill(fleets, vehicles, only=only), vehicles, fleets)
    up = {running.fleet for running in running_fleets()}
    if only is not None and up and only not in up:
        lines.append(f"error: {only} is not up on this computer, {', '.join(sorted(up))} is; leave out -f")
    for line in lines:
        print(line, file=sys.stderr if line.startswith("error:") else sys.stdout)
    return EXIT_FAILED if any(line.startswith("error:") for line in lines) else 0
