"""Safety arbiter of one vehicle (dsm2_transmitters.md section 8.3).

What may follow what is the table in `transitions.py`; here are its conditions and the outputs. Every input
first lets the time pass (`Arbiter.step`), then takes effect; so nothing that arrives after a limit was passed
can hide that it was passed.
"""

from __future__ import annotations

import math
from collections import Counter

from transmitter_gateway.admission import Admission, Stream
from transmitter_gateway.bridging import bridging_step, played_input, step_ages_s
from transmitter_gateway.hover import HoverThrust
from transmitter_gateway.inputs import (
    FLYING,
    NEUTRAL,
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
from transmitter_gateway.limits import ArbiterLimits
from transmitter_gateway.permissions import refusal
from transmitter_gateway.surveillance import Surveillance
from transmitter_gateway.transitions import ARMING, Condition, Transition, find_transition

LONGEST_SLEW_STEP_S = 0.04
THRUST = 2


class Arbiter:
    """Decides what one vehicle does from commands, raw poses, requests, link state and time.

    Parameters
    ----------
    vehicle : str
        Name of the vehicle, as in the poses.
    limits : ArbiterLimits
        All limits.
    u_hover : float
        Thrust at which the vehicle hovers, by its calibration.
    slew_per_s : tuple of float
        Fastest change of each input while ARMED [1/s].

    Attributes
    ----------
    state, reason
        Current state and why.
    counters : Counter
        Rejections, state entries, planned inputs played and steps that slew rates limited, by name.
    holder : str or None
        Source with the control lease.
    """

    def __init__(self, vehicle: str, limits: ArbiterLimits, u_hover: float, slew_per_s: Input) -> None:
        self.limits = limits
        self.state = State.DISARMED
        self.reason = "started"
        self.counters: Counter[str] = Counter()
        self.holder: str | None = None
        self.surveillance = Surveillance(vehicle, limits.surveillance, self.counters)
        self._admission = Admission(limits, self.counters)
        self._hover = HoverThrust(u_hover, limits.hover_correction, limits.floor_m + limits.airborne_m)
        self._slew_per_s = slew_per_s
        self._link = LinkState.LOST
        self._candidate: str | None = None
        self._shutdown = False
        self._u: Input = NEUTRAL
        self._moved_s = 4 * [-math.inf]
        self._now_s = -math.inf
        self._shaped_s = -math.inf
        self._entered_s = -math.inf
        self._low_since_s: float | None = None
        self._thrust_time_s = 0.0
        self._bridging_step = 0
        self._details: dict[Condition, str] = {}

    # Inputs -------------------------------------------------------------------------------------------

    def command(self, command: CommandInput, now_s: float) -> Answer:
        """Take a command; a rejected one changes nothing but a counter."""
        # The next step follows at once and judges the command; before it, time matters only to what is due.
        if now_s >= self.next_event_s():
            self._pass(now_s)
        rejection = self._admission.consider(
            command, now_s, pose_epoch=self.surveillance.epoch, holder=self.holder
        )
        return Answer(rejection is None, rejection or "accepted")

    def pose(self, pose: PoseInput, now_s: float) -> None:
        """Take a raw pose of the own or another vehicle."""
        self.surveillance.pose(pose, now_s, airborne=self.state in FLYING and not self._grounded(now_s))

    def link(self, link: LinkState) -> None:
        """Take the state of port and module; it takes effect with the next step."""
        self._link = link

    def request(self, request: ActionRequest, now_s: float) -> Answer:
        """Carry out or refuse a request; `permissions` says whose requests count."""
        self.step(now_s)
        problem = refusal(request, self.holder, self.limits.operators)
        if problem is None:
            problem = self._carry_out(request, now_s)
        if problem is not None:
            self.counters[f"refused: {request.action}"] += 1
            return Answer(False, problem)
        return Answer(True, f"{self.state}: {self.reason}")

    def _carry_out(self, request: ActionRequest, now_s: float) -> str | None:
        """Apply an allowed request; return why it had no effect, if so."""
        match request.action:
            case Action.HAND_OVER:
                return self._hand_over(request.source, now_s)
            case Action.SHUTDOWN:
                self._shutdown = True
                self.step(now_s)
                return None
            case Action.ARM:
                return self._arm(request.source, now_s)
            case Action.RESET:
                if self.state is not State.KILLED:
                    return "not killed"
                state = self._take(Condition.RESET, request.by, now_s)
                return None if state is State.DISARMED else "a source asks for thrust: lower it first"
            case Action.DISARM:
                self._take(Condition.DISARM, request.by, now_s)
            case Action.KILL:
                self._take(Condition.KILL, request.by, now_s)
        return None

    def _arm(self, source: str, now_s: float) -> str | None:
        if self.state in FLYING:
            return None
        self._candidate = source
        state = self._take(Condition.ARM, source, now_s)
        conditions = self._conditions(now_s, self._stream(), 0)
        self._candidate = None
        if state is State.ARMED:
            return None
        if state is State.KILLED:
            return "killed: an operator must reset first"
        missing = sorted(f"missing: {c}" for c in ARMING.needs - conditions - {Condition.ARM})
        present = sorted(
            f"{c}: {self._details[c]}" if c in self._details else str(c) for c in ARMING.unless & conditions
        )
        return "; ".join(missing + present)

    def take_over(self, last: LastApplied, now_s: float) -> Answer:
        """Go on with the flight of an earlier process, or say why not and stay as after any start.

        The vehicle is taken over descending; fresh commands of the source that had the lease then count
        again. A descent goes on to its end, because why it was begun is not known any more.
        """
        self.step(now_s)
        problem = self._take_over_problem(last, now_s)
        if problem is None:
            self.holder = last.holder if last.state in (State.ARMED, State.HOLD) else None
            self._u = last.u
            self._take(Condition.TAKE_OVER, "this gateway", now_s)
            if self.state is State.DESCEND:
                return Answer(True, f"{self.state}: {self.reason}")
            problem = "serial link lost"
        self.holder = None
        self.counters["refused: take over"] += 1
        self.reason = f"not taken over: {problem}"
        return Answer(False, problem)

    def _take_over_problem(self, last: LastApplied, now_s: float) -> str | None:
        limits = self.limits
        track = self.surveillance.own_track
        if self.state is not State.DISARMED or last.state not in FLYING:
            return f"{last.state} before, {self.state} now"
        if now_s >= last.written_s + limits.take_over_s:
            return f"no frames for {now_s - last.written_s:.2f} s, longer than {limits.take_over_s:g} s"
        if not last.u[THRUST] > limits.low_thrust:
            return "the thrust was low"
        if track is None or track.position_m is None:
            return "own pose not seen"
        if track.position_m[2] < limits.floor_m + limits.airborne_m:
            return f"at {track.position_m[2]:.2f} m it may stand on the floor"
        return None

    def _hand_over(self, source: str, now_s: float) -> str | None:
        if self.holder is None:
            return "nobody has the control lease: arm instead"
        stream = self._admission.streams.get(source)
        if stream is None or not self._is_fresh(stream, now_s):
            return f"{source} sends no fresh commands"
        self.holder = source
        self.reason = f"control handed over to {source}"
        return None

    def _take(self, condition: Condition, by: str, now_s: float) -> State:
        """Step once with a requested condition; return the state after it."""
        self._details[condition] = f"by {by}"
        return self._step(now_s, condition).state

    # Conditions ---------------------------------------------------------------------------------------

    def _stream(self) -> Stream | None:
        source = self.holder or self._candidate
        return None if source is None else self._admission.streams.get(source)

    def _is_fresh(self, stream: Stream, now_s: float) -> bool:
        return now_s < stream.arrival_s + self.limits.hold_after_s

    def _grounded(self, now_s: float) -> bool:
        return self._low_since_s is not None and now_s >= self._low_since_s + self.limits.arm_low_s

    def _conditions(self, now_s: float, stream: Stream | None, bridging: int) -> set[Condition]:
        found: set[Condition] = set()
        if self._shutdown:
            found.add(Condition.SHUTDOWN)
        if self._link is LinkState.LOST:
            found.add(Condition.LINK_LOST)
        elif self._link is LinkState.READY:
            found.add(Condition.READY)
        if stream is not None:
            self._judge_stream(found, stream, bridging, now_s)
        if self.state is State.KILLED and self._thrust_wanted(now_s):
            found.add(Condition.THRUST_WANTED)
        self._judge_poses(found, now_s)
        if self.state is State.HOLD and now_s >= self._entered_s + self.limits.hold_limit_s:
            found.add(Condition.HOLD_OVER)
        if self.state is State.DESCEND and now_s >= self._entered_s + self._descent_s:
            found.add(Condition.DESCENT_OVER)
        return found

    @property
    def _descent_s(self) -> float:
        return self.limits.cut_after_s - self.limits.descend_after_s

    def _judge_stream(self, found: set[Condition], stream: Stream, bridging: int, now_s: float) -> None:
        limits = self.limits
        if self._is_fresh(stream, now_s):
            found.add(Condition.FRESH)
        if bridging:
            found.add(Condition.BRIDGING)
        if now_s >= stream.arrival_s + limits.descend_after_s:
            found.add(Condition.SILENT)
        if now_s >= stream.arrival_s + limits.cut_after_s:
            found.add(Condition.GONE)
        if stream.low_since_s is not None and now_s >= stream.low_since_s + limits.arm_low_s:
            found.add(Condition.LOW_COMMANDED)

    def _thrust_wanted(self, now_s: float) -> bool:
        return any(
            stream.command.u[THRUST] > self.limits.low_thrust and self._is_fresh(stream, now_s)
            for stream in self._admission.streams.values()
        )

    def _judge_poses(self, found: set[Condition], now_s: float) -> None:
        """Judge the raw poses; a vehicle that stands on the floor is left alone unless it is to be armed."""
        flying = self.state in FLYING
        if flying and self._grounded(now_s):
            found.add(Condition.GROUNDED)
            return
        if not flying and self._candidate is None:
            return
        judgement = self.surveillance.judge(now_s, self._thrust_time_s if flying else 0.0)
        for condition, reason in (
            (Condition.HOLD_CAUSE, judgement.hold),
            (Condition.DESCEND_CAUSE, judgement.descend),
        ):
            if reason is not None:
                found.add(condition)
                self._details[condition] = reason

    # Time ---------------------------------------------------------------------------------------------

    def step(self, now_s: float) -> ArbiterOutput:
        """Let the time pass to `now_s`, change the state if the table says so, and give the output."""
        return self._step(now_s)

    def _step(self, now_s: float, requested: Condition | None = None) -> ArbiterOutput:
        acting = self._pass(now_s, requested)
        elapsed_s = 0.0 if math.isinf(self._shaped_s) else self._now_s - self._shaped_s
        self._shaped_s = self._now_s
        self._u = self._shape(self._now_s, elapsed_s, acting)
        return ArbiterOutput(
            self.state,
            self.reason,
            self._u,
            throttle_low=self.state in (State.CUT, State.KILLED),
            kill=self.state is State.KILLED,
            bridging_step=self._bridging_step,
            cause=None if acting is None else acting.command.cause,
        )

    def _pass(self, now_s: float, requested: Condition | None = None) -> Stream | None:
        """Let the time pass and change the state; whose commands act then."""
        now_s = max(now_s, self._now_s)
        elapsed_s = 0.0 if math.isinf(self._now_s) else now_s - self._now_s
        self._now_s = now_s
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
        wanted = 0.0 if stream is None else played_input(stream.command, bridging)[THRUST]
        if self.state in FLYING and max(self._u[THRUST], wanted) > self.limits.low_thrust:
            self._low_since_s = None
            self._thrust_time_s += elapsed_s
        elif self._low_since_s is None:
            self._low_since_s = now_s

    def _enter(self, row: Transition, now_s: float) -> None:
        details = [self._details[c] for c in row.needs if c in self._details]
        self.reason = ": ".join([row.reason, *details])
        if row.target is State.ARMED and self.state not in FLYING:
            self.holder = self._candidate
            self._thrust_time_s = 0.0
        if row.target not in FLYING:
            self.holder = None
            self.surveillance.release()
        self.state = row.target
        self._entered_s = now_s
        self.counters[f"entered {row.target}"] += 1

    # Output -------------------------------------------------------------------------------------------

    def _shape(self, now_s: float, elapsed_s: float, acting: Stream | None) -> Input:
        thrust = min(self._u[THRUST], self._hover.value)
        if acting is not None:
            u = self._slewed(played_input(acting.command, self._bridging_step), now_s)
            self._hover.note(self._u[THRUST], elapsed_s, self.surveillance.own_track, now_s)
            return u
        if self.state is State.HOLD:
            return (0.0, 0.0, thrust, 0.0)
        if self.state is State.DESCEND:
            floor = min(thrust, self._hover.value - self.limits.descend_below_hover)
            return (0.0, 0.0, max(floor, thrust - self.limits.descend_rate_per_s * elapsed_s), 0.0)
        return NEUTRAL

    def _slewed(self, target: Input, now_s: float) -> Input:
        """Inputs on their way to a target: the time since each of them moved last allows its next move.

        Steps in between, for poses or deadlines, must not use it up.
        """
        u = []
        for axis, (wanted, last, rate) in enumerate(zip(target, self._u, self._slew_per_s, strict=True)):
            most = rate * min(now_s - self._moved_s[axis], LONGEST_SLEW_STEP_S)
            if wanted != last:
                self._moved_s[axis] = now_s
            u.append(last - most if wanted < last - most else last + most if wanted > last + most else wanted)
        limited = (u[0], u[1], u[2], u[3])
        self.counters["steps slew limited"] += limited != target
        return limited

    def next_event_s(self) -> float:
        """Next time after the last step at which state or output may change by itself [s]."""
        if self.state not in FLYING:
            return math.inf
        limits = self.limits
        times = self.surveillance.next_event_s()
        stream = self._stream()
        if stream is not None:
            ages = [limits.hold_after_s, limits.descend_after_s, limits.cut_after_s]
            ages += step_ages_s(stream.command.period_s, limits)
            times += [stream.arrival_s + age for age in ages]
        if self._low_since_s is not None:
            times.append(self._low_since_s + limits.arm_low_s)
        times.append(self._entered_s + limits.hold_limit_s)
        times.append(self._entered_s + self._descent_s)
        return min((time for time in times if time > self._now_s), default=math.inf)
