"""Links between the vehicles of a rig: broadcasts that arrive late, and that each receiver may miss."""

from collections import defaultdict, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Generic, NamedTuple, TypeVar

from rcopterx.simulator.disturbance import random_stream

T = TypeVar("T")

_STREAMS: Final = 16  # streams of randomness from here on are those of networks
_TOLERANCE_S: Final = 1e-9


@dataclass(frozen=True)
class LinkQuality:
    """How messages between vehicles travel."""

    loss: float = 0.0  # fraction of the messages that a receiver does not get
    delay_s: float = 0.0  # time from sending to receiving


PERFECT: Final = LinkQuality()


class ReceivedMessage(NamedTuple, Generic[T]):
    """A message, and when it was sent."""

    message: T
    sent_s: float


class Network(Generic[T]):
    """Carries messages of one kind; losses depend on seed and sender alone."""

    def __init__(self, quality: LinkQuality, names: Iterable[str], seed: int, kind: int) -> None:
        self._quality = quality
        self._random = {name: random_stream(seed, name, _STREAMS + kind) for name in names}
        self._under_way: defaultdict[str, deque[tuple[str, ReceivedMessage[T]]]] = defaultdict(deque)
        self._newest: defaultdict[str, dict[str, ReceivedMessage[T]]] = defaultdict(dict)
        # number and size of all messages
        self.sent = self.bytes = 0

    def send(self, sender: str, message: T, now_s: float, size: int = 0) -> None:
        """Broadcast a message of some bytes."""
        self.sent += 1
        self.bytes += size
        lost = self._random[sender].random(len(self._random)) < self._quality.loss
        for receiver, misses in zip(sorted(self._random), lost, strict=True):
            if receiver != sender and not misses:
                self._under_way[receiver].append((sender, ReceivedMessage(message, now_s)))

    def newest(self, receiver: str, now_s: float) -> Mapping[str, ReceivedMessage[T]]:
        """Return the newest message of each sender that a vehicle has received."""
        arriving, newest = self._under_way[receiver], self._newest[receiver]
        while arriving and arriving[0][1].sent_s + self._quality.delay_s <= now_s + _TOLERANCE_S:
            sender, received = arriving.popleft()
            newest[sender] = received
        return newest
