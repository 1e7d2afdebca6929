"""Receivers that can be bound and carried away, and a radio that is served in one step."""

import math

from rcopterx.simulator.radio import RadioPty
from rcopterx.simulator.radio_module import AirPacket
from rcopterx.simulator.radio_receiver import FAILSAFE_THROTTLE_US, Receiver, ReceiverState

BIND_PACKETS_NEEDED = 10
STORE_AFTER_BIND_S = 5.0


class HandheldReceiver(Receiver):
    """A receiver at hand."""

    def __init__(
        self,
        model_match: int | None,
        *,
        connect_s: float = 2.5,
        in_range_check_reach: bool = True,
    ) -> None:
        self.in_range_check_reach = in_range_check_reach
        self.binding = False
        self._failsafe_throttle_us = FAILSAFE_THROTTLE_US
        super().__init__(model_match, connect_s=connect_s)

    def power_cycle(self) -> None:
        super().power_cycle()
        self.binding = False
        self._bind_packets = 0
        self._store_until_s = -math.inf

    def enter_bind_mode(self) -> None:
        """Power up with the bind plug in or the bind button held."""
        self.power_cycle()
        self.binding = True

    def receive(self, packet: AirPacket) -> None:
        if packet.weak and not self.in_range_check_reach:
            return
        if packet.bind:
            self._receive_bind(packet)
        elif not self.binding:
            super().receive(packet)
            if self._last_packet_s == packet.time_s:
                self._store_failsafe(packet)

    def _receive_bind(self, packet: AirPacket) -> None:
        if self.binding:
            self._bind_packets += 1
            if self._bind_packets >= BIND_PACKETS_NEEDED:
                self.binding = False
                self.model_match = packet.model_match
                self._store_until_s = math.inf

    def _store_failsafe(self, packet: AirPacket) -> None:
        if self._store_until_s == math.inf:
            self._store_until_s = packet.time_s + STORE_AFTER_BIND_S
        if packet.time_s <= self._store_until_s:
            self._failsafe_throttle_us = packet.pulses_us[0]

    def pulses_us(self, now_s: float) -> tuple[float, ...]:
        pulses_us = super().pulses_us(now_s)
        if self.state(now_s) in (ReceiverState.LINKED, ReceiverState.HOLD):
            return pulses_us
        return (self._failsafe_throttle_us, *pulses_us[1:])


def serve(radio: RadioPty, now_s: float) -> None:
    """Read the written bytes, advance the time, and write the answers."""
    radio.receive(now_s)
    radio.advance(now_s)
