"""Plans and statuses of tracked subjects that are no vehicles, published as if they were vehicles."""

from collections.abc import Mapping, Sequence
from os import getpid
from typing import Final

from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus, Diagnostics, Plan, SetPoint
from rcopterx.bus.session import Session
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.control.interfaces import Measurement
from rcopterx.formation.law import LeaderPlan
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import YAW, three
from rcopterx.vicon_gateway.frame import CapturedFrame, Stamp, SubjectPose
from rcopterx.vicon_gateway.subject_motion import STAGES, SubjectMotion

REPORT_PERIOD_S: Final = 0.2
UNSEEN: Final = "unseen"  # phase of a subject that vehicles cannot follow now


class SubjectPlans:
    """Publishes plans and statuses of subjects, from which vehicles keep `margins_m` farther than usual.

    `fastest` are the rates that all vehicles can fly, `period_s` is their shortest control period.
    """

    def __init__(
        self, margins_m: Mapping[str, float], fastest: Sequence[float], period_s: float, session: Session
    ) -> None:
        self._margins_m, self._period_s, self._session = margins_m, period_s, session
        self._motions = {name: SubjectMotion(fastest) for name in margins_m}
        self._stamp, self._report_at_s = Stamp(0, 0), 0.0

    def update(self, frame: CapturedFrame, stamp: Stamp, poses: Mapping[str, SubjectPose]) -> None:
        """Process a frame with the poses of what it lists, and publish what is due."""
        last, self._stamp = self._stamp, stamp
        # The poses continue in a new epoch, which begins a period after the last one as far as is known.
        elapsed = stamp.frame - last.frame if stamp.epoch == last.epoch else 1
        per_plan = max(1, round(self._period_s / frame.period_s))
        plan_due = stamp.frame // per_plan != last.frame // per_plan or stamp.epoch != last.epoch
        report_due = frame.received_s >= self._report_at_s
        self._report_at_s = frame.received_s + REPORT_PERIOD_S if report_due else self._report_at_s
        for name, motion in self._motions.items():
            motion.advance(elapsed * frame.period_s)
            pose = poses.get(name)
            if pose is not None and pose.position_m is not None and pose.quaternion_xyzw is not None:
                measured = Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
                motion.correct(measured.position_m, measured.yaw_rad)
            plan = motion.plan() if plan_due or report_due else None
            if plan is not None and plan_due:
                self._session.publish(channels.PLAN, name, self._message(name, plan))
            if report_due:
                self._session.publish(channels.AGENT_STATUS, name, self._status(motion, plan))

    def _message(self, name: str, plan: LeaderPlan) -> Plan:
        return Plan(
            epoch=self._stamp.epoch,
            frame=self._stamp.frame,
            source=name,
            ancestors=(),
            period_s=plan.trajectory.period_s,
            start_s=0.0,
            trajectory=TrajectoryArray.of(plan.trajectory.samples),
            followable=plan.followable,
            nominal=None if plan.nominal is None else TrajectoryArray.of(plan.nominal.samples),
            margins_m=tuple(self._margins_m[name] + margin_m for margin_m in plan.margins_m),
        )

    def _status(self, motion: SubjectMotion, plan: LeaderPlan | None) -> AgentStatus:
        """Return where a subject is, and whether vehicles can follow it."""
        place, rates, _ = motion.motion
        place_m, yaw_rad, known = three(place[:YAW]), float(place[YAW]), plan is not None
        return AgentStatus(
            phase=Phase.FLYING.value if plan is not None and plan.followable else UNSEEN,
            epoch=self._stamp.epoch,
            frame=self._stamp.frame,
            set_point=SetPoint(position_m=place_m, yaw_rad=yaw_rad),
            position_m=place_m if known else None,
            velocity_m_s=three(rates[:YAW]) if known else None,
            yaw_rad=yaw_rad if known else None,
            diagnostics=Diagnostics(controller="none", estimator="subject", horizon=STAGES, process=getpid()),
            pose_age_s=motion.unseen_s if known else None,
            host=self._session.address.host or None,
        )
