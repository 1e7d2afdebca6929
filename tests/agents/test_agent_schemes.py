"""A scheme in an agent: its messages travel on the bus, and it waits for no plans."""

import msgspec
import numpy as np
import pytest
from agent_bench import FOLLOWING, Bench, Join
from support.vehicle_types import COAXIAL_LAG

from rcopterx.bus import channels
from rcopterx.bus.external_messages import SchemeMessage
from rcopterx.bus.session import BusAddress
from rcopterx.control.plugins import SCHEMES
from rcopterx_studies.schemes.tracked import Moving

PLACE = Moving((0.4, 0.1, 1.0), (0.0, 0.0, 0.0))


def message(bench: Bench, payload: bytes, scheme: str = "ConsensusScheme") -> SchemeMessage:
    return SchemeMessage(
        epoch=1, frame=bench.frame, source="h1", scheme=scheme, offsets_m={}, payload=payload
    )


@pytest.fixture
def follower(join: Join, bus_address: BusAddress) -> Bench:
    bench = Bench(join, bus_address, FOLLOWING)
    bench.pilot.cooperation.vehicle = "h9"
    bench.pilot.use_controller(SCHEMES.build("consensus", COAXIAL_LAG, 0.02, {}))
    bench.messages = bench.others.subscribe(channels.SCHEME, "h9", depth=256)
    bench.start()
    return bench


def test_agent_publishes_the_messages_of_its_scheme_and_waits_for_no_plan(follower: Bench) -> None:
    sent: list[SchemeMessage] = []

    def published() -> bool:
        sent.extend(received.message for received in follower.messages.drain())
        return bool(sent)

    follower.see()
    follower.step_until(published, "no message of the scheme")
    assert sent[-1].offsets_m == {"h1": FOLLOWING[0].offset_m}
    assert msgspec.msgpack.decode(sent[-1].payload, type=Moving)
    assert follower.agent.control_by_s is None
    assert "leader_plan_late" not in follower.pilot.events
    assert "leader_plan_missing" not in follower.pilot.events


def test_agent_goes_beside_the_place_that_it_receives(follower: Bench) -> None:
    payload = msgspec.msgpack.encode(PLACE)
    for _ in range(40):
        follower.others.publish(channels.SCHEME, "h1", message(follower, payload))
        follower.see()
    assert follower.pilot.plan is not None
    goal_m = np.array(PLACE.position_m) + FOLLOWING[0].offset_m
    start_m = np.array([0.0, 0.0, 1.0])
    moved_m = follower.pilot.plan.position_m[-1] - start_m
    assert moved_m @ (goal_m - start_m) > 0.0


def test_payload_that_cannot_be_used_is_counted_in_the_status(follower: Bench) -> None:
    def counted() -> bool:
        follower.others.publish(channels.SCHEME, "h1", message(follower, b"\xff"))
        follower.see()
        return bool(follower.pilot.cooperation.rejected)

    follower.step_until(counted, "not counted")
    assert follower.status().diagnostics.rejected["scheme.payload"] >= 1


def test_agent_makes_every_exchange_of_a_control_period_at_its_time(follower: Bench) -> None:
    follower.pilot.use_controller(SCHEMES.build("admm", COAXIAL_LAG, 0.02, {}))
    follower.see()
    follower.command_of(follower.frame)
    sent: list[SchemeMessage] = []

    def exchanges(number: int) -> bool:
        sent.extend(received.message for received in follower.messages.drain())
        return [message.frame for message in sent].count(follower.frame) == number

    follower.step_until(lambda: exchanges(1), "no first exchange")
    assert follower.agent.next_s() == pytest.approx(follower.clock() + 0.01)
    follower.clock.advance(0.01)
    follower.step_until(lambda: exchanges(2), "no second exchange")
    assert follower.agent.next_s() > follower.clock() + 0.005
