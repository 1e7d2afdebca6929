"""The bus of a replayed agent: inputs come from a flight log, published messages are compared."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from rcopterx.bus.channels import LEASE, Channel
from rcopterx.bus.codec import decode
from rcopterx.bus.message import Message
from rcopterx.bus.requests import VERBS, RecallReply, Reply, Request
from rcopterx.bus.session import Incoming, RequestFailedError
from rcopterx.bus.stepping import REQUEST, StepBus
from rcopterx.bus.subscription import Inbox, Waking
from rcopterx_studies.replay.recorded_agent import AgentLife, AgentStep

M = TypeVar("M", bound=Message)


class ReplayBus(StepBus):
    """A bus without a session: inputs are those of a recorded agent, `published` gets what it sends."""

    def __init__(self, life: AgentLife, published: Callable[[Channel[Any], Message], None]) -> None:
        self.life = life.life
        self.missing = 0  # inputs so far that the flight log does not have
        self._published = published
        self._now_s = life.began_s
        self._granted = life.granted
        self._replies = list(life.replies)
        self._inboxes: list[Callable[[str], Inbox[Any] | None]] = []  # inbox of a unit, if subscribed
        self.requests: list[Incoming] = []
        self.events: set[str] = set()
        self._step: AgentStep | None = None
        self.estimate: Sequence[float] | None = None  # of the replayed agent's newest control period

    def take(self, step: AgentStep) -> None:
        """Set the inputs of the next step."""
        self._step = step

    def begin_step(self) -> float:
        """See `StepBus.begin_step`."""
        self.events.clear()
        if self._step is None:
            return self._now_s
        self._now_s = self._step.time_s
        for item in self._step.inputs:
            head, _, rest = item.key.partition("/")
            if item.payload is None:
                self.missing += 1
            elif not rest:
                self.events.add(head)
            elif head == REQUEST:
                request = decode(item.payload, VERBS[rest].request)
                self.requests.append(
                    Incoming("", rest, request, item.payload, item.arrived_s, lambda _: None)
                )
            elif item.subscription <= len(self._inboxes):
                inbox = self._inboxes[item.subscription - 1](head)
                if inbox is not None:
                    inbox.store(item.payload, item.arrived_s)
        self._step = None
        return self._now_s

    def end_step(
        self, _vehicle: str, estimate: Sequence[float] | None, _overtime: Sequence[tuple[int, int]] = ()
    ) -> None:
        """See `StepBus.end_step`."""
        self.estimate = estimate

    def note(self, event: str) -> None:
        """See `StepBus.note`; the flight log has the time of its effect."""

    def subscribe(self, channel: Channel[M], unit: str, depth: int = 1, *, waking: Waking = True) -> Inbox[M]:
        """See `StepBus.subscribe`."""
        del waking
        inbox = Inbox(channel, depth, unit)
        if channel is LEASE and self._granted is not None:
            inbox.store(self._granted, self._now_s)
        self._inboxes.append({unit: inbox}.get)
        return inbox

    def subscribe_all(self, channel: Channel[M], *, waking: Waking = True) -> Mapping[str, Inbox[M]]:
        """See `StepBus.subscribe_all`."""
        del waking
        inboxes: dict[str, Inbox[M]] = {}
        self._inboxes.append(lambda unit: inboxes.setdefault(unit, Inbox(channel, 1, unit)))
        return inboxes

    def publish(self, channel: Channel[M], unit: str, message: M) -> None:
        """See `StepBus.publish`."""
        del unit
        self._published(channel, message)

    def serve(self, unit: str, verbs: list[str]) -> None:
        """See `StepBus.serve`."""

    def request(self, unit: str, request: Request, timeout_s: float = 1.0, patience_s: float = 0.3) -> Reply:
        """See `StepBus.request`: returns the recorded reply."""
        del request, timeout_s, patience_s
        if not self._replies:
            raise RequestFailedError(f"{unit} was not answered")
        return decode(self._replies.pop(0), RecallReply)
