"""Emulated ppm-gen Arduino on the trainer port of a transmitter (protocol: isleder/ppm-gen)."""

from __future__ import annotations

import math

from rcopterx.simulator.radio_module import AirPacket, FreeRunningModule, SerialFrame
from rcopterx.transmitter_gateway.protocols.base import CENTER_US, FrameDecodeError
from rcopterx.transmitter_gateway.protocols.ppm import PPM_GEN_LINE, PpmGenProtocol, PpmSettings

PULSES_STOP_S = 0.1
PARKED_US = (1100.0, *([CENTER_US] * 5))


class TrainerTransmitter(FreeRunningModule):
    """A transmitter with its trainer switch held on.

    Without trainer pulses it sends its own sticks, which are parked at throttle low.
    """

    def __init__(
        self, settings: PpmSettings | None = None, *, model_match: int = 0, powered_s: float = 0.0
    ) -> None:
        self._protocol = PpmGenProtocol(settings)
        self._model_match = model_match
        super().__init__(PPM_GEN_LINE, 5 + 2 * self._protocol.channel_count, powered_s)

    def power_cycle(self, now_s: float) -> None:
        """Switch on; it transmits at once."""
        super().power_cycle(now_s)
        self._start_radio(now_s)

    def _forget(self) -> None:
        self._pulses: tuple[float, ...] = PARKED_US
        self._packet_s = -math.inf

    def _on_burst(self, end_s: float, data: bytes) -> None:
        try:
            decoded = self._protocol.decode(data)
        except FrameDecodeError as error:
            self.rejected[str(error)] += 1
            return
        self._pulses, self._packet_s = decoded.pulses_us, end_s
        self.frames.append(SerialFrame(end_s, decoded.pulses_us))

    def _packet(self, now_s: float) -> AirPacket:
        pulses = self._pulses if now_s <= self._packet_s + PULSES_STOP_S else PARKED_US
        return AirPacket(now_s, self.rf_channels, self._model_match, pulses)
