"""The loop of a transmitter gateway in virtual time: several emulated radios, no bus."""

import threading
from collections import Counter
from itertools import pairwise

import pytest
import serial
from gateway_bench import NAMES, Laboratory

from rcopterx.bus.keys import EVERY_FLEET, FLEET_UNIT
from rcopterx.bus.messages import Applied, Kill, TransmitterStatus
from rcopterx.transmitter_gateway.inputs import Action, State, Track
from rcopterx.transmitter_gateway.radios import TURN_S


def fail(*_: object, **__: object) -> None:
    raise RuntimeError("broken")


@pytest.mark.parametrize("broken", ["request", "on_readable", "next_deadline_s"])
def test_broken_transmitter_does_not_keep_the_others_from_landing(
    laboratory: Laboratory, broken: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    laboratory.fly()
    monkeypatch.setattr(laboratory.transmitter("h2"), broken, fail)
    flown_s = laboratory.bus.now_s
    laboratory.sinks = True
    laboratory.gateway.bring_down()
    assert 2.5 < laboratory.bus.now_s - flown_s < 4.5
    for name in ("h1", "h3"):
        assert laboratory.transmitter(name).arbiter.state is State.CUT
        assert laboratory.throttle_us[name][-25:] == [1100] * 25
    assert ("h2: cannot be brought down" in caplog.text) == (broken != "next_deadline_s")
    assert not any(laboratory.transmitter(name).port.is_open for name in NAMES)


@pytest.mark.parametrize("call", ["open", "close"])
def test_no_period_of_the_other_radios_is_lost_while_an_adapter_blocks(
    laboratory: Laboratory, call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    laboratory.fly()
    released = threading.Event()
    real = getattr(serial.Serial, call)
    path = str(laboratory.radios["h2"].path)

    def blocked(port: serial.Serial) -> None:
        assert port.port != path or released.wait(60.0)
        real(port)

    monkeypatch.setattr(serial.Serial, call, blocked)
    laboratory.blocked = {"h2"}
    began_s = laboratory.bus.now_s
    laboratory.radios["h2"].unplug()
    laboratory.run(0.1)
    laboratory.radios["h2"].replug(laboratory.bus.now_s)
    laboratory.run(2.0)
    assert not released.is_set()
    for name in ("h1", "h3"):
        times_s = [write.time_s for write in laboratory.writes[name] if write.time_s >= began_s]
        assert max(b - a for a, b in pairwise(times_s)) < 0.021
    released.set()


def test_error_in_the_poses_still_brings_everybody_down(
    laboratory: Laboratory, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    laboratory.fly()
    monkeypatch.setattr(laboratory.bus.inboxes["pose", "h2", "lab"][0], "drain", fail)
    laboratory.gateway.bring_down()
    assert laboratory.states() == {State.CUT}
    assert "broken" in caplog.text


@pytest.mark.parametrize("fleet", ["lab", EVERY_FLEET])
def test_a_kill_of_this_fleet_or_of_every_fleet_is_obeyed_and_published_at_once(
    laboratory: Laboratory, fleet: str
) -> None:
    laboratory.fly()
    laboratory.bus.published.clear()
    kill = Kill(source="operator", reason="test", vehicles=("h2",))
    laboratory.bus.arrive("kill", FLEET_UNIT, kill, fleet)
    laboratory.gateway.step()
    assert laboratory.transmitter("h2").arbiter.state is State.KILLED
    assert laboratory.transmitter("h1").arbiter.state is State.ARMED
    states = {
        name: message.state
        for name, message in laboratory.bus.published
        if isinstance(message, TransmitterStatus)
    }
    assert states == {"h1": "armed", "h2": "killed", "h3": "armed"}


def test_shut_down_lands_everybody_and_closes_the_ports(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.sinks = True
    laboratory.gateway.shut_down()
    assert laboratory.states() == {State.CUT}
    assert {laboratory.transmitter(name).arbiter.reason for name in NAMES} == {"landed: shutting down"}
    for name in NAMES:
        assert laboratory.throttle_us[name][-25:] == [1100] * 25
        assert not laboratory.transmitter(name).port.is_open


def test_what_is_written_for_a_command_tells_the_stages_it_has_passed(laboratory: Laboratory) -> None:
    laboratory.fly()
    written = [message for _, message in laboratory.bus.published if isinstance(message, Applied)]
    fresh = [applied for applied in written if applied.fresh]
    assert fresh
    for applied in fresh:
        assert applied.host == "radio"
        assert applied.timing is not None
        assert applied.timing.received_s == applied.frame
        assert applied.command_arrived_s is not None
        assert applied.command_arrived_s <= applied.written_s
    assert all(applied.timing is None for applied in written if not applied.fresh)


def test_every_written_frame_is_published_at_once(laboratory: Laboratory) -> None:
    laboratory.fly()
    for _ in range(300):
        laboratory.bus.published.clear()
        written = {name: len(laboratory.writes[name]) for name in NAMES}
        laboratory.turn()
        for name in NAMES:
            writes = laboratory.writes[name][written[name] :]
            assert [applied.written_s for applied in laboratory.applied(name)] == [w.time_s for w in writes]


def test_another_state_is_published_at_once(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.thrust = None
    silent = laboratory.transmitter("h2").arbiter
    while silent.state is not State.HOLD:
        frame = laboratory.frame
        laboratory.bus.published.clear()
        laboratory.turn()
        for name in ("h1", "h3") if laboratory.frame > frame else ():
            laboratory.bus.arrive("command", name, laboratory.command(0.55))
    assert laboratory.applied("h2")[-1].state == "hold"


def own_track(laboratory: Laboratory) -> Track:
    track = laboratory.transmitter("h1").arbiter.pose_monitor.own_track
    assert track is not None
    return track


def next_frame_arrives(laboratory: Laboratory) -> float:
    frame = laboratory.frame
    while laboratory.frame == frame:
        laboratory.turn()
    return laboratory.bus.now_s


def test_commands_are_written_on_arrival_and_judged_with_the_poses_that_are_there(
    laboratory: Laboratory,
) -> None:
    laboratory.fly()
    arrived_s = next_frame_arrives(laboratory)
    assert laboratory.writes["h1"][-1].time_s == arrived_s
    assert own_track(laboratory).frame == laboratory.frame


def test_poses_wait_at_most_a_turn_and_count_from_their_arrival(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.thrust = None
    while laboratory.states() != {State.HOLD}:
        laboratory.turn()
    arrived_s = next_frame_arrives(laboratory)
    while own_track(laboratory).frame < laboratory.frame:
        laboratory.turn()
    assert laboratory.bus.now_s <= arrived_s + TURN_S
    assert own_track(laboratory).seen_s == arrived_s


def turns_of_ten_frames(laboratory: Laboratory) -> int:
    frame, turns = laboratory.frame, 0
    while laboratory.frame < frame + 10:
        laboratory.turn()
        turns += 1
    return turns


def test_loop_waits_for_commands_while_they_fly_all_vehicles(laboratory: Laboratory) -> None:
    laboratory.fly()
    assert turns_of_ten_frames(laboratory) <= 20
    laboratory.bus.arrive("kill", FLEET_UNIT, Kill(source="operator", reason="test", vehicles=("h2",)))
    assert turns_of_ten_frames(laboratory) >= 40


def test_flood_of_commands_for_one_vehicle_is_read_in_portions_between_those_of_others(
    laboratory: Laboratory,
) -> None:
    laboratory.fly()
    laboratory.thrust = None
    laboratory.bus.now_s += 0.01
    laboratory.frame += 1
    flood = 200
    for _ in range(flood):
        laboratory.bus.arrive("command", "h2", laboratory.command(0.5, lease=2))
    laboratory.bus.arrive("command", "h3", laboratory.command(0.6))
    laboratory.gateway.step()
    write = laboratory.writes["h3"][-1]
    assert write.output.cause is not None
    assert write.output.cause.sequence == laboratory.frame
    counters = laboratory.transmitter("h2").arbiter.counters
    assert 0 < refused(counters) < flood / 10
    laboratory.run(0.02)
    assert refused(counters) == flood


def refused(counters: Counter[str]) -> int:
    return counters["no such control lease"] + counters["old sequence number"]


def test_kill_is_reported_at_once_also_where_it_cannot_be_written(laboratory: Laboratory) -> None:
    laboratory.run(1.0)
    laboratory.radios["h2"].unplug()
    laboratory.run(0.3)
    laboratory.bus.published.clear()
    laboratory.radios_of_gateway.request(Action.KILL, "test")
    laboratory.gateway.step()
    reported = {
        unit: message.state
        for unit, message in laboratory.bus.published
        if isinstance(message, TransmitterStatus)
    }
    assert reported == dict.fromkeys(NAMES, "killed")
    laboratory.bus.published.clear()
    laboratory.gateway.step()
    assert not any(isinstance(message, TransmitterStatus) for _, message in laboratory.bus.published)
