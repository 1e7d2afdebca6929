"""Emulated DSM2 receiver (behaviour: Spektrum AR7600 manual)."""

import math
from enum import StrEnum

from rcopterx.simulator.radio_module import AirPacket

CENTER_US = 1500.0
CHANNELS = 12
HOLD_S = 45 * 0.022
FAILSAFE_THROTTLE_US = 1100.0


class ReceiverState(StrEnum):
    """Source of the receiver's outputs."""

    SEARCHING = "searching"
    LINKED = "linked"
    HOLD = "hold"
    FAILSAFE = "failsafe"


class Receiver:
    """Receives the packets of a module and drives the vehicle's channels.

    `model_match`: number it was bound with, if any. `connect_s`: time to find a module on new radio channels;
    2 to 6 s are typical.
    """

    def __init__(self, model_match: int | None, *, connect_s: float = 2.5) -> None:
        self.model_match = model_match
        self._connect_s = connect_s
        self.power_cycle()

    def power_cycle(self) -> None:
        """Search for the module again."""
        self._pulses = (FAILSAFE_THROTTLE_US, *(CHANNELS - 1) * (CENTER_US,))
        self._linked_to: int | None = None
        self._last_packet_s = -math.inf
        self._found: tuple[int, float] | None = None

    def receive(self, packet: AirPacket) -> None:
        """Take a packet; a receiver of DSM2 answers none."""
        addressed = not packet.bind and packet.model_match == self.model_match
        if addressed and (packet.rf_channels == self._linked_to or self._find(packet)):
            self._last_packet_s = packet.time_s
            self._pulses = (*packet.pulses_us, *self._pulses[len(packet.pulses_us) :])

    def _find(self, packet: AirPacket) -> bool:
        """Search on new radio channels; the search starts when the hold of the old link is over."""
        if self._found is None or self._found[0] != packet.rf_channels:
            self._found = (packet.rf_channels, packet.time_s)
        start_s = max(self._found[1], self._last_packet_s + HOLD_S)
        if packet.time_s < start_s + self._connect_s:
            return False
        self._linked_to, self._found = packet.rf_channels, None
        return True

    def pulses_us(self, now_s: float) -> tuple[float, ...]:
        """Channels at `now_s` [us]: last values, and throttle at its stored position without a link."""
        if self.state(now_s) in (ReceiverState.LINKED, ReceiverState.HOLD):
            return self._pulses
        return (FAILSAFE_THROTTLE_US, *self._pulses[1:])

    def state(self, now_s: float) -> ReceiverState:
        """Return the source of the outputs at `now_s`."""
        if self._linked_to is None:
            return ReceiverState.SEARCHING
        if now_s < self._last_packet_s + 2 * 0.022:
            return ReceiverState.LINKED
        return ReceiverState.HOLD if now_s < self._last_packet_s + HOLD_S else ReceiverState.FAILSAFE
