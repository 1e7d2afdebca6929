"""Emulated Lemon-Rx DSMP module (format: EdgeTX, `pulses/dsmp.cpp`)."""

from __future__ import annotations

from rcopterx.simulator.radio_module import AirPacket, FreeRunningModule, SerialFrame
from rcopterx.transmitter_gateway.protocols.base import FrameDecodeError
from rcopterx.transmitter_gateway.protocols.dsmp import (
    ANSWER_LENGTH,
    BIND_RESULT,
    BIND_RESULT_LENGTH,
    CHANNELS_LENGTH,
    ELEVEN_BIT,
    LINE,
    RANGE_CHECK_POWER,
    SETUP,
    SETUP_LENGTH,
    START,
    VERSION,
    DsmpProtocol,
    DsmpSettings,
)

BIND_FLAG = 0x80


class DsmpModule(FreeRunningModule):
    """A module that needs a set-up frame, and reads channels as 10-bit ones until it has it.

    Like a bare board it is assumed to repeat its last channels when the frames stop. `firmware` is the major
    version it reports after its first set-up frame.
    """

    def __init__(self, powered_s: float = 0.0, *, firmware: int = 1) -> None:
        self._firmware = firmware
        super().__init__(LINE, CHANNELS_LENGTH, powered_s)

    def _forget(self) -> None:
        self._setup: bytes | None = None
        self._protocol = DsmpProtocol(DsmpSettings(channels=12))
        self._pulses: tuple[float, ...] = ()

    def _on_burst(self, end_s: float, data: bytes) -> None:
        if len(data) == SETUP_LENGTH and data[:2] == bytes((START, SETUP)):
            self._take_setup(data)
            return
        try:
            decoded = self._protocol.decode(data)
        except FrameDecodeError as error:
            self.rejected[str(error)] += 1
            return
        count = 12 if self._setup is None else self._setup[4]
        self._pulses = decoded.pulses_us[:count]
        self.frames.append(SerialFrame(end_s, self._pulses, bind=self._binding))
        self._start_radio(end_s)

    def _take_setup(self, data: bytes) -> None:
        if self._setup is None:
            answer = bytes((START, VERSION, 0, 0, 0, 0, self._firmware, 0))
            self._answers += answer.ljust(ANSWER_LENGTH, b"\0")
        if self._setup is None or self._setup[2] & ELEVEN_BIT != data[2] & ELEVEN_BIT:
            self._protocol = DsmpProtocol(DsmpSettings(channels=12, eleven_bit=bool(data[2] & ELEVEN_BIT)))
        self._setup = data

    @property
    def _binding(self) -> bool:
        return self._setup is not None and bool(self._setup[2] & BIND_FLAG)

    def receiver_answered(self, now_s: float) -> None:  # noqa: ARG002 - the interface gives the time
        """Report the bind result."""
        if self._binding:
            self._answers += bytes((START, BIND_RESULT, 0, 0, 6, 1)).ljust(BIND_RESULT_LENGTH, b"\0")

    def _packet(self, now_s: float) -> AirPacket:
        model = self._setup[5] if self._setup is not None else 0
        weak = self._setup is not None and self._setup[3] <= RANGE_CHECK_POWER
        return AirPacket(now_s, self.rf_channels, model, self._pulses, bind=self._binding, weak=weak)
