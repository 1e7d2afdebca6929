"""Which commands are accepted: form, limits, order, epoch, control lease (section 8.3)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from numbers import Real

from msgspec import Struct

from rcopterx.transmitter_gateway.inputs import Cause, CommandInput, Input, PoseStamp
from rcopterx.transmitter_gateway.limits import ArbiterLimits

LONGEST_PLAN = 64
MOST_SOURCES = 8
FORGET_AFTER_S = 2.0


class Rejection(StrEnum):
    """Why a command was rejected; the value is the counter's name."""

    MALFORMED = "malformed command"
    NOT_FINITE = "command not finite"
    OUT_OF_LIMITS = "command out of limits"
    OLD_SEQUENCE = "old sequence number"
    OLDER_EPOCH = "older epoch"
    UNKNOWN_EPOCH = "epoch not in the raw poses"
    OLD_POSE = "command computed from an old pose"
    NO_LEASE = "source without control lease"
    TOO_MANY_SOURCES = "too many sources"


class AcceptedCommand(Struct, frozen=True):
    """A command that passed every check, inputs clamped to the limits."""

    cause: Cause
    u: Input
    next_u: tuple[Input, ...]
    period_s: float


@dataclass(slots=True)
class Stream:
    """The newest valid command of one source, when it arrived, and since when its thrust is low."""

    command: AcceptedCommand
    arrival_s: float
    low_since_s: float | None


class Admission:
    """Checks commands and keeps one `Stream` per source.

    The stream of a source without the lease is kept as well, so that a hand-over can be refused to a silent
    source; it has no influence on the vehicle.

    Parameters
    ----------
    limits : ArbiterLimits
        Input limits and times.
    counters : Counter
        Rejections are counted here by reason.
    """

    def __init__(self, limits: ArbiterLimits, counters: Counter[str]) -> None:
        self._limits = limits
        self._bounds = tuple(
            (lower - limits.tolerance, lower, upper, upper + limits.tolerance)
            for lower, upper in zip(limits.lower, limits.upper, strict=True)
        )
        self._counters = counters
        self.streams: dict[str, Stream] = {}

    def consider(
        self, command: CommandInput, now_s: float, *, pose: PoseStamp | None, holder: str | None
    ) -> Rejection | None:
        """Accept `command` into its source's stream or say why not.

        Parameters
        ----------
        command : CommandInput
            The command as received.
        now_s : float
            Time of arrival [s].
        pose : PoseStamp or None
            Newest raw pose of the vehicle, if any was received.
        holder : str or None
            Source with the control lease; None while the vehicle is not flying.
        """
        checked = self._check_form(command)
        if isinstance(checked, AcceptedCommand):
            rejection = self._check_order(checked.cause, now_s, None if pose is None else pose.epoch, holder)
            if rejection is None and pose is not None:
                rejection = self._check_age(checked.cause, pose)
            if rejection is None:
                self._store(checked, now_s)
                rejection = None if holder in (None, checked.cause.source) else Rejection.NO_LEASE
        else:
            rejection = checked
        if rejection is not None:
            self._counters[rejection] += 1
        return rejection

    def _check_form(self, command: CommandInput) -> AcceptedCommand | Rejection:
        if not (isinstance(command.source, str) and command.source):
            return Rejection.MALFORMED
        for number in (command.epoch, command.sequence, command.frame):
            if type(number) is not int or number < 0:
                return Rejection.MALFORMED
        period = command.period_s
        if isinstance(period, bool) or not isinstance(period, Real):
            return Rejection.MALFORMED
        if not 0 < period <= self._limits.longest_period_s:
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
        cause = Cause(command.source, command.epoch, command.sequence, command.frame)
        return AcceptedCommand(cause, inputs[0], tuple(inputs[1:]), float(period))

    def _check_input(self, values: Sequence[float]) -> Input | Rejection:
        """Clamp an input; what is worst about a bad one is the reason: form, then finiteness, then limits."""
        try:
            numbers = tuple(values)
        except TypeError:
            return Rejection.MALFORMED
        if len(numbers) != 4:
            return Rejection.MALFORMED
        rejection: Rejection | None = None
        clamped: list[float] = []
        for value, (lowest, lower, upper, highest) in zip(numbers, self._bounds, strict=True):
            # Nearly all are floats within their limits; asking for the abstract type takes long.
            if type(value) is float and lower <= value <= upper:
                clamped.append(value)
            elif isinstance(value, bool) or not isinstance(value, Real):
                return Rejection.MALFORMED
            elif lowest <= value <= highest:
                clamped.append(min(max(float(value), lower), upper))
            elif rejection is not Rejection.NOT_FINITE:
                rejection = Rejection.OUT_OF_LIMITS if abs(value) < math.inf else Rejection.NOT_FINITE
        return rejection or (clamped[0], clamped[1], clamped[2], clamped[3])

    def _check_order(
        self, cause: Cause, now_s: float, pose_epoch: int | None, holder: str | None
    ) -> Rejection | None:
        """Judge epoch and sequence number against the source's last accepted command.

        A change of epoch is believed only when the raw poses, which do not come from the agent, carry that
        epoch too: then the Tracker's stream has restarted. A changed epoch starts a new count. A source may
        be behind the raw poses for a moment, but not ahead of them: what was believed before there were any
        is not believed when they contradict it.
        """
        flying = holder is not None
        self._forget_silent(now_s, holder)
        stream = self.streams.get(cause.source)
        if stream is None:
            if len(self.streams) >= MOST_SOURCES:
                return Rejection.TOO_MANY_SOURCES
            return Rejection.UNKNOWN_EPOCH if pose_epoch not in (None, cause.epoch) else None
        last = stream.command.cause
        if cause.epoch == last.epoch:
            if pose_epoch is not None and cause.epoch > pose_epoch:
                return Rejection.UNKNOWN_EPOCH
            return None if self._follows(cause, stream, now_s) else Rejection.OLD_SEQUENCE
        if cause.epoch < last.epoch and (flying or cause.epoch != pose_epoch):
            return Rejection.OLDER_EPOCH
        if pose_epoch is None:
            return Rejection.UNKNOWN_EPOCH if flying else None
        return None if cause.epoch == pose_epoch else Rejection.UNKNOWN_EPOCH

    def _follows(self, cause: Cause, stream: Stream, now_s: float) -> bool:
        """Whether a command comes after the last one of its source and epoch.

        An agent counts on from what the gateway told last; a source of somebody else's may begin at a wall
        clock, and wall clocks are set back. So a source whose last command is overdue may count from
        anywhere, with a newer frame; one that was only delayed has an older frame, and an earlier process of
        a source that commands is refused.
        """
        last = stream.command.cause
        overdue = now_s >= stream.arrival_s + self._limits.hold_after_s
        return cause.sequence > last.sequence or (overdue and cause.frame > last.frame)

    def _check_age(self, cause: Cause, pose: PoseStamp) -> Rejection | None:
        """Refuse a command that is behind the raw poses: its source does not hear them any more."""
        if pose.period_s is None or cause.epoch != pose.epoch:
            return None
        age_s = (pose.frame - cause.frame) * pose.period_s + pose.latency_s
        return Rejection.OLD_POSE if age_s > self._limits.command_age_s else None

    def _forget_silent(self, now_s: float, holder: str | None) -> None:
        """Let a source that fell silent start over, so that one wild sequence number is not for ever."""
        silent = [name for name, s in self.streams.items() if now_s - s.arrival_s > FORGET_AFTER_S]
        for name in silent:
            if name != holder:
                del self.streams[name]

    def _store(self, command: AcceptedCommand, now_s: float) -> None:
        before = self.streams.get(command.cause.source)
        low_since_s: float | None = None
        if command.u[2] <= self._limits.low_thrust:
            gapless = before is not None and now_s - before.arrival_s < self._limits.hold_after_s
            low_since_s = before.low_since_s if before is not None and gapless else now_s
            low_since_s = now_s if low_since_s is None else low_since_s
        self.streams[command.cause.source] = Stream(command, now_s, low_since_s)
