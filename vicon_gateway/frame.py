"""Frames of a motion-capture source, subject poses in SI units, Z up, and their stamps."""

from typing import NamedTuple

from rcopterx.bus.message import MAX_RESUMED_COUNT

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


GAP_TOLERANCE_S = 0.25  # between frame numbers and elapsed time: bursts, late delivery, reconnects
RATE_TOLERANCE = 1e-3  # relative error of the nominal period against the local clock


class Stamp(NamedTuple):
    """Time of a captured frame in the fleet's clock: an epoch, and the raw frame id in it.

    The epoch is in milliseconds of the wall clock at its first frame, or more: it always grows, also when the
    wall clock is set back, as far as earlier epochs are known (`EpochCounter.leave_behind`).
    """

    epoch: int
    frame: int


class EpochCounter:
    """Stamps the frames of one gateway.

    Within an epoch the frame number grows with time at the capture rate. When it does not, because the
    capture or the Tracker was started again, a new epoch begins.
    """

    def __init__(self) -> None:
        self.epochs = 0
        self.epoch = 0  # present one, 0 before the first frame
        self._foreign_epoch = 0
        self._last: CapturedFrame | None = None

    def leave_behind(self, epoch: int) -> None:
        """Take notice of an epoch that another gateway began; the next stamp has a newer one."""
        if epoch <= MAX_RESUMED_COUNT:
            self._foreign_epoch = max(self._foreign_epoch, epoch)

    def stamp(self, frame: CapturedFrame, wall_clock_s: float) -> Stamp | None:
        """Return the stamp of a frame; None for a capture that has been stamped before.

        A frame number that continues keeps the epoch, on a new connection too, when the gap agrees with the
        time that has passed. A jump back, or a gap that does not agree, begins a new epoch; so does a jump
        forward within a connection by more than the time that has passed. A frame that is the last one again,
        number and poses, is no capture, however much later it arrives. The wall clock [Unix time] matters
        only where a new epoch begins.
        """
        last = self._last
        if last is not None and frame.frame == last.frame and frame.subjects == last.subjects:
            return None  # a Tracker that hangs repeats its frame, to a new connection too
        self._last = frame
        overtaken = self._foreign_epoch > self.epoch
        if last is None or overtaken or not _continues(last, frame):
            self.epochs += 1
            self.epoch = max(int(wall_clock_s * 1000.0), self.epoch + 1, self._foreign_epoch + 1)
        elif frame.frame == last.frame:
            return None
        return Stamp(self.epoch, frame.frame)


def _continues(last: CapturedFrame, frame: CapturedFrame) -> bool:
    gap = frame.frame - last.frame
    if gap < 0:
        return False
    elapsed_s = frame.received_s - last.received_s
    surplus_s = gap * frame.period_s - elapsed_s
    tolerance_s = GAP_TOLERANCE_S + RATE_TOLERANCE * elapsed_s
    if frame.connection == last.connection:
        # Frames may be lost or late within a connection, but they do not come from the future.
        return surplus_s <= tolerance_s
    return abs(surplus_s) <= tolerance_s
