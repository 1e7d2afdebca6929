"""Channels of a frame from the arbiter's output: sticks, and the switches that arm and stop a vehicle."""

import math
from collections.abc import Sequence

from msgspec import Struct

from rcopterx.radios.calibration import Calibration
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.protocol import PulseRangeError, RadioProtocol
from rcopterx.transmitter_gateway.inputs import FLYING, NEUTRAL, ArbiterOutput, State


class Arming(Struct, frozen=True):
    """State of the arming channel in the frames written last, and since when."""

    on: bool
    since_s: float


def prepare_channels(protocol: RadioProtocol, calibration: Calibration, limits: ArbiterLimits) -> None:
    """Let unused channels rest; `PulseRangeError` if the protocol cannot carry the calibration's extremes."""
    protocol.rest_us = calibration.rest_us
    last, sent = len(calibration.pulses_us(NEUTRAL)) - 1, protocol.channels_on_air
    if last >= sent:
        raise PulseRangeError(
            f"{protocol.name}: the calibration has channel {last}, but only channels 0 to {sent - 1} are sent"
        )
    for extreme in (limits.lower, limits.upper):
        for on in (False, True):
            protocol.check(calibration.pulses_us(extreme, throttle_low=on, armed=on, stopped=on))


def shown_channels(
    calibration: Calibration, u: Sequence[float], throttle_us: float | None
) -> tuple[float, ...]:
    """Return the pulse widths [us] that show an input at the workbench, with the throttle low by default."""
    pulses = list(calibration.pulses_us(u, armed=throttle_us is not None))
    pulses[calibration.throttle.index] = throttle_us or calibration.throttle.low_us
    return tuple(pulses)


def channels_of(
    calibration: Calibration, output: ArbiterOutput, before: Arming | None, now_s: float
) -> tuple[tuple[float, ...], Arming]:
    """Return the pulse widths [us] of the next frame, and the state of the arming channel in it.

    Until the vehicle is armed, and for `low_s` afterwards, the throttle is low. The arming channel is off
    unless the vehicle is flown, and comes on after frames with it off for `low_s`. Without frames `before`,
    a vehicle that is flown was armed by an earlier process.
    """
    low_s = 0.0 if calibration.arming is None else calibration.arming.low_s
    flown = output.state in FLYING
    if before is None:
        arming = Arming(flown, -math.inf if flown else now_s)
    elif not flown:
        arming = Arming(False, now_s) if before.on else before
    elif before.on or now_s < before.since_s + low_s:
        arming = before
    else:
        arming = Arming(True, now_s)
    throttle_low = not arming.on or now_s < arming.since_s + low_s
    stopped = output.state is State.KILLED
    pulses_us = calibration.pulses_us(output.u, throttle_low=throttle_low, armed=arming.on, stopped=stopped)
    return pulses_us, arming
