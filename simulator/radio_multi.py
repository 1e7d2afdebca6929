"""Emulated Multiprotocol module (protocol: DIY-Multiprotocol-TX-Module)."""

import math

from msgspec import structs

from rcopterx.radios.multi import AUTOBIND_CHANNEL, CENTER_COUNT, FRAME_LENGTH, MultiFrame, pulse_of
from rcopterx.radios.multi_radios import DSM, RADIOS, MultiRadio
from rcopterx.radios.protocol import ten_bit_pulse_us
from rcopterx.simulator.radio_module import AirPacket, RadioModule, SerialFrame, Timer

BYTE_S = 120e-6
END_OF_FRAME_S = 250e-6
UART_READY_S = 0.2
BOOT_CHECK_BYTES = 5
BOOT_CHECK_S = 0.005
INIT_S = 0.142
INPUT_LOST_S = 0.070
STATUS_PERIOD_S = 0.501
FAST_PERIOD_S = 0.011
SLOW_PERIOD_S = 0.022
SECOND_COPY_S = 0.00401  # every packet is sent twice, on two radio channels

BIND_START_S = 0.13
BIND_SLOT_S = 0.01
BIND_PACKETS = 181
BIND_SLOTS = 603  # packets, then listening for an answer, which receivers of DSM2 do not send
PACKETS_AFTER_ABORT = 3

EU_NAMES = ("--->", "--->", "X 1F", "X 2F")  # sub-protocols that an EU build refuses begin with `--`
DSMX = (2, 3)
VERSION = bytes((1, 3, 4, 72))
ORDER_AETR = 0xE4
OTHER_PERIOD_S = 0.01
AUTOBIND_S = 2.0  # other protocols than DSM: packet interval, and how long some bind first


def air_value(count: int) -> int:
    """11-bit value on air of an 11-bit value on the line, computed as the module does."""
    return min(max(math.trunc((count - 204) * 1364 / 1640) + 342, 0), 2047)


def air_pulse_us(count: int, *, ten_bit: bool) -> float:
    """Pulse width [us] that a receiver decodes of an 11-bit value on the line, sent with 10 or 11 bits."""
    value = air_value(count)
    return ten_bit_pulse_us(float(value >> 1) if ten_bit else value / 2)


def killed_throttle(count: int) -> int | None:
    """10-bit throttle forced by channel 14, None when it does not interfere."""
    return None if count > 604 else max(count - 204, 0) * 168 // 400


def status_answer(flags: int, radio: str = "", sub_protocol: str = "") -> bytes:
    """Status answer; both names are empty for a protocol the build does not know."""
    names = bytes(9) if not radio else b"\x77" + sub_protocol.encode().ljust(8, b"\0")
    payload = (
        bytes((flags,)) + VERSION + bytes((ORDER_AETR, 0x46, 0x06)) + radio.encode().ljust(7, b"\0") + names
    )
    return b"MP" + bytes((0x01, len(payload))) + payload


class MultiModule(RadioModule):
    """A module in serial mode; `inverted_wiring` must agree with the polarity bit of its frames."""

    def __init__(self, powered_s: float = 0.0, *, inverted_wiring: bool = True) -> None:
        super().__init__(BYTE_S, END_OF_FRAME_S, FRAME_LENGTH)
        self._inverted_wiring = inverted_wiring
        self.knows_dsm2 = True  # False for EU builds, which refuse DSM2 and have DSMX
        self.rf_channels = 0
        self.power_cycle(powered_s)

    def power_cycle(self, now_s: float) -> None:
        """Boot again; the next transmission uses new radio channels."""
        self._reset_line()
        self._powered_s = now_s
        self._boot_bytes = 0
        self._booted_s = math.inf
        self._deaf = False
        self._frame: MultiFrame | None = None
        self._key: tuple[int, ...] | None = None
        self._last_frame_s = -math.inf
        self._init_done_s = math.inf
        self._next_rf_s = math.inf
        self._copy: AirPacket | None = None
        self._next_status_s = math.inf
        self._bind_slot: int | None = None
        self._next_slot_s = math.inf
        self._bind_bit = self._autobinding = False

    @property
    def binding(self) -> bool:
        """True from the bind request until the answer or the end of listening."""
        return self._bind_slot is not None or self._autobinding

    # Serial side --------------------------------------------------------------------------------------

    def _on_burst(self, end_s: float, data: bytes) -> None:
        if end_s < self._powered_s + UART_READY_S:
            self.rejected["before power-up was complete"] += 1
        elif end_s < self._booted_s:
            self._boot_bytes += len(data)
            if self._boot_bytes >= BOOT_CHECK_BYTES and math.isinf(self._booted_s):
                self._booted_s = end_s + BOOT_CHECK_S
                self._next_status_s = self._booted_s + STATUS_PERIOD_S
            self.rejected["swallowed by the boot loader"] += 1
        elif self._deaf:
            self.rejected["deaf: wrong polarity bit"] += 1
        else:
            start = 0
            if data[0] & 0xFC != 0x54:
                start = next((i for i, byte in enumerate(data) if byte & 0xFC == 0x54), len(data))
            if 26 <= len(data) - start <= 36:
                self._accept(data[start:], end_s)
            else:
                self.rejected["wrong length"] += 1

    def _accept(self, data: bytes, end_s: float) -> None:
        now_s = end_s + END_OF_FRAME_S
        returned = now_s > self._last_frame_s + INPUT_LOST_S
        self._last_frame_s = now_s
        if returned and math.isinf(self._init_done_s):
            self._thaw(now_s)
        frame = MultiFrame.from_bytes(data)
        if frame.failsafe:
            return
        if len(data) > 26 and frame.inverted_line != self._inverted_wiring:
            self._deaf = True
        last = data[26] if len(data) > 26 else 0
        key = (data[0], data[1] & 0x5F, data[2] & 0x7F, last & 0xF0, min(len(data), 27))
        if key != self._key:
            self._key = key
            self._initialise(now_s)
        self._frame = frame
        self._follow_bind_bit(frame.bind, now_s)
        pulses = tuple(pulse_of(count) for count in frame.ordered_counts)
        self.frames.append(SerialFrame(end_s, pulses, frame.kills, frame.bind))

    def _initialise(self, now_s: float) -> None:
        """Restart the radio part: it is silent for a while and picks two new channels."""
        self.rf_channels += 1
        self._init_done_s = now_s + INIT_S
        self._next_rf_s = math.inf
        self._copy = None

    def _thaw(self, now_s: float) -> None:
        """Continue where the radio part stopped for want of frames, with a pending second copy first."""
        if self.binding:
            self._next_slot_s = min(self._next_slot_s, now_s)
        else:
            self._next_rf_s = min(self._next_rf_s, now_s)

    def _follow_bind_bit(self, bind: bool, now_s: float) -> None:
        if bind and not self._bind_bit:
            self._initialise(now_s)
            self._bind_slot, self._next_slot_s = 0, now_s + BIND_START_S
        elif not bind and self._bind_bit and self._bind_slot is not None:
            self._bind_slot = max(self._bind_slot, BIND_PACKETS - PACKETS_AFTER_ABORT)
        self._bind_bit = bind

    # Radio side ---------------------------------------------------------------------------------------

    def _timers(self) -> list[Timer]:
        return [
            (self._init_done_s, self._finish_init),
            (self._next_rf_s, self._send_channels),
            (self._next_slot_s, self._bind_on),
            (self._next_status_s, self._periodic_status),
        ]

    def _finish_init(self, now_s: float) -> None:
        self._init_done_s = math.inf
        radio = self._radio()
        self._autobinding = radio is not None and radio[1].autobind
        if not self.binding:
            self._next_rf_s = now_s
        elif self._autobinding:
            self._next_rf_s = now_s + AUTOBIND_S
        self._send_status(now_s, initialised=True)

    def _radio(self) -> tuple[str, MultiRadio] | None:
        """Name and properties of the protocol of the last frame, if the build has it."""
        if (frame := self._frame) is None:
            return None
        found = ((name, radio) for name, radio in RADIOS.items() if radio.number == frame.protocol)
        name, radio = next(found, ("", None))
        return None if radio is None or frame.sub_protocol >= len(radio.sub_protocols) else (name, radio)

    def _valid(self) -> bool:
        frame = self._frame
        refused = frame is not None and frame.protocol == DSM and frame.sub_protocol not in DSMX
        return self._radio() is not None and (self.knows_dsm2 or not refused)

    def _send_channels(self, now_s: float) -> None:
        self._autobinding = False
        frame = self._frame
        if frame is None or now_s > self._last_frame_s + INPUT_LOST_S:
            self._next_rf_s = math.inf
            return
        if self._valid() and frame.protocol != DSM:
            self._packets.append(AirPacket(now_s, self.rf_channels, frame.rx_num, self._on_air(frame)))
            self._next_rf_s = now_s + OTHER_PERIOD_S
            return
        fast = frame.sub_protocol in (1, 3) and frame.option & 0x40
        if self._copy is not None:
            self._packets.append(structs.replace(self._copy, time_s=now_s))
            self._copy = None
            self._next_rf_s = now_s + (FAST_PERIOD_S if fast else SLOW_PERIOD_S) - SECOND_COPY_S
            return
        waiting_for_autobind = frame.autobind and frame.counts[AUTOBIND_CHANNEL] <= CENTER_COUNT
        if not self._valid() or waiting_for_autobind:
            self._next_rf_s = now_s + SLOW_PERIOD_S
            return
        pulses = self._on_air(frame)
        self._copy = AirPacket(now_s, self.rf_channels, frame.rx_num, pulses, weak=frame.range_check)
        self._packets.append(self._copy)
        self._next_rf_s = now_s + SECOND_COPY_S

    def _on_air(self, frame: MultiFrame) -> tuple[float, ...]:
        radio = self._radio()
        if radio is not None and radio[1].number != DSM:
            return tuple(pulse_of(count) for count in frame.ordered_counts[: radio[1].channels])
        wanted = frame.option & 0x0F
        counts = frame.ordered_counts[: wanted if 3 <= wanted <= 12 else 6]
        pulses = [air_pulse_us(count, ten_bit=frame.sub_protocol == 0) for count in counts]
        if (killed := killed_throttle(frame.kill_count)) is not None:
            pulses[0] = ten_bit_pulse_us(killed)
        return tuple(pulses)

    def _bind_on(self, now_s: float) -> None:
        """Send a bind packet, listen for 10 ms, or end binding; without frames it stands still."""
        slot = self._bind_slot
        if slot is None or now_s > self._last_frame_s + INPUT_LOST_S:
            self._next_slot_s = math.inf
            return
        if slot >= BIND_SLOTS:
            self._bind_slot, self._next_slot_s, self._next_rf_s = None, math.inf, now_s
            return
        if slot < BIND_PACKETS and self._valid() and self._frame is not None:
            self._packets.append(AirPacket(now_s, self.rf_channels, self._frame.rx_num, (), bind=True))
        self._bind_slot, self._next_slot_s = slot + 1, now_s + BIND_SLOT_S

    # Answers ------------------------------------------------------------------------------------------

    def _periodic_status(self, now_s: float) -> None:
        self._next_status_s = now_s + STATUS_PERIOD_S
        self._send_status(now_s)

    def _send_status(self, now_s: float, *, initialised: bool = False) -> None:
        """Send the status; a protocol is refused only in the next one after an initialisation."""
        frame = self._frame
        if frame is None or frame.telemetry_off:
            return
        present = 0x01 if now_s <= self._last_frame_s + INPUT_LOST_S else 0
        radio = self._radio()
        if radio is not None and (self._valid() or initialised):
            flags = 0x46 | present | (0x08 if self.binding else 0)
            own = frame.protocol != DSM or self.knows_dsm2
            names = radio[1].sub_protocols if own else EU_NAMES
            self._answers += status_answer(flags, radio[0], names[frame.sub_protocol])
        else:
            self._answers += status_answer(0x02 | present)
