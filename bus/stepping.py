"""A process that works in steps: input waits for the next step and is recorded, so that it can be replayed.

Within a step neither the time nor the input changes: the same inputs at the same steps give the same result.
"""

import secrets
import zlib
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeVar

from msgspec import Struct

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.bus.log_messages import AgentSteps, RoundedEstimate
from rcopterx.bus.message import Message
from rcopterx.bus.requests import Reply, Request
from rcopterx.bus.session import Incoming, Session
from rcopterx.bus.subscription import Deliver, Inbox, Waking

M = TypeVar("M", bound=Message)

MAX_WAITING: Final = 4096  # inputs that wait for a step; then the oldest are dropped
STEPS_PER_MESSAGE: Final = 20  # largest number of steps without a control period that are published together
REQUEST: Final = "request"
LIFE_BITS: Final = 53  # integers of this size are exact in every language


class _Input(Struct, frozen=True):
    """Input of the next step: a message for an inbox, a request, or an event of the process itself."""

    payload: bytes
    arrived_s: float
    inbox: Inbox[Any] | None = None
    subscription: int = 0
    request: str = ""
    event: str = ""

    @property
    def key(self) -> str:
        """As in `AgentSteps.keys`."""
        if self.inbox is not None:
            return self.inbox.key
        return f"{REQUEST}/{self.request}" if self.request else self.event


class StepBus:
    """A session whose messages and requests wait for the next step; methods without details are its own.

    `life` is a random number of the process; the code that removes one of `requests` must answer it; `events`
    inside the process take effect in this step, see `note`.
    """

    def __init__(self, session: Session) -> None:
        self.life = secrets.randbits(LIFE_BITS)
        self.events: set[str] = set()
        self.requests: list[Incoming] = []
        self._session = session
        self._now_s = self._began_s = session.clock()
        self._waiting: deque[_Input] = deque(maxlen=MAX_WAITING)
        self._subscriptions = 0
        self.publishing = True  # whether steps are published; others leave a gap in the numbers
        self._number = 0
        # Everything below is of the steps that have not been published yet.
        self._begins_s: list[float] = []
        self._counts: list[int] = []  # of inputs, by step
        self._inputs: list[_Input] = []
        self._overtime: list[tuple[int, int, int]] = []
        self._replies: list[bytes] = []

    def clock(self) -> float:
        """Return the time at which the present step began [monotonic s]."""
        return self._now_s

    def begin_step(self) -> float:
        """Deliver the input that has arrived and return the time at which the step begins [monotonic s]."""
        self.events = set()
        before = len(self._inputs)
        for _ in range(len(self._waiting)):
            item = self._waiting.popleft()
            self._inputs.append(item)
            if item.inbox is None:
                self.events.add(item.event)
            else:
                item.inbox.store(item.payload, item.arrived_s)
        for incoming in self._session.pending():
            self._inputs.append(_Input(incoming.payload, incoming.arrived_s, request=incoming.verb))
            self.requests.append(incoming)
        # Read after the input was collected, so that no input is later than the step.
        self._now_s = self._session.clock()
        self._begins_s.append(self._now_s)
        self._counts.append(len(self._inputs) - before)
        return self._now_s

    def end_step(
        self, vehicle: str, estimate: Sequence[float] | None, overtime: Sequence[tuple[int, int]] = ()
    ) -> None:
        """Publish the inputs of the steps since the last publication, under the vehicle's name.

        `estimate` has the 16 values of `RoundedEstimate` after a control period; see `AgentSteps.overtime`.
        """
        self._overtime += [(len(self._begins_s) - 1, *given_up) for given_up in overtime]
        if estimate is None and len(self._begins_s) < STEPS_PER_MESSAGE:
            return
        if self.publishing:
            steps = self._message(None if estimate is None else RoundedEstimate.of(estimate))
            self._session.publish(channels.AGENT_STEPS, vehicle, steps)
        self._number += 1
        for column in (self._begins_s, self._counts, self._inputs, self._overtime, self._replies):
            column.clear()

    def _message(self, estimate: RoundedEstimate | None) -> AgentSteps:
        return AgentSteps(
            life=self.life,
            began_s=self._began_s,
            number=self._number,
            times_s=tuple(self._begins_s),
            counts=tuple(self._counts),
            keys=tuple(item.key for item in self._inputs),
            subscriptions=tuple(item.subscription for item in self._inputs),
            checksums=tuple(zlib.crc32(item.payload) for item in self._inputs),
            arrivals_s=tuple(item.arrived_s for item in self._inputs),
            overtime=tuple(self._overtime),
            replies=tuple(self._replies),
            estimate=estimate,
        )

    def note(self, event: str) -> None:
        """Let an event inside the process take effect with the next step. Any thread may call this."""
        self._waiting.append(_Input(b"", self._session.clock(), event=event))
        self._session.wake()

    def subscribe(self, channel: Channel[M], unit: str, depth: int = 1, *, waking: Waking = True) -> Inbox[M]:
        """Receive a channel of one unit."""
        return self._session.subscribe(channel, unit, depth, waking=waking, deliver=self._deliverer())

    def subscribe_all(self, channel: Channel[M], *, waking: Waking = True) -> Mapping[str, Inbox[M]]:
        """Receive a channel of every unit; return their inboxes."""
        return self._session.subscribe_all(channel, waking=waking, deliver=self._deliverer()).inboxes

    def _deliverer(self) -> Deliver:
        """Callback of one more subscription; it lets messages wait for the next step."""
        self._subscriptions += 1
        number = self._subscriptions

        def deliver(inbox: Inbox[Any], payload: bytes, arrived_s: float) -> None:
            self._waiting.append(_Input(payload, arrived_s, inbox, number))

        return deliver

    def publish(self, channel: Channel[M], unit: str, message: M) -> None:
        """Send a message."""
        self._session.publish(channel, unit, message)

    def serve(self, unit: str, verbs: list[str]) -> None:
        """Accept requests."""
        self._session.serve(unit, verbs)

    def request(self, unit: str, request: Request, timeout_s: float = 1.0, patience_s: float = 0.3) -> Reply:
        """Send a request and wait for the reply; only while the process is set up."""
        reply = self._session.request(unit, request, timeout_s, patience_s)
        self._replies.append(encode(reply))
        return reply
