"""Tracker emulator: a DataStream server for any number of clients; one thread, whose loop calls `poll`."""

import selectors
import socket
import time
from collections.abc import Callable, Iterable

from rcopterx.simulator import faults
from rcopterx.simulator.tracker_faults import TrackerFaults
from rcopterx.simulator.tracker_frame import PROFILES, FrameContent, TrackerFrame
from rcopterx.simulator.tracker_link import RECEIVE_BYTES, TrackerLink
from rcopterx.simulator.tracker_session import EMPTY_PACKET, TrackerConnection
from rcopterx.vicon_gateway.wire import HEADER, WireError, encode_object, encode_packet

MAX_BACKLOG_BYTES = 1024 * 1024
WRONG_MAGIC_PACKET = HEADER.pack(0x0BADF00D, 0)


class TrackerServer:
    """A Tracker that shows the frames given to `publish`; clients that read too slowly lose frames.

    `profile`: age of the Tracker, and so its offer: tracker1, tracker2 or tracker3. `ValueError`: others,
    or a rate not positive. `OSError`: it cannot listen on the address; port 0: a free one, see `address`.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 801,
        *,
        profile: str = "tracker3",
        rate_hz: float = 50.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if profile not in PROFILES:
            raise ValueError(f"profile {profile!r}: allowed are {', '.join(PROFILES)}")
        if not 0.0 < rate_hz <= 10_000.0:
            raise ValueError(f"rate_hz {rate_hz}: allowed is more than 0, at most 10000")
        self._offer = PROFILES[profile]
        self._rate_hz = rate_hz
        self._clock = clock
        self.faults = TrackerFaults(self._offer)  # faults now and later
        self._clients: dict[int, TrackerLink] = {}
        self._subject_ids: dict[str, int] = {}
        self._burst_left = 0
        self.accepted = 0  # connections so far
        self.dropped = 0  # frames that a client did not get because it reads too slowly
        self._listener = socket.create_server((host, port), backlog=16)
        self._selector = selectors.EpollSelector()
        self._listener.setblocking(False)
        self._selector.register(self._listener, selectors.EVENT_READ)

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the listening socket."""
        host, port = self._listener.getsockname()[:2]
        return str(host), int(port)

    @property
    def clients(self) -> int:
        """Number of clients that are connected."""
        return len(self._clients)

    def fileno(self) -> int:
        """Return a descriptor that is readable when `poll` has something to do."""
        return self._selector.fileno()

    def next_due_s(self) -> float:
        """Return the time at which `poll` is needed even without network traffic, infinite for never."""
        times = [self.faults.table.next_change_s()]
        if self.faults.active(faults.Silence) is None:
            dribbling = self.faults.active(faults.Dribble) is not None
            for client in self._clients.values():
                times.append(client.due_s)
                if dribbling and client.outgoing and not client.blocked:
                    times.append(client.next_chunk_s)
        return min(times)

    def poll(self, timeout_s: float = 0.0) -> None:
        """Serve sockets and faults; waits for traffic at most `timeout_s`."""
        timeout_s = min(timeout_s, max(0.0, self.next_due_s() - self._clock()))
        for key, events in self._selector.select(timeout_s):
            if key.fileobj is self._listener:
                self._accept()
            elif events & selectors.EVENT_READ and key.fd in self._clients:
                self._receive(self._clients[key.fd])
        self._advance(self._clock())
        self._flush()

    def publish(self, frame: TrackerFrame) -> tuple[int, float]:
        """Send a frame to every client it is due for; `ValueError` for two bodies of one name.

        Returns its id on the wire and the time before its first byte.
        """
        if len({body.name for body in frame.bodies}) < len(frame.bodies):
            raise ValueError(f"frame {frame.frame}: two bodies have the same name")
        self._advance(self._clock())
        frame = self.faults.transform(frame)
        for body in frame.bodies:
            self._subject_ids.setdefault(body.name, len(self._subject_ids) + 1)
        y_up = self.faults.active(faults.YUp) is not None
        content = FrameContent(frame, self._rate_hz, self._subject_ids, y_up)
        packets = self._packets(content)
        sent_s = self._clock()
        self._dispatch(packets, sent_s)
        return frame.frame, sent_s

    def apply(self, fault: faults.TrackerFault) -> None:
        """Start a fault now; raises `FaultError` when it cannot be carried out."""
        now_s = self._clock()
        self.faults.apply(fault, now_s)
        self._advance(now_s)
        self._flush()

    def schedule(self, table: Iterable[faults.TimedFault]) -> None:
        """Start faults later, counted from now; raises `FaultError` when one cannot be carried out."""
        self.faults.schedule(table, self._clock())

    def close(self) -> None:
        """End all connections and stop listening."""
        for client in list(self._clients.values()):
            self._drop(client)
        self._selector.close()
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                link, _ = self._listener.accept()
            except OSError:  # no client is waiting, or it has gone again
                return
            link.setblocking(False)
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client = TrackerLink(link, TrackerConnection(self._offer))
            self._clients[link.fileno()] = client
            self._selector.register(link, selectors.EVENT_READ)
            self.greet(client)
            self.accepted += 1

    def greet(self, client: TrackerLink) -> None:
        """Begin the connection of a client."""
        client.queue(client.connection.greeting(), self._clock())

    def _receive(self, client: TrackerLink) -> None:
        mute = self.faults.active(faults.IgnorePings) or self.faults.active(faults.Silence)
        client.connection.answers_pings = mute is None
        try:
            if data := client.socket.recv(RECEIVE_BYTES):
                self.answer(client, data)
            else:
                self._drop(client)
        except BlockingIOError:
            return
        except (WireError, OSError):
            self._drop(client)

    def answer(self, client: TrackerLink, data: bytes) -> None:
        """Answer what a client sent; may raise `WireError`."""
        for packet in client.connection.receive(data):
            self._queue(client, packet, self._clock())

    def _packets(self, content: FrameContent) -> list[tuple[TrackerLink, bytes]]:
        """Build this frame's packet for every client it is due for and that keeps up."""
        if self.faults.active(faults.Silence) is not None or self.faults.skips():
            return []
        unknown = self.faults.active(faults.UnknownObject)
        empty = self.faults.active(faults.EmptyPackets) is not None
        packets = []
        for client in self._clients.values():
            if client.backlog_bytes > MAX_BACKLOG_BYTES:
                self.dropped += 1
                continue
            packet = EMPTY_PACKET if empty else client.connection.publish(content)
            if packet is not None and unknown is not None:
                extra = encode_object(unknown.object_type, bytes(unknown.size_bytes))
                packet = encode_packet(packet[HEADER.size :], extra)
            if packet is not None:
                packets.append((client, packet))
        return packets

    def _dispatch(self, packets: list[tuple[TrackerLink, bytes]], now_s: float) -> None:
        if self._burst_left > 0:
            self._burst_left -= 1
            for client, packet in packets:
                client.held.append(packet)
            if self._burst_left > 0:
                return
            packets = [(client, b"".join(client.held)) for client in self._clients.values()]
            for client in self._clients.values():
                client.held.clear()
        for client, packet in packets:
            self._queue(client, packet, now_s)
        self._flush()

    def _queue(self, client: TrackerLink, data: bytes, now_s: float) -> None:
        delay = self.faults.active(faults.Delay)
        client.queue(data, now_s if delay is None else now_s + delay.delay_s)

    def _advance(self, now_s: float) -> None:
        self.faults.advance(now_s)
        for fault in self.faults.take_pending():
            if isinstance(fault, faults.Burst):
                self._burst_left = fault.frames
            for client in list(self._clients.values()):
                if isinstance(fault, faults.WrongMagic):
                    self._queue(client, WRONG_MAGIC_PACKET, now_s)
                elif isinstance(fault, faults.Close | faults.Reset):
                    self._drop(client, reset=isinstance(fault, faults.Reset))

    def _flush(self) -> None:
        silent = self.faults.active(faults.Silence) is not None
        dribble = self.faults.active(faults.Dribble)
        now_s = self._clock()
        for client in list(self._clients.values()):
            was_blocked = client.blocked
            try:
                if silent:
                    client.blocked = False  # or a writable socket would keep the owner's loop spinning
                else:
                    client.send(now_s, dribble)
            except OSError:
                self._drop(client)
                continue
            if client.ended and not client.outgoing:
                self._drop(client)
            elif client.blocked != was_blocked:
                writing = selectors.EVENT_WRITE if client.blocked else 0
                self._selector.modify(client.socket, selectors.EVENT_READ | writing)

    def _drop(self, client: TrackerLink, reset: bool = False) -> None:
        self._selector.unregister(client.socket)
        del self._clients[client.socket.fileno()]
        client.close(reset)
