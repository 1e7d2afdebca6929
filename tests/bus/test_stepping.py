"""Promises of a process that works in steps: input waits for the next step, and all input is published."""

import math
import zlib
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
from support.bus import answering
from support.waiting import DEADLINE_S, FakeClock, wait_for

from rcopterx.bus import channels
from rcopterx.bus.codec import decode, encode
from rcopterx.bus.log_messages import AgentSteps, RoundedEstimate
from rcopterx.bus.message import InvalidMessageError, Message
from rcopterx.bus.messages import Pose
from rcopterx.bus.requests import Land, Recall, RecallReply, Request
from rcopterx.bus.session import Incoming, Session
from rcopterx.bus.stepping import STEPS_PER_MESSAGE, StepBus
from rcopterx.bus.subscription import Inbox

ESTIMATE = [float(number) for number in range(16)]


class FakeSession:
    """A session without a bus: tests deliver messages and requests, and see what is published."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.published: list[AgentSteps] = []
        self.incoming: list[Incoming] = []
        self.replies: list[RecallReply] = []
        self._deliverers: list[tuple[Inbox[Any], Callable[[Inbox[Any], bytes, float], None]]] = []

    def wake(self) -> None: ...

    def subscribe(
        self, channel: Any, unit: str, depth: int, *, waking: bool, deliver: Callable[..., None]
    ) -> Inbox[Any]:
        del waking
        inbox = Inbox(channel, depth, unit)
        self._deliverers.append((inbox, deliver))
        return inbox

    def arrive(self, subscription: int, message: Message) -> None:
        inbox, deliver = self._deliverers[subscription]
        deliver(inbox, encode(message), self.clock())

    def publish(self, channel: Any, unit: str, message: AgentSteps) -> None:
        assert channel is channels.AGENT_STEPS
        assert unit == "h1"
        self.published.append(message)

    def pending(self) -> list[Incoming]:
        incoming, self.incoming = self.incoming, []
        return incoming

    def request(self, _unit: str, _request: Request, _timeout_s: float, _patience_s: float) -> RecallReply:
        return self.replies.pop(0)


@pytest.fixture
def session() -> FakeSession:
    return FakeSession()


@pytest.fixture
def stepped(session: FakeSession) -> StepBus:
    return StepBus(cast(Session, session))


def pose(frame: int) -> Pose:
    return Pose(epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=True)


def test_what_arrives_during_a_step_waits_for_the_next_one(session: FakeSession, stepped: StepBus) -> None:
    inbox = stepped.subscribe(channels.POSE, "h1")
    began_s = stepped.begin_step()
    session.clock.advance(1.0)
    session.arrive(0, pose(2))
    assert inbox.latest() is None
    assert stepped.clock() == began_s
    assert stepped.begin_step() == stepped.clock() == began_s + 1.0
    received = inbox.latest()
    assert received is not None
    assert received.message.frame == 2


def test_an_event_takes_effect_in_the_next_step_only(stepped: StepBus) -> None:
    stepped.begin_step()
    stepped.note("event")
    assert "event" not in stepped.events
    stepped.begin_step()
    assert "event" in stepped.events
    stepped.begin_step()
    assert "event" not in stepped.events


def test_steps_of_a_real_session_are_published(join: Callable[..., Session]) -> None:
    stepped, other = StepBus(join()), join()
    inbox, steps = stepped.subscribe(channels.POSE, "h1"), other.subscribe(channels.AGENT_STEPS, "h1")

    def arrived() -> bool:
        other.publish(channels.POSE, "h1", pose(1))
        stepped.begin_step()
        stepped.end_step("h1", ESTIMATE)
        return inbox.latest() is not None and steps.latest() is not None

    wait_for(arrived, "no steps")
    received = steps.latest()
    assert received is not None
    assert received.message.life == stepped.life
    assert received.message.estimate == RoundedEstimate.of(ESTIMATE)
    assert received.message.estimate.to_numpy().tolist() == ESTIMATE


@pytest.mark.parametrize("place", [0, 7, 15])
def test_an_estimate_that_is_no_number_is_published_as_far_away(place: int) -> None:
    far = -(2.0**31 - 1.0) * RoundedEstimate.UNIT
    estimate = [1.0] * 16
    estimate[place] = math.nan
    rounded = RoundedEstimate.of(estimate).to_numpy()
    assert rounded[place] == far
    assert np.delete(rounded, place).tolist() == [1.0] * 15


def test_columns_of_inputs_belong_together(session: FakeSession, stepped: StepBus) -> None:
    stepped.subscribe(channels.POSE, "h9")
    inbox = stepped.subscribe(channels.POSE, "h1", depth=4)
    for frame in (1, 2):
        session.arrive(1, pose(frame))
        stepped.begin_step()
    stepped.end_step("h1", None)
    assert session.published == []
    stepped.end_step("h1", ESTIMATE)
    (message,) = session.published
    assert decode(encode(message), AgentSteps) == message
    assert message.counts == (1, 1)
    assert message.keys == ("h1/pose", "h1/pose")
    assert message.subscriptions == (2, 2)
    assert message.checksums == tuple(zlib.crc32(encode(pose(frame))) for frame in (1, 2))
    assert [received.message.frame for received in inbox.drain()] == [1, 2]


def test_what_was_given_up_for_time_is_published_with_its_step(
    session: FakeSession, stepped: StepBus
) -> None:
    for overtime in ([(3, 2)], [], [(1, 0), (4, 7)]):
        stepped.begin_step()
        stepped.end_step("h1", None if len(overtime) < 2 else ESTIMATE, overtime)
    stepped.begin_step()
    stepped.end_step("h1", ESTIMATE)
    assert [message.overtime for message in session.published] == [((0, 3, 2), (2, 1, 0), (2, 4, 7)), ()]
    assert decode(encode(session.published[0]), AgentSteps) == session.published[0]


def test_a_process_without_control_periods_publishes_its_steps_in_groups(
    session: FakeSession, stepped: StepBus
) -> None:
    for _ in range(2 * STEPS_PER_MESSAGE):
        stepped.begin_step()
        stepped.end_step("h1", None)
    assert [len(message.times_s) for message in session.published] == 2 * [STEPS_PER_MESSAGE]
    assert [message.number for message in session.published] == [0, 1]


def test_steps_that_are_not_published_leave_a_gap_in_the_numbers(
    session: FakeSession, stepped: StepBus
) -> None:
    for enabled in (True, False, True):
        stepped.publishing = enabled
        stepped.begin_step()
        stepped.end_step("h1", ESTIMATE)
    assert [message.number for message in session.published] == [0, 2]


def test_replies_are_published(session: FakeSession, stepped: StepBus) -> None:
    session.replies.append(RecallReply(accepted=True, age_s=2.0))
    reply = stepped.request("h1", Recall(vehicle="h1"))
    stepped.begin_step()
    stepped.end_step("h1", ESTIMATE)
    (message,) = session.published
    assert [decode(payload, RecallReply) for payload in message.replies] == [reply]


def test_requests_are_inputs(session: FakeSession, stepped: StepBus) -> None:
    session.incoming.append(Incoming("h1", "land", Land(), encode(Land()), 0.0, lambda _: None))
    stepped.begin_step()
    assert isinstance(stepped.requests[0].request, Land)
    stepped.end_step("h1", ESTIMATE)
    assert session.published[0].keys == ("request/land",)


def test_a_real_session_answers_requests_of_steps(join: Callable[..., Session]) -> None:
    server, client = join(), StepBus(join())
    server.serve("h1", ["recall"])
    with answering(server, lambda _: RecallReply(accepted=True, age_s=2.0)):
        reply = client.request("h1", Recall(vehicle="h1"), timeout_s=DEADLINE_S, patience_s=DEADLINE_S)
    assert isinstance(reply, RecallReply)
    assert reply.age_s == 2.0


def test_columns_of_other_lengths_are_refused() -> None:
    steps = AgentSteps(
        life=1, began_s=0.0, number=0, times_s=(1.0,), counts=(2,), keys=("a",), subscriptions=(1,),
        checksums=(1,), arrivals_s=(0.0,),
    )  # fmt: skip
    with pytest.raises(InvalidMessageError, match="not as many inputs"):
        steps.check()
