"""Vehicles as standard messages of Foxglove."""

import math
from collections.abc import Sequence
from typing import Final

from foxglove.messages import (
    Color,
    CubePrimitive,
    CylinderPrimitive,
    FrameTransform,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    PoseInFrame,
    Quaternion,
    SceneEntity,
    SpherePrimitive,
    TextPrimitive,
    Timestamp,
    Vector3,
)

from rcopterx.bus import messages
from rcopterx.ground_station.colours import rgb_colour
from rcopterx.vehicles.state import Array

ROOM: Final = "room"
"""Name of the inertial frame; that of a vehicle's frame is its name."""
NANO: Final = 1_000_000_000
PLAN_POINTS: Final = 25
ROTOR_M: Final = 0.2
Place = Sequence[float]


def stamp(time_ns: int) -> Timestamp:
    """Nanoseconds since 1970 as a time stamp."""
    return Timestamp(*divmod(time_ns, NANO))


def colour(number: int, alpha: float = 1.0) -> Color:
    """Colour of a vehicle by its number in the fleet file."""
    red, green, blue = (value / 255 for value in rgb_colour(number))
    return Color(r=red, g=green, b=blue, a=alpha)


def transform(name: str, place: Place, xyzw: Sequence[float], time_ns: int) -> FrameTransform:
    """Transform from the room to the frame of a vehicle at a place [m]."""
    return FrameTransform(
        timestamp=stamp(time_ns),
        parent_frame_id=ROOM,
        child_frame_id=name,
        translation=_vector(place),
        rotation=_quaternion(xyzw),
    )


def in_room(at: Pose, time_ns: int) -> PoseInFrame:
    """A pose in the room."""
    return PoseInFrame(timestamp=stamp(time_ns), frame_id=ROOM, pose=at)


def pose(place: Place, xyzw: Sequence[float] = (0.0, 0.0, 0.0, 1.0)) -> Pose:
    """A pose by its place [m] and quaternion."""
    return Pose(position=_vector(place), orientation=_quaternion(xyzw))


def reference(plan: messages.Plan) -> Pose | None:
    """Reference of a plan; None without one."""
    if plan.reference is None:
        return None
    half_rad = plan.reference[3] / 2
    return pose(plan.reference, (0.0, 0.0, math.sin(half_rad), math.cos(half_rad)))


def vehicle(name: str, number: int, time_ns: int) -> SceneEntity:
    """Rotor disc and name of a vehicle, in its own frame."""
    above, over = pose((0.0, 0.0, 0.05)), pose((0.0, 0.0, 0.2))
    nose = [Point3(), Point3(x=0.15)]
    return SceneEntity(
        timestamp=stamp(time_ns),
        frame_id=name,
        id=name,
        frame_locked=True,
        cylinders=[
            CylinderPrimitive(
                pose=above, size=Vector3(x=2 * ROTOR_M, y=2 * ROTOR_M, z=0.01), bottom_scale=1.0,
                top_scale=1.0, color=colour(number, 0.5),
            )
        ],
        lines=[_line(nose, number, 0.03)],
        texts=[TextPrimitive(pose=over, billboard=True, font_size=0.1, color=colour(number), text=name)],
    )  # fmt: skip


def plan_entity(
    name: str, number: int, plan: messages.Plan, leaders: Sequence[Place], time_ns: int
) -> SceneEntity:
    """Plan of a vehicle with its reference, and lines to the places of its leaders [m], in the room."""
    places: Array = plan.samples()[:, :3]
    shown = places[:: max(1, len(places) // PLAN_POINTS)].tolist()
    lines = [_line([_point(place) for place in shown], number, 0.015)]
    lines += [_line([_point(shown[0]), _point(place)], number, 0.005) for place in leaders]
    balls = []
    if plan.reference is not None:
        balls.append(
            SpherePrimitive(
                pose=pose(plan.reference), size=Vector3(x=0.06, y=0.06, z=0.06), color=colour(number, 0.4)
            )
        )
    return SceneEntity(timestamp=stamp(time_ns), frame_id=ROOM, id=f"{name} plan", lines=lines, spheres=balls)


def volume(low_m: Place, high_m: Place, time_ns: int) -> SceneEntity:
    """The flight volume as a faint box."""
    middle = [(low + high) / 2 for low, high in zip(low_m, high_m, strict=True)]
    size = [high - low for low, high in zip(low_m, high_m, strict=True)]
    box = CubePrimitive(pose=pose(middle), size=_vector(size), color=Color(r=0.5, g=0.5, b=0.5, a=0.06))
    return SceneEntity(timestamp=stamp(time_ns), frame_id=ROOM, id="flight volume", cubes=[box])


def _line(points: list[Point3], number: int, thickness: float) -> LinePrimitive:
    return LinePrimitive(
        type=LinePrimitiveLineType.LineStrip, thickness=thickness, points=points, color=colour(number)
    )


def _point(place: Place) -> Point3:
    return Point3(x=place[0], y=place[1], z=place[2])


def _vector(place: Place) -> Vector3:
    return Vector3(x=place[0], y=place[1], z=place[2])


def _quaternion(xyzw: Sequence[float]) -> Quaternion:
    return Quaternion(x=xyzw[0], y=xyzw[1], z=xyzw[2], w=xyzw[3])
