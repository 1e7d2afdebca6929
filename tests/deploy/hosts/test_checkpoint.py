"""Promises of the launcher's checkpoint: an agent that restarts learns what its predecessor meant to do."""

from collections.abc import Callable
from dataclasses import replace

from support.bus import asked
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.intent import FlownBy, Intent
from rcopterx.bus.messages import Applied, LeaderLink, SetPoint, TransmitterStatus
from rcopterx.bus.requests import Recall, RecallReply
from rcopterx.bus.session import BusAddress, Session
from rcopterx.deploy.hosts.checkpoint import CheckpointService
from rcopterx.deploy.hosts.guarding import Guard

INTENT = Intent(
    phase="flying",
    epoch=1,
    frame=100,
    flown_by=FlownBy(controller="paper", estimator="kalman"),
    set_point=SetPoint(position_m=(0.1, 0.2, 1.0), yaw_rad=0.5),
    assigned=(LeaderLink(leader="h2", offset_m=(0.4, 0.0, 0.0)),),
)


def test_recall_gives_the_last_intent_of_each_vehicle_and_its_age(
    bus_address: BusAddress, join: Callable[..., Session]
) -> None:
    service = CheckpointService(
        replace(bus_address, host="main"), ["h1", "h2"], {"h1": 2, "h2": 0}.__getitem__, Guard("main", {})
    ).start()
    agent = join()

    def recalled() -> RecallReply:
        reply = asked(agent, "main", Recall(vehicle="h1"))
        assert isinstance(reply, RecallReply)
        return reply

    try:
        first = recalled()
        assert not first.accepted
        assert first.reason == "h1 has not reported anything yet"
        assert first.quick_deaths == 2

        def remembered() -> bool:
            agent.publish(channels.INTENT, "h1", INTENT)
            return recalled().accepted

        wait_for(remembered, "the intent is not remembered")
        reply = recalled()
        assert reply.intent == INTENT
        assert 0 <= reply.age_s < DEADLINE_S
        assert reply.quick_deaths == 2
        other = asked(agent, "main", Recall(vehicle="h2"))
        assert not other.accepted
    finally:
        service.close()


def transmitter_status(state: str) -> TransmitterStatus:
    return TransmitterStatus(state=state, reason="", link="lost", module="", ready=False)


APPLIED = Applied(
    state="armed",
    input=(0.0, 0.0, 0.5, 0.0),
    pulse_width_us=(1500.0,),
    epoch=1,
    frame=1,
    sequence=1,
    fresh=True,
)


def test_vehicles_on_the_floor_are_known_by_their_gateway_and_their_launcher(
    bus_address: BusAddress, join: Callable[..., Session]
) -> None:
    service = CheckpointService(
        replace(bus_address, host="spare"), ["h1"], lambda _: 0, Guard("spare", {"h1": 0})
    ).start()
    other = join()
    launcher = LauncherStatus(running=("h1",), absent=())

    def known(state: str) -> bool:
        status = TransmitterStatus(
            state=state, reason="", link="ready", module="", ready=True, command_age_s=2.0
        )
        other.publish(channels.LAUNCHER, "home", launcher)
        other.publish(channels.TRANSMITTER_STATUS, "h1", status)
        found = service.on_floor()
        return found.keys() == {"h1"} and found["h1"].runner == "home"

    try:
        wait_for(lambda: known("disarmed"), "the vehicle on the floor is not known")
        wait_for(lambda: not known("armed"), "a vehicle in flight is taken for one on the floor")
    finally:
        service.close()


def test_frames_of_guarded_vehicles_are_received_and_of_others_not(
    bus_address: BusAddress, join: Callable[..., Session]
) -> None:
    service = CheckpointService(
        replace(bus_address, host="spare"), ["h1", "h2"], lambda _: 0, Guard("spare", {"h1": 0})
    ).start()
    gateway = join()

    def received() -> bool:
        gateway.publish(channels.APPLIED, "h2", APPLIED)
        gateway.publish(channels.APPLIED, "h1", APPLIED)
        return bool(service.frames())

    try:
        wait_for(received, "no frame is received")
        assert service.frames().keys() == {"h1"}
    finally:
        service.close()
