"""The learner: fits models to the ordinary flight of the vehicles of a fleet, and sends these to them.

It only listens, as the recorder does, and sends what it has found as a request to tune. Fits take seconds
of a processor at the lowest priority; no process waits for them.
"""

import logging
import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec

from rcopterx.bus import channels
from rcopterx.bus.heartbeat import own_heartbeat
from rcopterx.bus.message import Parameters
from rcopterx.bus.messages import AgentStatus
from rcopterx.bus.requests import Reply, Tune
from rcopterx.bus.session import BusAddress, RequestFailedError, Session
from rcopterx.control.identification.excitation import UNDER_WAY
from rcopterx.control.identification.fit import WORSE, errors_ahead, identify
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.control.identification.result import PARTS, Identification
from rcopterx.flights.ordinary_flight import OrdinaryFlight
from rcopterx.formation.topology import roots
from rcopterx.places import replace_file
from rcopterx.vehicles.model import Model, fitted_parameters, with_parameters
from rcopterx.vehicles.phases import Phase


class KeptModel(msgspec.Struct, frozen=True):
    """What a vehicle has learned in one flight; kept in a file of its own beside the flight logs."""

    date: str
    hover_thrust: float | None  # share of the largest thrust, which shows the battery of that flight
    before: dict[str, Any]  # parameters of the model by the fleet file, which it departs from
    parts: tuple[str, ...]
    parameters: dict[str, Any]

    @classmethod
    def of(cls, before: Model, found: Identification, hover_thrust: float | None) -> "KeptModel":
        """Return what a fit has found now."""
        date = time.strftime("%Y-%m-%d %H:%M")
        own = fitted_parameters(found.model)
        return cls(date, hover_thrust, fitted_parameters(before), found.accepted, own)


def _path(directory: Path, vehicle: str) -> Path:
    return directory / f"{vehicle}.json"


def write_kept(directory: Path, vehicle: str, kept: KeptModel) -> None:
    """Keep a model in place of the one before; a disk that is full or read-only keeps none."""
    path = _path(directory, vehicle)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        replace_file(path, msgspec.json.format(msgspec.json.encode(kept)))
    except OSError:
        path.unlink(missing_ok=True)


def read_kept(directory: Path, vehicle: str, model: Model) -> KeptModel | None:
    """Return the kept model of a vehicle; None without one, or if the fleet file has changed its model."""
    try:
        kept = msgspec.json.decode(_path(directory, vehicle).read_bytes(), type=KeptModel)
    except (OSError, msgspec.DecodeError):
        return None
    present = msgspec.to_builtins(fitted_parameters(model))
    return kept if msgspec.to_builtins(kept.before) == present else None


def agrees(kept: KeptModel, model: Model, flight: FlightRecording) -> bool:
    """Whether a kept model predicts a flight as well as the model by the fleet file, in all learned parts."""
    before, now = (errors_ahead(one, flight) for one in (model, with_parameters(model, kept.parameters)))
    return all(now[part] <= WORSE * before[part] for part in PARTS if part in kept.parts)


_LOG = logging.getLogger(__name__)
LEARNED_FROM_S: Final = 50.0  # of flight with set points, from which a model is learned
MOVED_M: Final = 0.3  # a vehicle that stayed within less has not flown to set points
COMPARED_S: Final = 12.0  # of flight, with which a model of an earlier flight has to agree
AGAIN_S: Final = 180.0  # until the next fit, which follows a battery, or a repair
LATE_SHARE: Final = 0.02  # share of late commands from which the computer has no room for a fit
CHECK_S: Final = 0.5
DEPTH: Final = 32_768  # messages that may wait during the fits of a large fleet
LOWEST_NICE: Final = 19
TUNING_LIMIT_S: Final = 20.0


@dataclass(frozen=True)
class LearnerSettings:
    """Settings of a learner."""

    bus: BusAddress
    models: Mapping[str, Model]  # models by the fleet file of the vehicles that learn
    periods_s: Mapping[str, float]  # their control periods
    directory: Path  # of models of earlier flights


class LearningVehicle:
    """One vehicle as the learner sees it."""

    def __init__(self, name: str, settings: LearnerSettings, session: Session) -> None:
        self.name, self.model = name, settings.models[name]
        self.flight = OrdinaryFlight(self.model.kind, settings.periods_s[name])
        self.status: AgentStatus | None = None  # newest one; None if it is silent or not in free flight
        self.due_s = 0.0  # earliest time of the next fit [monotonic s]
        self.compared = False  # whether the model of an earlier flight was compared with this one
        self._session = session
        self._poses = session.subscribe(channels.POSE, name, DEPTH, waking=False)
        self._applied = session.subscribe(channels.APPLIED, name, DEPTH, waking=False)
        self._statuses = session.subscribe(channels.AGENT_STATUS, name, waking=False)

    def update(self) -> None:
        """Process what has arrived."""
        for pose in self._poses.drain():
            self.flight.add_pose(pose.message)
        for applied in self._applied.drain():
            self.flight.add_applied(applied.message)
        newest = self._statuses.latest()
        alive = self._statuses.alive(self._session.clock())
        self.status = newest.message if newest is not None and alive and _free(newest.message) else None
        if self.status is None:
            self.flight.restart()

    @property
    def ready(self) -> bool:
        """Whether a model can be learned from what it has flown."""
        if self._session.clock() < self.due_s or self.flight.duration_s < LEARNED_FROM_S:
            return False
        return self.flight.extent_m >= MOVED_M

    def use(self, parameters: Parameters, parts: tuple[str, ...], source: str) -> bool:
        """Send a model to the vehicle, log the answer, and return whether the vehicle flies with it."""
        try:
            reply = self._session.request(self.name, Tune(model=parameters, learned=parts), TUNING_LIMIT_S)
        except RequestFailedError as error:
            reply = Reply(accepted=False, reason=str(error))
        if reply.accepted:
            _LOG.info("%s: learned %s from %s", self.name, ", ".join(parts), source)
        else:
            _LOG.warning("%s: what it learned from %s is not used: %s", self.name, source, reply.reason)
        return reply.accepted


def _free(status: AgentStatus) -> bool:
    """Whether a vehicle flies by its own controller, undisturbed, with a model that it may replace."""
    values = status.diagnostics
    own = not values.client and (bool(values.learned) or not values.model)
    return own and status.phase == Phase.FLYING and status.excitation != UNDER_WAY


class Learner:
    """Learns the models of the vehicles of a fleet."""

    def __init__(self, settings: LearnerSettings, session: Session) -> None:
        self._directory, self._session = settings.directory, session
        self.vehicles = {name: LearningVehicle(name, settings, session) for name in settings.models}

    def step(self) -> None:
        """Process what has arrived; fit what can be fitted, at most one formation at a time."""
        for vehicle in self.vehicles.values():
            vehicle.update()
        flying = {name: vehicle for name, vehicle in self.vehicles.items() if vehicle.status is not None}
        for vehicle in flying.values():
            self._compare(vehicle)
        links = {name: one.status.assigned for name, one in flying.items() if one.status is not None}
        for root in dict.fromkeys(roots(links, name) for name in links):
            formation = [vehicle for name, vehicle in flying.items() if roots(links, name) == root]
            if all(vehicle.ready for vehicle in formation):
                self._learn(formation)
                return

    def _compare(self, vehicle: LearningVehicle) -> None:
        """Use the model of an earlier flight, if the beginning of this one agrees with it."""
        status = vehicle.status
        if vehicle.compared or status is None or vehicle.flight.duration_s < COMPARED_S:
            return
        vehicle.compared = True
        kept = None if status.diagnostics.model else read_kept(self._directory, vehicle.name, vehicle.model)
        if kept is None:
            return
        try:
            fits = agrees(kept, vehicle.model, vehicle.flight.recording())
        except ValueError as error:
            _LOG.info("%s: its model of %s is not used: %s", vehicle.name, kept.date, error)
            return
        if fits:
            vehicle.use(kept.parameters, kept.parts, f"a flight of {kept.date}")
        else:
            _LOG.info("%s: its first seconds of flight differ from its model of %s", vehicle.name, kept.date)

    def _learn(self, formation: list[LearningVehicle]) -> None:
        """Fit the models of a formation one after the other, then use them together."""
        now_s = self._session.clock()
        if late := [one.name for one in formation if one.status and one.status.late_share > LATE_SHARE]:
            _LOG.warning("not learned: commands of %s are late, this computer has no room", ", ".join(late))
        found = {} if late else {vehicle.name: _fitted(vehicle) for vehicle in formation}
        for vehicle in formation:
            vehicle.due_s = now_s + AGAIN_S
            fit = found.get(vehicle.name)
            if fit is None or vehicle.status is None:
                continue
            # What was refused this time does not take away what is known.
            if fit.accepted and set(fit.accepted) >= set(vehicle.status.diagnostics.learned):
                parameters = fitted_parameters(fit.model)
                if vehicle.use(parameters, fit.accepted, f"{vehicle.flight.duration_s:.0f} s of flight"):
                    hover = vehicle.status.diagnostics.hover_thrust
                    write_kept(self._directory, vehicle.name, KeptModel.of(vehicle.model, fit, hover))


def _fitted(vehicle: LearningVehicle) -> Identification | None:
    """Fit a model to what a vehicle has flown; None, with the reason in the log, if that is of no use."""
    own_heartbeat().beat()
    try:
        found = identify(vehicle.flight.recording(), vehicle.model, ordinary=True)
    except ValueError as error:
        _LOG.info("%s: nothing learned: %s", vehicle.name, error)
        return None
    for problem in found.problems:
        _LOG.info("%s: not learned: %s", vehicle.name, problem)
    return found


def run_learner(settings: LearnerSettings) -> None:
    """Learn until SIGTERM or SIGINT, which end the process at once: there is nothing to finish."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: os._exit(0))
    os.setpriority(os.PRIO_PROCESS, 0, LOWEST_NICE)
    with Session(settings.bus) as session:
        learner, heartbeat = Learner(settings, session), own_heartbeat()
        while True:
            heartbeat.beat()
            session.wait(CHECK_S)
            learner.step()
