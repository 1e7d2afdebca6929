"""Promises of an agent that is started again: it goes on where its predecessor was."""

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import pytest
from agent_bench import FOLLOWING, Bench, Join
from support.bus import answering
from support.waiting import DEADLINE_S, wait_for

from rcopterx.agents.process import Agent
from rcopterx.bus import channels
from rcopterx.bus.intent import FlownBy, Intent
from rcopterx.bus.messages import SetPoint
from rcopterx.bus.requests import GoTo, RecallReply
from rcopterx.bus.session import BusAddress, Session
from rcopterx.bus.stepping import StepBus


def test_what_is_asked_before_an_agent_knows_that_it_flies_waits_for_that(bench: Bench) -> None:
    answers: list[bool] = []
    goal = GoTo(set_point=SetPoint(position_m=(0.3, 0.2, 1.1), yaw_rad=0.5))

    def ask() -> None:
        answers.append(bench.others.request("h9", goal, timeout_s=DEADLINE_S, patience_s=DEADLINE_S).accepted)

    bench.step_until(lambda: bench.agent.serving_since_s < math.inf, "the agent has no lease")
    asker = threading.Thread(target=ask)
    asker.start()
    bench.step_until(lambda: bench.bus.requests, "the request does not arrive")
    assert answers == []
    bench.start()
    bench.step_until(lambda: answers, "no answer")
    asker.join()
    assert answers == [True]


@contextmanager
def remembering(session: Session, intent: Intent) -> Iterator[None]:
    """A launcher that remembers an intent."""
    session.serve("main", ["recall"])
    with answering(session, lambda _: RecallReply(accepted=True, intent=intent)):
        yield


INTENT = Intent(
    phase="flying",
    epoch=1,
    frame=90,
    yaw_rad=2 * math.tau + 0.1,
    set_point=SetPoint(position_m=(0.3, 0.2, 1.1), yaw_rad=2 * math.tau + 0.5),
    flown_by=FlownBy(controller="paper", estimator="extended_kalman", controller_settings={"horizon": 50}),
)


def successor(join: Join, address: BusAddress, intent: Intent) -> Bench:
    """An agent whose predecessor meant to do something."""
    with remembering(join(), intent):
        bench = Bench(join, address)

        def recalled() -> bool:
            """The agent asked before anybody served; ask again as its successor would."""
            if bench.agent.handover.predecessor is None:
                bench.agent = Agent(
                    bench.settings, bench.pilot, StepBus(join(clock=bench.clock)), realtime=False
                )
            return bench.agent.handover.predecessor == intent

        wait_for(recalled, "the launcher is not found")
    return bench


def test_an_agent_that_restarts_in_flight_goes_on_with_the_task_of_its_predecessor(
    join: Join, bus_address: BusAddress
) -> None:
    bench = successor(join, bus_address, INTENT)
    bench.start()
    assert bench.status().set_point == INTENT.set_point


def test_an_agent_that_restarts_in_flight_does_not_turn_back_whole_turns(
    join: Join, bus_address: BusAddress
) -> None:
    """Its vehicle is seen at heading 0, and has turned twice."""
    bench = successor(join, bus_address, INTENT)
    bench.start()
    status = bench.status()
    # A loaded computer may have predicted a period before the status; a whole turn is 6.28 rad.
    assert status.yaw_rad == pytest.approx(2 * math.tau, abs=0.01)
    assert status.set_point.yaw_rad - status.yaw_rad == pytest.approx(0.5, abs=0.01)


def test_an_agent_that_starts_on_the_floor_forgets_the_task_of_its_predecessor(
    join: Join, bus_address: BusAddress
) -> None:
    bench = successor(join, bus_address, msgspec.structs.replace(INTENT, assigned=FOLLOWING))
    bench.start("disarmed", 0.0)
    assert bench.status().following == ()


CLIMBING = msgspec.structs.replace(
    INTENT, phase="takeoff", set_point=SetPoint(position_m=(0.0, 0.0, 0.9), yaw_rad=0.0), floor_m=0.1
)


def test_a_take_off_begins_again_if_the_agent_restarts_while_the_rotor_turns_up(
    join: Join, bus_address: BusAddress
) -> None:
    bench = successor(join, bus_address, CLIMBING)
    bench.start("armed", 0.1)
    assert bench.status().phase == "takeoff"
    # The test shows the standing vehicle at a height of 1 m.
    assert bench.pilot.guidance.set_point()[0][2] == pytest.approx(1.8)


@pytest.mark.parametrize(("intent", "state"), [
    (msgspec.structs.replace(CLIMBING, frame=0), "armed"),
    (CLIMBING, "disarmed"),
    (msgspec.structs.replace(CLIMBING, phase="landing"), "armed"),
])  # fmt: skip
def test_no_take_off_begins_by_an_old_intent_or_without_arming(
    join: Join, bus_address: BusAddress, intent: Intent, state: str
) -> None:
    bench = successor(join, bus_address, intent)
    bench.start(state, 0.1)
    assert bench.status().phase in ("ground", "armed")


def test_an_agent_tells_its_intent_for_its_successor(bench: Bench) -> None:
    intents = bench.others.subscribe(channels.INTENT, "h9")
    bench.start()
    bench.step_until(lambda: intents.latest() is not None or bench.status() is None, "no intent")
    received = intents.latest()
    assert received is not None
    assert received.message.phase == "flying"
    assert received.message.set_point.position_m == pytest.approx((0.0, 0.0, 1.0))
