"""Promises of the message load: what is published is heard by whoever hears it in flight, and is counted."""

from typing import Any

import pytest

from rcopterx.benchmarks import message_load
from rcopterx.benchmarks.message_load import Listening, Stream, copies_hz, listenings, streams
from rcopterx.bus import channels
from rcopterx.bus.channels import Channel


def listeners(stream: Stream, hosts: int, vehicles: int) -> list[tuple[int, str]]:
    return [(one.host, one.program) for one in listenings(hosts, vehicles) if one.hears(stream)]


def stream_of(channel: Channel[Any], vehicle: str, hosts: int, vehicles: int) -> Stream:
    (found,) = (one for one in streams(hosts, vehicles) if one.channel is channel and one.vehicle == vehicle)
    return found


def test_a_command_is_for_the_gateway_of_its_host_only() -> None:
    command = stream_of(channels.COMMAND, "v1-0", hosts=3, vehicles=4)
    assert command.host == 1
    assert listeners(command, 3, 4) == [(1, "gateway")]


def test_a_pose_is_for_its_agent_and_the_gateway_of_every_host() -> None:
    pose = stream_of(channels.POSE, "v1-0", hosts=3, vehicles=4)
    assert pose.host == 0
    assert sorted(listeners(pose, 3, 4)) == [(0, "gateway"), (1, "gateway"), (1, "v1-0"), (2, "gateway")]


def test_a_plan_is_for_followers_and_near_vehicles_of_its_host() -> None:
    plan = stream_of(channels.PLAN, "v1-0", hosts=3, vehicles=9)
    heard = listeners(plan, 3, 9)
    assert {host for host, _ in heard} == {1}
    assert [program for _, program in heard] == [f"v1-{number}" for number in range(1, 9)]


@pytest.mark.parametrize("vehicles", [1, 2, 10])
def test_no_agent_hears_its_own_plan_or_one_twice(vehicles: int) -> None:
    plans = [one for one in listenings(2, vehicles) if one.channel is channels.PLAN]
    assert len(set(plans)) == len(plans)
    assert all(one.program != one.vehicle for one in plans)


def test_copies_are_counted_by_router() -> None:
    pose, status = channels.POSE, channels.AGENT_STATUS
    said = [Stream(0, "tracker", pose, "v1-0"), Stream(1, "v1-0", status, "v1-0")]
    heard = [
        Listening(1, "v1-0", pose, "v1-0"), Listening(1, "gateway", pose, "*"),
        Listening(0, "gateway", pose, "*"), Listening(0, "launcher", status, "*"),
        Listening(0, "v0-0", pose, "v0-0"),
    ]  # fmt: skip
    assert copies_hz(0, said, heard) == (pose.rate_hz + status.rate_hz, pose.rate_hz)
    assert copies_hz(1, said, heard) == (2 * pose.rate_hz, status.rate_hz)


@pytest.mark.campaign
@pytest.mark.timeout(120)
def test_messages_pass_through_real_routers() -> None:
    rows = message_load.run(hosts=2, vehicles=2, seconds=2.0)
    assert len(rows) == 2
    for row in rows:
        assert row["router"] > 0.0
        for probe in (row["command"], row["pose"]):
            assert 0.5 < probe["arrived"] < 1.5
            assert 0.0 < probe["p50_ms"] <= probe["p99_ms"]
