"""Promises of the Foxglove export: other readers find poses, transforms, plans, plots and events in it."""

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from rcopterx.bus.codec import decode
from rcopterx.bus.messages import Pose
from rcopterx.flights.mcap_reading import messages_of

pytest.importorskip("foxglove")
decoding = pytest.importorskip("mcap_protobuf.decoder")

from rcopterx.ground_station.foxglove.export import export_foxglove  # noqa: E402  # needs the SDK

FLIGHT = Path(__file__).parents[2] / "fixtures" / "reference_flight.mcap"
VEHICLES = ("h1", "h2")
Shown = dict[str, list[tuple[str, Any, int]]]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return export_foxglove([FLIGHT], tmp_path_factory.mktemp("export"))


@pytest.fixture(scope="module")
def shown(files: list[Path]) -> Shown:
    """Schema, content and time of every message by topic."""
    found: Shown = defaultdict(list)
    with files[0].open("rb") as file:
        reader = make_reader(file, decoder_factories=[decoding.DecoderFactory()])
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            if channel.message_encoding == "json":
                content = json.loads(message.data)
            else:
                content = decoding.DecoderFactory().decoder_for("protobuf", schema)(message.data)
            found[channel.topic].append((schema.name, content, message.log_time))
    return found


def test_every_pose_is_there_at_its_time(shown: Shown) -> None:
    for name in VEHICLES:
        recorded = [
            (message.time_ns, decode(message.payload, Pose))
            for message in messages_of(FLIGHT)
            if message.topic == f"{name}/pose"
        ]
        poses = shown[f"/{name}/pose"]
        assert [time_ns for _, _, time_ns in poses] == [time_ns for time_ns, _ in recorded]
        for (schema, content, _), (_, pose) in zip(poses, recorded, strict=True):
            assert schema == "foxglove.PoseInFrame"
            at = content.pose.position
            assert (at.x, at.y, at.z) == pose.position_m


def test_vehicles_are_frames_of_the_room(shown: Shown) -> None:
    moved = [one for _, content, _ in shown["/tf"] for one in content.transforms]
    assert {one.child_frame_id for one in moved} == set(VEHICLES)
    assert {one.parent_frame_id for one in moved} == {"room"}


def test_the_scene_has_vehicles_their_plans_and_who_follows_whom(shown: Shown) -> None:
    entities = [entity for _, content, _ in shown["/scene"] for entity in content.entities]
    assert {entity.id for entity in entities} >= {*VEHICLES, "h1 plan", "h2 plan", "flight volume"}
    follower = [entity for entity in entities if entity.id == "h2 plan"][-1]
    assert len(follower.lines) == 2
    assert len(follower.lines[0].points) >= 2


def test_numbers_are_plots_and_events_are_log_lines(shown: Shown) -> None:
    for name in VEHICLES:
        assert {"pitch", "roll", "thrust", "yaw"} == shown[f"/{name}/sticks"][0][1].keys()
        assert any("error_mm" in content for _, content, _ in shown[f"/{name}/flight"])
    lines = [content for schema, content, _ in shown["/log"] if schema == "foxglove.Log"]
    assert any("takeoff" in line.message and line.name == "h1" for line in lines)


def test_the_layout_shows_what_the_export_has(files: list[Path], shown: Shown) -> None:
    layout = json.loads(files[1].read_text(encoding="utf-8"))
    panels = layout["configById"]
    assert set(panels["3D!scene"]["topics"]) <= set(shown)

    def leaves(split: Any) -> set[str]:
        return {split} if isinstance(split, str) else leaves(split["first"]) | leaves(split["second"])

    assert leaves(layout["layout"]) == set(panels)
