"""Runs the real agent on the inputs of a recorded one, and compares what both did."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import msgspec
import numpy as np

from rcopterx.agents.guards.time_limit import Overtime, TimeLimit
from rcopterx.agents.process import TRAJECTORY_CHECKED, TUNED, Agent
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import decode, encode
from rcopterx.bus.log_messages import RoundedEstimate
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Command, Plan
from rcopterx.deploy.roles.agent import pilot_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.vehicles.state import MOTION_SIZE, Array
from rcopterx_studies.replay.recorded_agent import AgentLife, AgentStep, RecordedAgent
from rcopterx_studies.replay.replay_bus import ReplayBus

TOLERANCE: Final = 1e-6  # of inputs, positions [m] and speeds [m/s] on a different computer
ESTIMATED: Final = (
    "x [m]", "y [m]", "z [m]", "yaw [rad]", "body x speed [m/s]", "body y speed [m/s]", "z speed [m/s]",
    "yaw rate [rad/s]", "pitch actuator", "roll actuator", "thrust actuator", "yaw actuator",
    "x disturbance [m/s^2]", "y disturbance [m/s^2]", "z disturbance [m/s^2]", "yaw disturbance [rad/s^2]",
)  # fmt: skip
STICKS: Final = ("pitch", "roll", "thrust", "yaw")


def arithmetic(provenance: Mapping[str, str]) -> tuple[str, ...]:
    """Return what decides whether two computers compute the same to the last bit."""
    return tuple(provenance.get(name, "") for name in ("processor", "python", "numpy", "scipy", "osqp"))


@dataclass(frozen=True)
class Difference:
    """The first control period in which the replay differs."""

    time_s: float  # since the first step of the agent
    frame: int
    cause: str  # `input`, `estimate`, `reference` or `solution`: the first of them that differs
    detail: str


@dataclass
class Comparison:
    """Result of the replay of an agent; differences of inputs are those of the sticks."""

    vehicle: str
    periods: int = 0  # control periods that were compared
    identical: int = 0  # periods with the same command and plan to the last bit
    largest_input: float = 0.0
    rms_input: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    largest_plan: float = 0.0  # largest difference of planned positions [m] and speeds [m/s]
    missing_inputs: int = 0  # inputs that the flight log does not have
    unmatched: int = 0  # commands of only one of both agents
    flown_s: float = 0.0
    first: Difference | None = None
    notes: list[str] = field(default_factory=list)


def changed(fleet: FleetFile, vehicle: str, changes: Mapping[str, Any]) -> FleetFile:
    """Fleet file with another controller, estimator, horizon or settings of the controller of a vehicle."""
    control = fleet.vehicles[vehicle].control
    own = {name: value for name, value in changes.items() if name in ("controller", "estimator", "horizon")}
    settings = {name: value for name, value in changes.items() if name not in own}
    other = control.settings if own.get("controller", control.controller) == control.controller else {}
    control = msgspec.structs.replace(control, **own, settings={**other, **settings})
    replaced = msgspec.structs.replace(fleet.vehicles[vehicle], control=control)
    return msgspec.structs.replace(fleet, vehicles={**fleet.vehicles, vehicle: replaced})


def replay(recorded: RecordedAgent, fleet: FleetFile, tolerance: float = 0.0) -> Comparison:
    """Run an agent on recorded inputs; differences up to `tolerance` are ignored. Raises FleetError."""
    compared = _Compared(recorded, tolerance)
    result = compared.result
    for life in recorded.lives:
        if not life.from_start:
            result.notes.append("the recording begins after the start of the agent")
        if life.lost_steps:
            result.notes.append(f"{life.lost_steps} messages about steps are lost")
        missing = 0
        for step, period in control_periods(recorded.vehicle, fleet, life, fleet == recorded.fleet):
            compared.add(step.time_s - life.steps[0].time_s, step, period)
            missing = period.missing
        result.missing_inputs += missing
        if life.steps:
            result.flown_s += life.steps[-1].time_s - life.steps[0].time_s
    if compared.errors:
        result.rms_input = tuple(np.sqrt(np.mean(np.square(compared.errors), axis=0)).tolist())
    return result


class RepeatedTimeLimit(TimeLimit):
    """Ends the calls of a replayed agent where those of the recorded one ended, see `NotedTimeLimit`."""

    def __init__(self) -> None:
        self._noted: frozenset[Overtime] = frozenset()
        self._calls = self._queries = 0
        self._over = False

    def begin_step(self, overtime: Iterable[Overtime]) -> None:
        """Repeat this overtime in the next step."""
        self._noted = frozenset(overtime)
        self._calls = 0

    def begin(self, limit_s: float) -> None:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.begin`."""
        self._calls += 1
        self._queries = 0
        self._over = False

    def end(self, limit_s: float) -> bool:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.end`."""
        return (self._calls, 0) in self._noted

    def over(self, limit_s: float) -> bool:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.over`."""
        self._queries += 1
        self._over = self._over or (self._calls, self._queries) in self._noted
        return self._over


@dataclass
class ControlPeriod:
    """Outputs of the replayed agent in a step; command and plan are None if it did not control."""

    command: Command | None = None
    plan: Plan | None = None
    estimate: RoundedEstimate | None = None
    missing: int = 0  # inputs so far that the flight log does not have


def control_periods(
    vehicle: str, fleet: FleetFile, life: AgentLife, as_flown: bool = True
) -> Iterator[tuple[AgentStep, ControlPeriod]]:
    """Every step in which the replayed agent or the recorded one controlled, with the replayed outputs.

    With `as_flown`, for the same fleet file, the replay aborts the same computations that ran out of time.
    """
    period = ControlPeriod()

    def published(_: Channel[Any], message: Message) -> None:
        if isinstance(message, Command):
            period.command = message
        elif isinstance(message, Plan):
            period.plan = message

    bus = ReplayBus(life, published)
    settings, pilot = pilot_of(fleet, vehicle)
    limit = RepeatedTimeLimit()
    agent = Agent(settings, pilot, bus, realtime=False, stopwatch=lambda: 0.0, limit=limit)
    for step in life.steps:
        if any(item.key in (TUNED, TRAJECTORY_CHECKED) for item in step.inputs):
            agent.wait_for_work()
        period = ControlPeriod()
        bus.take(step)
        limit.begin_step(step.overtime if as_flown else ())
        agent.step()
        if bus.estimate is not None or step.estimate is not None:
            period.estimate = None if bus.estimate is None else RoundedEstimate.of(bus.estimate)
            period.missing = bus.missing
            yield step, period
    agent.wait_for_work()


class _Compared:
    """The control periods that have been compared."""

    def __init__(self, recorded: RecordedAgent, tolerance: float) -> None:
        self.result = Comparison(recorded.vehicle)
        self.errors: list[Array] = []  # of the inputs
        self._recorded = recorded
        self._tolerance = tolerance

    def add(self, time_s: float, step: AgentStep, period: ControlPeriod) -> None:
        """Compare a control period, `time_s` after the first step of the agent."""
        result = self.result
        command, plan = period.command, period.plan
        if command is None or plan is None:
            result.unmatched += 1
            detail = _lost(period) or "the recorded agent controlled here, the replayed one did not"
            result.first = result.first or Difference(time_s, 0, "input", detail)
            return
        then = self._recorded.commands.get((command.lease, command.sequence))
        planned = encode(plan)
        plan_then = self._plan_then(plan, planned)
        if then is None or plan_then is None:
            # Messages that were on their way when the recording ended are missing.
            result.unmatched += 1
            return
        result.periods += 1
        command_then = decode(then, Command)
        # Durations are not repeated.
        command = msgspec.structs.replace(command, timing=command_then.timing)
        old = decode(plan_then, Plan)
        # Earlier versions did not send fields that have been appended since.
        if encode(command) == then and planned == encode(old):
            result.identical += 1
            self.errors.append(np.zeros(4))
            return
        error = np.subtract(command.input, command_then.input)
        self.errors.append(error)
        gap = _gap(plan, old)
        result.largest_input = max(result.largest_input, float(np.abs(error).max()))
        result.largest_plan = max(result.largest_plan, gap)
        if max(float(np.abs(error).max()), gap) > self._tolerance or self._tolerance == 0.0:
            cause = self._cause(step, period, plan, old, error, gap)
            result.first = result.first or Difference(time_s, plan.frame, *cause)

    def _plan_then(self, plan: Plan, planned: bytes) -> bytes | None:
        """Recorded plan to compare with: the nearest of those of a frame that was bridged or taken over."""
        plans = self._recorded.plans.get((plan.epoch, plan.frame), [])
        if planned in plans:
            return planned
        return min(plans, key=lambda then: _gap(plan, decode(then, Plan)), default=None)

    def _cause(
        self, step: AgentStep, period: ControlPeriod, plan: Plan, old: Plan, error: Any, gap: float
    ) -> tuple[str, str]:
        """The first stage of the computation that differs, and how."""
        if lost := _lost(period):
            return "input", lost
        now, then = period.estimate, step.estimate
        if (plan.epoch, plan.frame) != (old.epoch, old.frame) or now is None or then is None:
            return "input", "the recorded agent did not control in this step"
        estimates = np.abs(now.to_numpy() - then.to_numpy())
        worst = int(estimates.argmax())
        if estimates[worst] > self._tolerance + RoundedEstimate.UNIT:
            return "estimate", f"{ESTIMATED[worst]} by {estimates[worst]:.3g}"
        if self._tolerance == 0.0 and now.checksum != then.checksum:
            return "estimate", f"by less than {2 * RoundedEstimate.UNIT:.1g}"
        if (plan.reference is None) != (old.reference is None):
            return "reference", "only one of both agents has one"
        if plan.reference is not None and old.reference is not None:
            references = np.abs(np.subtract(plan.reference, old.reference))
            if references.max() > self._tolerance:
                worst = int(references.argmax())
                return "reference", f"{ESTIMATED[worst]} by {references[worst]:.3g}"
        worst = int(np.abs(error).argmax())
        return "solution", f"{STICKS[worst]} stick by {abs(error[worst]):.3g}, plan by {gap:.3g}"


def _lost(period: ControlPeriod) -> str:
    """Note about missing inputs, which explain any difference; empty if there are none."""
    return f"{period.missing} inputs so far are not in the flight log" if period.missing else ""


def _gap(plan: Plan, other: Plan) -> float:
    """Largest difference of the positions and speeds of two plans; infinite for different lengths."""
    if plan.trajectory.stages != other.trajectory.stages:
        return float("inf")
    difference = plan.trajectory.to_numpy() - other.trajectory.to_numpy()
    return float(np.abs(difference[:, :MOTION_SIZE]).max())
