"""Emulated DSM2 receiver (behaviour: Spektrum AR7600 manual)."""

import math
from enum import StrEnum

from rcopterx.simulator.radio_module import AirPacket

CENTER_US = 1500.0
CHANNELS = 12
HOLD_S = 45 * 0.022
BIND_PACKETS_NEEDED = 10
FAILSAFE_THROTTLE_US = 1100.0  # until a bind stores another one
STORE_AFTER_BIND_S = 5.0


class ReceiverState(StrEnum):
    """Source of the receiver's outputs."""

    SEARCHING = "searching"
    LINKED = "linked"
    HOLD = "hold"
    FAILSAFE = "failsafe"
    BIND = "bind"


class Receiver:
    """Receives the packets of a module and drives the vehicle's channels.

    `model_match`: number it was bound with, if any. `connect_s`: time to find a module on new radio channels;
    2 to 6 s are typical. `answers_bind`: newer receivers answer a bind, old DSM2 ones do not.
    """

    def __init__(
        self,
        model_match: int | None,
        *,
        connect_s: float = 2.5,
        answers_bind: bool = False,
        in_range_check_reach: bool = True,
    ) -> None:
        self.model_match = model_match
        self.in_range_check_reach = in_range_check_reach
        self._connect_s = connect_s
        self._answers_bind = answers_bind
        self._failsafe_throttle_us = FAILSAFE_THROTTLE_US
        self.power_cycle()

    def power_cycle(self) -> None:
        """Search for the module again."""
        self._pulses = (self._failsafe_throttle_us, *(CHANNELS - 1) * (CENTER_US,))
        self._linked_to: int | None = None
        self._last_packet_s = -math.inf
        self._found: tuple[int, float] | None = None
        self._bind_mode = False
        self._bind_packets = 0
        self._store_until_s = -math.inf

    def enter_bind_mode(self) -> None:
        """Power up with the bind plug in or the bind button held."""
        self.power_cycle()
        self._bind_mode = True

    def receive(self, packet: AirPacket) -> bool:
        """Take a packet; return True when the receiver answers a bind."""
        if packet.weak and not self.in_range_check_reach:
            return False
        if packet.bind:
            return self._receive_bind(packet)
        if self._bind_mode or packet.model_match != self.model_match:
            return False
        if packet.rf_channels == self._linked_to or self._find(packet):
            self._take(packet)
        return False

    def _receive_bind(self, packet: AirPacket) -> bool:
        if self._bind_mode:
            self._bind_packets += 1
            if self._bind_packets >= BIND_PACKETS_NEEDED:
                self._bind_mode = False
                self.model_match = packet.model_match
                self._store_until_s = math.inf
        return self._answers_bind and not self._bind_mode and self._bind_packets > 0

    def _find(self, packet: AirPacket) -> bool:
        """Search on new radio channels; the search starts when the hold of the old link is over."""
        if self._found is None or self._found[0] != packet.rf_channels:
            self._found = (packet.rf_channels, packet.time_s)
        start_s = max(self._found[1], self._last_packet_s + HOLD_S)
        if packet.time_s < start_s + self._connect_s:
            return False
        self._linked_to, self._found = packet.rf_channels, None
        return True

    def _take(self, packet: AirPacket) -> None:
        self._last_packet_s = packet.time_s
        self._pulses = (*packet.pulses_us, *self._pulses[len(packet.pulses_us) :])
        if self._store_until_s == math.inf:
            self._store_until_s = packet.time_s + STORE_AFTER_BIND_S
        if packet.time_s <= self._store_until_s:
            self._failsafe_throttle_us = packet.pulses_us[0]

    def pulses_us(self, now_s: float) -> tuple[float, ...]:
        """Channels at `now_s` [us]: last values, and throttle at its stored position without a link."""
        if self.state(now_s) in (ReceiverState.LINKED, ReceiverState.HOLD):
            return self._pulses
        return (self._failsafe_throttle_us, *self._pulses[1:])

    def state(self, now_s: float) -> ReceiverState:
        """Return the source of the outputs at `now_s`."""
        if self._bind_mode:
            return ReceiverState.BIND
        if self._linked_to is None:
            return ReceiverState.SEARCHING
        if now_s < self._last_packet_s + 2 * 0.022:
            return ReceiverState.LINKED
        return ReceiverState.HOLD if now_s < self._last_packet_s + HOLD_S else ReceiverState.FAILSAFE
