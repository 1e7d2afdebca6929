"""Hostile bytes for everything that reads the DataStream protocol.

Run a campaign from the root of the checkout::

    nice -n 10 python -m tests.vicon_gateway.fuzz_datastream 1000000 [seed]

Valid streams are mutated: bytes changed, cut out, doubled and spliced, lengths and counts replaced by hostile
numbers, with and without repairing the headers around. The only error allowed is `WireError`; frames that are
delivered all the same must hold finite poses; no input may take long or make the process grow.
"""

import math
import random
import resource
import struct
import sys
import time
from collections.abc import Callable

from rcopterx.simulator.tracker_frame import PROFILES, FrameContent, TrackedBody, TrackerFrame
from rcopterx.simulator.tracker_session import TrackerConnection
from rcopterx.vicon_gateway.datastream import DataStreamSession
from rcopterx.vicon_gateway.frame import CapturedFrame
from rcopterx.vicon_gateway.objects import (
    ObjectEnums,
    Ping,
    RequestFrame,
    decode_body,
    packet,
)
from rcopterx.vicon_gateway.wire import (
    HEADER,
    ObjectType,
    WireError,
    encode_object,
    encode_packet,
    split_objects,
)

MAX_INPUT_S = 1.0
MAX_GROWTH_KIB = 128 * 1024
HOSTILE = (0, 1, 7, 8, 0x7F, 0xFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0xFFFFFFFF, 0x04000000, 0x04000001)
KINDS = tuple(int(kind) for kind in ObjectType)
WORDS = (*HOSTILE, *KINDS, 0x1A2B0001)


def server_streams() -> list[bytes]:
    """Return what a client receives: the offer and some frames, of every profile."""
    streams = []
    for offer in PROFILES.values():
        for selection in (offer, offer & {1, 2, 5, 9, 26, 40, 100004}):
            connection = TrackerConnection(offer)
            connection.receive(packet(ObjectEnums(selection), RequestFrame(streaming=True)))
            stream = connection.greeting() + packet(Ping(1))
            for number in range(4):
                bodies = (
                    TrackedBody("heli1", (0.1 * number, 1.0, 2.0)),
                    TrackedBody("heli2", (0.0, 1.0, 2.0), occluded=number == 2),
                )
                content = FrameContent(TrackerFrame(number, bodies), 50.0, {"heli1": 1, "heli2": 2})
                stream += connection.publish(content) or b""
            streams.append(stream)
    return streams


def client_streams() -> list[bytes]:
    """Return what a server receives."""
    selection = ObjectEnums(frozenset({1, 2, 5, 9, 100004}))
    return [
        packet(selection, RequestFrame(streaming=True)) + packet(Ping(1)) + packet(Ping(2)),
        packet(RequestFrame(streaming=False)) + packet(selection),
    ]


class Mutator:
    """Makes hostile inputs out of valid streams."""

    def __init__(self, seeds: list[bytes], generator: random.Random) -> None:
        self._seeds = seeds
        self._random = generator

    def stream(self) -> bytes:
        """Return a mutated stream; every second one is mutated inside its objects, headers repaired."""
        data = self._random.choice(self._seeds)
        mutated = self._inside_objects(data) if self._random.random() < 0.5 else bytearray(data)
        for _ in range(self._random.choice((0, 1, 1, 2, 5))):
            mutated = self._mutate(mutated)
        return bytes(mutated)

    def payload(self) -> tuple[int, bytes]:
        """Return a type and a mutated payload, sometimes of another type."""
        data = self._random.choice(self._seeds)
        kind, payload = self._random.choice(self._objects(data))
        if self._random.random() < 0.2:
            kind = self._random.choice(KINDS)
        return kind, bytes(self._mutate(bytearray(payload)))

    def _objects(self, stream: bytes) -> list[tuple[int, bytes]]:
        found, position = [], 0
        while position < len(stream):
            size = HEADER.unpack_from(stream, position)[1]
            found += split_objects(stream[position + 8 : position + 8 + size])
            position += 8 + size
        return found

    def _inside_objects(self, stream: bytes) -> bytearray:
        mutated, position = bytearray(), 0
        while position < len(stream):
            size = HEADER.unpack_from(stream, position)[1]
            objects = split_objects(stream[position + 8 : position + 8 + size])
            position += 8 + size
            parts = []
            for kind, payload in objects:
                hit = self._random.random() < 0.1
                parts.append(encode_object(kind, bytes(self._mutate(bytearray(payload))) if hit else payload))
            mutated += encode_packet(*parts)
        return mutated

    def _mutate(self, data: bytearray) -> bytearray:
        generator = self._random
        place = generator.randrange(len(data) + 1)
        length = generator.choice((1, 2, 4, 8, 30))
        match generator.randrange(8):
            case 0 if place < len(data):
                data[place] ^= 1 << generator.randrange(8)
            case 1 if place < len(data):
                data[place] = generator.randrange(256)
            case 2:
                data[place : place + 4] = struct.pack("<I", generator.choice(WORDS))
            case 3:
                del data[place : place + length]
            case 4:
                data[place:place] = generator.randbytes(length)
            case 5:
                data[place:place] = data[place : place + length]
            case 6:
                other = generator.choice(self._seeds)
                start = generator.randrange(len(other))
                data[place : place + length] = other[start : start + length]
            case _:
                del data[place:]
        return data


def check_frame(frame: CapturedFrame | None) -> None:
    """Fail when a delivered frame holds anything but finite numbers and unit quaternions."""
    if frame is None:
        return
    assert 0.0 < frame.period_s < math.inf
    assert 0.0 <= frame.latency_s < math.inf
    assert 0 <= frame.frame < 0xFFFFFFFF
    for subject in frame.subjects:
        assert subject.occluded == (subject.position_m is None) == (subject.quaternion_xyzw is None)
        assert all(map(math.isfinite, subject.position_m or ()))
        if subject.quaternion_xyzw is not None:
            assert abs(math.hypot(*subject.quaternion_xyzw) - 1.0) < 1e-9
        assert subject.quality is None or 0.0 <= subject.quality <= 1.0


class Targets:
    """One hostile input for one of the readers, in turn."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._from_server = Mutator(server_streams(), self._random)
        self._from_client = Mutator(client_streams(), self._random)
        self.refused = 0
        self.accepted = 0
        self.frames = 0

    def run(self, number: int) -> None:
        """Feed one input; raises whatever is not `WireError`."""
        targets: tuple[Callable[[], None], ...] = (self._session, self._objects, self._session, self._server)
        try:
            targets[number % len(targets)]()
            self.accepted += 1
        except WireError:
            self.refused += 1

    def _session(self) -> None:
        session = DataStreamSession()
        data = self._from_server.stream()
        cut = self._random.randrange(len(data) + 1)
        for now_s, part in enumerate((data[:cut], data[cut:])):
            session.feed(part, float(now_s))
            frame = session.take_frame()
            check_frame(frame)
            self.frames += frame is not None

    def _objects(self) -> None:
        mutator = self._random.choice((self._from_server, self._from_client))
        kind, payload = mutator.payload()
        decode_body(encode_object(kind, payload))
        decode_body(encode_object(kind, payload) + payload)

    def _server(self) -> None:
        connection = TrackerConnection(PROFILES["tracker3"])
        content = FrameContent(TrackerFrame(0, (TrackedBody("heli1", (0.0, 0.0, 0.0)),)), 50.0, {"heli1": 1})
        connection.publish(content)
        connection.receive(self._from_client.stream())
        connection.publish(content)


def campaign(number: int, seed: int, report_every: int = 0) -> Targets:
    """Run `number` inputs and check time per input and growth of the process."""
    targets = Targets(seed)
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    slowest_s = 0.0
    for index in range(number):
        start_s = time.process_time()
        targets.run(index)
        slowest_s = max(slowest_s, time.process_time() - start_s)
        assert slowest_s < MAX_INPUT_S, f"input {index} of seed {seed} took {slowest_s:.1f} s"
        if report_every and (index + 1) % report_every == 0:
            print(f"{index + 1} inputs, {targets.refused} refused, {targets.frames} frames", flush=True)
    growth_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib
    assert growth_kib < MAX_GROWTH_KIB, f"the process grew by {growth_kib} KiB"
    if report_every:
        print(f"slowest input {slowest_s * 1e3:.2f} ms of CPU, growth {growth_kib} KiB")
    return targets


if __name__ == "__main__":
    campaign(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1, report_every=100_000)
