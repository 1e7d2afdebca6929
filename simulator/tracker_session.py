"""The server's side of a DataStream connection as a pure state machine: bytes and frames in, bytes out."""

from collections.abc import Mapping
from itertools import chain

from rcopterx.simulator.tracker_frame import FrameContent
from rcopterx.vicon_gateway import objects as sdk
from rcopterx.vicon_gateway.wire import STATIC_TYPES, ObjectType, PacketReader, encode_packet

EMPTY_PACKET = encode_packet()
MAX_REQUEST_BYTES = 64 * 1024

_SEND_ORDER = (1, 2, 37, 28, 28001, 29, 40, 5, 23, 26, 39, 8, 9, 7)


class TrackerConnection:
    """Requests of one client, and the objects sent to it; `offer` are the types that this server can send."""

    def __init__(self, offer: frozenset[int]) -> None:
        self.offer = offer
        self.selection: frozenset[int] | None = None
        self._kinds: tuple[int, ...] = ()
        self.streaming = False
        self.answers_pings = True
        self._reader = PacketReader(MAX_REQUEST_BYTES)
        self._sent: dict[int, list[bytes]] = {}

    def greeting(self) -> bytes:
        """Return the first packet of the server: its offer."""
        return sdk.packet(sdk.ObjectEnums(self.offer))

    def receive(self, data: bytes) -> list[bytes]:
        """Handle bytes of the client; return the packets to send at once, or raise `WireError`."""
        self._reader.feed(data)
        replies: list[bytes] = []
        while (body := self._reader.next_body()) is not None:
            for item in sdk.decode_body(body):
                replies += self._handle(item)
        return replies

    def publish(self, content: FrameContent) -> bytes | None:
        """Return the packet of a captured frame, None when it is not due."""
        if self.selection is None:
            return None
        if not self.selection:
            return EMPTY_PACKET  # keeps the SDK's reader going, counts as nothing
        return self._frame_packet(content) if self.streaming else None

    def _handle(self, item: sdk.WireObject) -> list[bytes]:
        match item:
            case sdk.ObjectEnums(types):
                self.selection = types & self.offer
                self._kinds = tuple([kind for kind in _SEND_ORDER if kind in self.selection])
                self._sent = {kind: sent for kind, sent in self._sent.items() if kind in self.selection}
            case sdk.RequestFrame(streaming):
                self.streaming = streaming
            case sdk.Ping() if self.answers_pings:
                return [sdk.packet(item)]
        return []

    def _frame_packet(self, content: FrameContent) -> bytes:
        assert self.selection is not None
        objects = {kind: content.objects(kind) for kind in self._kinds}
        unchanged = self._unchanged(objects)
        self._sent = objects
        present = [[] if kind in unchanged else items for kind, items in objects.items()]
        parts = chain.from_iterable(present)
        if ObjectType.CONTENTS not in self.selection:
            return encode_packet(*parts)
        counts = dict(zip(objects, map(len, present), strict=True))
        return encode_packet(sdk.Contents(counts, unchanged).encode(), *parts)

    def _unchanged(self, objects: Mapping[int, list[bytes]]) -> frozenset[int]:
        """Return the types to leave out; none for a client without the Contents object that names them."""
        if ObjectType.CONTENTS not in (self.selection or ()):
            return frozenset()
        static = {kind: items for kind, items in objects.items() if kind in STATIC_TYPES}
        same = {kind for kind, items in static.items() if items and items == self._sent.get(kind)}
        if same >= static.keys():
            return frozenset(same)
        emptied = any(self._sent.get(kind) and not items for kind, items in static.items())
        if emptied and all(kind in same or not items for kind, items in static.items()):
            # Without any static object in the packet the client would keep objects that are gone.
            same.discard(ObjectType.STREAM_INFO)
        return frozenset(same)
