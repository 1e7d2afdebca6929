"""Packets of a Crazyflie: the Crazy RealTime Protocol (format: documentation of crazyflie-firmware)."""

import math
import re
import struct
from collections.abc import Iterable

from msgspec import Struct, structs

from rcopterx.radios.crazyradio import RADIO
from rcopterx.radios.protocol import FrameDecodeError, ProtocolError
from rcopterx.radios.set_points import AttitudeSetPoint

NULL_PACKET = b"\xff"  # carries nothing; asks whether a vehicle is there, and answers so
LONGEST_DATA = 30
FULL_THRUST = 60_000  # the firmware needs the rest of its 65535 for the attitude
HIGHEST_CHANNEL = 125
DATA_RATES = ("250K", "1M", "2M")
CONSOLE, PARAMETERS, COMMANDER, SUPERVISOR, PLATFORM = 0, 2, 3, 9, 13  # ports
VERSION_CHANNEL = 1  # of the platform
NAMED_CHANNEL, SET_BY_NAME = 3, 0  # channel of the parameters, and its command
UINT8, FLOAT, UINT32 = 0x08, 0x06, 0x0A  # types of parameters
STATE_CHANNEL, COMMAND_CHANNEL = 0, 1  # channels of the supervisor
ARM, RECOVER, STATE_BITS = 0x01, 0x02, 0x0C  # commands of the supervisor
LINK_CONTROL = 15  # port, whose channel 3 reaches the second processor, of radio and power
ANSWERED = 0x80

_SET_POINT = struct.Struct("<fffH")
_LINK_BITS = 0x0C
_STATE_ANSWER = bytes((ANSWERED | STATE_BITS,))


class Packet(Struct, frozen=True):
    """A packet: port 0..15, channel 0..3, and at most 30 bytes."""

    port: int
    channel: int
    data: bytes = b""

    def to_bytes(self) -> bytes:
        """Encode with its header."""
        return bytes((self.port << 4 | _LINK_BITS | self.channel,)) + self.data

    @staticmethod
    def from_bytes(raw: bytes) -> "Packet":
        """Decode; raises `FrameDecodeError` for a packet that is empty or too long."""
        if not 1 <= len(raw) <= 1 + LONGEST_DATA:
            raise FrameDecodeError(f"crtp: packet that is empty or longer than {1 + LONGEST_DATA} bytes")
        return Packet(raw[0] >> 4, raw[0] & 0x03, raw[1:])


def set_point_packet(point: AttitudeSetPoint) -> Packet:
    """Encode a set point; the first one after the start has to be without thrust."""
    thrust = round(FULL_THRUST * point.thrust)
    data = _SET_POINT.pack(point.roll_deg, point.pitch_deg, point.yaw_rate_deg_s, thrust)
    return Packet(COMMANDER, 0, data)


def set_point_of(packet: Packet) -> AttitudeSetPoint:
    """Decode; raises `FrameDecodeError` for another packet, and for angles that are not finite."""
    if (packet.port, packet.channel) != (COMMANDER, 0) or len(packet.data) != _SET_POINT.size:
        raise FrameDecodeError("crtp: no set point")
    roll, pitch, yaw_rate, thrust = _SET_POINT.unpack(packet.data)
    if not all(map(math.isfinite, (roll, pitch, yaw_rate))):
        raise FrameDecodeError("crtp: a set point that is not finite")
    return AttitudeSetPoint(roll, pitch, yaw_rate, thrust / FULL_THRUST)


class SupervisorState(Struct, frozen=True):
    """State of the firmware's supervisor; `arms_itself` whenever it can, `locked` until a restart."""

    can_be_armed: bool = False
    armed: bool = False
    arms_itself: bool = False
    can_fly: bool = False
    flying: bool = False
    tumbled: bool = False
    locked: bool = False
    crashed: bool = False

    def packet(self) -> Packet:
        """Encode as the answer to `STATE_REQUEST`."""
        bits = sum(flag << bit for bit, flag in enumerate(structs.astuple(self)))
        return Packet(SUPERVISOR, STATE_CHANNEL, _STATE_ANSWER + bits.to_bytes(2, "little"))

    @staticmethod
    def of(packet: Packet) -> "SupervisorState | None":
        """Decode; None for another packet. Raises `FrameDecodeError` for a malformed answer."""
        data = packet.data
        if (packet.port, packet.channel) != (SUPERVISOR, STATE_CHANNEL) or data[:1] != _STATE_ANSWER:
            return None
        if len(data) != 3:
            raise FrameDecodeError(f"crtp: state of {len(data)} bytes, 3 are needed")
        bits = int.from_bytes(data[1:], "little")
        return SupervisorState(*(bool(bits >> bit & 1) for bit in range(8)))


VERSION_REQUEST = Packet(PLATFORM, VERSION_CHANNEL, b"\0")
STATE_REQUEST = Packet(SUPERVISOR, STATE_CHANNEL, bytes((STATE_BITS,)))
EMERGENCY_STOP = Packet(SUPERVISOR, COMMAND_CHANNEL, b"\x03")  # stops the motors until a restart
WATCHDOG = Packet(SUPERVISOR, COMMAND_CHANNEL, b"\x04")
"""Keeps the motors running for another second; from the first one on the firmware waits for the next."""


RECOVERY = Packet(SUPERVISOR, COMMAND_CHANNEL, bytes((RECOVER,)))
"""Ends the state of a crash, if the vehicle is upright again."""
RESTART = (Packet(LINK_CONTROL, 3, b"\xfe\xff"), Packet(LINK_CONTROL, 3, b"\xfe\xf0\x01"))
"""Restarts the firmware: the second packet counts after the first."""


def arm_request(*, on: bool) -> Packet:
    """Arm or disarm."""
    return Packet(SUPERVISOR, COMMAND_CHANNEL, bytes((ARM, on)))


def set_parameter(group: str, name: str, kind: int, value: bytes) -> Packet:
    """Set a parameter by its name, without the table of all of them."""
    names = b"".join(word.encode() + b"\0" for word in (group, name))
    return Packet(PARAMETERS, NAMED_CHANNEL, bytes((SET_BY_NAME,)) + names + bytes((kind,)) + value)


def joined(packets: Iterable[bytes]) -> bytes:
    """Join packets into a frame, each after a byte with its length; one that is too long stays too long."""
    # A datagram may be longer than a byte can state.
    cut = [packet[: 2 + LONGEST_DATA] for packet in packets]
    return b"".join(bytes((len(packet),)) + packet for packet in cut)


def separated(frame: bytes) -> list[bytes]:
    """Separate the packets of a frame; raises `FrameDecodeError` for one that ends within a packet."""
    packets = []
    while frame:
        end = 1 + frame[0]
        if not 1 < end <= len(frame):
            raise FrameDecodeError("crtp: a frame that ends within a packet")
        packets.append(frame[1:end])
        frame = frame[end:]
    return packets


class RadioAddress(Struct, frozen=True):
    """Where a Crazyflie is: number of the dongle, channel 0..125, data rate by its number, 5 bytes."""

    dongle: int
    channel: int
    rate: int
    address: bytes

    @staticmethod
    def of(path: str) -> "RadioAddress":
        """Read `radio://DONGLE/CHANNEL/RATE/ADDRESS`; raises `ProtocolError` for anything else."""
        match path.removeprefix(RADIO).split("/"):
            case [dongle, channel, rate, address] if path.startswith(RADIO) and (
                dongle.isdecimal()
                and channel.isdecimal()
                and int(channel) <= HIGHEST_CHANNEL
                and rate in DATA_RATES
                and re.fullmatch(r"[0-9A-Fa-f]{10}", address)
            ):
                return RadioAddress(int(dongle), int(channel), DATA_RATES.index(rate), bytes.fromhex(address))
        rates = ", ".join(DATA_RATES)
        raise ProtocolError(
            f"{path!r} is no address such as udp://127.0.0.1:19850 or radio://0/80/2M/E7E7E7E7E7: "
            f"number of the dongle, channel 0 to {HIGHEST_CHANNEL}, {rates}, 10 hexadecimal digits"
        )
