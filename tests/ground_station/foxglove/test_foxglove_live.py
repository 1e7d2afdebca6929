"""Promises of the live view: a client of the protocol sees the fleet's channels and their messages."""

import json
import struct
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from support.bus import free_port

from rcopterx.ground_station.scripting.fleet import Fleet

pytest.importorskip("foxglove")
client = pytest.importorskip("websockets.sync.client")

from rcopterx.ground_station.foxglove.live import FoxgloveServer  # noqa: E402  # needs the SDK

PROTOCOL = "foxglove.sdk.v1"
DEADLINE_S = 60.0
MESSAGE = struct.Struct("<BIQ")
"""Kind, subscription and time of a message that is followed by its content."""


@pytest.fixture
def server(fleet: Fleet) -> Iterator[FoxgloveServer]:
    end = threading.Event()
    with FoxgloveServer(fleet.file, fleet.session, free_port()) as running:

        def serve() -> None:
            while not end.is_set():
                running.serve(0.05)

        loop = threading.Thread(target=serve)
        loop.start()
        yield running
        end.set()
        loop.join()


def advertised(connection: Any) -> dict[str, dict[str, Any]]:
    """Channels by topic, once all are advertised."""
    found: dict[str, dict[str, Any]] = {}
    while "/h2/flight" not in found:
        text = connection.recv(timeout=DEADLINE_S)
        told = json.loads(text) if isinstance(text, str) else {}
        if told.get("op") == "advertise":
            found |= {channel["topic"]: channel for channel in told["channels"]}
    return found


def test_a_viewer_is_told_of_the_channels_and_gets_what_it_subscribes_to(server: FoxgloveServer) -> None:
    with client.connect(server.address, subprotocols=[PROTOCOL]) as connection:
        channels = advertised(connection)
        assert channels["/tf"]["schemaName"] == "foxglove.FrameTransforms"
        assert channels["/h1/pose"]["schemaName"] == "foxglove.PoseInFrame"
        assert channels["/scene"]["schemaName"] == "foxglove.SceneUpdate"
        wanted = {number: channels[topic]["id"] for number, topic in enumerate(("/tf", "/scene"))}
        subscriptions = [{"id": number, "channelId": channel} for number, channel in wanted.items()]
        connection.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        got: dict[int, bytes] = {}
        while set(got) != set(wanted):
            data = connection.recv(timeout=DEADLINE_S)
            if isinstance(data, bytes) and data[0] == 1:
                _, number, time_ns = MESSAGE.unpack_from(data)
                assert time_ns > 1_700_000_000 * 10**9
                got[number] = data[MESSAGE.size :]
        assert b"room" in got[0]


def test_viewers_can_send_nothing(server: FoxgloveServer) -> None:
    channel = {"id": 1, "topic": "/h1/kill", "encoding": "json", "schemaName": ""}
    with client.connect(server.address, subprotocols=[PROTOCOL]) as connection:
        assert json.loads(connection.recv(timeout=DEADLINE_S))["capabilities"] == []
        connection.send(json.dumps({"op": "advertise", "channels": [channel]}))
        answer: dict[str, Any] = {}
        while answer.get("op") != "status":
            text = connection.recv(timeout=DEADLINE_S)
            answer = json.loads(text) if isinstance(text, str) else {}
        assert "clientPublish" in answer["message"]


def test_a_port_in_use_is_told(fleet: Fleet, server: FoxgloveServer) -> None:
    port = int(server.address.rpartition(":")[2])
    with pytest.raises(OSError, match=str(port)):
        FoxgloveServer(fleet.file, fleet.session, port)
