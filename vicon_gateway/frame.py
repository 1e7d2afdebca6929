"""Frames of a motion-capture source: subject poses in SI units, Z up."""

from typing import NamedTuple

Position = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class SubjectPose(NamedTuple):
    """One subject in one frame.

    Attributes
    ----------
    occluded
        The subject is listed but not seen in this frame, and there is no pose.
    position_m
        Origin of the root segment in the Tracker's world, Z up.
    quaternion_xyzw
        Unit quaternion with w >= 0 that rotates segment to world coordinates.
    quality
        From 0 (bad) to 1 (good); None where the source does not report it.
    """

    name: str
    occluded: bool
    position_m: Position | None
    quaternion_xyzw: Quaternion | None
    quality: float | None


class CapturedFrame(NamedTuple):
    """All subjects at one capture instant.

    Attributes
    ----------
    frame
        Raw frame id of the wire, from 0; tools built on SDK 1.11 and later show this number plus one.
    connection
        Number of the connection that delivered it, from 1; a change means the stream was interrupted.
    period_s
        Nominal time between frames.
    received_s
        Local clock at arrival.
    latency_s, latency_samples
        Capture to arrival: a sum, and its stages as the source names them, "Network Transmission" among them
        once a ping was answered.
    subjects
        Every listed subject, occluded or not.
    """

    frame: int
    connection: int
    period_s: float
    received_s: float
    latency_s: float
    latency_samples: tuple[tuple[str, float], ...]
    subjects: tuple[SubjectPose, ...]

    @property
    def captured_s(self) -> float:
        """Local clock at the capture instant."""
        return self.received_s - self.latency_s
