"""The process of tracked subjects: poses in, plans and statuses out, as if the subjects were vehicles."""

import math
import os
from collections.abc import Mapping
from typing import Final

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.load import Pacing
from rcopterx.agents.subjects.track import AVOIDED_S, FOLLOWED_S, STAGES, SubjectTrack
from rcopterx.bus import channels
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from rcopterx.bus.messages import AgentStatus, Diagnostics, Plan, SetPoint
from rcopterx.bus.realtime import ending_signals, prepare_loop, request_realtime
from rcopterx.bus.session import BusAddress, Session
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.control.interfaces import Measurement
from rcopterx.control.references.set_points import ProfileLimits
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import YAW, three

REPORT_PERIOD_S: Final = 0.2
UNSEEN: Final = "unseen"  # phase of a subject that vehicles cannot follow now
POSES_KEPT: Final = 32


class Subject:
    """One subject on the bus, from which vehicles keep `margin_m` farther than from each other.

    `limits` are those of what all vehicles can fly, `period_s` is their shortest control period.
    """

    def __init__(
        self, name: str, margin_m: float, limits: ProfileLimits | None, period_s: float, session: Session
    ) -> None:
        self._name, self._margin_m, self._session = name, margin_m, session
        self._track, self._pacing = SubjectTrack(limits), Pacing(period_s)
        self._poses = session.subscribe(channels.POSE, name, depth=POSES_KEPT)
        self._followable = False

    def step(self) -> None:
        """Process the poses that have arrived, and publish the plan if it is due."""
        due = False
        for received in self._poses.drain():
            pose, measurement = received.message, None
            if pose.position_m is not None and pose.quaternion_xyzw is not None:
                measurement = Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
            if self._track.observe(StampedMeasurement(pose.epoch, pose.frame, pose.period_s, measurement)):
                self._pacing.on_pose(pose.frame, received.arrived_s, pose.period_s)
                due = self._pacing.control_due(pose.frame, flying=False) or due
        if due:
            self._publish_plan()

    def _publish_plan(self) -> None:
        clock, plan = self._track.clock, self._track.plan()
        self._followable = plan is not None and plan.followable
        if plan is None:
            return
        message = Plan(
            epoch=clock.epoch,
            frame=clock.current_frame,
            source=self._name,
            ancestors=(),
            period_s=plan.trajectory.period_s,
            start_s=0.0,
            trajectory=TrajectoryArray.of(plan.trajectory.samples),
            followable=plan.followable,
            margins_m=tuple(self._margin_m + margin_m for margin_m in plan.margins_m),
        )
        self._session.publish(channels.PLAN, self._name, message)

    def report(self, now_s: float) -> None:
        """Publish the status: where the subject is, and whether vehicles can follow it."""
        clock, (place, rates, _) = self._track.clock, self._track.motion
        pose_age_s = self._poses.age_s(now_s)
        unseen_s = math.inf if pose_age_s is None else self._track.unseen_s + pose_age_s
        followable, known = self._followable and unseen_s <= FOLLOWED_S, unseen_s <= AVOIDED_S
        place_m, yaw_rad = three(place[:YAW]), float(place[YAW])
        status = AgentStatus(
            phase=Phase.FLYING.value if followable else UNSEEN,
            epoch=clock.epoch,
            frame=clock.current_frame,
            set_point=SetPoint(position_m=place_m, yaw_rad=yaw_rad),
            position_m=place_m if known else None,
            velocity_m_s=three(rates[:YAW]) if known else None,
            yaw_rad=yaw_rad if known else None,
            diagnostics=Diagnostics(
                controller="none", estimator="subject", horizon=STAGES, process=os.getpid()
            ),
            pose_age_s=pose_age_s,
            host=self._session.address.host or None,
        )
        self._session.publish(channels.AGENT_STATUS, self._name, status)


def run_subjects(
    bus: BusAddress,
    margins_m: Mapping[str, float],
    limits: ProfileLimits | None,
    period_s: float,
    realtime_priority: int,
) -> None:
    """Publish plans of subjects, see `Subject`, until SIGTERM or SIGINT; may raise `BusUnreachableError`."""
    stopping = ending_signals()
    request_realtime(realtime_priority)
    with Session(bus) as session:
        subjects = [Subject(name, m, limits, period_s, session) for name, m in margins_m.items()]
        heartbeat, report_at_s = own_heartbeat(), session.clock()
        prepare_loop()
        while not stopping:
            heartbeat.beat()
            session.wait(min(LONGEST_WAIT_S, max(0.0, report_at_s - session.clock())))
            now_s = session.clock()
            for subject in subjects:
                subject.step()
                if now_s >= report_at_s:
                    subject.report(now_s)
            report_at_s = report_at_s if now_s < report_at_s else now_s + REPORT_PERIOD_S
        heartbeat.ending()
