"""Emulated Spektrum radio board fed with 14-byte frames (format: EdgeTX, `pulses/dsm2.cpp`)."""

from __future__ import annotations

from rcopterx.simulator.radio_module import AirPacket, FreeRunningModule, SerialFrame
from rcopterx.transmitter_gateway.protocols.base import FrameDecodeError
from rcopterx.transmitter_gateway.protocols.dsm2_serial import FRAME_LENGTH, LINE, Dsm2SerialProtocol


class Dsm2Board(FreeRunningModule):
    """A board that answers nothing and repeats its last frame for ever.

    It obeys the bind flag only if the first frame after power-up has it.
    """

    def __init__(self, powered_s: float = 0.0) -> None:
        self._protocol = Dsm2SerialProtocol()
        super().__init__(LINE, FRAME_LENGTH, powered_s)

    def _forget(self) -> None:
        self._frame: SerialFrame | None = None
        self._model = 0
        self._weak = False
        self._binding = False

    def _on_burst(self, end_s: float, data: bytes) -> None:
        try:
            decoded = self._protocol.decode(data)
        except FrameDecodeError as error:
            self.rejected[str(error)] += 1
            return
        self._binding = decoded.flags.bind and (self._binding or self._frame is None)
        self._frame = SerialFrame(end_s, decoded.pulses_us, bind=decoded.flags.bind)
        self._model, self._weak = data[1], decoded.flags.range_check
        self.frames.append(self._frame)
        self._start_radio(end_s)

    def _packet(self, now_s: float) -> AirPacket:
        pulses = () if self._frame is None else self._frame.pulses_us
        return AirPacket(now_s, self.rf_channels, self._model, pulses, bind=self._binding, weak=self._weak)
