"""What a motion-capture source delivers: frames of subject poses in SI units, Z up."""

from typing import NamedTuple

Position = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class SubjectPose(NamedTuple):
    """One subject in one frame.

    Attributes
    ----------
    name : str
        Name in the Tracker.
    occluded : bool
        True: the subject is listed but not seen in this frame, and there is no pose.
    position_m : (3,) or None
        Origin of the root segment in the Tracker's world, Z up.
    quaternion_xyzw : (4,) or None
        Unit quaternion with w >= 0 that rotates segment to world coordinates.
    quality : float or None
        From 0 (bad) to 1 (good); None where the source does not tell.
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
    frame : int
        Raw frame id of the wire, from 0; tools built on SDK 1.11 and later show this number plus one.
    connection : int
        Number of the connection that delivered it, from 1; a change means the stream was interrupted.
    period_s : float
        Nominal time between frames.
    received_s : float
        Local clock at arrival.
    latency_s : float
        Capture to arrival: the sum of `latency_samples`.
    latency_samples : tuple of (name, seconds)
        Stages as the source names them, and "Network Transmission" once a ping was answered.
    subjects : tuple of SubjectPose
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
