"""Promises of an agent that is started again: it goes on where its predecessor was."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
from agent_bench import FOLLOWING, Bench, Join
from support.bus import answering
from support.statuses import flying_status
from support.waiting import wait_for

from agents.process import Agent, build_pilot
from bus.messages import AgentStatus, SetPoint
from bus.requests import GoTo, RecallReply
from bus.session import BusAddress, Session


def test_sequences_grow_over_restarts(bench: Bench, join: Join) -> None:
    bench.start("disarmed", 0.0)
    newest = bench.sent[-1].sequence
    successor = Agent(bench.settings, build_pilot(bench.settings), join(clock=bench.clock), realtime=False)
    assert successor._sequence > newest - 1000


def test_what_is_asked_before_an_agent_knows_that_it_flies_waits_for_that(bench: Bench) -> None:
    answers: list[bool] = []
    goal = GoTo(set_point=SetPoint(position_m=(0.3, 0.2, 1.1), yaw_rad=0.5))

    def ask() -> None:
        answers.append(bench.others.request("h9", goal, timeout_s=10, patience_s=10).accepted)

    asker = threading.Thread(target=ask)
    asker.start()
    wait_for(lambda: not bench.agent._session._incoming.empty(), "the request does not arrive")
    bench.agent.step()
    assert answers == []
    bench.start()
    bench.step_until(lambda: answers, "no answer")
    asker.join()
    assert answers == [True]


@contextmanager
def remembering(session: Session, status: AgentStatus) -> Iterator[None]:
    """A launcher that remembers a status."""
    session.serve("h9", ["recall"])
    with answering(session, lambda _: RecallReply(accepted=True, status=status)):
        yield


STATUS = flying_status(frame=90, horizon=8, set_point=SetPoint(position_m=(0.3, 0.2, 1.1), yaw_rad=0.5))


def test_an_agent_that_restarts_in_flight_goes_on_with_the_task_of_its_predecessor(
    join: Join, bus_address: BusAddress
) -> None:
    with remembering(join(), STATUS):
        bench = Bench(join, bus_address)
        wait_for(lambda: recalled(bench, join), "the launcher is not found")
    bench.start()
    assert bench.status().set_point == STATUS.set_point


def recalled(bench: Bench, join: Join) -> bool:
    """The agent asked before anybody served; ask again as its successor would."""
    if bench.agent._previous is None:
        bench.agent = Agent(bench.settings, bench.pilot, join(clock=bench.clock), realtime=False)
    return bench.agent._previous == STATUS


def test_an_agent_that_starts_on_the_floor_forgets_the_task_of_its_predecessor(
    join: Join, bus_address: BusAddress
) -> None:
    followed = msgspec.structs.replace(STATUS, following=FOLLOWING)
    with remembering(join(), followed):
        bench = Bench(join, bus_address)
    bench.start("disarmed", 0.0)
    assert bench.status().following == ()
