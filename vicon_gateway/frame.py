"""Frames of a motion-capture source: subject poses in SI units, Z up."""

from typing import NamedTuple

Position = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class SubjectPose(NamedTuple):
    """One subject in one frame; an occluded one is listed but not seen, and has no pose."""

    name: str
    occluded: bool
    position_m: Position | None  # of the root segment in the Tracker's world, Z up
    quaternion_xyzw: Quaternion | None  # w >= 0, rotates segment to world coordinates
    quality: float | None  # from 0 (bad) to 1 (good), None where it is not reported


class CapturedFrame(NamedTuple):
    """All subjects at one capture instant."""

    # raw frame id of the wire, from 0; tools built on SDK 1.11 and later show this number plus one
    frame: int
    # number of the connection that delivered it, from 1; a change means the stream was interrupted
    connection: int
    period_s: float
    received_s: float  # local clock at arrival
    latency_s: float  # capture to arrival, that of the network included once three pings were answered
    subjects: tuple[SubjectPose, ...]
