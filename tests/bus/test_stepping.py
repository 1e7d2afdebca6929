"""Promises of a process that works in steps: nothing changes within one, and all that enters it is noted."""

import math
import zlib
from collections.abc import Callable

import numpy as np
import pytest
from support.bus import answering
from support.waiting import DEADLINE_S, FakeClock, wait_for

from rcopterx.bus import channels
from rcopterx.bus.codec import decode, encode
from rcopterx.bus.log_messages import AgentSteps, RoundedEstimate
from rcopterx.bus.message import InvalidMessageError
from rcopterx.bus.messages import Pose
from rcopterx.bus.requests import Land, Recall, RecallReply
from rcopterx.bus.session import Session
from rcopterx.bus.stepping import STEPS_TOLD, SteppedSession

Join = Callable[..., Session]


def pose(frame: int) -> Pose:
    return Pose(epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=True)


def stepped_until(stepped: SteppedSession, condition: Callable[[], bool], what: str) -> None:
    def step() -> bool:
        stepped.begin_step()
        return condition()

    wait_for(step, what)


def test_what_arrives_during_a_step_waits_for_the_next_one(join: Join) -> None:
    clock = FakeClock()
    stepped, sender = SteppedSession(join(clock=clock)), join()
    arrived = []
    inbox = stepped.subscribe(channels.POSE, "h1")
    store = inbox.store
    stepped_until(
        stepped, lambda: bool(sender.publish(channels.POSE, "h1", pose(1)) or inbox.latest()), "no pose"
    )
    before_s = stepped.clock()
    clock.advance(1.0)
    inbox.store = lambda payload, arrived_s: (arrived.append(payload), store(payload, arrived_s))  # type: ignore[assignment, func-returns-value]
    sender.publish(channels.POSE, "h1", pose(2))
    second = encode(pose(2))
    wait_for(lambda: any(i.payload == second for i in stepped._waiting), "the pose does not arrive")
    assert arrived == []
    assert stepped.clock() == before_s
    received = inbox.latest()
    assert received is not None
    assert received.message.frame == 1
    stepped.begin_step()
    assert second in arrived
    assert stepped.clock() == before_s + 1.0


def test_steps_are_told_with_all_that_they_took_in(join: Join) -> None:
    clock = FakeClock()
    bus, other = join(clock=clock), join()
    told = other.subscribe(channels.AGENT_STEPS, "h1", depth=8)
    stepped = SteppedSession(bus)
    stepped.subscribe(channels.POSE, "h9")
    inbox = stepped.subscribe(channels.POSE, "h1")
    stepped_until(
        stepped, lambda: bool(other.publish(channels.POSE, "h1", pose(1)) or inbox.latest()), "no pose"
    )
    stepped.note("word")
    stepped.begin_step()
    assert "word" in stepped.words
    stepped.begin_step()
    assert "word" not in stepped.words
    estimate = [float(number) for number in range(16)]

    def heard() -> bool:
        stepped.end_step("h1", estimate)
        stepped.begin_step()
        return told.latest() is not None

    wait_for(heard, "no steps")
    # The first ones may have been told before the subscription was known everywhere.
    received = told.latest()
    assert received is not None
    assert received.message.life == stepped.life
    assert received.message.estimate == RoundedEstimate.of(estimate)
    assert received.message.estimate.to_numpy().tolist() == estimate


@pytest.mark.parametrize("place", [0, 7, 15])
def test_an_estimate_that_is_no_number_is_told_as_far_away(place: int) -> None:
    far = -(2.0**31 - 1.0) * RoundedEstimate.UNIT
    estimate = [1.0] * 16
    estimate[place] = math.nan
    told = RoundedEstimate.of(estimate).to_numpy()
    assert told[place] == far
    assert np.delete(told, place).tolist() == [1.0] * 15


def test_columns_of_inputs_belong_together(join: Join) -> None:
    stepped, sent = SteppedSession(join(clock=FakeClock())), []
    stepped._session.publish = lambda channel, unit, message: sent.append((channel, unit, message))  # type: ignore[method-assign]
    inbox = stepped.subscribe(channels.POSE, "h1", depth=4)
    for frame in (1, 2):
        stepped._deliverer()  # a subscription without messages
        stepped._waiting.append(stepped_input(stepped, inbox, frame))
        stepped.begin_step()
    stepped.end_step("h1", None)
    assert sent == []
    stepped.end_step("h1", 16 * [0.0])
    ((channel, unit, message),) = sent
    assert (channel, unit) == (channels.AGENT_STEPS, "h1")
    assert decode(encode(message), AgentSteps) == message
    assert message.counts == (1, 1)
    assert message.keys == ("h1/pose", "h1/pose")
    assert message.checksums == tuple(zlib.crc32(encode(pose(frame))) for frame in (1, 2))
    assert [received.message.frame for received in inbox.drain()] == [1, 2]


def test_what_was_given_up_for_time_is_told_with_its_step(join: Join) -> None:
    stepped, sent = SteppedSession(join(clock=FakeClock())), []
    stepped._session.publish = lambda channel, unit, message: sent.append(message)  # type: ignore[method-assign]
    for overtime in ([(3, 2)], [], [(1, 0), (4, 7)]):
        stepped.begin_step()
        stepped.end_step("h1", None if len(overtime) < 2 else 16 * [0.0], overtime)
    stepped.begin_step()
    stepped.end_step("h1", 16 * [0.0])
    assert [message.overtime for message in sent] == [((0, 3, 2), (2, 1, 0), (2, 4, 7)), ()]
    assert decode(encode(sent[0]), AgentSteps) == sent[0]


def stepped_input(stepped: SteppedSession, inbox: object, frame: int) -> object:
    deliverer = stepped._deliverer()
    deliverer(inbox, encode(pose(frame)), 0.1 * frame)  # type: ignore[arg-type]
    return stepped._waiting.pop()


def test_a_process_that_controls_nothing_tells_its_steps_now_and_then(join: Join) -> None:
    stepped, sent = SteppedSession(join(clock=FakeClock())), []
    stepped._session.publish = lambda channel, unit, message: sent.append(message)  # type: ignore[method-assign]
    for _ in range(2 * STEPS_TOLD):
        stepped.begin_step()
        stepped.end_step("h1", None)
    assert [len(message.times_s) for message in sent] == [STEPS_TOLD, STEPS_TOLD]
    assert [message.number for message in sent] == [0, 1]


def test_steps_that_are_not_told_leave_a_gap_in_the_numbers(join: Join) -> None:
    told = join().subscribe(channels.AGENT_STEPS, "h1", depth=8)
    stepped = SteppedSession(join())
    numbers: list[int] = []

    def step() -> None:
        stepped.begin_step()
        stepped.end_step("h1", 16 * [0.0])

    def heard_beyond(number: int) -> bool:
        step()
        numbers.extend(received.message.number for received in told.drain())
        return max(numbers, default=-1) > number

    wait_for(lambda: heard_beyond(-1), "no steps")
    stepped.tell_steps(False)
    silent = stepped._told
    step()
    stepped.tell_steps(True)
    wait_for(lambda: heard_beyond(silent), "no steps after the gap")
    assert silent not in numbers


def test_requests_are_inputs_and_replies_are_told(join: Join) -> None:
    stepped, other, sent = SteppedSession(join(clock=FakeClock())), join(), []
    other.serve("h1", ["recall"])
    with answering(other, lambda _: RecallReply(accepted=True, age_s=2.0)):
        reply = stepped.request("h1", Recall(vehicle="h1"), timeout_s=DEADLINE_S, patience_s=DEADLINE_S)
    stepped._session.publish = lambda channel, unit, message: sent.append(message)  # type: ignore[method-assign]
    stepped.begin_step()
    stepped.end_step("h1", 16 * [0.0])
    (message,) = sent
    assert [decode(payload, RecallReply) for payload in message.replies] == [reply]
    stepped.serve("h1", ["land"])
    stepped_until(stepped, lambda: bool(ask(other)) or bool(stepped.requests), "no request")
    assert isinstance(stepped.requests[0].request, Land)


def ask(session: Session) -> None:
    """Ask without waiting for the answer."""
    key = channels.request_key(session.address.fleet, "h1", "land")
    session._zenoh.get(key, payload=encode(Land()), timeout=0.2)


def test_columns_of_other_lengths_are_refused() -> None:
    steps = AgentSteps(
        life=1, began_s=0.0, number=0, times_s=(1.0,), counts=(2,), keys=("a",), subscriptions=(1,),
        checksums=(1,), arrivals_s=(0.0,),
    )  # fmt: skip
    with pytest.raises(InvalidMessageError, match="not as many inputs"):
        steps.check()
