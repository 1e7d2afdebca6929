"""A process's connection to the bus: publish, subscribe, send and serve requests."""

import time
import weakref
from collections.abc import Callable, Collection, Iterable
from contextlib import AbstractContextManager, ExitStack, closing, suppress
from dataclasses import dataclass
from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

import zenoh

from rcopterx.bus import channels
from rcopterx.bus.attachments import attached, number_of, sent_at
from rcopterx.bus.channels import Channel
from rcopterx.bus.clock import REAL_TIME, Clock
from rcopterx.bus.codec import RejectedError, decode, encode, prepare
from rcopterx.bus.endpoints import LONG_S, Credentials, client_config, open_session, reason_of
from rcopterx.bus.log_messages import AnsweredRequest
from rcopterx.bus.message import Message
from rcopterx.bus.publishing import publisher_of
from rcopterx.bus.requests import VERBS, Identify, IdentifyReply, Reply, Request, Verb, verb_of
from rcopterx.bus.subscription import (
    Deliver,
    Inbox,
    OnArrival,
    Subscription,
    UnitSubscriptions,
    Waking,
    callback_of,
)
from rcopterx.bus.wakeup import Waiter, Wakeup

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.participant import LockstepInbox, Participant

M = TypeVar("M", bound=Message)
T = TypeVar("T")

MOST_REQUESTS: Final = 256  # requests that wait for the loop of a process; further ones are rejected
RETRY_S = 0.02  # pause before a request is sent again where no process serves it
FIRST_ATTEMPT_S = 0.1  # time for one endpoint; it doubles in each round, for routers on a busy machine
SILENT_SHARE = 0.8  # share of the time-out after which an empty result means that the server did not answer


class BusUnreachableError(ConnectionError):
    """No router answered at the endpoints within the time-out."""


class RequestFailedError(RuntimeError):
    """A request was not served, not answered in time, or not understood."""


class NotServedError(RequestFailedError):
    """No process serves the request."""


prepare(channel.message for channel in channels.CHANNELS)
prepare(message for verb in VERBS.values() for message in (verb.request, verb.reply))


@dataclass(frozen=True)
class BusAddress:
    """How to reach the bus of a fleet from one of its hosts or programs."""

    endpoints: tuple[str, ...]  # of the router
    fleet: str  # name in the keys
    namespace: str | None = None  # for tests only
    host: str = ""  # name of this computer in the fleet file, empty without one
    credentials: Credentials | None = None  # for endpoints that require a certificate
    # messages of other units are discarded, so that strangers cannot fill the memory; empty permits all
    units: frozenset[str] = frozenset()
    clock: Clock = REAL_TIME
    process: str = ""
    """Name of the process, if it takes turns in lockstep."""


@dataclass(frozen=True)
class Incoming:
    """A valid request that waits for its answer."""

    unit: str
    verb: str
    request: Request
    payload: bytes  # the request as it arrived
    arrived_s: float  # monotonic clock of the process
    send: Callable[[bytes], None]  # sends the encoded reply

    def answer(self, reply: Reply) -> None:
        """Send the reply and close the request."""
        self.send(encode(reply))


class RawMessage(NamedTuple):
    """A message as it arrived; `number` is its sender's count on this key from 1 on, 0 if unknown."""

    unit: str
    topic: str
    payload: bytes
    arrived_s: float
    number: int = 0


def opened(address: BusAddress, timeout_s: float) -> zenoh.Session:
    """Open a Zenoh client of the first router that answers, tried in turn; else `BusUnreachableError`."""
    give_up_s = time.monotonic() + timeout_s
    attempt_s = FIRST_ATTEMPT_S
    reason = ""
    while True:
        for endpoint in address.endpoints:
            left_s = max(0.0, give_up_s - time.monotonic())
            limit_s = min(attempt_s, left_s)
            try:
                config = client_config(
                    [endpoint],
                    address.namespace,
                    limit_s,
                    address.credentials,
                    patient=address.clock.lockstep,
                )
                return open_session(config)
            except zenoh.ZError as error:
                reason = reason_of(error)
        if time.monotonic() >= give_up_s:
            raise BusUnreachableError(
                f"no router at {', '.join(address.endpoints)} after {timeout_s:g} s ({reason})"
            )
        attempt_s *= 2


class Session(AbstractContextManager["Session"]):
    """One open connection to the bus; raises `BusUnreachableError` if no router answers within `timeout_s`.

    `waiter` is notified on receive threads when a message or request arrived; `wait` is its wait. `clock` is
    monotonic [s], that of the fleet by default. In lockstep the first turn has begun when the constructor
    returns, unless `begin` is False, and waits end without a turn once `interrupted`.
    """

    def __init__(
        self,
        address: BusAddress,
        waiter: Waiter | None = None,
        clock: Callable[[], float] | None = None,
        timeout_s: float = 5.0,
        *,
        begin: bool = True,
        interrupted: Callable[[], bool] = lambda: False,
    ) -> None:
        self.address = address
        self.clock = clock or address.clock.now
        self._publishers: dict[tuple[str, str], Callable[[bytes], None]] = {}
        self._incoming: SimpleQueue[Incoming] = SimpleQueue()
        self._zenoh = opened(address, timeout_s)
        resources = ExitStack()
        if waiter is None:
            waiter = resources.enter_context(closing(Wakeup(address.clock)))
        self._waiter, self.wake, self.wait = waiter, waiter.notify, waiter.wait
        resources.callback(self._zenoh.close)  # before what its receive threads notify
        # An open session would keep the interpreter from ending: it waits for callbacks.
        self._close = weakref.finalize(self, resources.close)
        self.participant: Participant | None = None
        """Takes the turns of this process in lockstep; None if it takes none."""
        if address.clock.page is not None and address.process:
            # Imported here: no flight of hardware needs it.
            from rcopterx.bus.lockstep.scheduler import participant_of

            self.participant = participant_of(address.clock.page, address.process, self.await_subscriptions)
            self.participant.interrupted = interrupted
            self.wake, self._waiter.scheduled = self.participant.wake, self.participant
            if begin:
                self.begin()

    def begin(self, start_limit_s: float | None = None) -> None:
        """Take the first turn in lockstep; with a limit once all other processes are there.

        Raises `TimeoutError`: some are missing after this real time; the session is closed then.
        """
        if self.participant is None:
            return
        try:
            if start_limit_s is not None:
                self.participant.await_others(start_limit_s)
        except TimeoutError:
            self.close()
            raise
        self.participant.begin()

    def wait_in(self, call: Callable[[float], T], timeout_s: float, descriptors: Collection[int] = ()) -> T:
        """Return the result of a call that waits by itself for a time [s], in lockstep after the wait."""
        if self.participant is None:
            return call(timeout_s)
        self.participant.wait(timeout_s, descriptors)
        return call(0.0)

    def finish_first(self, work: Callable[[], None]) -> None:
        """Let waits in lockstep call `work` first: what threads have begun counts in the same turn."""
        if self.participant is not None:
            self.participant.before_wait = work

    def take_no_turns(self, process: str) -> None:
        """Enter a process that the time of the fleet, in lockstep, need not wait for."""
        if self.address.clock.page is not None:
            from rcopterx.bus.lockstep.participant import join_without_turns

            self.await_subscriptions()
            join_without_turns(self.address.clock.page, process)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the bus; done at the end of the program otherwise."""
        if self.participant is not None:
            self.participant.leave()
            self.participant = self._waiter.scheduled = None
        self._close()

    def await_subscriptions(self) -> None:
        """Wait for an answer of the router, which has handled all earlier subscriptions by then."""
        key = channels.request_key(self.address.fleet, self.address.host, "identify")
        for _ in self._zenoh.get(key, payload=encode(Identify()), timeout=LONG_S):
            pass

    def publish(self, channel: Channel[M], unit: str, message: M) -> None:
        """Send a message; never blocks, drops on congestion."""
        place = unit, channel.topic
        if place not in self._publishers:
            key = channels.key(self.address.fleet, *place)
            self._publishers[place] = publisher_of(self._zenoh, self.participant, channel, key)
        self._publishers[place](encode(message))

    def republish(self, unit: str, topic: str, payload: bytes) -> None:
        """Send a message of a flight log again, unchanged."""
        key = channels.key(self.address.fleet, unit, topic)
        self._zenoh.put(key, payload, congestion_control=zenoh.CongestionControl.DROP)

    def subscribe(
        self,
        channel: Channel[M],
        unit: str,
        depth: int = 1,  # messages kept until they are read
        *,
        # whether messages wake the loop; a function decides for each message, on the receive thread
        waking: Waking = True,
        fleet: str | None = None,  # another fleet than the own one
        own: bool = True,  # whether messages of this session are received, too
        deliver: Deliver = Inbox.store,  # called on the receive thread to put a payload into the inbox
    ) -> Subscription[M]:
        """Receive a channel of one unit."""
        full_key = channels.key(fleet or self.address.fleet, unit, channel.topic)
        origin = zenoh.Locality.ANY if own else zenoh.Locality.REMOTE
        on_arrival, reception = self._on_arrival(waking, deliver), self._reception(full_key, waking)
        return Subscription(self._zenoh, channel, full_key, on_arrival, depth, origin, reception)

    def subscribe_all(
        self, channel: Channel[M], depth: int = 1, *, waking: Waking = True, deliver: Deliver = Inbox.store
    ) -> UnitSubscriptions[M]:
        """Receive a channel of every unit; parameters as in `subscribe`."""
        pattern = channels.key(self.address.fleet, "*", channel.topic)
        on_arrival, reception = self._on_arrival(waking, deliver), self._reception(pattern, waking)
        units = self.address.units
        return UnitSubscriptions(self._zenoh, channel, pattern, on_arrival, depth, units, reception)

    def _on_arrival(self, waking: Waking, deliver: Deliver) -> OnArrival:
        """Return what delivers a payload with the time of its arrival, and wakes the loop."""

        def arrived(inbox: Inbox[Any], payload: bytes) -> None:
            deliver(inbox, payload, self.clock())
            if waking() if callable(waking) else waking:
                self.wake()

        return arrived

    def _reception(self, key: str, waking: Waking) -> "LockstepInbox | None":
        """Return what holds messages of a key back in lockstep."""
        return None if self.participant is None else self.participant.receive(key, waking=waking is not False)

    def tap(self, store: Callable[[RawMessage], None], topic: str = "*", fleet: str | None = None) -> None:
        """Receive all messages of a fleet, or of one topic, undecoded; receive threads call `store`."""
        units = self.address.units

        def on_sample(sample: zenoh.Sample) -> None:
            chunks = str(sample.key_expr).split("/")
            # A message on a wildcard key belongs to no unit.
            if len(chunks) == 4 and "*" not in str(sample.key_expr) and (not units or chunks[2] in units):
                attachment = attached(sample.attachment)
                sent_s, number = sent_at(attachment), number_of(attachment)
                arrived_s = self.clock() if sent_s is None else sent_s
                store(RawMessage(chunks[2], chunks[3], sample.payload.to_bytes(), arrived_s, number))

        pattern = channels.key(fleet or self.address.fleet, "*", topic)
        self._zenoh.declare_subscriber(pattern, callback_of(on_sample, None))

    def serve(self, unit: str, verbs: list[str]) -> None:
        """Accept requests for a unit; they wait in `pending` until the loop answers them."""
        for verb in verbs:
            key = channels.request_key(self.address.fleet, unit, verb)
            inbox = None if self.participant is None else self.participant.serve(key)
            on_query = callback_of(partial(self._on_query, unit, verb), inbox)
            self._zenoh.declare_queryable(key, on_query, complete=True)

    def _on_query(self, unit: str, verb: str, query: zenoh.Query) -> None:
        payload = query.payload.to_bytes() if query.payload is not None else b""
        try:
            request = decode(payload, VERBS[verb].request)
            if self._incoming.qsize() >= MOST_REQUESTS:
                raise RejectedError("overrun", f"{MOST_REQUESTS} requests are waiting already")
        except RejectedError as error:
            with query:
                query.reply_err(f"{verb}: {error}".encode())
            return
        arrived_s = self.clock()

        def send(reply: bytes) -> None:
            participant = self.participant
            stamp = None if participant is None else participant.reply_stamp(attached(query.attachment))
            with query:
                query.reply(query.key_expr, reply, attachment=stamp)
            if not VERBS[verb].recorded:
                return
            took_s = max(0.0, self.clock() - arrived_s)
            answered = AnsweredRequest(verb=verb, request=payload, reply=reply, took_s=took_s)
            self.publish(channels.ANSWERED, unit, answered)

        self._incoming.put(Incoming(unit, verb, request, payload, arrived_s, send))
        self.wake()

    def pending(self) -> list[Incoming]:
        """Return the requests that arrived since the last call; each must be answered."""
        return [self._incoming.get_nowait() for _ in range(self._incoming.qsize())]

    def request(self, unit: str, request: Request, timeout_s: float = 1.0, patience_s: float = 0.3) -> Reply:
        """Send a request to a unit and wait for the reply; the type of the request determines the verb.

        `timeout_s`: for the reply of a process that serves the verb, in the time of the fleet. `patience_s`:
        for a process to serve it, in the time of the fleet and at least in real time: one that has just been
        replaced is not found for a moment. A request whose link is lost meanwhile is sent again. Raises
        `NotServedError`: no process serves it. Raises `RequestFailedError`: no reply in time, rejected as
        malformed, the reply is malformed, or the session is closed.
        """
        verb = verb_of(type(request))
        key = channels.request_key(self.address.fleet, unit, verb.name)
        payload = encode(request)
        limit_s = self.address.clock.real_s(timeout_s)
        give_up_s = self.clock() + patience_s * max(1.0, self.address.clock.speed)
        while True:
            asked_s, sent_s = self.clock(), time.monotonic()
            try:
                serving = self.participant if self.participant and self.participant.serves(key) else None
                replies: Iterable[zenoh.Reply] = (
                    self._zenoh.get(key, payload=payload, timeout=limit_s)
                    if serving is None
                    else serving.request(partial(self._zenoh.get, key, payload=payload), key, timeout_s)
                )
            except zenoh.ZError as error:
                raise RequestFailedError(f"{verb.name} was not sent to {unit}: {error}") from error
            for reply in replies:
                if reply.ok is not None:
                    return self._reply(unit, verb, reply.ok.payload.to_bytes())
                text = reply.err.payload.to_bytes().decode(errors="replace") if reply.err else ""
                raise RequestFailedError(f"{unit} did not answer {verb.name}: {text}")
            # Some time-outs come without an error; without a server Zenoh answers at once.
            if serving is not None or time.monotonic() - sent_s >= SILENT_SHARE * limit_s:
                raise RequestFailedError(f"{unit} did not answer {verb.name}: Timeout")
            # In between, the link to the server or that to the router was lost.
            give_up_s += self.clock() - asked_s
            if self.clock() >= give_up_s:
                raise NotServedError(f"no process serves {verb.name} for {unit}")
            self.wait_in(time.sleep, RETRY_S)

    def identify(self, timeout_s: float = 0.5) -> list[IdentifyReply]:
        """Return the answer of each linked router that knows which fleet it serves."""
        pattern = channels.request_key("*", "*", "identify")
        found = []
        for reply in self._zenoh.get(
            pattern, payload=encode(Identify()), timeout=timeout_s, target=zenoh.QueryTarget.ALL
        ):
            if reply.ok is not None:
                with suppress(RejectedError):
                    found.append(decode(reply.ok.payload.to_bytes(), IdentifyReply))
        return found

    def _reply(self, unit: str, verb: Verb, payload: bytes) -> Reply:
        try:
            return decode(payload, verb.reply)
        except RejectedError as error:
            raise RequestFailedError(f"{unit} answered {verb.name} with an invalid reply: {error}") from None
