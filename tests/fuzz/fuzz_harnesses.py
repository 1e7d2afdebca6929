"""One harness for each reader of bytes from outside: every input gives a result or the documented error."""

import struct
import tempfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

import msgspec
from mcap.opcode import Opcode

from rcopterx.bus import channels, requests
from rcopterx.bus.codec import RejectedError, decode, encode
from rcopterx.bus.message import Message
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.flights.flights import Flight
from rcopterx.flights.listing import mend, summary_of
from rcopterx.flights.mcap_reading import LogContents, messages_of
from rcopterx.flights.mcap_records import MAGIC, FlightLogError
from rcopterx.radios.dsm2_serial import Dsm2SerialProtocol
from rcopterx.radios.dsmp import DsmpProtocol
from rcopterx.radios.ppm import PpmGenProtocol
from rcopterx.radios.protocol import FrameDecodeError
from rcopterx.radios.registry import PROTOCOL_NAMES, create_protocol
from rcopterx.vicon_gateway.datastream import DataStreamSession
from rcopterx.vicon_gateway.wire import WireError

CORPUS: Final = Path(__file__).parent / "corpus"
"""Minimal inputs in a directory for each harness."""
MEMORY: Final = Path("/dev/shm")
PIECE_BYTES: Final = 61
"""Streams arrive in pieces of other lengths than their packets."""
MESSAGES: Final[tuple[type[Message], ...]] = tuple(
    sorted(
        {channel.message for channel in channels.CHANNELS}
        | {verb.request for verb in requests.VERBS.values()}
        | {verb.reply for verb in requests.VERBS.values()},
        key=lambda message: message.__name__,
    )
)


def codec(data: bytes) -> None:
    """Decode a message whose type the first byte selects; what is accepted survives another round."""
    if not data:
        return
    kind = MESSAGES[data[0] % len(MESSAGES)]
    try:
        message = decode(data[1:], kind)
    except RejectedError:
        return
    assert decode(encode(message), kind) == message


def datastream(data: bytes) -> None:
    """Receive the stream of a Tracker."""
    session = DataStreamSession()
    try:
        for start in range(0, len(data), PIECE_BYTES):
            session.feed(data[start : start + PIECE_BYTES], 0.01 * start)
            session.take_frame()
            session.take_outgoing()
    except WireError:
        pass


def module(data: bytes) -> None:
    """Receive the answers of a radio module whose protocol the first byte selects."""
    if not data:
        return
    protocol = create_protocol(PROTOCOL_NAMES[data[0] % len(PROTOCOL_NAMES)])
    protocol.link_opened(0.0)
    for start in range(1, len(data), PIECE_BYTES):
        protocol.receive(data[start : start + PIECE_BYTES], 0.01 * start)
        assert len(protocol.status(0.01 * start).text) < 1000
    if isinstance(protocol, Dsm2SerialProtocol | DsmpProtocol | PpmGenProtocol):
        with suppress(FrameDecodeError):
            protocol.decode(data[1:])


def flight_log(data: bytes) -> None:
    """Read a flight log and mend it; without the magic of a log, the input is the content of a chunk."""
    if not data.startswith(MAGIC):
        body = struct.pack("<QQQIIQ", 0, 0, len(data), zlib.crc32(data), 0, len(data)) + data
        data = MAGIC + struct.pack("<BQ", Opcode.CHUNK, len(body)) + body
    with tempfile.TemporaryDirectory(dir=MEMORY) as directory:
        path = Path(directory) / "flight.mcap"
        path.write_bytes(data)
        summary_of(Flight("lab", (path,)))
        try:
            count = sum(1 for _ in messages_of(path))
            mended = mend(path)
        except FlightLogError:
            return
        assert mended.messages == count
        contents = LogContents()
        assert sum(1 for _ in messages_of(mended.path, contents)) == count
        assert contents.complete
        assert path.read_bytes() == data


def fleet_file(data: bytes) -> None:
    """Read a fleet file; an accepted one survives its snapshot."""
    try:
        fleet = parse_fleet(data.decode(errors="replace"))
    except FleetError:
        return
    assert msgspec.json.decode(msgspec.json.encode(fleet), type=FleetFile) == fleet


HARNESSES: Final[Mapping[str, Callable[[bytes], None]]] = {
    harness.__name__: harness for harness in (codec, datastream, module, flight_log, fleet_file)
}
