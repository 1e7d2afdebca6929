"""Messages of schemes: what is sent, what is understood, what is rejected and counted."""

import math

import msgspec
import numpy as np
import pytest
from pilot_bench import HOVER, airborne, real
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.cooperation import MOST_EXCHANGES, SILENT_S, Cooperation, Unpacked
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.following.leader_plans import followed_leader
from rcopterx.agents.guards.step_guard import StepGuard
from rcopterx.agents.scheme_messages import LaterExchanges, scheme_message, unpacked
from rcopterx.bus.codec import decode, encode
from rcopterx.bus.external_messages import MAX_PAYLOAD_BYTES, SchemeMessage
from rcopterx.bus.messages import LeaderLink
from rcopterx.control.interfaces import Estimate
from rcopterx.control.plugins import CONTROLLERS, SCHEMES
from rcopterx.control.references.trajectory import hold
from rcopterx.control.scheme import MAX_MESSAGE_BYTES, Situation
from rcopterx_studies.schemes.consensus import ConsensusScheme, ConsensusSettings
from rcopterx_studies.schemes.tracked import Moving

PERIOD_S = 0.02


class Loud(ConsensusScheme):
    """Sends more than is allowed."""

    class Message(msgspec.Struct):
        text: str

    def exchange(self, situation: Situation) -> msgspec.Struct:  # type: ignore[override]
        return self.Message("x" * (MAX_MESSAGE_BYTES + 1))


class Curious(ConsensusScheme):
    """Keeps its last situation."""

    def exchange(self, situation: Situation) -> msgspec.Struct | None:
        self.situation = situation
        return super().exchange(situation)


def cooperation(vehicle: str, leader: str | None = None, kind: type = Curious) -> Cooperation:
    clock = FleetClock()
    clock.frames_until(1, 50, PERIOD_S)
    links = [LeaderLink(leader=leader, offset_m=(-0.5, 0.2, 0.0))] if leader else []
    guidance = Guidance([followed_leader(link) for link in links])
    scheme = kind(COAXIAL_LAG, PERIOD_S, ConsensusSettings())
    made = Cooperation(guidance, StepGuard(COAXIAL_LAG, scheme), clock)
    made.vehicle = vehicle
    made.use(scheme)
    motion = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    estimate = Estimate(motion, COAXIAL_LAG.hover_input, np.zeros(4))
    made.begin_period(estimate, hold(motion[:3], 0.0, PERIOD_S, 50))
    return made


def sent_by(one: Cooperation) -> SchemeMessage:
    sent = one.exchange({})
    assert sent is not None
    return decode(encode(scheme_message(sent, one.vehicle, 1, 50)), SchemeMessage)


def test_follower_and_leader_get_offsets_of_opposite_signs() -> None:
    leader, follower = cooperation("h1"), cooperation("h2", "h1")
    messages = {one.vehicle: sent_by(one) for one in (leader, follower)}
    for one, other, offset_m, followed in (
        (leader, "h2", [0.5, -0.2, 0.0], False),
        (follower, "h1", [-0.5, 0.2, 0.0], True),
    ):
        arrived = unpacked(messages[other], one, 0.04)
        assert arrived is not None
        one.exchange({other: arrived})
        neighbour = one.scheme.situation.neighbours[other]
        assert np.allclose(neighbour.offset_m, offset_m)
        assert neighbour.followed is followed
        assert isinstance(neighbour.message, Moving)
        assert neighbour.age_s == 0.04


def test_leader_that_was_not_heard_is_a_neighbour_without_message() -> None:
    follower = cooperation("h2", "h1")
    follower.exchange({})
    assert follower.scheme.situation.follows
    assert follower.scheme.situation.neighbours["h1"].message is None


def test_silent_vehicle_is_unknown_after_a_while() -> None:
    follower = cooperation("h2", "h1")
    place = Moving((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    for age_s, known in ((SILENT_S - 0.1, True), (SILENT_S, False)):
        follower.exchange({"h1": Unpacked(place, age_s, None)})
        assert (follower.scheme.situation.neighbours["h1"].message is not None) is known


@pytest.mark.parametrize(
    "payload",
    [
        b"\xff",
        msgspec.msgpack.encode({"position_m": [1.0, 2.0]}),
        msgspec.msgpack.encode({"position_m": [1.0, 2.0, float("nan")], "velocity_m_s": [0.0, 0.0, 0.0]}),
    ],
)
def test_payload_that_is_no_message_of_the_scheme_is_rejected_and_counted(payload: bytes) -> None:
    one = cooperation("h1")
    assert one.unpack("Curious", payload, None, 0.0) is None
    assert one.rejected == {"scheme.payload": 1}


def test_message_of_another_scheme_is_ignored() -> None:
    one = cooperation("h1")
    assert one.unpack("Other", b"\xff", None, 0.0) is None
    assert not one.rejected


def test_message_that_is_too_large_is_a_failure_of_the_scheme() -> None:
    assert MAX_MESSAGE_BYTES == MAX_PAYLOAD_BYTES
    one = cooperation("h1", kind=Loud)
    assert one.exchange({}) is None


def test_controller_without_messages_sends_none() -> None:
    one = cooperation("h1")
    one.use(CONTROLLERS.build("cascade", COAXIAL_LAG, PERIOD_S, {}))
    assert one.exchange({}) is None
    one.use(SCHEMES.build("consensus", COAXIAL_LAG, PERIOD_S, {}))
    assert one.exchange({}) is not None


class Failing(ConsensusScheme):
    """Raises in its exchanges, and wants a million of them."""

    exchanges = 1_000_000

    def exchange(self, situation: Situation) -> msgspec.Struct | None:
        raise RuntimeError("no message")


def test_exchange_that_fails_fails_the_next_step_as_well() -> None:
    one = cooperation("h1", kind=Failing)
    assert one.exchange({}) is None
    guard = one.step_guard
    place = hold(np.array([0.0, 0.0, 1.0]), 0.0, PERIOD_S, 50)
    motion = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    estimate = Estimate(motion, COAXIAL_LAG.hover_input, np.zeros(4))
    assert guard.step(estimate, place, COAXIAL_LAG.hover_input).fallback is not None
    assert guard.step(estimate, place, COAXIAL_LAG.hover_input).fallback is None


def test_number_of_exchanges_is_limited() -> None:
    assert cooperation("h1", kind=Failing).exchanges == MOST_EXCHANGES
    assert cooperation("h1").exchanges == 1


def test_later_exchanges_are_spread_over_the_period() -> None:
    one = cooperation("h1")
    one.use(SCHEMES.build("admm", COAXIAL_LAG, PERIOD_S, {"exchanges": 4}))
    later = LaterExchanges(one)
    assert later.due_s == math.inf
    later.begin_period(7.0)
    due_s = []
    while later.due_s < math.inf:
        due_s.append(later.due_s)
        assert later.exchange({}) is not None
    assert due_s == pytest.approx([7.005, 7.01, 7.015])


def test_vehicle_that_has_landed_sends_nothing() -> None:
    pilot = airborne(real("cascade", "kalman"))
    pilot.use_controller(SCHEMES.build("admm", COAXIAL_LAG, PERIOD_S, {"exchanges": 2}))
    later = LaterExchanges(pilot.cooperation)
    assert pilot.control({}).sent is not None
    later.begin_period(7.0)
    assert later.exchange({}) is not None
    pilot.note_applied("disarmed", 0, HOVER)
    assert pilot.control({}).sent is None
    later.begin_period(7.02)
    assert later.exchange({}) is None
