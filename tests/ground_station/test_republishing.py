"""Promises of a flight log that is put on the bus again: every message as it was, at its time."""

from collections.abc import Callable
from pathlib import Path

from support.waiting import FakeClock, wait_for

from rcopterx.bus.session import RawMessage, Session
from rcopterx.flights.mcap_reading import messages_of
from rcopterx.ground_station.republishing import fleet_of, republish

Join = Callable[..., Session]
FLIGHT = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"


def test_every_message_is_sent_again_as_it_was(join: Join) -> None:
    heard: list[RawMessage] = []
    listener, sender = join(), join()
    listener.tap(heard.append)
    wait_for(lambda: bool(heard) or sender.republish("h1", "pose", b"x"), "nobody hears")
    heard.clear()
    clock = FakeClock()
    waited: list[float] = []

    def wait(seconds: float) -> bool:
        waited.append(seconds)
        clock.advance(seconds)
        return False

    recorded = list(messages_of(FLIGHT))
    assert republish([FLIGHT], sender, 2.0, wait, clock) == len(recorded)
    seconds = (recorded[-1].time_ns - recorded[0].time_ns) / 1e9
    assert abs(sum(waited) - seconds / 2.0) < 0.01
    last = recorded[-1]
    unit, _, topic = last.topic.partition("/")

    def last_heard() -> bool:
        # Under load some are dropped, as on every bus.
        sender.republish(unit, topic, last.payload)
        return any(message.payload == last.payload for message in heard)

    wait_for(last_heard, "the end is not heard")
    sent = {(m.topic, m.payload) for m in recorded}
    assert {(f"{h.unit}/{h.topic}", h.payload) for h in heard if h.payload != b"x"} <= sent


def test_a_replay_ends_when_it_is_asked_to(join: Join) -> None:
    assert republish([FLIGHT], join(), 1.0, lambda _: True, FakeClock()) < 10


def test_a_flight_knows_its_fleet() -> None:
    assert list(fleet_of([FLIGHT]).vehicles) == ["h1", "h2"]
