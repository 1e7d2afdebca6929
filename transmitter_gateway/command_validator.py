"""Which commands are accepted (form, limits, control lease, epoch, order), and what acts till the next."""

import math
from collections import Counter
from collections.abc import Sequence
from enum import StrEnum
from numbers import Real
from typing import Final

from msgspec import Struct

from rcopterx.bus.message import LONGEST_PERIOD_S, MAX_COUNT, SHORTEST_PERIOD_S
from rcopterx.bus.messages import MAX_NEXT_INPUTS
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.inputs import THRUST, Cause, CommandInput, Input, PoseInput

RESERVED_S: Final = 0.1  # for an agent that was given a lease to command before the next one gets one
MOST_AGENTS: Final = 16  # agents whose leases are remembered


class Leases:
    """Control leases of one vehicle: newest `issued`, and `commanding`, whose commands count; 0 for none.

    An agent requests a lease and adds its number to every command. Numbers only grow and are issued here
    only, so no clock of any host matters. The newest lease that has commanded counts; commands of earlier
    ones are rejected from then on, however long they were delayed.
    """

    def __init__(self) -> None:
        self.commanding = 0
        self.issued = 0
        self._of_agents: dict[int, int] = {}
        self._reserved_until_s = -math.inf

    def bid(self, agent: int, now_s: float, *, fresh: bool, take_over: bool) -> int:
        """Lease of an agent that requests one; 0 while another commands. Repeated requests get the same.

        `fresh`: the vehicle is commanded now; `take_over`: from the agent that commands.
        """
        known = self._of_agents.get(agent, 0)
        if known and known >= self.commanding:
            return known
        if not take_over and (fresh or now_s < self._reserved_until_s):
            return 0
        self.issued += 1
        self._of_agents.pop(agent, None)
        self._of_agents[agent] = self.issued
        if len(self._of_agents) > MOST_AGENTS:
            del self._of_agents[next(iter(self._of_agents))]
        self._reserved_until_s = now_s + RESERVED_S
        return self.issued

    def lost(self, lease: int) -> bool:
        """Whether a later lease commands."""
        return lease < self.commanding

    def was_issued(self, lease: int) -> bool:
        """Whether this lease can have been issued."""
        return 1 <= lease <= self.issued

    def command(self, lease: int) -> bool:
        """A valid command of a lease takes effect; True if it is the first one after another lease."""
        changed = 0 < self.commanding < lease
        self.commanding = max(self.commanding, lease)
        return changed

    def resume(self, commanding: int, issued: int, now_s: float) -> None:
        """Continue from an earlier process of the gateway."""
        self.commanding = max(self.commanding, commanding)
        self.issued = max(self.issued, commanding, issued)
        if self.issued:
            self._reserved_until_s = now_s + RESERVED_S


LONGEST_PLAN = 1 + MAX_NEXT_INPUTS  # planned inputs of a command, the first one included


class Rejection(StrEnum):
    """Why a command was rejected; the value is the counter's name."""

    MALFORMED = "malformed command"
    NOT_FINITE = "command not finite"
    OUT_OF_LIMITS = "command out of limits"
    OLD_SEQUENCE = "old sequence number"
    OLDER_EPOCH = "older epoch"
    UNKNOWN_EPOCH = "epoch not in the raw poses"
    OLD_POSE = "command computed from an old pose"
    FUTURE_POSE = "command ahead of the raw poses"
    NO_LEASE = "no such control lease"
    LEASE_LOST = "control lease lost"


class AcceptedCommand(Struct, frozen=True):
    """A command that passed every check, inputs clamped to the limits."""

    cause: Cause
    u: Input
    next_u: tuple[Input, ...]
    period_s: float
    given_up: str | None = None


class Stream(Struct):
    """The newest valid command, when it arrived, and since when the commanded thrust is low."""

    command: AcceptedCommand
    arrival_s: float
    low_since_s: float | None

    def is_low(self, now_s: float, limits: ArbiterLimits) -> bool:
        """Whether the commanded thrust has been low for as long as arming needs."""
        return self.low_since_s is not None and now_s >= self.low_since_s + limits.arm_low_s


class CommandValidator:
    """Checks commands and keeps the newest valid one, of the agent with the newest lease, as `stream`."""

    def __init__(self, limits: ArbiterLimits, counters: Counter[str]) -> None:
        self._limits = limits
        self._bounds = tuple(
            (lower - limits.tolerance, lower, upper, upper + limits.tolerance)
            for lower, upper in zip(limits.lower, limits.upper, strict=True)
        )
        self._counters = counters
        self.stream: Stream | None = None
        self.leases = Leases()

    def consider(
        self,
        command: CommandInput,
        now_s: float,
        *,
        pose: PoseInput | None,
        epoch_age_s: float = 0.0,  # of the pose: time since the first one with its epoch
        flying: bool,
    ) -> Rejection | None:
        """Accept `command` or return why not, by the newest raw pose; a later lease takes over."""
        checked = self._check_form(command)
        if isinstance(checked, AcceptedCommand):
            rejection = self._check_order(checked.cause, None if pose is None else pose.epoch, flying)
            if rejection is None and pose is not None:
                rejection = self._check_age(checked.cause, pose, epoch_age_s)
            if rejection is None:
                self._store(checked, now_s)
        else:
            rejection = checked
        if rejection is not None:
            self._counters[rejection] += 1
        return rejection

    def fresh(self, now_s: float) -> bool:
        """Whether the newest command is not late."""
        return self.stream is not None and now_s < self.stream.arrival_s + self._limits.hold_after_s

    def thrust_wanted(self, now_s: float) -> bool:
        """Whether a command that is not late asks for thrust."""
        stream = self.stream
        wanted = stream is not None and stream.command.u[THRUST] > self._limits.low_thrust
        return wanted and self.fresh(now_s)

    def _check_form(self, command: CommandInput) -> AcceptedCommand | Rejection:
        numbers = (command.lease, command.epoch, command.sequence, command.frame)
        if set(map(type, numbers)) != {int} or min(numbers) < 0 or max(numbers) > MAX_COUNT:
            return Rejection.MALFORMED
        period = command.period_s
        # Nearly all are floats, and checking for the abstract type takes long.
        if type(period) is not float and (isinstance(period, bool) or not isinstance(period, Real)):
            return Rejection.MALFORMED
        if not SHORTEST_PERIOD_S <= period <= LONGEST_PERIOD_S:
            return Rejection.NOT_FINITE if not math.isfinite(period) else Rejection.OUT_OF_LIMITS
        try:
            plan = (command.u, *command.next_u)
        except TypeError:
            return Rejection.MALFORMED
        if len(plan) > LONGEST_PLAN:
            return Rejection.MALFORMED
        inputs: list[Input] = []
        for values in plan:
            checked = self._check_input(values)
            if isinstance(checked, Rejection):
                return checked
            inputs.append(checked)
        return AcceptedCommand(Cause(*numbers), inputs[0], tuple(inputs[1:]), float(period), command.given_up)

    def _check_input(self, values: Sequence[float]) -> Input | Rejection:
        """Clamp an input, or return the worst reason against it: form, then finiteness, then limits."""
        try:
            numbers = tuple(values)
        except TypeError:
            return Rejection.MALFORMED
        if len(numbers) != 4:
            return Rejection.MALFORMED
        rejection: Rejection | None = None
        clamped: list[float] = []
        for value, (lowest, lower, upper, highest) in zip(numbers, self._bounds, strict=True):
            if type(value) is float and lower <= value <= upper:
                clamped.append(value)
            elif isinstance(value, bool) or not isinstance(value, Real):
                return Rejection.MALFORMED
            elif lowest <= value <= highest:
                clamped.append(min(max(float(value), lower), upper))
            elif rejection is not Rejection.NOT_FINITE:
                rejection = Rejection.OUT_OF_LIMITS if abs(value) < math.inf else Rejection.NOT_FINITE
        return rejection or (clamped[0], clamped[1], clamped[2], clamped[3])

    def _check_order(self, cause: Cause, pose_epoch: int | None, flying: bool) -> Rejection | None:
        """Check lease, epoch and sequence number against the last accepted command."""
        # The first command of a lease has the epoch of the raw poses, if there are any. Later ones change to
        # theirs only, because the Tracker has restarted, and the sequence begins anew; in flight the epoch
        # never decreases. `_check_age` limits how long it may be that of an earlier stream.
        if self.leases.lost(cause.lease):
            return Rejection.LEASE_LOST
        if not self.leases.was_issued(cause.lease):
            return Rejection.NO_LEASE
        if self.stream is None or self.stream.command.cause.lease != cause.lease:
            return Rejection.UNKNOWN_EPOCH if pose_epoch not in (None, cause.epoch) else None
        last = self.stream.command.cause
        if cause.epoch == last.epoch:
            if pose_epoch is not None and cause.epoch > pose_epoch:
                return Rejection.UNKNOWN_EPOCH
            return None if cause.sequence > last.sequence else Rejection.OLD_SEQUENCE
        if cause.epoch < last.epoch and (flying or cause.epoch != pose_epoch):
            return Rejection.OLDER_EPOCH
        if pose_epoch is None:
            return Rejection.UNKNOWN_EPOCH if flying else None
        return None if cause.epoch == pose_epoch else Rejection.UNKNOWN_EPOCH

    def _check_age(self, cause: Cause, pose: PoseInput, epoch_age_s: float) -> Rejection | None:
        """Reject a command far from the raw poses; an agent that bridges missing ones is a little ahead."""
        limit_s = self._limits.command_age_s
        if cause.epoch != pose.epoch:
            return Rejection.OLDER_EPOCH if epoch_age_s > limit_s else None
        if pose.period_s is None:
            return None
        age_s = (pose.frame - cause.frame) * pose.period_s + pose.latency_s
        if age_s < -limit_s:
            return Rejection.FUTURE_POSE
        return Rejection.OLD_POSE if age_s > limit_s else None

    def _store(self, command: AcceptedCommand, now_s: float) -> None:
        if self.leases.command(command.cause.lease):
            self._counters["agents that took over"] += 1
        before = self.stream
        low_since_s: float | None = None
        if command.u[2] <= self._limits.low_thrust:
            gapless = before is not None and now_s - before.arrival_s < self._limits.hold_after_s
            low_since_s = before.low_since_s if before is not None and gapless else now_s
            low_since_s = now_s if low_since_s is None else low_since_s
        self.stream = Stream(command, now_s, low_since_s)


FIRST_AFTER_PERIODS = 1.5
ROUNDING = 1e-9


def bridging_step(stream: Stream, now_s: float, limits: ArbiterLimits) -> int:
    """Number of the planned input to be played at `now_s`: 0 none, 1 the first.

    Planned input n belongs to the time n periods after its command. The first one waits half a period longer,
    but not until HOLD, so that a command that is slightly late does not count as missing.
    """
    period_s, arrival_s = stream.command.period_s, stream.arrival_s
    if now_s < arrival_s + _first_after_s(period_s, limits):
        return 0
    usable = min(len(stream.command.next_u), _steps_within(limits.bridge_s, period_s))
    if now_s >= arrival_s + max((usable + 1) * period_s, limits.hold_after_s):
        return 0
    return min(max(int((now_s - arrival_s) / period_s + ROUNDING), 1), usable)


def played_input(command: AcceptedCommand, step: int) -> Input:
    """Input that acts in a step of `bridging_step`."""
    return command.next_u[step - 1] if step else command.u


def next_change_s(stream: Stream, now_s: float, limits: ArbiterLimits) -> float:
    """When the age of the newest command next changes the output, after `now_s`; infinite if never."""
    period_s = stream.command.period_s
    ages_s = [number * period_s for number in range(2, _steps_within(limits.bridge_s, period_s) + 2)]
    limits_s = limits.hold_after_s, limits.descend_after_s, limits.cut_after_s
    times_s = [stream.arrival_s + age_s for age_s in (*ages_s, _first_after_s(period_s, limits), *limits_s)]
    return min([time_s for time_s in times_s if time_s > now_s], default=math.inf)


def _steps_within(time_s: float, period_s: float) -> int:
    return int(time_s / period_s + ROUNDING)


def _first_after_s(period_s: float, limits: ArbiterLimits) -> float:
    return min(FIRST_AFTER_PERIODS * period_s, limits.hold_after_s)
