"""A process that works in steps: what arrives waits for the next one and is noted, so it can be replayed.

Within a step nothing changes but by the process itself: neither the time nor what has arrived. So the same
inputs at the same steps make the process do the same again.
"""

import secrets
import zlib
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final, Protocol, TypeVar

from msgspec import Struct

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.bus.log_messages import AgentSteps, RoundedEstimate
from rcopterx.bus.message import Message
from rcopterx.bus.requests import Reply, Request
from rcopterx.bus.session import Incoming, Session
from rcopterx.bus.subscription import Deliver, Inbox

M = TypeVar("M", bound=Message)

MOST_WAITING: Final = 4096
"""A process that makes no step for so many messages loses the oldest, as it would anyway."""
STEPS_TOLD: Final = 20
"""Steps without a control period that are told together."""
REQUEST: Final = "request"
LIFE_BITS: Final = 53
"""Chosen by chance: enough that no two processes have the same number, and exact in every language."""


class Inboxes(Protocol[M]):
    """Inboxes of a channel by unit."""

    @property
    def inboxes(self) -> Mapping[str, Inbox[M]]:
        """By unit."""
        ...


class StepBus(Protocol):
    """What a process that works in steps needs of the bus; `Session` tells more of each.

    Attributes
    ----------
    life
        Identifies the process.
    requests
        Those that this step took in or earlier ones left; whoever takes them out must answer each.
    """

    life: int
    requests: list[Incoming]

    @property
    def words(self) -> Collection[str]:
        """What was noted and takes effect in this step."""
        ...

    def clock(self) -> float:
        """Time at which the present step began [monotonic s]."""
        ...

    def begin_step(self) -> float:
        """Hand over what has arrived; the time at which the step begins [monotonic s]."""
        ...

    def end_step(
        self, vehicle: str, estimate: Sequence[float] | None, overtime: Sequence[tuple[int, int]] = ()
    ) -> None:
        """Tell what the step took in and gave up for time; with an estimate after a control period."""
        ...

    def tell_steps(self, wanted: bool) -> None:
        """Whether steps are told from now on; those that are not leave a gap in their numbers."""
        ...

    def note(self, word: str) -> None:
        """Have something that happened inside the process, in any thread, take effect with the next step."""
        ...

    def subscribe(self, channel: Channel[M], unit: str, depth: int = 1, *, waking: bool = True) -> Inbox[M]:
        """Receive a channel of one unit."""
        ...

    def subscribe_all(self, channel: Channel[M], *, waking: bool = True) -> Inboxes[M]:
        """Receive a channel of every unit."""
        ...

    def publish(self, channel: Channel[M], unit: str, message: M) -> None:
        """Send a message."""
        ...

    def wanted(self, channel: Channel[M], unit: str) -> bool:
        """Whether anybody listens to what would be published."""
        ...

    def serve(self, unit: str, verbs: list[str]) -> None:
        """Answer requests."""
        ...

    def announce(self, unit: str, role: str) -> None:
        """Be seen alive."""
        ...

    def request(self, unit: str, request: Request, timeout_s: float = 1.0, patience_s: float = 0.3) -> Reply:
        """Ask a unit; only while the process is made."""
        ...


class _Input(Struct, frozen=True):
    """What waits for the next step: a message for an inbox, a request, or a word of the process itself."""

    payload: bytes
    arrived_s: float
    inbox: Inbox[Any] | None = None
    subscription: int = 0
    request: str = ""
    word: str = ""

    @property
    def key(self) -> str:
        """As in `AgentSteps.keys`."""
        if self.inbox is not None:
            return f"{self.inbox.unit}/{self.inbox.channel.topic}"
        return f"{REQUEST}/{self.request}" if self.request else self.word


class SteppedSession:
    """A session whose messages and requests wait for the next step.

    Parameters
    ----------
    session
        Open session on the bus.
    """

    def __init__(self, session: Session) -> None:
        self.life = secrets.randbits(LIFE_BITS)
        self._session = session
        self._now_s = self._began_s = session.clock()
        self._waiting: deque[_Input] = deque(maxlen=MOST_WAITING)
        self.words: list[str] = []
        self.requests: list[Incoming] = []
        self._subscriptions = 0
        self._told = 0
        self._steps: list[tuple[float, int]] = []
        """When each step began that is to be told, and how many inputs there were by then."""
        self._inputs: list[_Input] = []
        self._overtime: list[tuple[int, int, int]] = []
        self._replies: list[bytes] = []
        self._telling = True

    def clock(self) -> float:
        """See `StepBus.clock`."""
        return self._now_s

    def begin_step(self) -> float:
        """See `StepBus.begin_step`."""
        waiting, inputs = self._waiting, self._inputs
        self.words = words = []
        for _ in range(len(waiting)):
            item = waiting.popleft()
            inputs.append(item)
            if item.inbox is None:
                words.append(item.word)
            else:
                item.inbox.store(item.payload, item.arrived_s)
        for incoming in self._session.pending():
            inputs.append(_Input(incoming.payload, incoming.arrived_s, request=incoming.verb))
            self.requests.append(incoming)
        # After what arrived, so that nothing is from the future.
        self._now_s = now_s = self._session.clock()
        self._steps.append((now_s, len(inputs)))
        return now_s

    def end_step(
        self, vehicle: str, estimate: Sequence[float] | None, overtime: Sequence[tuple[int, int]] = ()
    ) -> None:
        """See `StepBus.end_step`."""
        if overtime:
            self._overtime += [(len(self._steps) - 1, *given_up) for given_up in overtime]
        if estimate is None and len(self._steps) < STEPS_TOLD:
            return
        if self._telling and self._session.wanted(channels.AGENT_STEPS, vehicle):
            self._tell(vehicle, None if estimate is None else RoundedEstimate.of(estimate))
        self._told += 1
        self._steps.clear()
        self._inputs.clear()
        self._overtime.clear()
        self._replies.clear()

    def _tell(self, vehicle: str, estimate: RoundedEstimate | None) -> None:
        ends = [taken for _, taken in self._steps]
        steps = AgentSteps(
            life=self.life,
            began_s=self._began_s,
            number=self._told,
            times_s=tuple(began_s for began_s, _ in self._steps),
            counts=tuple(end - begin for begin, end in pairwise([0, *ends])),
            keys=tuple(item.key for item in self._inputs),
            subscriptions=tuple(item.subscription for item in self._inputs),
            checksums=tuple(zlib.crc32(item.payload) for item in self._inputs),
            arrivals_s=tuple(item.arrived_s for item in self._inputs),
            overtime=tuple(self._overtime),
            replies=tuple(self._replies),
            estimate=estimate,
        )
        self._session.publish(channels.AGENT_STEPS, vehicle, steps)

    def tell_steps(self, wanted: bool) -> None:
        """See `StepBus.tell_steps`."""
        self._telling = wanted

    def note(self, word: str) -> None:
        """See `StepBus.note`."""
        self._waiting.append(_Input(b"", self._session.clock(), word=word))
        self._session.wake()

    def subscribe(self, channel: Channel[M], unit: str, depth: int = 1, *, waking: bool = True) -> Inbox[M]:
        """See `StepBus.subscribe`."""
        return self._session.subscribe(channel, unit, depth, waking=waking, deliver=self._deliverer())

    def subscribe_all(self, channel: Channel[M], *, waking: bool = True) -> Inboxes[M]:
        """See `StepBus.subscribe_all`."""
        return self._session.subscribe_all(channel, waking=waking, deliver=self._deliverer())

    def _deliverer(self) -> Deliver:
        """What lets messages of one more subscription wait for the next step."""
        self._subscriptions += 1
        number, wait = self._subscriptions, self._waiting.append

        def deliver(inbox: Inbox[Any], payload: bytes, arrived_s: float) -> None:
            wait(_Input(payload, arrived_s, inbox, number))

        return deliver

    def publish(self, channel: Channel[M], unit: str, message: M) -> None:
        """See `StepBus.publish`."""
        self._session.publish(channel, unit, message)

    def wanted(self, channel: Channel[M], unit: str) -> bool:
        """See `StepBus.wanted`."""
        return self._session.wanted(channel, unit)

    def serve(self, unit: str, verbs: list[str]) -> None:
        """See `StepBus.serve`."""
        self._session.serve(unit, verbs)

    def announce(self, unit: str, role: str) -> None:
        """See `StepBus.announce`."""
        self._session.announce(unit, role)

    def request(self, unit: str, request: Request, timeout_s: float = 1.0, patience_s: float = 0.3) -> Reply:
        """See `StepBus.request`."""
        reply = self._session.request(unit, request, timeout_s, patience_s)
        self._replies.append(encode(reply))
        return reply
