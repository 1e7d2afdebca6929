"""Emulated radio modules that repeat channels on a fixed grid from their first frame on, whatever follows."""

import math
from abc import abstractmethod

from rcopterx.radios import dsm2_serial, dsmp
from rcopterx.radios.ppm import LINE, PpmGenProtocol, PpmSettings
from rcopterx.radios.protocol import CENTER_US, DecodedFrame, FrameDecodeError, SerialLine
from rcopterx.simulator.radio_module import AirPacket, RadioModule, SerialFrame, Timer

AIR_PERIOD_S = 0.022
PAUSE_BYTES = 4
BIND_FLAG = 0x80
PULSES_STOP_S = 0.1
PARKED_US = (1100.0, *([CENTER_US] * 5))


class FreeRunningModule(RadioModule):
    """Base of these modules; frames that `_protocol` does not decode are rejected."""

    _protocol: dsm2_serial.Dsm2SerialProtocol | dsmp.DsmpProtocol | PpmGenProtocol

    def __init__(self, line: SerialLine, frame_length: int, powered_s: float) -> None:
        byte_s = line.duration_s(1)
        super().__init__(byte_s, PAUSE_BYTES * byte_s, frame_length)
        self.rf_channels = 0
        self.power_cycle(powered_s)

    def power_cycle(self, now_s: float) -> None:  # noqa: ARG002 - these modules have no boot time
        """Wait for a first frame; new radio channels."""
        self._reset_line()
        self.rf_channels += 1
        self._next_rf_s = math.inf
        self._forget()

    def _on_burst(self, end_s: float, data: bytes) -> None:
        try:
            decoded = self._protocol.decode(data)
        except FrameDecodeError as error:
            self.rejected[str(error)] += 1
            return
        self._take_frame(end_s, data, decoded)
        self._start_radio(end_s)

    @abstractmethod
    def _forget(self) -> None:
        """Forget everything received."""

    @abstractmethod
    def _take_frame(self, end_s: float, data: bytes, decoded: DecodedFrame) -> None:
        """Take a frame whose last byte arrived at `end_s`."""

    @abstractmethod
    def _packet(self, now_s: float) -> AirPacket:
        """Channels that are sent at `now_s`."""

    def _start_radio(self, now_s: float) -> None:
        if math.isinf(self._next_rf_s):
            self._next_rf_s = now_s

    def _timers(self) -> list[Timer]:
        return [(self._next_rf_s, self._send)]

    def _send(self, now_s: float) -> None:
        self._next_rf_s = now_s + AIR_PERIOD_S
        self._packets.append(self._packet(now_s))


class Dsm2Board(FreeRunningModule):
    """Spektrum radio board fed with 14-byte frames (format: EdgeTX, `pulses/dsm2.cpp`); it answers nothing.

    It repeats its last frame for ever, and obeys the bind flag only in the first frame after power-up.
    """

    def __init__(self, powered_s: float = 0.0) -> None:
        self._protocol = dsm2_serial.Dsm2SerialProtocol()
        super().__init__(dsm2_serial.LINE, dsm2_serial.FRAME.size, powered_s)

    def _forget(self) -> None:
        self._pulses: tuple[float, ...] = ()
        self._model = 0
        self._weak = self._binding = False

    def _take_frame(self, end_s: float, data: bytes, decoded: DecodedFrame) -> None:
        bind = decoded.flags.bind
        self._binding = bind and (self._binding or not self._pulses)
        self._pulses, self._model, self._weak = decoded.pulses_us, data[1], decoded.flags.range_check
        self.frames.append(SerialFrame(end_s, decoded.pulses_us, bind=bind))

    def _packet(self, now_s: float) -> AirPacket:
        return AirPacket(
            now_s, self.rf_channels, self._model, self._pulses, bind=self._binding, weak=self._weak
        )


class DsmpModule(FreeRunningModule):
    """Lemon-Rx DSMP module (format: EdgeTX, `pulses/dsmp.cpp`).

    It reads channels as 10-bit ones until it has a set-up frame, after which it reports its major version
    `firmware`. Like a bare board it is assumed to repeat its last channels when the frames stop.
    """

    def __init__(self, powered_s: float = 0.0, *, firmware: int = 1) -> None:
        self._firmware = firmware
        super().__init__(dsmp.LINE, dsmp.CHANNELS_LENGTH, powered_s)

    def _forget(self) -> None:
        self._setup: bytes | None = None
        self._protocol = dsmp.DsmpProtocol(dsmp.DsmpSettings(channels=12))
        self._pulses: tuple[float, ...] = ()

    def _on_burst(self, end_s: float, data: bytes) -> None:
        if len(data) == dsmp.SETUP_LENGTH and data[:2] == bytes((dsmp.START, dsmp.SETUP)):
            self._take_setup(data)
        else:
            super()._on_burst(end_s, data)

    def _take_frame(self, end_s: float, data: bytes, decoded: DecodedFrame) -> None:  # noqa: ARG002
        count = 12 if self._setup is None else self._setup[4]
        self._pulses = decoded.pulses_us[:count]
        self.frames.append(SerialFrame(end_s, self._pulses, bind=self._binding))

    def _take_setup(self, data: bytes) -> None:
        answer = bytes((dsmp.START, dsmp.VERSION, 0, 0, 0, 0, self._firmware, 0))
        self._answers += answer.ljust(dsmp.ANSWER_LENGTH, b"\0")
        eleven_bit = bool(data[2] & dsmp.ELEVEN_BIT)
        if self._setup is None or bool(self._setup[2] & dsmp.ELEVEN_BIT) != eleven_bit:
            self._protocol = dsmp.DsmpProtocol(dsmp.DsmpSettings(channels=12, eleven_bit=eleven_bit))
        self._setup = data

    @property
    def _binding(self) -> bool:
        return self._setup is not None and bool(self._setup[2] & BIND_FLAG)

    def _packet(self, now_s: float) -> AirPacket:
        model = self._setup[5] if self._setup is not None else 0
        weak = self._setup is not None and self._setup[3] <= dsmp.RANGE_CHECK_POWER
        return AirPacket(now_s, self.rf_channels, model, self._pulses, bind=self._binding, weak=weak)


class TrainerTransmitter(FreeRunningModule):
    """A transmitter fed by a ppm-gen Arduino (isleder/ppm-gen); sends throttle low without pulses."""

    def __init__(
        self, settings: PpmSettings | None = None, *, model_match: int = 0, powered_s: float = 0.0
    ) -> None:
        self._protocol = protocol = PpmGenProtocol(settings)
        self._model_match = model_match
        super().__init__(LINE, 5 + 2 * protocol.channel_count, powered_s)

    def power_cycle(self, now_s: float) -> None:
        """Switch on; it transmits at once."""
        super().power_cycle(now_s)
        self._start_radio(now_s)

    def _forget(self) -> None:
        self._pulses: tuple[float, ...] = PARKED_US
        self._packet_s = -math.inf

    def _take_frame(self, end_s: float, data: bytes, decoded: DecodedFrame) -> None:  # noqa: ARG002
        self._pulses, self._packet_s = decoded.pulses_us, end_s
        self.frames.append(SerialFrame(end_s, decoded.pulses_us))

    def _packet(self, now_s: float) -> AirPacket:
        pulses = self._pulses if now_s <= self._packet_s + PULSES_STOP_S else PARKED_US
        return AirPacket(now_s, self.rf_channels, self._model_match, pulses)
