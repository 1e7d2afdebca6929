"""The server's side of a DataStream connection as a pure state machine: bytes and frames in, bytes out."""

from collections.abc import Mapping
from itertools import chain

from rcopterx.simulator.tracker_frame import FrameContent
from rcopterx.vicon_gateway import objects as sdk
from rcopterx.vicon_gateway.wire import STATIC_TYPES, ObjectType, PacketReader, encode_packet

EMPTY_PACKET = encode_packet()
MAX_REQUEST_BYTES = 64 * 1024
MAX_OWED_FRAMES = 1_000_000

_SEND_ORDER = (1, 2, 37, 28, 28001, 29, 40, 5, 23, 26, 36, 39, 8, 9, 901, 6, 7)


class TrackerConnection:
    """Requests of one client, and the objects sent to it; `offer` are the types that this server can send."""

    def __init__(self, offer: frozenset[int]) -> None:
        self.offer = offer
        self.selection: frozenset[int] | None = None
        self._kinds: tuple[int, ...] = ()
        self.streaming = False
        self.owed_next = 0
        self.owed_latest = 0
        self.answers_pings = True
        self._filter: Mapping[int, frozenset[int]] = {}
        self._reader = PacketReader(MAX_REQUEST_BYTES)
        self._sent: dict[int, list[bytes]] = {}
        self._latest: FrameContent | None = None
        self._latest_sent = False

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
        if self.owed_latest and self.selection and self._latest is not None and not self._latest_sent:
            replies.append(self._frame_packet(self._latest))
        return replies

    def publish(self, content: FrameContent) -> bytes | None:
        """Return the packet of a captured frame, None when it is not due."""
        self._latest, self._latest_sent = content, False
        if self.selection is None:
            return None
        if not self.selection:
            return EMPTY_PACKET  # keeps the SDK's reader going, counts as nothing
        if self.streaming or self.owed_next or self.owed_latest:
            return self._frame_packet(content)
        return None

    def miss(self, content: FrameContent) -> None:
        """Note a captured frame that cannot be sent because the client does not read."""
        self._latest, self._latest_sent = content, False

    def _handle(self, item: sdk.WireObject) -> list[bytes]:
        match item:
            case sdk.ObjectEnums(types):
                self.selection = types & self.offer
                self._kinds = tuple([kind for kind in _SEND_ORDER if kind in self.selection])
                self._sent = {kind: sent for kind, sent in self._sent.items() if kind in self.selection}
            case sdk.RequestFrame(streaming):
                self.streaming = streaming
                self.owed_latest = 0 if streaming else min(self.owed_latest + 1, MAX_OWED_FRAMES)
            case sdk.RequestNextFrame(number):
                self.streaming = False
                self.owed_next = min(self.owed_next + number, MAX_OWED_FRAMES)
            case sdk.Filter(allowed):
                self._filter = allowed
            case sdk.Ping() if self.answers_pings:
                return [sdk.packet(item)]
        return []

    def _frame_packet(self, content: FrameContent) -> bytes:
        assert self.selection is not None
        self._latest_sent = True
        if self.owed_latest:
            self.owed_latest -= 1
        elif self.owed_next:
            self.owed_next -= 1
        allowed = self._filter.get
        objects = {kind: content.objects(kind, allowed(kind)) for kind in self._kinds}
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
