"""The pilot of one vehicle: pose in, plan and command out. No bus, no clock, no logging.

The same object flies in the agent process, in experiments faster than real time, and in replay. One frame of
the motion capture is one call of `observe`; every control period is one call of `control`:

    estimator -> delay compensation -> reference (own or from leaders' plans) -> controller -> command, plan
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from msgspec import Struct

from rcopterx.agents.cooperation import Cooperation, Sent, Unpacked
from rcopterx.agents.estimation import EstimatorGuard, StampedMeasurement, StateEstimation
from rcopterx.agents.flight.guidance import Guidance, resting
from rcopterx.agents.flight.lift_off import LiftOff
from rcopterx.agents.flight.sign_proof import PROOF_M, SETTLING_S, SignProof
from rcopterx.agents.flight.timeline import BumplessTransfer, FleetClock, InputHistory, as_sent
from rcopterx.agents.flight.vehicle_watch import DEFAULT_LIMITS, HoverThrustLimits, VehicleWatch
from rcopterx.agents.guards.step_guard import BRIDGED_S, StepGuard
from rcopterx.agents.separation.avoidance import NeighbourPlan, PlanAvoidance, SeparationEllipsoid
from rcopterx.control.identification.excitation import Exciter
from rcopterx.control.interfaces import Controller, Estimate, Estimator
from rcopterx.control.references.columns import POSE
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.formation.law import LeaderPlan
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.phases import EVENT_OF_STATE, Event, Phase
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, YAW, Array, Z

CONTROLLER_REPLACED: Final = "controller_replaced"  # counted when the default one takes its place
SUSPENDED: Final = "its path is suspended: resume (rcopterx resume), or send it elsewhere"
TOO_FAST: Final = "a subject comes too fast to be avoided to the side: it stays above, or lands"
UNSEEN_S: Final = 0.045  # without a pose for so long the thrust of a lift-off rises no further
_INFORMATIVE: Final = (Phase.TAKEOFF, Phase.FLYING)  # phases that show whether it follows its sticks
_NOTHING: Mapping[str, Any] = MappingProxyType({})


class ControlOutput(Struct, frozen=True):
    """Result of one control period."""

    input: Array  # command, shape (4,)
    next_inputs: Array  # planned inputs after it, shape (k, 4), for the gateway to play if a command is late
    plan: Trajectory  # N stages, the first one `start_s` after the frame
    start_s: float
    reference: Array | None  # first stage of the reference: x, y, z [m], yaw [rad]; None on the floor
    nominal: Trajectory | None = None  # stages of the undisturbed reference; None on the floor
    sent: Sent | None = None  # message of a scheme to other vehicles


class Pilot:
    """Flies one vehicle; `separation` is the ellipsoid that others do not enter, None for no avoidance."""

    def __init__(
        self,
        model: Model,
        controller: Controller,
        estimator: Estimator,
        guidance: Guidance,
        separation: SeparationEllipsoid | None = None,
        default_controller: Controller | None = None,
        default_estimator: Estimator | None = None,
        hover_thrust_limits: HoverThrustLimits = DEFAULT_LIMITS,
    ) -> None:
        self.model = model
        self.events = guidance.events
        """Counts by kind, of all parts of the agent: steps that were not optimal, failures, periods without a
        leader, and others."""
        self.step_guard = StepGuard(model, controller, default_controller, self.events)
        self.estimator = EstimatorGuard(estimator, default_estimator)
        self.guidance = guidance
        self.avoidance = PlanAvoidance(separation, self.step_guard)
        self.plan: Trajectory | None = None  # newest plan of the controller; None on the floor
        self.reference: Array | None = None  # place and yaw where the plan should begin, if in flight
        self.vehicle_watch = VehicleWatch(model, hover_thrust_limits, controller.period_s)
        self.exciter = Exciter()
        self.clock = FleetClock()
        self.cooperation = Cooperation(guidance, self.step_guard, self.clock)
        self.cooperation.use(controller)
        self.input_history = InputHistory(np.zeros(INPUT_SIZE))
        self.estimation = StateEstimation(self.clock, self.estimator, self.input_history, self.events)
        self.sequence = 0
        self.lift_off_delay_s = 0.0  # sets its lift-off apart from those of other vehicles
        self.measured_tilt = True  # whether the motion capture shows roll and pitch
        self.informed = False  # whether the transmitter's state is known, before which nothing is commanded
        self._watched = False  # whether another agent flies the vehicle in the air, and this one watches
        self._lift_off = LiftOff(model)
        self._signs = SignProof(model)
        self._flown_by_controller = False
        self._transfer = BumplessTransfer(model)
        self._planned: Array = np.zeros((0, INPUT_SIZE))  # inputs planned after the newest command

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for people: the last failures, and what has been replaced."""
        remarks = [
            self.vehicle_watch.remark,
            self.guidance.remark,
            SUSPENDED if self.guidance.suspended else "",
            TOO_FAST if self.avoidance.over_m > -np.inf else "",
        ]
        for guard, stays in (
            (self.step_guard, "; the default controller flies until one is chosen"),
            (self.estimator, "; the default estimator is used until one is chosen"),
        ):
            if guard.calls.failure:
                remarks.append(guard.calls.failure + (stays if guard.replaced else ""))
        return tuple(filter(None, remarks))

    @property
    def given_up(self) -> str | None:
        """Why the vehicle, which stands, has landed by itself and has to be disarmed; else None."""
        fault = self.vehicle_watch.fault
        return None if fault is None or self.guidance.phase is not Phase.ARMED else fault.text

    @property
    def controller(self) -> Controller:
        """Present controller."""
        return self.step_guard.controller

    @property
    def estimate(self) -> Estimate:
        """Present estimate."""
        return self.estimator.estimate

    @property
    def ready(self) -> bool:
        """Whether the vehicle has been seen."""
        return self.estimation.ready

    def observe(self, frame: StampedMeasurement) -> bool:
        """Process one frame; return False if it is older than the last one."""
        used = self.estimation.observe(frame, self._standing)
        if used and self._signs.under_way:
            self._signs.observe(frame.measurement, self.input_history, self.clock.time_s)
        if used and frame.measurement is not None:
            self._lift_off.see(float(frame.measurement.position_m[Z]), self.clock.time_s)
        return used

    def coast(self) -> bool:
        """Predict over an overdue frame; return False beyond the limit of blind flight."""
        return self.estimation.coast(self._standing)

    def note_applied(self, state: str, sequence: int, value: Array) -> None:
        """Process the state and input that the transmitter gateway applied, once the vehicle was seen."""
        self.input_history.correct(sequence, value)
        if not self.clock.started:
            return
        event = EVENT_OF_STATE[state]
        if event is Event.OVERRIDE:
            # No command of this agent acts.
            self._record_input(value)
        if not self.informed and event is not Event.DISARM and self._in_the_air(value):
            event = Event.RESUME
            if not self._watched:
                # The earlier process commanded what acts now; the first step starts from there.
                self.input_history.restart(value)
        self.informed, self._watched = True, False
        if event is Event.ARM and self.guidance.phase is Phase.GROUND:
            # A person arms it again after what was wrong.
            self.vehicle_watch.begin()
        self.guidance.on_event(event, self.estimate, self.clock.time_s)

    def watch(self, state: str, value: Array) -> None:
        """Process an input applied for another agent, so that this one can take over with a warm estimate."""
        if not self.clock.started:
            return
        before = self._watched
        self._watched = EVENT_OF_STATE[state] is not Event.DISARM and self._in_the_air(value)
        if self._watched and not before:
            self.input_history.restart(value)
        self._record_input(value)

    def take_off(self, height_m: float) -> str | None:
        """Begin to take off; a refusal is returned as its reason."""
        if not self.ready:
            return "no pose yet" if not self.clock.started else f"no pose for {self.estimation.blind_s:.1f} s"
        time_s = self.clock.time_s
        refusal = self.guidance.take_off(self.estimate, height_m, time_s)
        if refusal is None:
            self._lift_off = LiftOff(self.model)
            self._lift_off.begin(time_s + self.lift_off_delay_s, float(self.estimate.motion[Z]))
            self.vehicle_watch.begin()
        return refusal

    def use_model(self, model: Model, default: Controller, default_estimator: Estimator) -> None:
        """Change to another model, and defaults for it; a controller and an estimator have to follow."""
        self.model = self.step_guard.model = model
        self.step_guard.default, self.estimator.default = default, default_estimator
        self.vehicle_watch = self.vehicle_watch.with_model(model)

    def use_controller(self, controller: Controller) -> None:
        """Change to another controller, which starts from the input applied last."""
        self.step_guard.use(controller)
        self._begin_with_controller()

    def use_defaults(self) -> None:
        """Change to the default controller and estimator, as if the present ones had failed."""
        self._use_default_controller()
        self.estimator.use_default()

    def _use_default_controller(self) -> None:
        if self.step_guard.use_default():
            self._begin_with_controller()
            self.events[CONTROLLER_REPLACED] += 1

    def _begin_with_controller(self) -> None:
        self.cooperation.use(self.controller)
        self._begin_transfer()
        self._flown_by_controller = False

    def use_estimator(self, estimator: Estimator) -> None:
        """Change to another estimator, which starts from the present estimate."""
        self.estimator.use(estimator, self.clock.started)
        self._begin_transfer()

    def _begin_transfer(self) -> None:
        if self._flown_by_controller:
            self._transfer.begin()

    def control(
        self,
        plans: Mapping[str, LeaderPlan],
        neighbours: Mapping[str, NeighbourPlan] = _NOTHING,
        received: Mapping[str, Unpacked] = _NOTHING,
    ) -> ControlOutput:
        """Compute command and plan of the present control period, always finite and within the limits."""
        self.sequence += 1
        self._decide()
        output = self._stand() if self._standing else self._fly(plans, neighbours, received)
        self._planned = output.next_inputs
        self._record_input(output.input)
        return output

    def _decide(self) -> None:
        """Change the phase, the excitation, or the controller, by the present estimate."""
        time_s, exciter = self.clock.time_s, self.exciter
        self.guidance.check_floor(self.estimate, time_s)
        if self._lift_off.under_way:
            self._update_lift_off(time_s)
        elif self._signs.under_way and self._lift_off.undone(time_s):
            self._lift_off.resume(time_s)
        if exciter.under_way:
            flying = self.guidance.phase is Phase.FLYING
            exciter.watch(time_s, self.estimate.motion[:YAW], self.estimation.blind_s, flying)
        if self.step_guard.given_up and not self._standing:
            self._use_default_controller()

    def _fly(
        self,
        plans: Mapping[str, LeaderPlan],
        neighbours: Mapping[str, NeighbourPlan],
        received: Mapping[str, Unpacked],
    ) -> ControlOutput:
        """Return the output in the air: a step of the controller from the estimate along the reference."""
        time_s, delay_s, guidance = self.clock.time_s, self.model.delay_s, self.guidance
        period_s, horizon = self.controller.period_s, self.controller.horizon
        last_input = self.input_history.newest
        estimate = self.estimation.compensated(self.model)
        reference, nominal = guidance.references(plans, estimate, time_s, delay_s, period_s, horizon)
        if not self._flown_by_controller:
            self._start_controller(estimate, last_input)
        if not self.avoidance.update(neighbours, self.plan, guidance.followable, delay_s):
            self.events["cannot_avoid"] += 1
        if self.avoidance.over_m > -np.inf:
            reference = self._over_subjects(reference)
        self.cooperation.begin_period(estimate, reference)
        sent = self.cooperation.exchange(received)
        step = self.step_guard.step(estimate, reference, last_input)
        if step.fallback is not None:
            self.events[step.fallback] += 1
        self.plan, self.reference = step.plan, reference.samples[0, POSE]
        inputs = self._transfer.smoothed(step.inputs[: self._bridged_rows], last_input, period_s)
        if self.exciter.under_way:
            added = self.exciter.added(inputs, time_s, period_s)
            inputs = np.clip(added, self.model.u_min, self.model.u_max)
        if self._signs.under_way:
            inputs = self._signs.pulses(inputs, time_s, period_s)
        inputs = as_sent(self.vehicle_watch.without_broken_axes(inputs), self.model)
        self._check_vehicle(inputs[0], time_s)
        return ControlOutput(inputs[0], inputs[1:], step.plan, delay_s, self.reference, nominal, sent)

    def _over_subjects(self, reference: Trajectory) -> Trajectory:
        """Return the reference above subjects that are too fast, or begin to land below the ceiling."""
        height_m = self.avoidance.over_m
        self.events["subject_too_fast"] += 1
        if height_m > self.model.state_max[Z]:
            self.guidance.land(self.estimate, self.clock.time_s)
            return reference
        samples = reference.samples.copy()
        samples[:, Z] = np.maximum(samples[:, Z], height_m)
        return Trajectory(samples, reference.period_s)

    def _stand(self) -> ControlOutput:
        """Return the output on the floor: rotor off, or turning up in open loop."""
        period_s, rising = self.controller.period_s, self._lift_off.under_way
        inputs = np.zeros((self._bridged_rows if rising else 1, INPUT_SIZE))
        inputs[:, U_THRUST] = [  # each acts for a period
            self._lift_off.thrust(self.clock.time_s + (number + 0.5) * period_s)
            for number in range(len(inputs))
        ]
        self._flown_by_controller = False
        self._signs.end()
        self.cooperation.rest()
        self.plan = self.reference = None
        plan = resting(self.estimate, period_s, self.controller.horizon)
        return ControlOutput(inputs[0], inputs[1:], plan, self.model.delay_s, None)

    def fly_as_planned(self) -> None:
        """Leave out a control period: the transmitter gateway plays the input planned for it."""
        self.step_guard.leave_out()
        if len(self._planned):
            self._check_vehicle(self._planned[0], self.clock.time_s)
            self._record_input(self._planned[0])
            self._planned = self._planned[1:]
            self.events["control_left_out"] += 1

    def _record_input(self, value: Array) -> None:
        """Record an input sent now, which acts a transport delay later."""
        self.input_history.append(self.clock.time_s + self.model.delay_s, self.sequence, value)

    def _check_vehicle(self, command: Array, time_s: float) -> None:
        """Land if the vehicle does not follow its sticks, or follows them the wrong way."""
        seen_in_flight = self.estimation.blind_s == 0.0 and not self._standing
        informative = seen_in_flight and self.guidance.phase in _INFORMATIVE
        fault = self.vehicle_watch.observe(command, self.estimate.motion, time_s, informative)
        if self._signs.under_way:
            if self.guidance.phase is Phase.EMERGENCY:
                self._signs.begin(time_s + SETTLING_S)
            elif fault is None:
                self.vehicle_watch.fault = fault = self._signs.judge(time_s)
                if self._signs.repeats(time_s) and self.guidance.phase is Phase.TAKEOFF:
                    place_m, floor_m = self.estimate.motion, self.guidance.task.floor_m
                    self._climb_from(max(float(place_m[Z]) - 2.0 * PROOF_M, floor_m + PROOF_M), time_s)
        if fault is not None:
            self.events[fault.kind] += 1
            self.guidance.land(self.estimate, time_s)

    @property
    def _bridged_rows(self) -> int:
        """Number of inputs that go with a command, its own included."""
        return 1 + round(BRIDGED_S / self.controller.period_s)

    @property
    def _standing(self) -> bool:
        return self._lift_off.under_way or not (self.guidance.rotor_on or self._watched)

    def _update_lift_off(self, time_s: float) -> None:
        """Hand over once the vehicle has lifted, wait while it is not seen, give up a lift-off that fails."""
        phase = self.guidance.phase
        if phase is Phase.EMERGENCY or (phase is Phase.TAKEOFF and self.estimation.blind_s > UNSEEN_S):
            self._lift_off.pause(time_s)
        elif phase is not Phase.TAKEOFF:
            self._lift_off.end()
        elif self._lift_off.lifted(float(self.estimate.motion[Z]), time_s):
            self._hand_over(time_s)
        elif self._lift_off.failed(time_s):
            self._lift_off.end()
            self.events["not_lifted"] += 1
            self.guidance.on_event(Event.NOT_LIFTED, self.estimate, time_s)

    def _hand_over(self, time_s: float) -> None:
        """Hand the vehicle, which has left the floor, over to the controller."""
        lifted, carrying_thrust = self._lift_off.handed_over(self.estimate.motion, time_s)
        self.estimator.take_over(lifted)
        self._signs = SignProof(self.model, measured_tilt=self.measured_tilt)
        height_m = float(self.estimate.motion[Z])
        self._climb_from(height_m + PROOF_M, time_s)
        # What carries it is less than the thrust by now.
        carrying = self.input_history.newest.copy()
        carrying[U_THRUST] = carrying_thrust
        self._lift_off.end()
        self._signs.begin(time_s, floor_m=self._lift_off.floor_m, height_m=height_m)
        self._start_controller(self.estimation.compensated(self.model), carrying)

    def _climb_from(self, height_m: float, time_s: float) -> None:
        """Hold a height until the sticks should have been proved, or nearly so, and climb then."""
        held = self.estimate.motion.copy()
        held[Z] = height_m
        self.guidance.lifted(self.estimate._replace(motion=held), time_s + self._signs.climb_after_s)

    def _start_controller(self, estimate: Estimate, last_input: Array) -> None:
        self.step_guard.reset(estimate, last_input)
        self._flown_by_controller = True

    def _in_the_air(self, value: Array) -> bool:
        return bool(value[U_THRUST] > 0.5 * self.model.hover_input[U_THRUST])
