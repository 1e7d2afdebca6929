"""Promises of the launcher's recall: an agent that restarts learns what its predecessor meant to do."""

from collections.abc import Callable

from support.waiting import wait_for

from bus import channels
from bus.intent import Intent
from bus.messages import LeaderLink, SetPoint
from bus.requests import Recall, RecallReply
from bus.session import BusAddress, Session
from deploy.recall import RecallService

INTENT = Intent(
    phase="flying",
    epoch=1,
    frame=100,
    controller="paper",
    estimator="kalman",
    set_point=SetPoint(position_m=(0.1, 0.2, 1.0), yaw_rad=0.5),
    assigned=(LeaderLink(leader="h2", offset_m=(0.4, 0.0, 0.0)),),
)


def test_recall_gives_the_last_intent_of_each_vehicle_and_its_age(
    bus_address: BusAddress, join: Callable[..., Session]
) -> None:
    service = RecallService(bus_address, ["h1", "h2"], ["h1"])
    agent = join()

    def recalled() -> RecallReply:
        reply = agent.request("h1", Recall(), patience_s=10.0)
        assert isinstance(reply, RecallReply)
        return reply

    try:
        first = recalled()
        assert not first.accepted
        assert first.reason == "h1 has not reported anything yet"

        def remembered() -> bool:
            agent.publish(channels.INTENT, "h1", INTENT)
            return recalled().accepted

        wait_for(remembered, "the intent is not remembered")
        reply = recalled()
        assert reply.intent == INTENT
        assert 0 <= reply.age_s < 10
        other = agent.request("h2", Recall())
        assert not other.accepted
    finally:
        service.close()
