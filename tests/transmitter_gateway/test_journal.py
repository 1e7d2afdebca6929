"""Promises of the journal: every call once and in order, in messages that name what is missing."""

from gateway_bench import NAMES, Laboratory

from rcopterx.bus.codec import decode, encode
from rcopterx.bus.log_messages import ArbiterCalls
from rcopterx.bus.messages import TransmitterStatus
from rcopterx.transmitter_gateway.journal import CALLS_PER_MESSAGE, MOST_CALLS, Journal
from rcopterx.transmitter_gateway.process import STATUS_PERIOD_S


def test_calls_are_taken_once_in_order_and_in_limited_messages() -> None:
    journal = Journal(7.0)
    for number in range(CALLS_PER_MESSAGE + 1):
        journal.note("pose", "h1", float(number), 1, number)
    first, second = journal.take(), journal.take()
    assert (first.began_s, first.number, second.number) == (7.0, 0, CALLS_PER_MESSAGE)
    assert [call[3][1] for call in (*first.calls, *second.calls)] == list(range(CALLS_PER_MESSAGE + 1))
    assert journal.take().calls == ()


def test_a_message_of_full_length_can_be_sent() -> None:
    journal = Journal()
    for _ in range(CALLS_PER_MESSAGE):
        journal.note(
            "take_over", "a" * 31, 1e9 + 1e-7, "armed", (0.1, 0.2, 0.3, 0.4), *[1e9 + 1e-7] * 6, True
        )
    taken = journal.take()
    assert decode(encode(taken), ArbiterCalls) == taken


def test_without_a_bus_the_oldest_calls_are_dropped_and_leave_a_gap_in_the_numbers() -> None:
    journal = Journal()
    for number in range(MOST_CALLS + 5):
        journal.note("step", "h1", float(number))
    taken = journal.take()
    assert (taken.number, taken.calls[0]) == (5, ("step", "h1", 5.0, ()))


def test_what_has_not_changed_is_noted_once_for_each_vehicle() -> None:
    journal = Journal()
    for state, vehicle in (("up", "h1"), ("up", "h1"), ("up", "h2"), ("ready", "h1"), ("up", "h1")):
        journal.note_change("link", vehicle, 0.0, state, None)
    noted = [(vehicle, arguments[0]) for _, vehicle, _, arguments in journal.take().calls]
    assert noted == [("h1", "up"), ("h2", "up"), ("h1", "ready"), ("h1", "up")]


def test_a_gateway_publishes_the_calls_of_all_its_vehicles_with_its_statuses(laboratory: Laboratory) -> None:
    laboratory.fly()
    messages = [
        (unit, message) for unit, message in laboratory.bus.published if isinstance(message, ArbiterCalls)
    ]
    assert {unit for unit, _ in messages} == {NAMES[0]}
    assert abs(len(messages) - laboratory.bus.now_s / STATUS_PERIOD_S) < 2
    assert [message.number for _, message in messages] == [
        sum(len(earlier.calls) for _, earlier in messages[:place]) for place in range(len(messages))
    ]
    calls = [call for _, message in messages for call in message.calls]
    assert {(call, vehicle) for call, vehicle, *_ in calls} >= {
        (call, name)
        for name in NAMES
        for call in ("resume", "bid", "pose", "command", "link", "request", "step", "reason", "written")
    }
    # One of each pose, not one for each vehicle that it concerns.
    poses = [(vehicle, *arguments) for call, vehicle, _, arguments in calls if call == "pose"]
    assert len(poses) == len(set(poses))


def test_a_gateway_that_ends_publishes_its_last_calls(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.height_m = 0.0
    laboratory.thrust = 0.0
    laboratory.gateway.shut_down()
    published = [each for _, each in laboratory.bus.published if isinstance(each, ArbiterCalls)]
    written = sum(call == "written" for message in published for call, *_ in message.calls)
    assert written == sum(len(laboratory.applied(name)) for name in NAMES)
    assert laboratory.radios_of_gateway.journal.take().calls == ()


def test_statuses_have_the_counters_of_arbiter_port_and_protocol(laboratory: Laboratory) -> None:
    laboratory.fly()
    statuses = [each for _, each in laboratory.bus.published if isinstance(each, TransmitterStatus)]
    assert statuses[-1].counters["openings"] == 1
    assert statuses[-1].counters["entered ARMED"] == 1
    assert statuses[-1].counters["frames written"] > 0
