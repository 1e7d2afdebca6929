"""Promises of the recorder in a script: it keeps what travels, all of it or the newest."""

import time

from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.bus.channels import CHANNELS
from rcopterx.bus.session import RawMessage
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.fleet import Fleet


def arriving(fleet: Fleet) -> list[RawMessage]:
    """Messages that recorders keep, from now on."""
    arrived = list[RawMessage]()
    topics = {channel.topic for channel in CHANNELS if channel.recorded}
    fleet.session.tap(lambda message: arrived.append(message) if message.topic in topics else None, "*")
    return arrived


def test_a_recording_holds_what_travelled_between_start_and_stop(
    fleet: Fleet, vehicles: dict[str, ScriptedVehicle]
) -> None:
    recorder = FlightSampler(fleet.session)
    arrived = arriving(fleet)
    assert not recorder.stop().records()
    recorder.start()
    before = len(arrived)
    wait_for(lambda: len(arrived) > before + 30, "nothing is recorded")
    recording = recorder.stop()
    messages = recording.messages(channels.AGENT_STATUS, "h1")
    assert messages
    assert all(message.phase == "ground" for message, _ in messages)
    times = [arrived_s for _, arrived_s in messages]
    assert times == sorted(times)
    assert not recording.rejected


def test_a_recorder_with_a_limit_keeps_the_newest(fleet: Fleet) -> None:
    recorder = FlightSampler(fleet.session, kept=5)
    recorder.start()
    arrived = arriving(fleet)
    wait_for(lambda: len(arrived) > 5, "nothing is recorded")
    before_s = fleet.session.clock()
    time.sleep(0.5)
    recording = recorder.stop()
    assert len(recording.records()) == 5
    times = [
        arrived_s
        for channel in CHANNELS
        for unit in recording.units(channel)
        for _, arrived_s in recording.messages(channel, unit)
    ]
    assert times
    assert min(times) > before_s
