"""Which planned input acts while the next command is late.

Planned input n belongs to the time n periods after its command. The first one waits half a period longer, but
not until HOLD, so that a command that is slightly late does not count as missing.
"""

import math

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.command_validator import AcceptedCommand, Stream
from rcopterx.transmitter_gateway.inputs import Input

FIRST_AFTER_PERIODS = 1.5
ROUNDING = 1e-9


def bridging_step(stream: Stream, now_s: float, limits: ArbiterLimits) -> int:
    """Number of the planned input to be played at `now_s`: 0 none, 1 the first."""
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
    ages_s += [
        _first_after_s(period_s, limits),
        limits.hold_after_s,
        limits.descend_after_s,
        limits.cut_after_s,
    ]
    return min(
        [stream.arrival_s + age_s for age_s in ages_s if stream.arrival_s + age_s > now_s], default=math.inf
    )


def _steps_within(time_s: float, period_s: float) -> int:
    return int(time_s / period_s + ROUNDING)


def _first_after_s(period_s: float, limits: ArbiterLimits) -> float:
    return min(FIRST_AFTER_PERIODS * period_s, limits.hold_after_s)
