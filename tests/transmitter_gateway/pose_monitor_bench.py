"""Pose monitor of one vehicle with a virtual clock."""

from collections import Counter
from typing import Any

from rcopterx.radios.limits import Fence, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import PoseInput, Position
from rcopterx.transmitter_gateway.pose_monitor import Judgement, PoseMonitor

BOX = Fence((-1.5, -1.5, 0.0), (1.5, 1.5, 2.0))
CENTRE: Position = (0.0, 0.0, 1.0)
QUIET = Judgement(None, None)


class Watch:
    """Pose monitor of h1 with a virtual clock and poses at 100 Hz."""

    def __init__(self, limits: SurveillanceLimits | None = None) -> None:
        self.counters: Counter[str] = Counter()
        self.monitor = PoseMonitor(limits or SurveillanceLimits(), self.counters)
        self.now_s = 50.0
        self.frame = 0
        self.epoch = 1

    def pose(
        self,
        position: Position | None = CENTRE,
        vehicle: str = "h1",
        airborne: bool = True,
        period_s: float | None = 0.01,
        latency_s: float = 0.0,
        yaw_rad: float | None = 0.0,
    ) -> bool:
        pose = PoseInput(vehicle, self.epoch, self.frame, position, period_s, yaw_rad, latency_s)
        if vehicle != "h1":
            return self.monitor.other_pose(pose, self.now_s)
        return self.monitor.own_pose(pose, self.now_s, airborne=airborne)

    def step(self, position: Position | None = CENTRE, seconds: float = 0.01, **options: Any) -> bool:
        self.now_s += seconds
        self.frame += 1
        return self.pose(position, **options)

    def judge(self, thrust_time_s: float = 0.0) -> Judgement:
        return self.monitor.judge(self.now_s, thrust_time_s)

    def velocity(self) -> Position:
        track = self.monitor.own_track
        assert track is not None
        return track.velocity_m_s
