"""A guidance in flight, and leaders whose plans it follows."""

import numpy as np

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.columns import COLUMNS
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.formation.law import FollowedLeader, FormationOffset, LeaderPlan
from rcopterx.vehicles.phases import Event
from support.flight import still

PERIOD_S = 0.02
STAGES = 20
FLOOR = still((0.2, 0.1, 0.05))
ALOFT = still((0.2, 0.1, 1.0), 0.3)


def at(position_m: tuple[float, float, float], yaw_rad: float = 0.0, climb_m_s: float = 0.0) -> Estimate:
    estimate = still(position_m, yaw_rad)
    estimate.motion[6] = climb_m_s
    return estimate


def flying(links: tuple[FollowedLeader, ...] = (), estimate: Estimate = ALOFT) -> Guidance:
    guidance = Guidance(links)
    guidance.on_event(Event.RESUME, estimate, 0.0)
    return guidance


def offset(x: float, y: float = 0.0, z: float = 0.0, yaw_rad: float = 0.0) -> FormationOffset:
    return FormationOffset(np.array([x, y, z]), yaw_rad)


def standing_leader(
    position_m: tuple[float, float, float],
    yaw_rad: float = 0.0,
    ahead_s: float = 0.0,
    followable: bool = True,
) -> LeaderPlan:
    return LeaderPlan(hold(np.array(position_m), yaw_rad, PERIOD_S, STAGES), ahead_s, followable)


def moving_leader(speed_m_s: float, ahead_s: float = 0.0) -> LeaderPlan:
    samples = np.zeros((STAGES, COLUMNS))
    samples[:, 0] = speed_m_s * PERIOD_S * np.arange(STAGES)
    samples[:, 4] = speed_m_s
    samples[:, 2] = 1.0
    return LeaderPlan(Trajectory(samples, PERIOD_S), ahead_s)


def reference(
    guidance: Guidance,
    plans: dict[str, LeaderPlan] | None = None,
    time_s: float = 0.0,
    estimate: Estimate = ALOFT,
    delay_s: float = 0.0,
) -> Trajectory:
    return guidance.references(plans or {}, estimate, time_s, delay_s, PERIOD_S, STAGES).flown


def armed() -> Guidance:
    guidance = Guidance()
    guidance.on_event(Event.ARM, FLOOR, 0.0)
    return guidance
