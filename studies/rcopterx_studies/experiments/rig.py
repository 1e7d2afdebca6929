"""Closed loop of several vehicles in one process, faster than real time: the pilots of flight without a bus.

The plants are the simulator's with the transport delay in them (there is no emulated radio link to bring it);
the pilots are built as the agent process builds them. Plans go from leaders to followers by the fleet clock,
as on the bus. Same vehicles, conditions, events and seed, same flight.
"""

import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Final

import numpy as np
from msgspec.structs import replace

from rcopterx.agents.assembly import build_pilot
from rcopterx.agents.cooperation import Sent, Unpacked
from rcopterx.agents.estimation import OCCLUDED, StampedMeasurement
from rcopterx.agents.following.leader_plans import link_message, target_link
from rcopterx.agents.guards.step_guard import hovering_input
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.scheme_messages import scheme_message, unpacked
from rcopterx.agents.separation.avoidance import NeighbourPlan
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.configuration import DEFAULT_ESTIMATOR, Configuration
from rcopterx.agents.tuning.guard import OscillationGuard, without_guard
from rcopterx.bus.codec import encode
from rcopterx.bus.external_messages import SchemeMessage
from rcopterx.bus.message import Parameters
from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.requests import Tune
from rcopterx.bus.session import BusAddress
from rcopterx.control.identification.recording import FlightLog
from rcopterx.control.interfaces import Measurement
from rcopterx.formation.law import LeaderPlan
from rcopterx.formation.placement import Room
from rcopterx.formation.profile_limits import profile_limits_of
from rcopterx.radios.calibration import Calibration
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array
from rcopterx_studies.experiments.events import PilotEvent, apply
from rcopterx_studies.experiments.network import PERFECT, LinkQuality, Network
from rcopterx_studies.experiments.record import UNKNOWN, FlightRecord, VehicleRecord, station_of

Progress = Callable[[float], None]
"""Called every few seconds with the fraction of the flight that is flown."""

NO_BUS: Final = BusAddress((), "rig")
ROOM_M: Final = 100.0
PERIOD_S: Final = 0.02
"""Period of the motion capture and of control."""
SLEW_PER_S: Final[Array] = np.array(Calibration().slew_per_s)
"""Slew rates of the sticks, those of a calibration by default."""
PROGRESS_EVERY_S: Final = 5.0
SETTLED_S: Final = 5.0
"""Errors of experiments count from here on: estimators start at rest without knowing trim and turbulence."""


@dataclass(frozen=True)
class RigVehicle:
    """One vehicle: the settings of its agent, and where it hovers at time 0.

    `plant_type` is the type that truly flies, and with it the true transport delay; None for `model`.
    `as_published` are references as in the paper: set points step, and followers copy their leader's plan.
    """

    name: str
    model: Model
    start: BodyPose
    controller: str
    controller_settings: Mapping[str, object] = field(default_factory=dict)
    estimator_settings: Mapping[str, object] = field(default_factory=dict)
    horizon: int = 50
    following: tuple[LeaderLink, ...] = ()
    plant_type: Model | None = None
    deviation_share: float = 0.25
    as_published: bool = False
    estimator: str = DEFAULT_ESTIMATOR


@dataclass(frozen=True)
class RigOptions:
    """How the loop is closed."""

    links: LinkQuality = PERFECT  # how plans and messages of schemes travel between vehicles
    avoid: bool = False  # controllers keep clear of the plans of all other vehicles, if they can
    # From when to when agents do not run, by vehicle [s]. The vehicle goes on as by a transmitter gateway:
    # with the planned inputs, then at its place by a plain law. A new agent takes over.
    killed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # n of vehicles whose agents compute in every n-th period only
    slow: Mapping[str, int] = field(default_factory=dict)
    # Vehicles that oscillate lower their bandwidth, as in agents. A change is used from the next period on.
    guard: bool = False
    watch: bool = False  # vehicles that do not follow their commands land by themselves, as in agents


SAME_FRAME: Final = RigOptions()
GUARDED: Final = RigOptions(guard=True)


class RigError(ValueError):
    """The rig cannot fly these vehicles or events; the message says why."""


class Rig:
    """Vehicles that fly together, leaders first in a frame; `RigError`: unknown leader, cycle of leaders."""

    def __init__(
        self,
        vehicles: Sequence[RigVehicle],
        conditions: Conditions,
        seed: int = 0,
        options: RigOptions = SAME_FRAME,
    ) -> None:
        self._vehicles = {vehicle.name: vehicle for vehicle in vehicles}
        self._options = options
        self.laboratory = Laboratory(
            {name: vehicle.plant_type or vehicle.model for name, vehicle in self._vehicles.items()},
            {name: vehicle.start for name, vehicle in self._vehicles.items()},
            conditions,
            seed,
        )
        self._frame = 0
        self._plans: dict[str, tuple[int, ControlOutput]] = {}
        """Newest outputs with their frames."""
        self.plan_network: Network[tuple[int, ControlOutput]] = Network(
            options.links, self._vehicles, seed, 0
        )
        self.message_network: Network[SchemeMessage] = Network(options.links, self._vehicles, seed, 1)
        self.step_times_s: defaultdict[str, list[float]] = defaultdict(list)
        """Processor time of each agent in each of its control periods."""
        self._logs: dict[str, FlightLog] = {}
        self._seen: dict[str, StampedMeasurement] = {}
        self.pilots: dict[str, Pilot] = {}
        self.tunings: dict[str, Tuning] = {}
        self.guards: dict[str, OscillationGuard] = {}
        for name in self._vehicles:
            self._start_agent(name)
        flying_order({name: pilot.guidance.awaited for name, pilot in self.pilots.items()})
        self._applied = {name: vehicle.model.hover_input for name, vehicle in self._vehicles.items()}

    def _start_agent(self, name: str) -> None:
        """Start an agent while its vehicle is in the air."""
        settings = self._settings(self._vehicles[name])
        self.pilots[name] = pilot = build_pilot(settings)
        self.tunings[name] = Tuning(settings.configuration, pilot, settings.period_s)
        self.guards[name] = OscillationGuard(pilot, self.tunings[name])
        pilot.vehicle_watch.active = self._options.watch
        pilot.observe(self._measured(name))
        pilot.note_applied("armed", 0, self._vehicles[name].model.hover_input)

    @property
    def time_s(self) -> float:
        """Time of the next period."""
        return self._frame * PERIOD_S

    def log(self, name: str) -> FlightLog:
        """Log poses and sticks of a vehicle from now on, for an identification."""
        self._logs[name] = FlightLog(self._vehicles[name].model.kind, PERIOD_S)
        return self._logs[name]

    def use_model(self, name: str, parameters: Parameters) -> None:
        """Let a vehicle fly on with identified parameters, as agents do; `RigError` if it cannot."""
        tuning = self.tunings[name]
        tuning.begin(without_guard(tuning.configuration).changed(Tune(model=parameters)))
        tuning.wait()
        if isinstance(outcome := tuning.finish(), ValueError):
            raise RigError(f"{name}: {outcome}")

    def fly(
        self, duration_s: float, events: Sequence[PilotEvent] = (), progress: Progress | None = None
    ) -> FlightRecord:
        """Fly on; times of events count from the rig's own time 0, `RigError` if a vehicle refuses one."""
        frames = round(duration_s / PERIOD_S)
        waiting = deque(sorted(events, key=lambda event: event.time_s))
        rows: dict[str, list[tuple[object, ...]]] = {name: [] for name in self._vehicles}
        for flown in range(frames):
            now_s = self.time_s
            while waiting and waiting[0].time_s <= now_s + 1e-9:
                self._apply(waiting.popleft())
            self._control(now_s, rows)
            self.laboratory.advance(PERIOD_S)
            self._frame += 1
            for name, pilot in self.pilots.items():
                pilot.observe(self._measured(name))
            if progress is not None and flown % round(PROGRESS_EVERY_S / PERIOD_S) == 0:
                progress(flown / frames)
        return FlightRecord({name: self._record(name, of_vehicle) for name, of_vehicle in rows.items()})

    def _record(self, name: str, rows: Sequence[tuple[object, ...]]) -> VehicleRecord:
        time_s, motion, reference, station, inputs = (
            np.array(column, dtype=float) for column in zip(*rows, strict=True)
        )
        # Frames that the Tracker missed are weather, and no fallbacks.
        missed = Counter({OCCLUDED: self._frame + 1})
        pilot = self.pilots[name]
        fallbacks = pilot.events - missed
        plant = self.laboratory.plants[name]
        return VehicleRecord(
            time_s, motion, reference, station, inputs, fallbacks, plant.left_volume, plant.touchdowns
        )

    def _settings(self, vehicle: RigVehicle) -> AgentSettings:
        return AgentSettings(
            bus=NO_BUS,
            vehicle=vehicle.name,
            vehicles=tuple(self._vehicles),
            model=vehicle.model,
            room=Room((-ROOM_M, -ROOM_M, 0.0), (ROOM_M, ROOM_M, ROOM_M)),
            configuration=Configuration(
                vehicle.controller,
                vehicle.estimator,
                {"horizon": vehicle.horizon, **vehicle.controller_settings},
                vehicle.estimator_settings,
            ),
            period_s=PERIOD_S,
            following=vehicle.following,
            deviation_share=1.0 if vehicle.as_published else vehicle.deviation_share,
        )

    def _measured(self, name: str) -> StampedMeasurement:
        pose = self.laboratory.seen_pose(name)
        measurement = None if pose is None else Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
        self._seen[name] = StampedMeasurement(1, self._frame, PERIOD_S, measurement)
        return self._seen[name]

    def _apply(self, event: PilotEvent) -> None:
        if event.vehicle not in self.pilots:
            raise RigError(f"event at {event.time_s:g} s: there is no vehicle {event.vehicle!r}")
        plans = self._leader_plans(event.vehicle, self._plans, list(self._plans))
        limits = None
        if not self._vehicles[event.vehicle].as_published:
            models = {name: vehicle.model for name, vehicle in self._vehicles.items()}
            links = {
                name: tuple(target_link(link) for link in pilot.guidance.task.followed)
                for name, pilot in self.pilots.items()
            }
            limits = profile_limits_of(links, models, event.vehicle)
        refusal = apply(event, self.pilots[event.vehicle], plans, limits)
        if refusal is not None:
            raise RigError(f"{event.vehicle} refused {event}: {refusal}")

    def _control(self, now_s: float, rows: Mapping[str, list[tuple[object, ...]]]) -> None:
        order = flying_order({name: pilot.guidance.awaited for name, pilot in self.pilots.items()})
        messages = {}
        for name in order:
            flight = self._flight(name, now_s)
            messages[name] = flight.sent
            # The transmitter gateway limits slew rates, and reports the applied input before the next pose.
            before, wanted = self._applied[name], flight.input
            applied = np.clip(wanted, before - PERIOD_S * SLEW_PER_S, before + PERIOD_S * SLEW_PER_S)
            self._applied[name] = applied
            self.laboratory.plants[name].set_input(applied)
            self._add_to_log(name, applied)
            pilot = self.pilots[name]
            pilot.note_applied("armed", pilot.sequence, applied)
            reference = UNKNOWN if flight.reference is None else flight.reference.copy()
            motion = self.laboratory.plants[name].motion
            rows[name].append((now_s, motion, reference, self._station(pilot), flight.input))
        self._exchange(now_s, messages)

    def _flight(self, name: str, now_s: float) -> ControlOutput:
        """Output of a vehicle's agent, or what its transmitter gateway flies without one."""
        from_s, to_s = self._options.killed.get(name, (np.inf, np.inf))
        frame, last = self._plans.get(name, (0, None))
        if from_s <= now_s < to_s and last is not None:
            return self._without_agent(name, last, self._frame - frame)
        if now_s - PERIOD_S < to_s <= now_s:
            self._start_agent(name)
        pilot = self.pilots[name]
        if self._frame % self._options.slow.get(name, 1) and last is not None:
            pilot.fly_as_planned()
            planned = last.next_inputs[min(self._frame - frame, len(last.next_inputs)) - 1]
            return replace(last, input=planned, sent=None)
        began_s = time.thread_time()
        known = {other: plan.message for other, plan in self.plan_network.newest(name, now_s).items()}
        avoids = self._options.avoid and not pilot.guidance.coordinated
        near = self._leader_plans(name, known, list(known)) if avoids else {}
        neighbours = {other: NeighbourPlan(plan, 1.0) for other, plan in near.items()}
        plans = self._leader_plans(name, known, pilot.guidance.awaited)
        flight = pilot.control(plans, neighbours, self._received(name, now_s))
        if self._options.guard:
            self.guards[name].watch(flight)
            self.tunings[name].wait()
            self.tunings[name].finish()
        self.step_times_s[name].append(time.thread_time() - began_s)
        self._plans[name] = (self._frame, flight)
        self.plan_network.send(name, self._plans[name], now_s)
        return flight

    def _without_agent(self, name: str, last: ControlOutput, age: int) -> ControlOutput:
        """What a gateway flies, `age` periods after the last output: as planned, then holding the place."""
        if age <= len(last.next_inputs):
            return replace(last, input=last.next_inputs[age - 1], sent=None)
        model, motion = self._vehicles[name].model, np.array(self.laboratory.plants[name].motion)
        place = last.plan.samples[len(last.next_inputs), :4]
        return replace(last, input=np.clip(hovering_input(model, motion, place), model.u_min, model.u_max))

    def _received(self, name: str, now_s: float) -> dict[str, Unpacked]:
        """Messages of the schemes of other vehicles."""
        cooperation = self.pilots[name].cooperation
        messages = {
            other: unpacked(message, cooperation, now_s - sent_s)
            for other, (message, sent_s) in self.message_network.newest(name, now_s).items()
        }
        return {other: each for other, each in messages.items() if each is not None}

    def _exchange(self, now_s: float, messages: Mapping[str, Sent | None]) -> None:
        """Send the messages of this period, and make the exchanges between this period and the next one."""
        self._send(now_s, messages)
        rounds = {name: self.pilots[name].cooperation.exchanges for name, sent in messages.items() if sent}
        for number in range(1, max(rounds.values(), default=1)):
            ahead_s, sent = number * PERIOD_S / max(rounds.values()), {}
            for name in (name for name, count in rounds.items() if number < count):
                pilot, began_s = self.pilots[name], time.thread_time()
                sent[name] = pilot.cooperation.exchange(self._received(name, now_s + ahead_s), ahead_s)
                self.step_times_s[name][-1] += time.thread_time() - began_s
            self._send(now_s + ahead_s, sent)

    def _send(self, now_s: float, messages: Mapping[str, Sent | None]) -> None:
        for name, sent in messages.items():
            if sent is not None:
                message = scheme_message(sent, name, 1, self._frame)
                self.message_network.send(name, message, now_s, len(encode(message)))

    def _add_to_log(self, name: str, applied: Array) -> None:
        log, measurement = self._logs.get(name), self._seen[name].measurement
        if log is not None and measurement is not None:
            log.add_pose(self._frame, measurement)
            log.add_input(self._frame, applied)

    def _leader_plans(
        self, name: str, known: Mapping[str, tuple[int, ControlOutput]], leaders: Sequence[str]
    ) -> dict[str, LeaderPlan]:
        """Plans aligned to a follower's clock, as in agents."""
        clock = self.pilots[name].clock
        plans = {}
        for leader in leaders:
            if leader in known:
                frame, flight = known[leader]
                ahead_s = (clock.current_frame - frame) * clock.period_s - flight.start_s
                followable = self.pilots[leader].guidance.followable
                plans[leader] = LeaderPlan(flight.plan, ahead_s, followable, flight.nominal)
        return plans

    def _station(self, pilot: Pilot) -> Array:
        """True `station_of` the leaders with the present offsets."""
        if not pilot.guidance.follows:
            return UNKNOWN
        links = [
            link_message(link, link.offset_at(pilot.clock.time_s)) for link in pilot.guidance.task.followed
        ]
        motions = {link.leader: np.array(self.laboratory.plants[link.leader].motion) for link in links}
        return station_of(links, motions)


def flying_order(leaders: Mapping[str, Sequence[str]]) -> list[str]:
    """Order vehicles so that leaders come before their followers; `RigError` for unknown ones or a cycle."""
    unknown = [leader for own in leaders.values() for leader in own if leader not in leaders]
    if unknown:
        raise RigError(f"unknown leader {unknown[0]!r}; there are {', '.join(leaders)}")
    try:
        return list(TopologicalSorter(leaders).static_order())
    except CycleError as error:
        raise RigError(f"a cycle of leaders: {' follows '.join(reversed(error.args[1]))}") from None
