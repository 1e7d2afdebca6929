"""Observation of a vehicle: poses, frames without a pose, and the inputs that its transmitter applied."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.load import Pacing
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.takeover import ControlLease
from rcopterx.bus.messages import Applied, Pose
from rcopterx.bus.subscription import Inbox, Received
from rcopterx.control.interfaces import Measurement

OF_ANOTHER_AGENT: Final = -1  # sequence of no command of this agent


@dataclass
class Observation:
    """Gives the messages of the gateways about one vehicle to its pilot; `clock` is monotonic [s]."""

    pilot: Pilot
    pacing: Pacing
    poses: Inbox[Pose]
    applied: Inbox[Applied]
    lease: ControlLease
    clock: Callable[[], float]
    seen: Received[Pose] | None = None  # newest pose that the pilot accepted; None before the first

    def take_applied(self) -> bool:
        """Process the inputs written to the radio; return whether the vehicle is found in flight."""
        pilot, lease, guidance = self.pilot, self.lease, self.pilot.guidance
        was_flying = guidance.rotor_on
        for received in self.applied.drain():
            applied = received.message
            lease.note_applied(applied.lease, self.clock())
            if not lease.held:
                pilot.watch(applied.state, np.array(applied.input))
                continue
            sequence = applied.sequence if applied.lease == lease.number else OF_ANOTHER_AGENT
            pilot.note_applied(applied.state, sequence, np.array(applied.input))
        return guidance.rotor_on and not was_flying

    def frames(self, now_s: float) -> Iterator[float]:
        """Give new and overdue frames to the pilot; yield when each began [monotonic s].

        Poses that waited during a pause update the estimate only: commands computed from the past do not act.
        """
        pilot, pacing = self.pilot, self.pacing
        for received in self.poses.drain():
            pose = received.message
            if pilot.observe(_stamped(pose)):
                self.seen = received
                pacing.on_pose(pose.frame, received.arrived_s, pose.period_s)
                if pilot.ready and not pacing.behind:
                    yield received.arrived_s
        overdue_at_s = pacing.overdue_at_s
        if now_s >= overdue_at_s:
            pacing.on_coast()
            if pilot.coast():
                yield overdue_at_s


def _stamped(pose: Pose) -> StampedMeasurement:
    measurement = None
    if pose.position_m is not None and pose.quaternion_xyzw is not None:
        measurement = Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
    return StampedMeasurement(pose.epoch, pose.frame, pose.period_s, measurement)
