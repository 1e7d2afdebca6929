"""The Vicon gateway process: frames of the Tracker in, one pose per vehicle out."""

import logging
import math
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import asdict

from rcopterx.bus import channels
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from rcopterx.bus.host_messages import SubjectState, TrackerStatus
from rcopterx.bus.message import MAX_POSITION_M
from rcopterx.bus.messages import Pose
from rcopterx.bus.realtime import ending_signals, prepare_loop, request_realtime
from rcopterx.bus.rounding import TIME_BITS, rounded
from rcopterx.bus.session import BusAddress, Session
from rcopterx.bus.subscription import UnitSubscriptions
from rcopterx.vicon_gateway.client import DataStreamClient, FrameClient
from rcopterx.vicon_gateway.frame import CapturedFrame, EpochCounter, Position, Stamp, SubjectPose
from rcopterx.vicon_gateway.recording import RecordingFile

if TYPE_CHECKING:
    from rcopterx.vicon_gateway.brands import BrandSettings  # imports in vain where there is a Vicon Tracker
    from rcopterx.vicon_gateway.external_poses import PoseLink, PoseSender  # their library is an extra
    from rcopterx.vicon_gateway.subject_plans import SubjectPlans  # few fleets have any

SAME_PLACE_M = 0.01  # closer than any two bodies can be


class SubjectMap:
    """Assigns poses to vehicles by exact subject names, and keeps account of all subjects.

    `far` counts poses in no room: they are passed on as occluded, since no reader accepts such a position.
    """

    def __init__(self, vehicle_of_subject: Mapping[str, str]) -> None:
        self._vehicles = dict(vehicle_of_subject)
        self._listed: Counter[str] = Counter()
        self._places: dict[str, Position] = {}
        self.far = 0
        self._occluded_since_s: dict[str, float] = {}

    def update(self, frame: CapturedFrame) -> list[tuple[str, SubjectPose]]:
        """Return (vehicle, pose) of every vehicle that a frame lists, occluded or not."""
        self._listed = Counter([pose.name for pose in frame.subjects])
        self._places = {pose.name: pose.position_m for pose in frame.subjects if pose.position_m is not None}
        known: list[tuple[str, SubjectPose]] = []
        occluded: dict[str, float] = {}
        for pose in frame.subjects:
            vehicle = self._vehicles.get(pose.name)
            if vehicle is not None and self._listed[pose.name] == 1:
                known.append((vehicle, self._within_reach(pose)))
            if pose.occluded:
                occluded[pose.name] = self._occluded_since_s.get(pose.name, frame.received_s)
        self._occluded_since_s = occluded
        return known

    def _within_reach(self, pose: SubjectPose) -> SubjectPose:
        if pose.position_m is None or _in_a_room(pose.position_m):
            return pose
        self.far += 1
        return SubjectPose(pose.name, True, None, None, pose.quality)

    def states(self, now_s: float) -> tuple[SubjectState, ...]:
        """Return every configured and every listed subject; `now_s` is the clock of the frames."""
        states = []
        for name in dict.fromkeys((*self._vehicles, *self._listed)):
            since_s = self._occluded_since_s.get(name)
            listed = self._listed.get(name, 0)
            place = self._places.get(name)
            state = SubjectState(
                subject=name[:400],
                vehicle=self._vehicles.get(name),
                listed=listed > 0,
                occluded_s=None if since_s is None else max(0.0, now_s - since_s),
                ambiguous=listed > 1,
                shown_at_m=None if place is None or _in_a_room(place) else place,
                same_place_as=self._beside(name)[:400],
            )
            states.append(state)
        return tuple(states)

    def _beside(self, name: str) -> str:
        """Another subject at the same place; empty for none."""
        place, places = self._places.get(name), self._places.items()
        if place is None:
            return ""
        near = (other for other, at in places if other != name and math.dist(at, place) < SAME_PLACE_M)
        return next(near, "")


def _in_a_room(position: Position) -> bool:
    return all(abs(value) <= MAX_POSITION_M for value in position)


@dataclass(frozen=True)
class TrackerSettings:
    """Motion capture, None for Vicon as `brand`; subjects; a new file for the raw stream, if any; links of
    vehicles that get their poses from this process; and what plans for subjects that are no vehicles."""

    bus: BusAddress
    host: str
    port: int
    subjects: Mapping[str, str]
    brand: "BrandSettings | None" = None
    record_raw: Path | None = None
    realtime_priority: int = 0
    pose_links: "Mapping[str, PoseLink]" = field(default_factory=dict)
    subject_plans: "Callable[[Session], SubjectPlans] | None" = None


STATUS_PERIOD_S = 0.2
POSES_KEPT = 8
STANDBY_S = 1.0  # a gateway that stands by continues when the other one has been silent for this long
FLOWN_LIMIT_S = 3.0  # a starting gateway waits so long for the epoch in which vehicles fly


class TrackerGateway:
    """Publishes the frames of a client; `recording` is the file the client records into."""

    def __init__(
        self,
        settings: TrackerSettings,
        client: FrameClient,
        session: Session,
        realtime: bool,
        recording: Path | None = None,
    ) -> None:
        self._settings = settings
        self._pose_sender: PoseSender | None = None
        if settings.pose_links:
            from rcopterx.vicon_gateway import external_poses

            self._pose_sender = external_poses.PoseSender(settings.pose_links)
        self._subject_plans = settings.subject_plans and settings.subject_plans(session)
        self._host = settings.bus.host or None
        self._recording = recording
        self._client = client
        self._session = session
        self._realtime = realtime
        self._subjects = SubjectMap(settings.subjects)
        self.epochs, self._wall_s = EpochCounter(), settings.bus.clock.wall_s  # the fleet's clock
        self._stamp = Stamp(0, 0)
        self._frame: CapturedFrame | None = None
        self._report_at_s = 0.0
        self._standby_until_s = -math.inf
        self.standbys = 0  # how often it stood by because another gateway published
        # One vehicle's poses are enough to detect another gateway.
        vehicle = next(iter(settings.subjects.values()))
        self._published = session.subscribe(channels.POSE, vehicle, depth=POSES_KEPT, waking=False, own=False)
        self._flown: tuple[UnitSubscriptions[Any], ...] = (
            session.subscribe_all(channels.APPLIED, waking=False),
            session.subscribe_all(channels.INTENT, waking=False),
        )
        self._flown_until_s = session.clock() + FLOWN_LIMIT_S

    def close(self) -> None:
        """Close what poses for autopilots are sent by."""
        if self._pose_sender is not None:
            self._pose_sender.close()

    def step(self) -> None:
        """Wait for the next frame, publish its poses, and now and then the status."""
        wait_s = max(self._report_at_s, self._standby_until_s) - self._session.clock()
        wait_s = min(LONGEST_WAIT_S, max(0.0, wait_s))
        frame = self._session.wait_in(self._client.next_frame, wait_s, self._client.descriptors)
        now_s = self._session.clock() if frame is None else frame.received_s
        if self._flown:
            self._notice_earlier_gateway(now_s)
        self._notice_other_gateway(now_s)
        if now_s < self._standby_until_s:
            return
        if frame is not None:
            self._publish(frame)
        elif now_s >= self._report_at_s:
            self._report_at_s = now_s + STATUS_PERIOD_S
            self._session.publish(channels.TRACKER_STATUS, channels.TRACKER_UNIT, self._status(now_s))

    def _publish(self, frame: CapturedFrame) -> None:
        stamp = self.epochs.stamp(frame, self._wall_s())
        if stamp is not None:
            self._frame, self._stamp = frame, stamp
            publish, latency_s = self._session.publish, rounded(max(0.0, frame.latency_s), TIME_BITS)
            poses = self._subjects.update(frame)
            for vehicle, subject in poses:
                pose = Pose(
                    epoch=stamp.epoch,
                    frame=stamp.frame,
                    period_s=frame.period_s,
                    latency_s=latency_s,
                    received_s=frame.received_s,
                    occluded=subject.occluded,
                    position_m=subject.position_m,
                    quaternion_xyzw=subject.quaternion_xyzw,
                    quality=subject.quality,
                    host=self._host,
                )
                publish(channels.POSE, vehicle, pose)
                if self._pose_sender is not None:
                    self._pose_sender.send(vehicle, subject, frame.received_s)
            if self._subject_plans is not None:
                self._subject_plans.update(frame, stamp, dict(poses))

    def _notice_earlier_gateway(self, now_s: float) -> None:
        """Begin a newer epoch than transmitters or agents report, though the clock was set back."""
        for subscriptions in self._flown:
            for inbox in list(subscriptions.inboxes.values()):
                received = inbox.latest()
                if received is not None:
                    self.epochs.leave_behind(received.message.epoch)
        if now_s >= self._flown_until_s:
            for subscriptions in self._flown:
                subscriptions.close()
            self._flown = ()

    def _notice_other_gateway(self, now_s: float) -> None:
        """Stand by while another gateway publishes: of two, the one that began later continues."""
        # One that has published nothing yet never does: it may receive the last pose of one that has died.
        for received in self._published.drain():
            epoch = received.message.epoch
            if epoch <= self.epochs.epoch:
                continue
            if self.epochs.epoch:
                if now_s >= self._standby_until_s:
                    self.standbys += 1
                    logging.getLogger(__name__).warning("another gateway publishes poses; this one stands by")
                self._standby_until_s = now_s + STANDBY_S
            self.epochs.leave_behind(epoch)

    def _status(self, now_s: float) -> TrackerStatus:
        state = self._client.state
        counters = {
            "connects": state.connects,
            **asdict(state.counters),
            "epochs": self.epochs.epochs,
            "standbys": self.standbys,
            "poses in no room": self._subjects.far,
            "poses for autopilots not sent": 0 if self._pose_sender is None else self._pose_sender.failed,
            "recording failures": int(state.recording_error is not None),
        }
        trying = state.doing if state.last_error is None else f"{state.doing} (before: {state.last_error})"
        recorded = f"{state.recorded_bytes} bytes in {self._recording}" if self._recording else ""
        return TrackerStatus(
            state=state.name,
            trying=trying[:400],
            address=f"{self._settings.host}:{self._settings.port}",
            epoch=self._stamp.epoch,
            frame=self._stamp.frame,
            period_s=0.0 if self._frame is None else self._frame.period_s,
            latency_s=0.0 if self._frame is None else self._frame.latency_s,
            subjects=self._subjects.states(now_s),
            counters=counters,
            realtime=self._realtime,
            recording=(state.recording_error or recorded)[:400],
        )


def run_tracker_gateway(settings: TrackerSettings) -> None:
    """Run the gateway until SIGTERM or SIGINT; it keeps trying while the Tracker does not answer.

    Raises `LibraryMissingError`: the motion capture needs the library `motioncapture`, which is not
    installed; `RecordingFileError`: the file to record into cannot be created. When it fails later, the
    gateway continues without it; `BusUnreachableError`: no router answers.
    """
    if settings.brand is not None:
        # Imported here: a Vicon Tracker needs no other brand.
        from rcopterx.vicon_gateway.brands import BrandClient, check_library

        check_library()
    with ExitStack() as stack:
        file = None
        if settings.record_raw is not None:
            file = stack.enter_context(closing(RecordingFile.create(settings.record_raw)))
        # Errors of the settings have been raised; from here on this process is the gateway.
        stopping = ending_signals()
        realtime = request_realtime(settings.realtime_priority)
        session = stack.enter_context(Session(settings.bus))
        client: FrameClient
        if settings.brand is not None:
            client = BrandClient(settings.brand, session.clock, speed=settings.bus.clock.speed)
        else:
            record_raw = None if file is None else file.write
            client = DataStreamClient(
                settings.host,
                settings.port,
                clock=session.clock,
                speed=settings.bus.clock.speed,
                record_raw=record_raw,
                at_once=settings.bus.clock.lockstep,
            )
        stack.callback(client.close)
        path = None if file is None else file.path
        gateway = stack.enter_context(closing(TrackerGateway(settings, client, session, realtime, path)))
        heartbeat = own_heartbeat()
        prepare_loop()
        while not stopping:
            heartbeat.beat()
            gateway.step()
        heartbeat.ending()
