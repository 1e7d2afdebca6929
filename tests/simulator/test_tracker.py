import math
import select
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest
from support.waiting import DEADLINE_S

from rcopterx.simulator.faults import (
    Delay,
    FaultError,
    Occlude,
    Recover,
    ResetFrameId,
    Silence,
    SkipFrames,
    TimedFault,
)
from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame
from rcopterx.vicon_gateway.objects import (
    FrameInfo,
    ObjectEnums,
    Ping,
    RequestFrame,
    WireObject,
    decode_body,
    packet,
)
from rcopterx.vicon_gateway.wire import HEADER, PacketReader

STREAM = packet(ObjectEnums(frozenset({1, 2, 5, 9, 26, 100004})), RequestFrame(True))
HELI = TrackedBody("heli1", (1.0, 2.0, 3.0))


def frame(number: int) -> TrackerFrame:
    return TrackerFrame(number, (HELI,))


@pytest.fixture
def server() -> Iterator[TrackerServer]:
    with closing(TrackerServer(port=0)) as found:
        yield found


class Peer:
    """A client on a plain socket."""

    def __init__(self, server: TrackerServer) -> None:
        self.server = server
        self.socket = socket.socket()
        # Little fits into what the kernel keeps for a client that does not read.
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65_536)
        self.socket.connect(server.address)
        self.socket.setblocking(False)
        self.reader = PacketReader()
        self.unread_bytes = 0  # of a packet that has not come completely
        self.packets: list[list[WireObject]] = []
        self.at_end = False

    def read(self) -> None:
        try:
            data = self.socket.recv(65_536)
        except BlockingIOError:
            return
        except ConnectionResetError:
            data = b""
        self.at_end = self.at_end or not data
        self.reader.feed(data)
        self.unread_bytes += len(data)
        while (body := self.reader.next_body()) is not None:
            self.unread_bytes -= HEADER.size + len(body)
            self.packets.append(decode_body(body))

    def run_until(self, condition: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline_s
            self.server.poll(0.001)
            self.read()

    def start(self) -> "Peer":
        """Read the offer, select, and wait until a published frame is due for this client."""
        self.run_until(lambda: len(self.packets) == 1)
        self.socket.sendall(STREAM + packet(Ping(1)))
        self.run_until(lambda: [Ping(1)] in self.packets)
        return self

    def has(self, number: int) -> bool:
        return any(FrameInfo(number) in objects for objects in self.packets)

    def close(self, reset: bool = False) -> None:
        if reset:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


@pytest.fixture
def connect(server: TrackerServer) -> Iterator[Callable[[], Peer]]:
    peers: list[Peer] = []

    def make() -> Peer:
        peers.append(Peer(server))
        return peers[-1]

    yield make
    for peer in peers:
        peer.close()


def test_offer_is_sent_before_the_client_says_anything(
    server: TrackerServer, connect: Callable[[], Peer]
) -> None:
    peer = connect()
    peer.run_until(lambda: len(peer.packets) == 1)
    (offer,) = peer.packets[0]
    assert isinstance(offer, ObjectEnums)
    assert {1, 2, 5, 9, 42} <= offer.types


def test_published_frame_goes_to_all_clients_at_once(
    server: TrackerServer, connect: Callable[[], Peer]
) -> None:
    peers = [connect().start() for _ in range(3)]
    before_s = time.monotonic()
    number, sent_s = server.publish(frame(7))
    assert number == 7
    assert before_s <= sent_s <= time.monotonic()
    for peer in peers:
        peer.run_until(lambda peer=peer: peer.has(7))


def test_published_frame_reports_the_id_that_is_on_the_wire(server: TrackerServer) -> None:
    server.apply(ResetFrameId(3))
    assert [server.publish(frame(number))[0] for number in (100, 101)] == [3, 4]


def test_frames_that_are_skipped_go_to_nobody(server: TrackerServer, connect: Callable[[], Peer]) -> None:
    client = connect().start()
    server.publish(frame(0))
    server.apply(SkipFrames())
    for number in range(1, 5):
        server.publish(frame(number))
    client.run_until(lambda: client.has(4))
    assert [number for number in range(5) if client.has(number)] == [0, 2, 4]


def test_descriptor_is_readable_when_there_is_something_to_do(server: TrackerServer) -> None:
    assert select.select([server], [], [], 0.0)[0] == []
    with socket.create_connection(server.address):
        assert select.select([server], [], [], DEADLINE_S)[0] == [server]
        server.poll()
        assert server.clients == 1


def test_client_that_does_not_read_loses_frames_and_holds_up_nobody(
    server: TrackerServer, connect: Callable[[], Peer]
) -> None:
    sleeper, reader = connect().start(), connect().start()
    bodies = tuple(TrackedBody(f"h{number}", (0.0, 0.0, 0.0)) for number in range(200))
    for number in range(10_000):
        server.publish(TrackerFrame(number, bodies))
        reader.run_until(lambda number=number: reader.has(number))
        reader.packets.clear()
        if server.dropped == 5:
            break
    sleeper.run_until(lambda: not sleeper.unread_bytes and sleeper.has(number - 5))
    server.publish(TrackerFrame(number + 1, bodies))
    sleeper.run_until(lambda: sleeper.has(number + 1))
    assert not sleeper.has(number)


def test_silence_with_a_blocked_client_does_not_keep_the_loop_spinning(
    server: TrackerServer, connect: Callable[[], Peer]
) -> None:
    sleeper = connect().start()
    bodies = tuple(TrackedBody(f"h{number}", (0.0, 0.0, 0.0)) for number in range(200))
    number = 0
    while server.dropped == 0:
        server.publish(TrackerFrame(number, bodies))
        number += 1
    server.apply(Silence())
    while select.select([sleeper.socket], [], [], 0.0)[0]:
        sleeper.read()
    sent = len(sleeper.packets)
    server.poll()
    assert select.select([server], [], [], 0.0)[0] == []
    server.apply(Recover())
    sleeper.run_until(lambda: len(sleeper.packets) > sent and not sleeper.unread_bytes)
    server.publish(TrackerFrame(number, bodies))
    sleeper.run_until(lambda: sleeper.has(number))


@pytest.mark.parametrize("reset", [False, True])
def test_client_that_goes_away_is_forgotten(
    server: TrackerServer, connect: Callable[[], Peer], reset: bool
) -> None:
    gone, stays = connect().start(), connect().start()
    gone.close(reset)
    stays.run_until(lambda: server.clients == 1)
    server.publish(frame(0))
    stays.run_until(lambda: stays.has(0))


def test_client_that_speaks_nonsense_is_cut_off(server: TrackerServer, connect: Callable[[], Peer]) -> None:
    peer, stays = connect().start(), connect().start()
    peer.socket.sendall(b"GET / HTTP/1.1\r\n\r\n")
    peer.run_until(lambda: peer.at_end)
    assert server.clients == 1
    server.publish(frame(0))
    stays.run_until(lambda: stays.has(0))


def test_planned_faults_wake_the_loop_at_their_time() -> None:
    now_s = 100.0
    with closing(TrackerServer(port=0, clock=lambda: now_s)) as server:
        assert server.next_due_s() == math.inf
        server.schedule([TimedFault(2.0, Silence(duration_s=1.0))])
        assert server.next_due_s() == 102.0
        now_s = 102.0
        server.poll()
        assert server.next_due_s() == 103.0
        now_s = 103.0
        server.poll()
        assert server.next_due_s() == math.inf


def test_delayed_packet_is_due_at_its_time() -> None:
    now_s = 100.0
    with closing(TrackerServer(port=0, clock=lambda: now_s)) as server:
        peer = Peer(server).start()
        server.apply(Delay(delay_s=0.5))
        server.publish(frame(0))
        assert server.next_due_s() == 100.5
        for _ in range(20):
            server.poll()
            peer.read()
        assert not peer.has(0)
        now_s = 100.5
        peer.run_until(lambda: peer.has(0))
        peer.close()


def test_fault_for_a_subject_that_is_not_there_is_refused(server: TrackerServer) -> None:
    server.publish(frame(0))
    with pytest.raises(FaultError, match="no subject 'h9'; tracked are 'heli1'"):
        server.apply(Occlude("h9"))


def test_frame_with_two_bodies_of_one_name_is_refused(server: TrackerServer) -> None:
    with pytest.raises(ValueError, match="same name"):
        server.publish(TrackerFrame(0, (HELI, HELI)))


@pytest.mark.parametrize("arguments", [{"profile": "tracker4"}, {"rate_hz": 0.0}, {"rate_hz": float("nan")}])
def test_settings_that_make_no_sense_are_refused(arguments: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="allowed"):
        TrackerServer(port=0, **arguments)


def test_address_in_use_is_an_error_of_the_system(server: TrackerServer) -> None:
    with pytest.raises(OSError, match="Address already in use"):
        TrackerServer(*server.address)
