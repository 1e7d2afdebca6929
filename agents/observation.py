"""What an agent observes of its vehicle: poses, periods without one, and what its transmitter applied."""

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from rcopterx.agents.interfaces import Measurement
from rcopterx.agents.lease import ControlLease
from rcopterx.agents.pacing import Pacing
from rcopterx.agents.pilot import Pilot, StampedMeasurement
from rcopterx.agents.telemetry import prefixed
from rcopterx.bus.messages import Applied, Pose
from rcopterx.bus.subscription import Inbox, Received

OF_ANOTHER_AGENT: Final = -1
"""Sequence of no command of this agent."""


class Observation:
    """Takes in what the gateways publish of one vehicle.

    Parameters
    ----------
    pilot, pacing
        The vehicle's.
    poses, applied
        Filled by the bus.
    lease
        Of the agent.
    clock
        Monotonic clock [s].
    """

    events: Mapping[str, int] = MappingProxyType({})

    def __init__(
        self,
        pilot: Pilot,
        pacing: Pacing,
        poses: Inbox[Pose],
        applied: Inbox[Applied],
        lease: ControlLease,
        clock: Callable[[], float],
    ) -> None:
        self._pilot = pilot
        self._pacing = pacing
        self._poses = poses
        self._applied = applied
        self._lease = lease
        self._clock = clock
        self.seen: Received[Pose] | None = None
        """Newest pose that the pilot took in."""

    @property
    def rejected(self) -> Mapping[str, int]:
        """See `telemetry.Source`."""
        return prefixed("pose", self._poses.rejected) | prefixed("applied", self._applied.rejected)

    @property
    def pose_age_s(self) -> float | None:
        """Age of the newest pose."""
        return self._poses.age_s(self._clock())

    @property
    def overdue_at_s(self) -> float | None:
        """When the next pose counts as overdue [monotonic s]; None before the first."""
        return self._pacing.coast_at_s(self._pilot.clock.period_s)

    def take_applied(self) -> None:
        """Tell the pilot what was written to the radio; what another agent flies is only watched."""
        for received in self._applied.drain():
            applied, lease = received.message, self._lease
            lease.note_applied(applied.lease, self._clock())
            if not lease.held:
                self._pilot.watch(applied.state, np.array(applied.input))
                continue
            sequence = applied.sequence if applied.lease == lease.number else OF_ANOTHER_AGENT
            self._pilot.note_applied(applied.state, sequence, np.array(applied.input))

    def frames(self) -> Iterator[float]:
        """Tell the pilot each new frame, and one that is overdue; yields when it began [monotonic s]."""
        for received in self._poses.drain():
            if self._pilot.observe(_stamped(received.message)):
                self.seen = received
                self._pacing.on_pose(received.arrived_s)
                if self._pilot.ready:
                    yield received.arrived_s
        overdue_at_s = self.overdue_at_s
        if overdue_at_s is not None and self._clock() >= overdue_at_s:
            self._pacing.on_coast()
            if self._pilot.coast():
                yield overdue_at_s


def _stamped(pose: Pose) -> StampedMeasurement:
    measurement = None
    if pose.position_m is not None and pose.quaternion_xyzw is not None:
        measurement = Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
    return StampedMeasurement(pose.epoch, pose.frame, pose.period_s, measurement)
