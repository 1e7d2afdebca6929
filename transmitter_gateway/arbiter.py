"""Safety arbiter of one vehicle (docs/safety.md).

`transitions.py` holds the table of states; here are its conditions and the outputs. Before an input takes
effect, everything happens that was due until then: an input that arrives after a limit cannot hide that it
passed.
"""

import math
from collections import Counter

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.command_validator import (
    CommandValidator,
    Stream,
    bridging_step,
    next_change_s,
    played_input,
)
from rcopterx.transmitter_gateway.inputs import (
    FLYING,
    FOR_OPERATORS,
    ON_THE_WAY_DOWN,
    THRUST,
    Action,
    ActionRequest,
    Answer,
    ArbiterOutput,
    CommandInput,
    Input,
    LastApplied,
    LinkState,
    PoseInput,
    State,
)
from rcopterx.transmitter_gateway.landing import Motion, Touchdown
from rcopterx.transmitter_gateway.output_limiter import HoverThrust, OutputLimiter
from rcopterx.transmitter_gateway.pose_monitor import PoseMonitor
from rcopterx.transmitter_gateway.standing import Standing
from rcopterx.transmitter_gateway.take_over import take_over_problem
from rcopterx.transmitter_gateway.transitions import ARMING, Condition, Transition, find_transition
from rcopterx.vehicles.lift_off import LiftOffProof, SeenPose


class Arbiter:
    """Decides what one vehicle does from commands, raw poses, requests, link state and time."""

    def __init__(self, vehicle: str, limits: ArbiterLimits, u_hover: float, slew_per_s: Input) -> None:
        self._vehicle = vehicle
        self.limits = limits
        self.state = State.DISARMED  # current state, and why
        self.reason = self._landing_reason = "started"
        # rejections, state entries, planned inputs played and steps that slew rates limited, by name
        self.counters: Counter[str] = Counter()
        self.commanded = False  # whether commands count: from arming until the flight is over
        self.pose_monitor = PoseMonitor(limits.surveillance, self.counters)
        self._validator = CommandValidator(limits, self.counters)
        self.leases = self._validator.leases  # control leases of the vehicle's agents
        self._limiter = OutputLimiter(limits, u_hover, slew_per_s, self.counters)
        self._touchdown = Touchdown()
        self.standing = Standing(vehicle, limits, self.pose_monitor.other_places)
        self.lift_off = LiftOffProof(vehicle, limits.lift_off, limits.surveillance.trust_repeated_poses)
        self._link = LinkState.LOST
        self._arming = self._shutdown = False
        self._motion: Motion | None = None
        self._climb_m_s: float | None = None
        self._located = False
        self._now_s = self._applied_s = -math.inf
        self._entered_s = self._landing_since_s = self._sunk_s = self._descended_s = -math.inf
        self._low_since_s: float | None = None
        self._thrust_time_s, self._bridging_step = 0.0, 0
        self._details: dict[Condition, str] = {}
        self._event_s: float | None = None

    # Inputs -------------------------------------------------------------------------------------------

    def command(self, command: CommandInput, now_s: float) -> Answer:
        """Take a command; a rejected one changes nothing but a counter."""
        if now_s >= self.next_event_s():
            self._pass(now_s)
        pose, age_s = self.pose_monitor.newest, now_s - self.pose_monitor.epoch_since_s
        rejection = self._validator.consider(
            command, now_s, pose=pose, epoch_age_s=age_s, flying=self.commanded
        )
        self._event_s = None
        return Answer(rejection is None, rejection or "accepted")

    def bid(self, agent: int, now_s: float, *, take_over: bool) -> int:
        """Control lease of an agent that asks for one, 0 while it is not given any; see `Leases.bid`."""
        return self.leases.bid(agent, now_s, fresh=self._validator.fresh(now_s), take_over=take_over)

    @property
    def hover(self) -> HoverThrust:
        """Thrust at which the vehicle hovers, as far as the arbiter has learned it."""
        return self._limiter.hover

    @property
    def grounded(self) -> bool:
        """Whether the thrust has been low for so long that the vehicle stands on the floor."""
        return self._grounded(self._now_s)

    def pose(self, pose: PoseInput, now_s: float, explained_m: float = math.inf) -> None:
        """Take a raw pose of the own or another vehicle, which its own rotor may lift to `explained_m`."""
        if pose.vehicle != self._vehicle:
            if self.pose_monitor.other_pose(pose, now_s) and pose.position_m is not None:
                self.lift_off.other(pose.vehicle, pose.position_m[2], explained_m)
        else:
            self._event_s = None
            airborne = self.state in FLYING and not self._grounded(now_s)
            share = self.lift_off.share if self.limits.lift_off and self.lift_off.proved else None
            accepted = self.pose_monitor.own_pose(pose, now_s, airborne=airborne, share=share)
            if airborne:
                self.standing.restart()
            elif accepted:
                self.standing.observe(pose, now_s)
            if pose.position_m is not None and self.pose_monitor.newest is pose:
                seen = SeenPose(pose.position_m, pose.tilt_rad)
                self.lift_off.own(seen, now_s, self.pose_monitor.captured_s)

    def link(self, link: LinkState, problem: str | None = None) -> None:
        """Take the state of port and module, and why it is not ready; it takes effect with the next step."""
        self._link = link
        self._details.pop(Condition.READY, None)
        if problem is not None:
            self._details[Condition.LINK_LOST if link is LinkState.LOST else Condition.READY] = problem

    def request(self, request: ActionRequest, now_s: float) -> Answer:
        """Carry out or refuse a request; see `FOR_OPERATORS`."""
        self.step(now_s)
        operator = request.by in self.limits.operators
        problem = None if operator else FOR_OPERATORS.get(request.action)
        problem = problem or self._carry_out(request, now_s)
        if problem is not None:
            self.counters[f"refused: {request.action}"] += 1
            return Answer(False, problem)
        return Answer(True, f"{self.state}: {self.reason}")

    def _carry_out(self, request: ActionRequest, now_s: float) -> str | None:
        """Apply an allowed request; return why it had no effect, if so."""
        match request.action:
            case Action.SHUTDOWN:
                self._shutdown = True
                self.step(now_s)
            case Action.ARM:
                return self._arm(request.by, now_s)
            case Action.RESET:
                if self.state is not State.KILLED:
                    return "not killed"
                state = self._take(Condition.RESET, request.by, now_s)
                return None if state is State.DISARMED else "a source asks for thrust: lower it first"
            case Action.DISARM:
                if self._take(Condition.DISARM, request.by, now_s) in FLYING:
                    return "it may be in the air: land it first; kill is what cuts motors"
            case Action.KILL:
                self._take(Condition.KILL, request.by, now_s)
        return None

    def _arm(self, by: str, now_s: float) -> str | None:
        if self.state in FLYING:
            return None
        self._arming = True
        state = self._take(Condition.ARM, by, now_s)
        conditions = self._conditions(now_s, self._stream(), 0)
        self._arming = False
        if state is State.ARMED:
            return None
        if state is State.KILLED:
            return "killed: an operator must reset first"
        missing = sorted(f"missing: {self._detailed(c)}" for c in ARMING.needs - conditions - {Condition.ARM})
        return "; ".join(missing + sorted(map(self._detailed, ARMING.unless & conditions)))

    def _detailed(self, condition: Condition) -> str:
        """A condition with its detail, if any."""
        return f"{condition}: {self._details[condition]}" if condition in self._details else str(condition)

    def take_over(self, last: LastApplied, now_s: float) -> Answer:
        """Continue the flight of an earlier process, by landing until fresh commands; or answer why not."""
        self.step(now_s)
        problem = take_over_problem(last, self.pose_monitor.own_track, self.limits, now_s)
        if problem is None and self.state is not State.DISARMED:
            problem = f"{self.state} now"
        if problem is None:
            self.commanded = last.commanded
            self._limiter.take_over(last.u, last.hover_thrust, last.hover_known_s)
            self.lift_off.begin(proved=last.lifted, thrust=self._limiter.u[THRUST])
            distrust = "own pose jumped before a restart" if last.mistaken else None
            self.pose_monitor.take_over(last.track, distrust, now_s)
            self._take(Condition.TAKE_OVER, "this gateway", now_s)
            if self.state in FLYING:
                return Answer(True, f"{self.state}: {self.reason}")
            problem = "serial link lost"
        self.commanded = False
        self.counters["refused: take over"] += 1
        self.reason = f"not taken over: {problem}"
        return Answer(False, problem)

    def _take(self, condition: Condition, by: str, now_s: float) -> State:
        """Step once with a requested condition; return the state after it."""
        self._details[condition] = f"by {by}"
        return self.step(now_s, condition).state

    # Conditions ---------------------------------------------------------------------------------------

    def _stream(self) -> Stream | None:
        """Newest commands, while they count or decide about arming."""
        return self._validator.stream if self.commanded or self._arming else None

    def _grounded(self, now_s: float) -> bool:
        return self._low_since_s is not None and now_s >= self._low_since_s + self.limits.arm_low_s

    def _conditions(self, now_s: float, stream: Stream | None, bridging: int) -> set[Condition]:
        limits, state, sinks = self.limits, self.state, self.lift_off.sinking
        landing_over_s = self._landing_since_s + limits.landing.longest_s
        holds = {
            Condition.SHUTDOWN: self._shutdown,
            Condition.LINK_LOST: self._link is LinkState.LOST,
            Condition.READY: self._link is LinkState.READY,
            Condition.THRUST_WANTED: state is State.KILLED and self._validator.thrust_wanted(now_s),
            Condition.IDLE: state is State.ARMED and now_s >= self._idle_at_s,
            Condition.HOLD_OVER: state is State.HOLD and now_s >= self._entered_s + limits.hold_limit_s,
            Condition.DESCENT_OVER: state is State.DESCEND and not sinks and now_s >= self._descended_s,
            Condition.LANDING_OVER: state in ON_THE_WAY_DOWN and now_s >= landing_over_s,
        }
        if stream is not None:
            holds |= {
                Condition.FRESH: self._validator.fresh(now_s),
                Condition.BRIDGING: bridging > 0,
                Condition.SILENT: now_s >= stream.arrival_s + limits.descend_after_s,
                Condition.GONE: now_s >= stream.arrival_s + limits.cut_after_s,
                Condition.LOW_COMMANDED: stream.is_low(now_s, limits),
            }
        found = {condition for condition, true in holds.items() if true}
        self._find(Condition.GIVEN_UP, None if stream is None else stream.command.given_up, found)
        self._judge_poses(found, now_s)
        if state in FLYING:
            failing = Condition.SINKING if sinks else Condition.LIFT_OFF
            self._find(failing, self.lift_off.problem, found)
        return found

    @property
    def _idle_at_s(self) -> float:
        """When an armed vehicle that stays on the floor is disarmed [s]."""
        if self._low_since_s is None:
            return math.inf
        return max(self._low_since_s, self._entered_s) + self.limits.disarm_after_s

    def _judge_poses(self, found: set[Condition], now_s: float) -> None:
        """Judge the raw poses; a vehicle that stands on the floor is left alone unless it is to be armed."""
        flying = self.state in FLYING
        self._motion = self._climb_m_s = None
        self._located = flying and self._grounded(now_s)
        if self._located:
            found.add(Condition.GROUNDED)
            self._find(Condition.IMPLAUSIBLE, "; ".join(self.standing.own_problems(now_s)), found)
            return
        self._judge_motion(found, now_s)
        if not flying:
            if not self._arming:
                return
            problems = self.standing.problems(now_s, arming=True)
            self._find(Condition.IMPLAUSIBLE, "; ".join(problems), found)
        judgement = self.pose_monitor.judge(now_s, self._thrust_time_s if flying else 0.0)
        self._find(Condition.HOLD_CAUSE, judgement.hold, found)
        self._find(Condition.DESCEND_CAUSE, judgement.descend, found)

    def _find(self, condition: Condition, detail: str | None, found: set[Condition]) -> None:
        """Add a condition if there is a reason for it."""
        if detail:
            found.add(condition)
            self._details[condition] = detail

    def _judge_motion(self, found: set[Condition], now_s: float) -> None:
        if (motion := self.pose_monitor.own_motion(now_s, self.limits.landing.pose_age_s)) is None:
            self._touchdown.release()
            return
        found.add(Condition.SEEN)
        self._located = not self.pose_monitor.doubtful
        height_m, climb_m_s = motion.position_m[2] - self._floor_m, motion.velocity_m_s[2]
        if self.limits.falls(height_m, climb_m_s) and self.lift_off.problem is None:  # else not believed
            found.add(Condition.AIRBORNE)
            self._climb_m_s = climb_m_s if self._located and height_m >= self.limits.airborne_m else None
        fence = self.limits.surveillance.fence
        if self.state not in ON_THE_WAY_DOWN:
            self._touchdown.release()
        elif fence is not None and not self._limiter.law.obeyed and fence.left(motion.position_m):
            found.add(Condition.RUNAWAY)
        elif self._touchdown.happened(motion, self._floor_m, now_s) or (
            self.state is State.DESCEND and now_s >= self._sunk_s and Condition.AIRBORNE not in found
        ):
            found.add(Condition.TOUCHDOWN)
        if self.state is State.LAND or Condition.AIRBORNE in found:
            self._motion = motion

    @property
    def _floor_m(self) -> float:
        return self.pose_monitor.floor_m(self.limits.floor_m)

    # Time ---------------------------------------------------------------------------------------------

    def step(self, now_s: float, requested: Condition | None = None) -> ArbiterOutput:
        """Advance to `now_s`, change the state by the table, also as `requested`, and return the output."""
        acting = self._pass(now_s, requested)
        elapsed_s = 0.0 if math.isinf(self._applied_s) else self._now_s - self._applied_s
        self._applied_s = self._now_s
        self._apply(self._now_s, elapsed_s, acting)
        cause = None if acting is None else acting.command.cause
        return ArbiterOutput(self.state, self._limiter.u, self._bridging_step, cause)

    def _pass(self, now_s: float, requested: Condition | None = None) -> Stream | None:
        """Advance the time and change the state; returns the commands that act then."""
        now_s = max(now_s, self._now_s)
        elapsed_s = 0.0 if math.isinf(self._now_s) else now_s - self._now_s
        self._now_s, self._event_s = now_s, None
        stream = self._stream()
        bridging = 0 if stream is None else bridging_step(stream, now_s, self.limits)
        self._watch_thrust(now_s, elapsed_s, stream, bridging)
        conditions = self._conditions(now_s, stream, bridging)
        if requested is not None:
            conditions.add(requested)
        row = find_transition(self.state, frozenset(conditions))
        if row is not None:
            self._enter(row, now_s)
        acting = stream if self.state is State.ARMED else None
        played = 0 if acting is None else bridging
        if played > self._bridging_step:
            self.counters["planned inputs played"] += played - self._bridging_step
        self._bridging_step = played
        return acting

    def _watch_thrust(self, now_s: float, elapsed_s: float, stream: Stream | None, bridging: int) -> None:
        """Keep track of since when neither the applied nor the commanded thrust lifts the vehicle."""
        wanted = 0.0
        if stream is not None and self.state not in ON_THE_WAY_DOWN:
            wanted = played_input(stream.command, bridging)[THRUST]
        if self.state in FLYING and max(self._limiter.u[THRUST], wanted) > self.limits.low_thrust:
            self._low_since_s = None
            self._thrust_time_s += elapsed_s
        elif self._low_since_s is None:
            self._low_since_s = now_s
        self.lift_off.thrust(self._limiter.u[THRUST], elapsed_s, stands=self._grounded(now_s))

    def _enter(self, row: Transition, now_s: float) -> None:
        causes = row.needs | (row.unless & {Condition.READY})
        details = [self._details[c] for c in causes if c in self._details]
        self.reason = ": ".join([row.reason, *details])
        if self.state not in ON_THE_WAY_DOWN:
            self._landing_since_s, self._landing_reason = now_s, self.reason
        elif row.target in {*ON_THE_WAY_DOWN, State.CUT} and self.reason != self._landing_reason:
            self.reason += f": {self._landing_reason}"
        if row.target is State.ARMED and self.state not in FLYING:
            self.commanded = True
            self._thrust_time_s = 0.0
            self.lift_off.begin()
        if row.target not in FLYING:
            self.commanded = False
            self.pose_monitor.release()
        self.state, self._entered_s = row.target, now_s
        descents_s = self.limits.descents_s(self.pose_monitor.height_m(self._floor_m))
        self._sunk_s, self._descended_s = (now_s + duration_s for duration_s in descents_s)
        self.counters[f"entered {row.target}"] += 1

    # Output -------------------------------------------------------------------------------------------

    def _apply(self, now_s: float, elapsed_s: float, acting: Stream | None) -> None:
        limiter, motion = self._limiter, self._motion
        limiter.learn_hover(elapsed_s, self._climb_m_s, located=self._located)
        if acting is not None:
            flies = motion is not None and not acting.is_low(now_s, self.limits)
            height_m = motion.position_m[2] - self._floor_m if motion is not None and flies else None
            target = played_input(acting.command, self._bridging_step)
            limiter.play(target, now_s, height_m, unproved=not self.lift_off.proved)
        elif self.state is State.HOLD and self.lift_off.proved:
            limiter.hold(motion, elapsed_s)
        elif self.state is State.LAND and motion is not None:
            limiter.land(motion, self._floor_m, now_s - self._landing_since_s, elapsed_s)
        elif self.state in FLYING and (self.lift_off.sinking or self.lift_off.unfinished):
            limiter.sink(self.lift_off.sinking_thrust)
        elif self.state in FLYING:
            limiter.descend(elapsed_s, late=now_s >= self._sunk_s)
        else:
            limiter.stop()

    def next_event_s(self) -> float:
        """Next time after the last step at which state or output may change by itself [s]."""
        if self._event_s is None:
            self._event_s = self._found_event_s()
        return self._event_s

    def _found_event_s(self) -> float:
        if self.state not in FLYING:
            return math.inf
        limits, times = self.limits, self.pose_monitor.next_event_s()
        if (stream := self._stream()) is not None:
            times.append(next_change_s(stream, self._now_s, limits))
        if self._low_since_s is not None:
            times += [self._low_since_s + limits.arm_low_s, self._idle_at_s]
        times += [self._entered_s + limits.hold_limit_s, self._descended_s]
        if self.state is State.LAND and (own := self.pose_monitor.own_track) is not None:
            landing = limits.landing
            times += [own.captured_s + landing.pose_age_s, self._landing_since_s + landing.longest_s]
        return min([time_s for time_s in times if time_s > self._now_s], default=math.inf)
